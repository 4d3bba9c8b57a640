//! What a seam costs: its length, costly on ridges that are seen, cheap in creases; and where one may end.

use std::cell::Cell;
use std::f64::consts::TAU;

use crate::surface::Surface;

/// How much costlier than its length a sharply convex edge is, and how much cheaper a sharply concave one.
const CREASE_FACTOR: f64 = 0.5;
/// Length over which bending counts as sharp, relative to the square root of the area.
const CREASE_LENGTH: f64 = 0.05;

/// Costs of edges as seams. Most edges of a large surface are never asked for: each is worked out once it is.
pub(in crate::atlas) struct SeamCosts<'a> {
    surface: &'a Surface,
    sharp: f64,
    known: Vec<Cell<f32>>,
}

impl<'a> SeamCosts<'a> {
    pub(in crate::atlas) fn new(surface: &'a Surface) -> Self {
        let sharp = CREASE_LENGTH * surface.area().sqrt();
        Self { surface, sharp, known: vec![Cell::new(f32::NAN); 3 * surface.faces().len()] }
    }

    /// Of a half-edge's edge, metres for flat surfaces; infinite on the border.
    pub(in crate::atlas) fn of(&self, h: u32) -> f64 {
        let h = h as usize;
        if self.known[h].get().is_nan() {
            let found = self.surface.twin(h).map_or(f64::INFINITY, |twin| cost(self.surface, h, twin, self.sharp));
            self.known[h].set(found as f32);
        }
        f64::from(self.known[h].get())
    }

    /// Of all edges of a line.
    pub(in crate::atlas) fn sum(&self, half_edges: &[u32]) -> f64 {
        half_edges.iter().map(|&h| self.of(h)).sum()
    }
}

/// Bending is measured per length, so that the cost does not depend on how finely the surface is meshed.
fn cost(surface: &Surface, h: usize, twin: usize, sharp: f64) -> f64 {
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
pub(in crate::atlas) fn angle_deficits(surface: &Surface) -> Vec<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Three right angles meet at a corner of a box; the diagonals of its sides pass some corners and not others.
    #[test]
    fn a_right_angle_is_missing_at_every_corner_of_a_box() {
        let positions: Vec<[f64; 3]> =
            (0..8).map(|v| [f64::from(v & 1), 2.0 * f64::from(v >> 1 & 1), 3.0 * f64::from(v >> 2)]).collect();
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let mut faces: Vec<[u32; 3]> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let closed = Surface::new(&positions, &faces, false).unwrap().0;
        for deficit in angle_deficits(&closed) {
            assert!((deficit - TAU / 4.0).abs() < 1e-12, "{deficit}");
        }
        // Without the side x = 1 its four corners are on the border.
        faces.truncate(10);
        let open = Surface::new(&positions, &faces, false).unwrap().0;
        for (v, deficit) in angle_deficits(&open).into_iter().enumerate() {
            let expected = if v & 1 == 1 { TAU } else { TAU / 4.0 };
            assert!((deficit - expected).abs() < 1e-12, "{v}: {deficit}");
        }
    }
}
