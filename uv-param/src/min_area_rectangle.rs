//! The rectangle of smallest area around a set of points, by rotating calipers.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use crate::error::Error;

/// A rectangle of the plane: points `p` with `0 <= R(-angle) (p - corner) <= (width, height)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Turn of the width axis against the x axis, in (-45, 45] degrees, radians.
    pub angle: f64,
    /// Extent along the turned x axis, in the unit of the points.
    pub width: f64,
    /// Extent along the turned y axis.
    pub height: f64,
    /// The corner with the smallest turned coordinates.
    pub corner: [f64; 2],
}

impl Rectangle {
    /// Width times height.
    pub fn area(&self) -> f64 {
        self.width * self.height
    }
}

/// Areas that differ by less than this fraction count as equal; then the smaller turn wins, so that squares and other
/// ties do not depend on rounding.
const TIE: f64 = 1e-12;

/// The rectangle of smallest area that holds all `points`. Time O(n log n) for the hull and O(h) for the calipers.
///
/// # Errors
/// [`Error::FlatPoints`] for fewer than three points or points on one line, [`Error::NonFiniteValue`].
pub fn min_area_rectangle(points: &[[f64; 2]]) -> Result<Rectangle, Error> {
    if let Some(index) = points.iter().position(|p| !(p[0].is_finite() && p[1].is_finite())) {
        return Err(Error::NonFiniteValue { what: "points", index });
    }
    let hull = convex_hull(points);
    if hull.len() < 3 {
        return Err(Error::FlatPoints { points: points.len() });
    }
    let mut best: Option<Rectangle> = None;
    rotating_calipers(&hull, |rectangle| {
        let better = match best {
            None => true,
            Some(b) if rectangle.area() < b.area() * (1.0 - TIE) => true,
            Some(b) => rectangle.area() <= b.area() * (1.0 + TIE) && rectangle.angle.abs() < b.angle.abs() - TIE,
        };
        if better {
            best = Some(rectangle);
        }
    });
    best.ok_or(Error::FlatPoints { points: points.len() })
}

/// Corners of the convex hull, counter-clockwise, no three on a line (exact predicate, monotone chain).
pub fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = outer_points(points);
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Vec<[f64; 2]> = Vec::with_capacity(64);
    let grow = |hull: &mut Vec<[f64; 2]>, keep: usize, p: [f64; 2]| {
        while hull.len() > keep && crate::triangle::orientation([hull[hull.len() - 2], hull[hull.len() - 1], p]) <= 0.0
        {
            hull.pop();
        }
        hull.push(p);
    };
    for &p in &sorted {
        grow(&mut hull, 1, p);
    }
    let lower = hull.len();
    for &p in sorted.iter().rev().skip(1) {
        grow(&mut hull, lower, p);
    }
    hull.pop();
    hull
}

/// The points outside the octagon of the extreme points in eight directions: the others cannot be corners of the hull.
fn outer_points(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let directions =
        [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]];
    let Some(&first) = points.first() else { return Vec::new() };
    let mut extreme = [first; 8];
    let mut reach = [f64::NEG_INFINITY; 8];
    for &p in points {
        for ((d, e), r) in directions.iter().zip(&mut extreme).zip(&mut reach) {
            let along = d[0] * p[0] + d[1] * p[1];
            if along > *r {
                (*r, *e) = (along, p);
            }
        }
    }
    // Strictly inside every side, with a margin far above the rounding of the plain determinant.
    let size = (reach[0] + reach[4]).max(reach[2] + reach[6]);
    let margin = 1e-12 * size * size;
    let inside = |p: &[f64; 2]| {
        (0..8).all(|i| {
            let (a, b) = (extreme[i], extreme[(i + 1) % 8]);
            let side = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            side > margin || (a == b)
        })
    };
    points.iter().filter(|p| !inside(p)).copied().collect()
}

/// Visits the tight rectangle on every edge of the hull: four pointers that each go around once.
fn rotating_calipers(hull: &[[f64; 2]], mut visit: impl FnMut(Rectangle)) {
    let n = hull.len();
    let (mut right, mut top, mut left) = (1, 1, 1);
    for i in 0..n {
        let (a, b) = (hull[i], hull[(i + 1) % n]);
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        let axis = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
        let along = |k: usize| axis[0] * (hull[k % n][0] - a[0]) + axis[1] * (hull[k % n][1] - a[1]);
        let above = |k: usize| axis[0] * (hull[k % n][1] - a[1]) - axis[1] * (hull[k % n][0] - a[0]);
        right = right.max(i + 1);
        while right < i + n && along(right + 1) >= along(right) {
            right += 1;
        }
        top = top.max(right);
        while top < i + n && above(top + 1) >= above(top) {
            top += 1;
        }
        left = left.max(top);
        while left < i + n && along(left + 1) <= along(left) {
            left += 1;
        }
        let (width, height) = (along(right) - along(left), above(top));
        let corner = [a[0] + along(left) * axis[0], a[1] + along(left) * axis[1]];
        visit(into_quarter_turn(axis, width, height, corner));
    }
}

/// Renames the sides of a rectangle so that its angle lies in (-45, 45] degrees.
fn into_quarter_turn(axis: [f64; 2], width: f64, height: f64, corner: [f64; 2]) -> Rectangle {
    let mut angle = axis[1].atan2(axis[0]);
    let [c, s] = axis;
    let corners = [
        corner,
        [corner[0] + width * c, corner[1] + width * s],
        [corner[0] + width * c - height * s, corner[1] + width * s + height * c],
        [corner[0] - height * s, corner[1] + height * c],
    ];
    let mut turns = 0;
    while angle > FRAC_PI_4 {
        angle -= FRAC_PI_2;
        turns += 1;
    }
    while angle <= -FRAC_PI_4 {
        angle += FRAC_PI_2;
        turns += 3;
    }
    // Turning the axes back by 90 degrees makes the corner to the left the first one.
    let corner = corners[(4 - turns % 4) % 4];
    let (width, height) = if turns % 2 == 0 { (width, height) } else { (height, width) };
    Rectangle { angle, width, height, corner }
}
