//! Relative motion of the camera, and how landmarks move in its axes.

use nalgebra::{Isometry3, Matrix2x3, Matrix3, SMatrix, Unit, UnitQuaternion, Vector2, Vector3};

use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;
use crate::filter::state::vio_state::VioState;

/// Relative motion of the camera between two of its poses, and its derivatives by the body's motion and by the calibration.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CameraMotion {
    /// Attitude of the old camera axes in the new ones.
    rotation: UnitQuaternion<f64>,
    matrix: Matrix3<f64>,
    /// Position of the old camera in the new axes.
    translation: Vector3<f64>,
    /// Errors `(ψ, τ)` of rotation (on the side of the new camera) and translation, by the errors of the body's motion
    /// (position, rotation on the start's side).
    pub(crate) by_motion: SMatrix<f64, 6, 6>,
    /// The same by the errors of the camera's position and attitude on the body.
    pub(crate) by_calibration: SMatrix<f64, 6, 6>,
}

/// How a landmark's error moves: `by_motion · (ψ, τ) + by_itself · e`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LandmarkTransition {
    pub(crate) by_motion: SMatrix<f64, 3, 6>,
    pub(crate) by_itself: Matrix3<f64>,
    /// Second derivative of the bearing by the inverse distance and the camera's translation.
    pub(crate) mixed: Matrix2x3<f64>,
    /// Second derivative of the bearing by the inverse distance.
    pub(crate) curvature: Vector2<f64>,
}

