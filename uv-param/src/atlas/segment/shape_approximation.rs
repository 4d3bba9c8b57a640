//! The first, too many charts: regions of the surface whose normals differ little (Cohen-Steiner, Alliez and Desbrun 2004,
//! variational shape approximation with the L2,1 metric).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use crate::surface::Surface;

/// Largest angle between the normal of a face and that of its region, radians: caps of a sphere of this size can be laid out
/// within a stretch of 1.1.
const MAX_DEVIATION: f64 = 0.85;
/// Rounds of averaging of the normals: a scan's noise makes no regions.
const SMOOTHING_ROUNDS: usize = 3;
/// Rounds of growing and placing seeds anew; in each, every region that bends too much gets one more seed.
const MAX_ROUNDS: usize = 24;
/// Rounds without new seeds that straighten the borders.
const FINAL_ROUNDS: usize = 4;

/// No region yet.
const NONE: u32 = u32::MAX;

/// A region number for every face; regions are connected and numbered without gaps.
pub(in crate::atlas) fn shape_approximation(surface: &Surface, barrier: &[bool]) -> Vec<u32> {
    let normals = smoothed_normals(surface);
    let areas: Vec<f64> = (0..surface.faces().len()).map(|f| surface.face_area(f)).collect();
    let mut seeds = first_faces(surface, barrier);
    let mut proxies: Vec<Vector3<f64>> = seeds.iter().map(|&f| normals[f as usize]).collect();
    let mut final_rounds = 0;
    let mut region = Vec::new();
    for round in 0..MAX_ROUNDS + FINAL_ROUNDS {
        region = grow(surface, barrier, &normals, &seeds, &proxies);
        let count = seeds.len();
        proxies = means(&region, &normals, &areas, count);
        let deviation = |f: usize| (normals[f] - proxies[region[f] as usize]).norm_squared();
        // The flattest face of every region starts the next round, the most deviating one a new region.
        let mut best = vec![(f64::INFINITY, NONE); count];
        let mut worst = vec![(0.0, NONE); count];
        for (f, &r) in region.iter().enumerate() {
            let found = deviation(f);
            if found < best[r as usize].0 {
                best[r as usize] = (found, f as u32);
            }
            if found > worst[r as usize].0 {
                worst[r as usize] = (found, f as u32);
            }
        }
        if round + 1 == MAX_ROUNDS + FINAL_ROUNDS || final_rounds == FINAL_ROUNDS {
            break;
        }
        // A seed in the middle of another region's plane may have lost even its own face to it.
        let held: Vec<usize> = (0..count).filter(|&r| best[r].1 != NONE).collect();
        seeds = held.iter().map(|&r| best[r].1).collect();
        proxies = held.iter().map(|&r| proxies[r]).collect();
        let limit = (2.0 * (0.5 * MAX_DEVIATION).sin()).powi(2);
        if round < MAX_ROUNDS {
            for &(found, f) in worst.iter().filter(|(found, _)| *found > limit) {
                debug_assert!(found > limit);
                if !seeds.contains(&f) {
                    seeds.push(f);
                    proxies.push(normals[f as usize]);
                }
            }
        }
        if seeds.len() == held.len() {
            final_rounds += 1;
        }
    }
    region
}

/// One face of every piece that the barriers leave in one.
fn first_faces(surface: &Surface, barrier: &[bool]) -> Vec<u32> {
    let mut seen = vec![false; surface.faces().len()];
    let mut firsts = Vec::new();
    for first in 0..seen.len() {
        if seen[first] {
            continue;
        }
        firsts.push(first as u32);
        seen[first] = true;
        let mut stack = vec![first];
        while let Some(f) = stack.pop() {
            for h in (3 * f..3 * f + 3).filter(|&h| !barrier[h]) {
                if let Some(twin) = surface.twin(h)
                    && !std::mem::replace(&mut seen[twin / 3], true)
                {
                    stack.push(twin / 3);
                }
            }
        }
    }
    firsts
}

/// Unit normals, averaged over neighbours by area.
fn smoothed_normals(surface: &Surface) -> Vec<Vector3<f64>> {
    let mut sums: Vec<Vector3<f64>> = (0..surface.faces().len()).map(|f| surface.face_cross(f)).collect();
    for _ in 0..SMOOTHING_ROUNDS {
        let around = |f: usize| (3 * f..3 * f + 3).filter_map(|h| surface.twin(h)).map(|twin| sums[twin / 3]);
        sums = (0..sums.len()).map(|f| sums[f] + around(f).sum::<Vector3<f64>>()).collect();
    }
    sums.iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vector3::z)).collect()
}

