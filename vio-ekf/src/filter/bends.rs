use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::covariance::Covariance;
use super::relative::LandmarkTransition;
use super::state::{State, at};

/// An error of the velocity lasts at least this long, s; ours.
pub(super) const LASTS: f64 = 0.1;

/// What the linear model leaves out of the bearings while velocity and distances are not known: the products `τ δρ` and `δρ²` of the
/// errors of the camera's translation and of the inverse distances.
///
/// For Gaussian errors their means and covariances follow from `P` (Athans, Wishner and Bertolini 1968). Errors of the distances
/// that landmarks share make the products of one landmark those of another. Left out, the filter would learn the scale from
/// its own mistakes: it sees how a landmark moves against a motion that is itself only estimated.
#[derive(Debug, Clone)]
pub(super) struct Bends {
    /// Of all inverse distances, row by row.
    distances: Vec<f64>,
    /// Between each inverse distance and the translation.
    common: Vec<Vector3<f64>>,
}

impl Bends {
    /// Memory for a number of landmarks.
    pub(super) fn new(landmarks: usize) -> Self {
        Self { distances: Vec::with_capacity(landmarks * landmarks), common: Vec::with_capacity(landmarks) }
    }

    /// Takes what it needs of the covariance before the step; `common` is that of a row and the translation of the step.
    pub(super) fn note(&mut self, covariance: &Covariance, common: impl Fn(usize) -> Vector3<f64>) {
        let rows = (at::HEAD + 2..covariance.size()).step_by(at::LANDMARK);
        self.distances.clear();
        self.common.clear();
        for row in rows.clone() {
            self.distances.extend(rows.clone().map(|other| covariance.row(row)[other]));
            self.common.push(common(row));
        }
    }

    /// Moves the bearings by the products' means, and adds their covariances to the lower triangle. `translation` is the covariance of
    /// the step's.
    pub(super) fn apply(
        &self,
        state: &mut State,
        covariance: &mut Covariance,
        (translation, lasting): (&Matrix3<f64>, f64),
        transitions: &[LandmarkTransition],
    ) {
        let count = transitions.len();
        for (slot, (own, common)) in transitions.iter().zip(&self.common).enumerate() {
            let distances = &self.distances[slot * count..][..=slot];
            let bearing = &mut state.landmarks[slot].bearing;
            *bearing = bearing.boxplus(&(own.mixed * common + own.bent * (0.5 * distances[slot])));
            let spread = own.mixed * translation;
            for (column, (other, shared)) in transitions.iter().zip(distances).enumerate() {
                let crossed = (own.mixed * self.common[column]) * (other.mixed * common).transpose();
                let bend = (spread * other.mixed.transpose() * *shared + crossed) * lasting
                    + own.bent * other.bent.transpose() * (0.5 * shared * shared);
                for r in 0..2 {
                    let row = covariance.row_mut(at::landmark(slot) + r);
                    for c in 0..2 {
                        row[at::landmark(column) + c] += bend[(r, c)];
                    }
                }
            }
        }
    }
}

/// For how much the product of a step counts. The errors of velocity and distance last for many steps, and so does their product:
/// `n` equal ones have `n` times the variance that independent ones would have. How long the velocity's error has lasted is in
/// what the position's error has in common with it.
pub(super) fn lasting(covariance: &Covariance, body_from_world: &UnitQuaternion<f64>, duration: f64) -> f64 {
    let velocity = covariance.block::<3, 3>(at::VELOCITY, at::VELOCITY).trace();
    if velocity <= 0.0 || duration <= 0.0 {
        return 1.0;
    }
    let turn = body_from_world.to_rotation_matrix().into_inner();
    let both = (turn * covariance.block::<3, 3>(at::POSITION, at::VELOCITY)).trace();
    1.0 + 2.0 * (LASTS + (both / velocity).max(0.0)) / duration
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_counts_for_as_long_as_the_velocity_has_been_wrong() {
        // A velocity that has been off by the same for 0.3 s, in a body that is turned against the world.
        let (turn, deviation, since, dt) = (UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1), 0.2_f64, 0.3, 0.05);
        let world_from_body = turn.to_rotation_matrix().into_inner();
        let mut covariance = Covariance::new(at::HEAD, at::HEAD);
        for r in 0..3 {
            covariance.inflate(at::VELOCITY + r, deviation * deviation);
            for c in 0..3 {
                let both = world_from_body[(r, c)] * deviation * deviation * since;
                covariance.correlate(at::POSITION + r, at::VELOCITY + c, both);
            }
        }
        let found = lasting(&covariance, &turn.inverse(), dt);
        assert!((found - (1.0 + 2.0 * (LASTS + since) / dt)).abs() < 1e-12, "{found}");
        assert_eq!(lasting(&Covariance::new(at::HEAD, at::HEAD), &turn, dt), 1.0);
    }
}