impl CameraMotion {
    /// From the pose of the body's end in the axes of its start.
    pub(crate) fn new(state: &VioState, start_from_end: &(Vector3<f64>, UnitQuaternion<f64>)) -> Self {
        let (moved, turn) = start_from_end;
        let (lever, camera) = (state.camera_position, state.camera_attitude);
        let camera_from_body = camera.inverse().to_rotation_matrix().into_inner();
        let end_from_start = turn.inverse().to_rotation_matrix().into_inner();
        let new_from_start = camera_from_body * end_from_start;
        let end_lever = end_from_start * (lever - moved);
        let rotation = camera.inverse() * turn.inverse() * camera;

        let mut by_motion = SMatrix::<f64, 6, 6>::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&-new_from_start);
        by_motion.fixed_view_mut::<3, 3>(3, 0).copy_from(&-new_from_start);
        by_motion.fixed_view_mut::<3, 3>(3, 3).copy_from(&(new_from_start * (lever - moved).cross_matrix()));
        let mut by_calibration = SMatrix::<f64, 6, 6>::zeros();
        let changed = new_from_start - camera_from_body;
        by_calibration.fixed_view_mut::<3, 3>(0, 3).copy_from(&changed);
        by_calibration.fixed_view_mut::<3, 3>(3, 0).copy_from(&changed);
        by_calibration.fixed_view_mut::<3, 3>(3, 3).copy_from(&(camera_from_body * (end_lever - lever).cross_matrix()));
        Self {
            rotation,
            matrix: rotation.to_rotation_matrix().into_inner(),
            translation: camera_from_body * (end_lever - lever),
            by_motion,
            by_calibration,
        }
    }

    /// From one camera of a rig to another, by their poses on the body, which are known exactly.
    pub(crate) fn between(first: &Isometry3<f64>, second: &Isometry3<f64>) -> Self {
        let second_from_first = second.inverse() * first;
        Self {
            rotation: second_from_first.rotation,
            matrix: second_from_first.rotation.to_rotation_matrix().into_inner(),
            translation: second_from_first.translation.vector,
            by_motion: SMatrix::zeros(),
            by_calibration: SMatrix::zeros(),
        }
    }

    /// Transforms a static landmark into the axes of the new camera. `None` for a point that the camera has run into.
    pub(crate) fn transform(&self, landmark: &Landmark) -> Option<(Landmark, LandmarkTransition)> {
        let (old, near) = (landmark.bearing.direction(), landmark.inverse_distance.value);
        let turned = self.matrix * old;
        let scaled = turned + self.translation * near;
        let (direction, length) = Unit::new_and_get(scaled);
        // Closer than a hundredth of its distance: rounding, and more, would decide where it is.
        if length.is_nan() || length < 0.01 {
            return None;
        }
        let bearing = landmark.bearing.transported(&self.rotation, &direction);
        let tangent = bearing.coordinates() / length;
        let radial = direction.transpose() * (-near / (length * length));

        let by_rotation = -turned.cross_matrix();
        let mut by_motion = SMatrix::<f64, 3, 6>::zeros();
        by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(tangent * by_rotation));
        by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&(tangent * near));
        by_motion.fixed_view_mut::<1, 3>(2, 0).copy_from(&(radial * by_rotation));
        by_motion.fixed_view_mut::<1, 3>(2, 3).copy_from(&(radial * near));
        let by_bearing = self.matrix * landmark.bearing.differential();
        let mut by_itself = Matrix3::zeros();
        let own = tangent * by_bearing;
        by_itself.fixed_view_mut::<2, 2>(0, 0).copy_from(&own);
        let own_by_distance = tangent * self.translation;
        by_itself.fixed_view_mut::<2, 1>(0, 2).copy_from(&own_by_distance);
        by_itself.fixed_view_mut::<1, 2>(2, 0).copy_from(&(radial * by_bearing));
        by_itself[(2, 2)] = (radial * self.translation)[0] + 1.0 / length;

        let curvature = own_by_distance * (-2.0 * direction.dot(&self.translation) / length);
        let inverse_distance = InverseDistance::new(near / length);
        let (warp, slope) = (&landmark.warp, landmark.slope.transpose());
        let transformed = Landmark {
            bearing,
            inverse_distance,
            warp: own * warp + own_by_distance * slope,
            slope: (radial * by_bearing * warp + slope * by_itself[(2, 2)]).transpose(),
            by_distance: by_itself * landmark.by_distance,
        };
        Some((transformed, LandmarkTransition { by_motion, by_itself, mixed: tangent, curvature }))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;
    use crate::filter::state::bearing::Bearing;
    use crate::lie::so3;
    use crate::sim::Rng;
    use crate::test_random::{signed, vector};

    /// A patch on a plane: where its pixels go, and at what distance, against differences of the transformation itself.
    #[test]
    fn a_patch_moves_as_the_points_of_its_plane_do() {
        let mut rng = Rng::new(3);
        for _ in 0..50 {
            let pose =
                |rng: &mut Rng| Isometry3::from_parts((vector(rng) * 0.5).into(), so3::exp(&(vector(rng) * 0.4)));
            let motion = CameraMotion::between(&pose(&mut rng), &pose(&mut rng));
            let bearing = Bearing::new(&Unit::new_normalize(Vector3::new(signed(&mut rng), signed(&mut rng), 1.5)));
            let mut landmark = Landmark::new(
                bearing,
                InverseDistance::new(0.4 + 0.3 * signed(&mut rng)),
                Matrix2::from_fn(|_, _| signed(&mut rng)),
            );
            landmark.slope = Vector2::new(signed(&mut rng), signed(&mut rng));
            let (moved, _) = motion.transform(&landmark).unwrap();
            let slope_of = |by_pixel: &dyn Fn(f64) -> (Vector2<f64>, f64)| {
                let [one, two] = [1e-6, -1e-6].map(|h| {
                    let (aside, farther) = by_pixel(h);
                    let inverse_distance = InverseDistance::new(landmark.inverse_distance.value + farther);
                    let point = Landmark { bearing: bearing.boxplus(&aside), inverse_distance, ..landmark };
                    motion.transform(&point).unwrap().0
                });
                let turned = one.bearing.direction() - two.bearing.direction();
                let nearer = one.inverse_distance.value - two.inverse_distance.value;
                let aside = moved.bearing.coordinates() * (turned / 2e-6);
                Vector3::new(aside.x, aside.y, nearer / 2e-6)
            };
            for column in 0..2 {
                let found = slope_of(&|h| (landmark.warp.column(column) * h, landmark.slope[column] * h));
                assert!((found.xy() - moved.warp.column(column)).norm() < 1e-6 * (1.0 + found.norm()));
                assert!((found.z - moved.slope[column]).abs() < 1e-6 * (1.0 + found.norm()));
            }
            let found = slope_of(&|h| (Vector2::zeros(), h));
            assert!((found - moved.by_distance).norm() < 1e-6 * (1.0 + found.norm()));
        }
    }
}
