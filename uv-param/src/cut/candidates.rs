//! Where a cut should reach: the vertices of greatest distortion.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::paths::BoundaryPaths;
use crate::chart::Chart;
use crate::disk::Disk;

/// Radius over which distortion is averaged, relative to the square root of the area: single bad faces are noise.
const SMOOTHING_RADIUS: f64 = 0.03;
/// Shortest cut that is worth making, in the same unit.
const MIN_CUT_LENGTH: f64 = 0.04;
/// Least distance between two candidates, in the same unit.
const MIN_SPACING: f64 = 0.16;
/// Shortest rim of a hole that is worth joining to the outer boundary for its own sake, in the same unit.
const MIN_HOLE_RIM: f64 = 0.3;
/// Most rounds of averaging, for very fine meshes.
const MAX_SMOOTHING_ROUNDS: f64 = 100.0;

/// A vertex on the rim of the longest hole, if that is neither small nor near the outer boundary.
pub(super) fn hole_to_join(disk: &Disk, paths: &BoundaryPaths) -> Option<u32> {
    let unit = disk.area().sqrt();
    let rim = disk.loops.get(1)?;
    let long = disk.loop_length(rim) >= MIN_HOLE_RIM * unit;
    (long && paths.distance[rim[0] as usize] >= MIN_CUT_LENGTH * unit).then(|| rim[0])
}

/// The `count` vertices with the most distortion around them, far from the outer boundary and from each other, worst first.
/// The way out counts too: a long cut frees more of the surface than a short one.
pub(super) fn cut_candidates(chart: &Chart, paths: &BoundaryPaths, count: usize) -> Vec<u32> {
    let disk = chart.disk();
    let unit = disk.area().sqrt();
    let distortion = smoothed_distortion(chart, SMOOTHING_RADIUS * unit);
    let score = |v: u32| distortion[v as usize] * paths.distance[v as usize].sqrt();
    let at = |v: u32| Vector3::from(disk.positions[v as usize]);
    let inner = |v: &u32| paths.distance[*v as usize] >= MIN_CUT_LENGTH * unit;
    let mut order: Vec<u32> = (0..disk.positions.len() as u32).filter(inner).collect();
    order.sort_unstable_by(|&a, &b| score(b).total_cmp(&score(a)).then(a.cmp(&b)));
    let mut cut_candidates: Vec<u32> = Vec::with_capacity(count);
    for v in order {
        if cut_candidates.len() == count {
            break;
        }
        if cut_candidates.iter().all(|&candidate| (at(candidate) - at(v)).norm() >= MIN_SPACING * unit) {
            cut_candidates.push(v);
        }
    }
    move_to_sharpest(disk, &mut cut_candidates, SMOOTHING_RADIUS * unit + mean_edge(disk), |v| inner(&v));
    cut_candidates
}

/// Moves every candidate to the sharpest point within `radius`; those on the rim of a hole stay, they open it.
fn move_to_sharpest(disk: &Disk, cut_candidates: &mut [u32], radius: f64, allowed: impl Fn(u32) -> bool) {
    let deficits = angle_deficits(disk);
    let at = |v: u32| Vector3::from(disk.positions[v as usize]);
    for candidate in cut_candidates {
        if disk.loops.iter().flatten().any(|v| v == candidate) {
            continue;
        }
        let near =
            (0..disk.positions.len() as u32).filter(|&v| allowed(v) && (at(*candidate) - at(v)).norm() <= radius);
        *candidate = near.max_by(|&a, &b| deficits[a as usize].total_cmp(&deficits[b as usize])).unwrap_or(*candidate);
    }
}

/// What is missing to a full turn around every inner vertex; 0 on the boundary. A cut frees most where it ends in a point:
/// beyond the apex of a cone there is nothing left to flatten.
fn angle_deficits(disk: &Disk) -> Vec<f64> {
    let mut deficits = vec![TAU; disk.positions.len()];
    for (f, face) in disk.faces.iter().enumerate() {
        let doubled_area = disk.face_cross(f).norm();
        for (k, &v) in face.iter().enumerate() {
            let (out, back) = (disk.edge(3 * f + k), -disk.edge(3 * f + (k + 2) % 3));
            deficits[v as usize] -= doubled_area.atan2(out.dot(&back));
        }
    }
    for &v in disk.loops.iter().flatten() {
        deficits[v as usize] = 0.0;
    }
    deficits
}

/// Mean of `ln max(s1, 1 / s2)` around every vertex, weighted by area.
fn smoothed_distortion(chart: &Chart, radius: f64) -> Vec<f64> {
    let disk = chart.disk();
    let names: Vec<[u32; 3]> = disk.faces.iter().map(|face| face.map(|v| disk.uncut_vertex(v))).collect();
    let mut on_faces: Vec<f64> = (0..disk.faces.len())
        .map(|f| {
            let [s1, s2] = chart.stretch(f as u32);
            s1.max(1.0 / s2.abs()).ln()
        })
        .collect();
    let mut on_vertices = to_vertices(disk, &names, &on_faces);
    // There and back spreads by about an edge, and rounds add up like the steps of a random walk.
    let rounds = (radius / mean_edge(disk)).powi(2).min(MAX_SMOOTHING_ROUNDS) as usize;
    for _ in 0..rounds {
        for (value, face) in on_faces.iter_mut().zip(&names) {
            *value = face.iter().map(|&v| on_vertices[v as usize]).sum::<f64>() / 3.0;
        }
        on_vertices = to_vertices(disk, &names, &on_faces);
    }
    (0..disk.positions.len() as u32).map(|v| on_vertices[disk.uncut_vertex(v) as usize]).collect()
}

/// Area-weighted mean of the faces around every vertex; `names` gives both sides of a seam one vertex.
fn to_vertices(disk: &Disk, names: &[[u32; 3]], on_faces: &[f64]) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]; disk.positions.len()];
    for (f, (face, value)) in names.iter().zip(on_faces).enumerate() {
        let area = disk.face_area(f);
        for &v in face {
            sums[v as usize][0] += area * value;
            sums[v as usize][1] += area;
        }
    }
    sums.into_iter().map(|[sum, area]| if area > 0.0 { sum / area } else { 0.0 }).collect()
}

fn mean_edge(disk: &Disk) -> f64 {
    let edges = disk.twins.len();
    (0..edges).map(|h| disk.edge(h).norm()).sum::<f64>() / edges as f64
}
