//! What a seam costs: its length, dear on ridges that are seen, cheap in creases; and where one may end.

use std::f64::consts::TAU;

use crate::surface::Surface;

/// How much dearer than its length a sharply convex edge is, and how much cheaper a sharply concave one.
const CREASE_FACTOR: f64 = 0.5;
/// Length over which bending counts as sharp, relative to the square root of the area.
const CREASE_LENGTH: f64 = 0.05;

/// Price of every edge as a seam, metres for flat surfaces, by half-edge; infinite on the border.
pub(super) fn seam_prices(surface: &Surface) -> Vec<f32> {
    let sharp = CREASE_LENGTH * surface.area().sqrt();
    (0..3 * surface.faces().len())
        .map(|h| surface.twin(h).map_or(f32::INFINITY, |twin| price(surface, h, twin, sharp) as f32))
        .collect()
}

/// Bending is measured per length, so that the price does not depend on how finely the surface is meshed.
fn price(surface: &Surface, h: usize, twin: usize, sharp: f64) -> f64 {
    let edge = surface.edge(h);
    let length = edge.norm();
    let (left, right) = (surface.face_cross(h / 3), surface.face_cross(twin / 3));
    // Positive where the surface is convex.
    let bend = left.cross(&right).dot(&edge).atan2(length * left.dot(&right));
    let across = (left.norm() + right.norm()) / (3.0 * length);
    length * (1.0 + CREASE_FACTOR * (bend * sharp / across).tanh())
}

/// What is missing to a full turn around every vertex, radians; a full turn on the border. A seam can end inside a chart only
/// where something is missing: elsewhere its two sides would lie over each other.
pub(super) fn angle_deficits(surface: &Surface) -> Vec<f64> {
    let mut deficits = vec![TAU; surface.positions().len()];
    for (f, face) in surface.faces().iter().enumerate() {
        let doubled_area = surface.face_cross(f).norm();
        for (k, &v) in face.iter().enumerate() {
            let (out, back) = (surface.edge(3 * f + k), -surface.edge(3 * f + (k + 2) % 3));
            deficits[v as usize] -= doubled_area.atan2(out.dot(&back));
        }
    }
    for h in (0..3 * surface.faces().len()).filter(|&h| surface.twin(h).is_none()) {
        for v in surface.ends(h) {
            deficits[v as usize] = TAU;
        }
    }
    deficits
}
