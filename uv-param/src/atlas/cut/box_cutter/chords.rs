//! Where a part could be cut: straight lines across it, and how much room around it each of them saves.

use std::f64::consts::FRAC_PI_2;

use super::part::{Part, Sheet};
use crate::min_area_rectangle::convex_hull;

/// Points of the rim between which chords are tried.
const POINTS: usize = 72;
/// Directions of boxes around a part, over a quarter of a circle.
const DIRECTIONS: u8 = 8;

/// A chord between two vertices of the outer rim.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chord {
    pub(super) ends: [u32; 2],
    /// Room around the part less that around its two pieces, m^2.
    pub(super) saved: f64,
    /// Metres.
    pub(super) length: f64,
}

/// All chords that save something and leave pieces of a least area.
pub(super) fn chords(sheet: &Sheet, part: &Part, least_area: f64) -> Vec<Chord> {
    let vertices = sampled(sheet, part);
    let points: Vec<[f64; 2]> = vertices.iter().map(|&v| sheet.at(v)).collect();
    let whole = room(&points);
    let mut found = Vec::new();
    for (i, j) in (0..points.len()).flat_map(|i| (i + 2..points.len()).map(move |j| (i, j))) {
        let length = (points[i][0] - points[j][0]).hypot(points[i][1] - points[j][1]);
        if !(length > 0.0 && lies_inside(&points, i, j)) {
            continue;
        }
        let pieces = [points[i..=j].to_vec(), points[j..].iter().chain(&points[..=i]).copied().collect()];
        if pieces.iter().any(|piece| area(piece) < least_area) {
            continue;
        }
        let saved = whole - pieces.iter().map(|piece| room(piece)).sum::<f64>();
        if saved > 0.0 {
            found.push(Chord { ends: [vertices[i], vertices[j]], saved, length });
        }
    }
    found
}

/// Some vertices of the outer rim, in turn: of each stretch of it the one where it bends inwards most, for there voids end.
fn sampled(sheet: &Sheet, part: &Part) -> Vec<u32> {
    let vertices: Vec<u32> =
        part.loops.first().map_or_else(Vec::new, |around| around.iter().map(|&h| sheet.ends(h)[0]).collect());
    let count = vertices.len();
    let at = |k: usize| sheet.at(vertices[k % count]);
    let mut reach = vec![0.0];
    for k in 0..count {
        let (p, q) = (at(k), at(k + 1));
        reach.push(reach[k] + (p[0] - q[0]).hypot(p[1] - q[1]));
    }
    let (total, step) = (reach[count], reach[count] / POINTS as f64);
    let beside = |k: usize, by: f64| {
        let wanted = (reach[k] + by).rem_euclid(total);
        at(reach.partition_point(|&r| r < wanted))
    };
    let mut best: [Option<(f64, u32)>; POINTS] = [None; POINTS];
    for k in 0..count {
        // Negative where the rim, which runs around the part counter-clockwise, bends inwards.
        let bend = side(beside(k, -step), at(k), beside(k, step));
        let stretch = ((reach[k] / step) as usize).min(POINTS - 1);
        if best[stretch].is_none_or(|(least, _)| bend < least) {
            best[stretch] = Some((bend, vertices[k]));
        }
    }
    best.iter().flatten().map(|&(_, v)| v).collect()
}

/// Mean of the areas of the smallest box and of the convex hull: what a part takes on a page lies between what it takes in a grid of boxes and what it
/// takes among shapes that fit its bays.
fn room(points: &[[f64; 2]]) -> f64 {
    let hull = convex_hull(points);
    let mut smallest = f64::INFINITY;
    for k in 0..DIRECTIONS {
        let (s, c) = (FRAC_PI_2 * f64::from(k) / f64::from(DIRECTIONS)).sin_cos();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &[x, y] in &hull {
            for (axis, at) in [c * x + s * y, c * y - s * x].into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
            }
        }
        smallest = smallest.min((high[0] - low[0]) * (high[1] - low[1]));
    }
    0.5 * (smallest + area(&hull))
}

/// Area of a polygon.
fn area(points: &[[f64; 2]]) -> f64 {
    points.first().map_or(0.0, |&origin| points.windows(2).map(|edge| 0.5 * side(origin, edge[0], edge[1])).sum())
}

/// Twice the area of a triangle; positive counter-clockwise.
fn side(p: [f64; 2], q: [f64; 2], r: [f64; 2]) -> f64 {
    (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
}

/// Whether the segment between two points of a polygon lies in it.
fn lies_inside(points: &[[f64; 2]], i: usize, j: usize) -> bool {
    let (p, q) = (points[i], points[j]);
    let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    let mut inside = false;
    for k in 0..points.len() {
        let next = (k + 1) % points.len();
        let (r, s) = (points[k], points[next]);
        let meets = [k, next].iter().any(|&end| end == i || end == j);
        let parts = |a, b, c, d| (side(a, b, c) > 0.0) != (side(a, b, d) > 0.0);
        if !meets && parts(p, q, r, s) && parts(r, s, p, q) {
            return false;
        }
        let is_right = || middle[0] < r[0] + (middle[1] - r[1]) / (s[1] - r[1]) * (s[0] - r[0]);
        inside ^= (r[1] > middle[1]) != (s[1] > middle[1]) && is_right();
    }
    inside
}
