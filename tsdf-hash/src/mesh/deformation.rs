//! Embedded deformation (Sumner, Schmid, Pauly 2007): a mesh follows a few places that have moved.

use nalgebra::{Isometry3, Point3};

use crate::mesh::triangle_mesh::Mesh;

/// Places that move a point: the nearest ones (as there).
const NEAREST: usize = 4;

/// Places and how each of them has moved. After a loop it shows at once about where the surface will be, long before all frames are fused anew
/// (thesis Paper I, section 4.6, deforms its mesh so, and keeps that). Where a drifting visit lies over an old one both move by a mean of
/// the two: what tells them apart is not kept with a vertex.
#[derive(Clone, Debug, Default)]
pub struct EmbeddedDeformation {
    places: Vec<(Point3<f64>, Isometry3<f64>)>,
}

impl EmbeddedDeformation {
    /// Places in the world, and the motions `new_from_old` there.
    pub fn new(places: Vec<(Point3<f64>, Isometry3<f64>)>) -> Self {
        Self { places }
    }

    /// Where a point has gone: the mean of where the nearest places take it, with weights `(1 − d / d_max)²`, `d_max` being the distance of the
    /// first place that has no say. Without places it stays.
    pub fn point(&self, point: &Point3<f64>) -> Point3<f64> {
        let mut near: Vec<(f64, &Isometry3<f64>)> =
            self.places.iter().map(|(place, motion)| ((place - point).norm(), motion)).collect();
        // The nearest ones and the first that has no say, not all in order.
        if near.len() > NEAREST {
            near.select_nth_unstable_by(NEAREST, |a, b| a.0.total_cmp(&b.0));
        }
        let farthest = near.get(NEAREST).map_or(f64::INFINITY, |(distance, _)| *distance);
        let weight = |distance: f64| if farthest.is_finite() { (1.0 - distance / farthest).powi(2) } else { 1.0 };
        let near = &near[..near.len().min(NEAREST)];
        let sum: f64 = near.iter().map(|(distance, _)| weight(*distance)).sum();
        // Places that are all equally far have no weights: the first of them decides.
        let Some((_, first)) = near.first() else { return *point };
        if sum <= f64::EPSILON {
            return *first * point;
        }
        let moved = near.iter().map(|(distance, motion)| (*motion * point).coords * (weight(*distance) / sum));
        Point3::from(moved.sum::<nalgebra::Vector3<f64>>())
    }

    /// Moves the vertices of a mesh; normals stay as they are.
    pub fn apply(&self, mesh: &mut Mesh) {
        for position in &mut mesh.positions {
            *position = self.point(&Point3::from(position.map(f64::from))).cast::<f32>().into();
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn row(motion: impl Fn(usize) -> Isometry3<f64>) -> EmbeddedDeformation {
        EmbeddedDeformation::new((0..10).map(|k| (Point3::new(k as f64, 0.0, 0.0), motion(k))).collect())
    }

    #[test]
    fn a_rigid_motion_is_followed_exactly() {
        let motion = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.2, 0.1, -0.3));
        let deformation = row(|_| motion);
        let mut mesh = Mesh { positions: vec![[0.3, 0.2, 0.1], [12.0, -3.0, 4.0]], ..Mesh::default() };
        let expected = mesh.positions.clone().into_iter().map(|p| motion * Point3::from(p.map(f64::from)));
        let expected: Vec<_> = expected.collect();
        deformation.apply(&mut mesh);
        for (found, expected) in mesh.positions.iter().zip(&expected) {
            assert!((Point3::from(found.map(f64::from)) - expected).norm() < 1e-6);
        }
    }

    /// A drift that grows along the way is taken back without a step: in the middle between two places by their mean.
    #[test]
    fn a_drift_that_grows_is_taken_back_evenly() {
        let deformation = row(|k| Isometry3::translation(0.0, 0.01 * k as f64, 0.0));
        let shift = |x: f64| deformation.point(&Point3::new(x, 0.0, 0.0)).y;
        assert!((shift(4.5) - 0.045).abs() < 1e-9);
        let shifts: Vec<f64> = (0..=100).map(|k| shift(2.0 + 0.05 * f64::from(k))).collect();
        for pair in shifts.windows(2) {
            assert!(pair[1] >= pair[0] - 1e-12 && pair[1] - pair[0] < 2.5e-3, "{pair:?}");
        }
    }

    /// Places 1 to 5 m away that shift by as many metres: the fifth has no say, and (4² 1 + 3² 2 + 2² 3 + 1² 4) / 30 is left.
    #[test]
    fn nearer_places_weigh_more() {
        let places = |order: [i32; 5]| {
            EmbeddedDeformation::new(
                order.map(f64::from).map(|d| (Point3::new(0.0, d, 0.0), Isometry3::translation(d, 0.0, 0.0))).to_vec(),
            )
        };
        for order in [[1, 2, 3, 4, 5], [5, 3, 1, 4, 2]] {
            let moved = places(order).point(&Point3::origin());
            assert!((moved - Point3::new(50.0 / 30.0, 0.0, 0.0)).norm() < 1e-12, "{moved}");
        }
    }

    #[test]
    fn places_that_say_nothing_change_nothing() {
        let point = Point3::new(1.0, 2.0, 3.0);
        assert_eq!(EmbeddedDeformation::default().point(&point), point);
        // Five places equally far.
        let motion = Isometry3::translation(1.0, 0.0, 0.0);
        let same = EmbeddedDeformation::new(vec![(Point3::origin(), motion); 5]);
        assert!((same.point(&point) - motion * point).norm() < 1e-12);
    }
}