/// Grows all regions at once, the face that fits best first.
fn grow(
    surface: &Surface,
    barrier: &[bool],
    normals: &[Vector3<f64>],
    seeds: &[u32],
    proxies: &[Vector3<f64>],
) -> Vec<u32> {
    let mut region = vec![NONE; normals.len()];
    let mut queue = BinaryHeap::new();
    for (r, &f) in seeds.iter().enumerate() {
        queue.push(Reverse((0_u64, f, r as u32)));
    }
    while let Some(Reverse((_, f, r))) = queue.pop() {
        if region[f as usize] != NONE {
            continue;
        }
        region[f as usize] = r;
        for h in (3 * f as usize..3 * f as usize + 3).filter(|&h| !barrier[h]) {
            if let Some(twin) = surface.twin(h)
                && region[twin / 3] == NONE
            {
                let error = (normals[twin / 3] - proxies[r as usize]).norm_squared();
                // Bits of floats that are not negative sort like the floats.
                queue.push(Reverse((error.to_bits(), (twin / 3) as u32, r)));
            }
        }
    }
    region
}

/// Mean normal of every region.
fn means(region: &[u32], normals: &[Vector3<f64>], areas: &[f64], count: usize) -> Vec<Vector3<f64>> {
    let mut sums = vec![Vector3::zeros(); count];
    for ((&r, normal), area) in region.iter().zip(normals).zip(areas) {
        sums[r as usize] += *area * normal;
    }
    sums.iter().map(|n: &Vector3<f64>| n.try_normalize(0.0).unwrap_or_else(Vector3::z)).collect()
}

/// Two connected halves, none of them empty, of a connected set of two faces or more: what is nearer to one of its two ends, measured
/// along the surface. `joined` tells whether a half-edge leads to another face of the set.
pub(in crate::atlas) fn halves(surface: &Surface, faces: &[u32], joined: impl Fn(usize) -> bool) -> [Vec<u32>; 2] {
    let from = |start: u32| distances(surface, &[start], &joined);
    let farthest = |found: &[Reached]| {
        found.iter().max_by_key(|at| (at.distance, at.steps, Reverse(at.face))).map_or(faces[0], |at| at.face)
    };
    let one = farthest(&from(faces[0]));
    let other = farthest(&from(one));
    let mut split = [Vec::new(), Vec::new()];
    for at in distances(surface, &[one, other], &joined) {
        split[usize::from(at.side)].push(at.face);
    }
    for half in &mut split {
        half.sort_unstable();
    }
    split
}

/// A face on the way from the starts, the nearest first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Reached {
    /// Bits of the distance over face centres: those of floats that are not negative sort like the floats.
    distance: u64,
    /// Edges that were passed: the centres of two faces can be the same, and then only this tells them apart.
    steps: u32,
    face: u32,
    /// The start that it was reached from.
    side: u8,
}

/// All faces that can be reached from the starts, by their distance.
fn distances(surface: &Surface, starts: &[u32], joined: &impl Fn(usize) -> bool) -> Vec<Reached> {
    let centre = |f: usize| surface.corners(f).map(Vector3::from).iter().sum::<Vector3<f64>>() / 3.0;
    let mut done = std::collections::HashSet::new();
    let mut found = Vec::new();
    let mut queue = BinaryHeap::new();
    for (side, &face) in starts.iter().enumerate() {
        queue.push(Reverse(Reached { distance: 0, steps: 0, face, side: side as u8 }));
    }
    while let Some(Reverse(at)) = queue.pop() {
        if !done.insert(at.face) {
            continue;
        }
        found.push(at);
        let here = centre(at.face as usize);
        for h in 3 * at.face as usize..3 * at.face as usize + 3 {
            if let Some(twin) = surface.twin(h)
                && joined(h)
                && !done.contains(&((twin / 3) as u32))
            {
                let distance = (f64::from_bits(at.distance) + (centre(twin / 3) - here).norm()).to_bits();
                queue.push(Reverse(Reached { distance, steps: at.steps + 1, face: (twin / 3) as u32, side: at.side }));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two faces that differ in one corner only, by less than the rounding of their centres.
    #[test]
    fn faces_with_the_same_centre_are_halved() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0 + f64::EPSILON, 1.0, 0.0]];
        let (surface, _) = Surface::new(&positions, &[[0, 1, 2], [1, 0, 3]], true).unwrap();
        assert_eq!(surface.faces().len(), 2);
        let mut found = halves(&surface, &[0, 1], |_| true);
        found.sort_unstable();
        assert_eq!(found, [[0], [1]]);
    }
}
