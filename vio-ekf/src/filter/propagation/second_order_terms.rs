//! Second-order terms of the propagation: products of the errors of velocity and inverse distance.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::filter::propagation::camera_motion::LandmarkTransition;
use crate::filter::state::error_state;
use crate::filter::state::vio_state::VioState;
use crate::inertial::covariance::Covariance;

/// Least correlation time of the velocity's error, s; ours.
pub(super) const MIN_CORRELATION_S: f64 = 0.1;

/// Variance of a bearing, rad², that is none: a ten-thousandth of a pixel, squared.
const NEGLIGIBLE: f64 = 1e-13;

/// The second-order terms of the bearings, which matter while velocity and distances are not known: the products `τ δρ` and `δρ²` of
/// the errors of the camera's translation and of the inverse distances.
///
/// For Gaussian errors their means and covariances follow from `P` (Athans, Wishner and Bertolini 1968). Errors of the distances
/// that landmarks share make the products of one landmark those of another. Left out, the filter would learn the scale from
/// its own mistakes: it sees how a landmark moves against a motion that is itself only estimated.
#[derive(Debug, Clone)]
pub(super) struct SecondOrderTerms {
    /// Covariance of all inverse distances, row by row.
    distances: Vec<f64>,
    /// Covariance of each inverse distance and the translation.
    cross: Vec<Vector3<f64>>,
}

impl SecondOrderTerms {
    /// Memory for a number of landmarks.
    pub(super) fn new(landmarks: usize) -> Self {
        Self { distances: Vec::with_capacity(landmarks * landmarks), cross: Vec::with_capacity(landmarks) }
    }

    /// Records what it needs of the covariance before the propagation; `cross` is that of a row and the translation.
    pub(super) fn record(&mut self, (covariance, head): (&Covariance, usize), cross: impl Fn(usize) -> Vector3<f64>) {
        let rows = (head + 2..covariance.size()).step_by(error_state::LANDMARK_SIZE);
        self.distances.clear();
        self.cross.clear();
        for row in rows.clone() {
            self.distances.extend(rows.clone().map(|other| covariance.row(row)[other]));
            self.cross.push(cross(row));
        }
    }

    /// Moves the bearings by the products' means, and adds their covariances to the lower triangle. `translation` is the covariance of
    /// the camera's translation.
    pub(super) fn apply(
        &self,
        state: &mut VioState,
        covariance: &mut Covariance,
        (translation, correlation_factor): (&Matrix3<f64>, f64),
        transitions: &[LandmarkTransition],
    ) {
        let count = transitions.len();
        for (slot, (own, cross)) in transitions.iter().zip(&self.cross).enumerate() {
            let distances = &self.distances[slot * count..][..=slot];
            let bearing = &mut state.landmarks[slot].bearing;
            *bearing = bearing.boxplus(&(own.mixed * cross + own.curvature * (0.5 * distances[slot])));
            let spread = own.mixed * translation;
            for (column, (other, shared)) in transitions.iter().zip(distances).enumerate() {
                // Most landmarks are known well enough for their products to be nothing.
                let most = (translation.trace() * shared.abs() + cross.norm() * self.cross[column].norm())
                    * correlation_factor;
                if most + shared * shared < NEGLIGIBLE {
                    continue;
                }
                let crossed = (own.mixed * self.cross[column]) * (other.mixed * cross).transpose();
                let product = (spread * other.mixed.transpose() * *shared + crossed) * correlation_factor
                    + own.curvature * other.curvature.transpose() * (0.5 * shared * shared);
                for r in 0..2 {
                    let row = covariance.row_mut(state.landmark_row(slot) + r);
                    for c in 0..2 {
                        row[state.landmark_row(column) + c] += product[(r, c)];
                    }
                }
            }
        }
    }
}

/// Factor on the variance of a product for its correlation over successive propagations. The errors of velocity and distance last
/// for many of them, and so does their product: `n` equal ones have `n` times the variance of independent ones. The correlation
/// time is estimated from the covariance of position and velocity; ours.
pub(super) fn correlation_factor(covariance: &Covariance, body_from_world: &UnitQuaternion<f64>, duration: f64) -> f64 {
    let velocity = covariance.block::<3, 3>(error_state::VELOCITY, error_state::VELOCITY).trace();
    if velocity <= 0.0 || duration <= 0.0 {
        return 1.0;
    }
    let rotation = body_from_world.to_rotation_matrix().into_inner();
    let both = (rotation * covariance.block::<3, 3>(error_state::POSITION, error_state::VELOCITY)).trace();
    1.0 + 2.0 * (MIN_CORRELATION_S + (both / velocity).max(0.0)) / duration
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_factor_follows_the_correlation_time_of_the_velocity() {
        // A velocity that has been off by the same for 0.3 s, in a body that is turned against the world.
        let (rotation, deviation, since, dt) = (UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1), 0.2_f64, 0.3, 0.05);
        let world_from_body = rotation.to_rotation_matrix().into_inner();
        let mut covariance = Covariance::new(error_state::FIXED, error_state::FIXED);
        for r in 0..3 {
            covariance.inflate(error_state::VELOCITY + r, deviation * deviation);
            for c in 0..3 {
                let both = world_from_body[(r, c)] * deviation * deviation * since;
                covariance.set_covariance(error_state::POSITION + r, error_state::VELOCITY + c, both);
            }
        }
        let found = correlation_factor(&covariance, &rotation.inverse(), dt);
        assert!((found - (1.0 + 2.0 * (MIN_CORRELATION_S + since) / dt)).abs() < 1e-12, "{found}");
        assert_eq!(correlation_factor(&Covariance::new(error_state::FIXED, error_state::FIXED), &rotation, dt), 1.0);
    }
}
