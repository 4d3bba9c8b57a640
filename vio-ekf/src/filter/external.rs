use nalgebra::{Matrix6, SMatrix};

use super::covariance::Measurement;
use super::estimator::Estimator;
use super::update::mahalanobis;
use super::{MAX_AHEAD, Vio, at};
use crate::{Camera, Error, PoseMeasurement, so3};

/// Largest squared Mahalanobis length of a pose's residual: 99.9 % of chi-square with 6 degrees of freedom.
const GATE: f64 = 22.46;

impl Vio {
    /// The camera as it was given.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Takes a pose that somebody else has measured: of a map that is tracked, of a registration, of a motion capture.
    ///
    /// It is the pose of the **body in the filter's world**; `source` is not used. Its time is by the inertial sensor's
    /// clock, not before that of the last image; a pose and an image of the same time must come in the order image, pose.
    /// [`UnifiedVio`](crate::UnifiedVio) sees to the order. Returns whether it was used: it is not before the start, nor if
    /// it contradicts the estimate.
    ///
    /// The errors of successive poses are taken as independent. For errors that last for a time τ, of poses dt apart, divide
    /// the information by `2 τ / dt`.
    pub fn pose(&mut self, pose: &PoseMeasurement) -> Result<bool, Error> {
        let whitener = pose.whitener()?;
        let Some(estimator) = &mut self.estimator else { return Ok(false) };
        let (stamp, anchor) = (pose.stamp, estimator.history.anchor());
        if stamp < anchor {
            return Err(Error::Late { what: "pose", stamp, now: anchor });
        }
        if stamp.secs_since(estimator.history.latest().stamp) > MAX_AHEAD {
            return Err(Error::OutOfRange { stamp, first: anchor, last: estimator.history.now() });
        }
        if stamp > anchor {
            if self.rested && self.rest.is_at_rest(estimator.history.now()) {
                estimator.stay(stamp, &self.settings.rest);
            } else {
                let tracks = &mut self.tracks;
                estimator.advance(stamp, |slot| {
                    tracks.swap_remove(slot);
                });
            }
            // What patches drift since the last image is counted from here on at the next one.
            if self.tracks.iter().any(|track| track.patch.is_some()) {
                let drift = self.settings.patches.drift / self.camera.fx.min(self.camera.fy);
                let elapsed = estimator.history.anchor().secs_since(anchor);
                estimator.diffuse(drift * drift * elapsed);
            }
        }
        let measurement = against(estimator, pose, &whitener);
        let fits = mahalanobis(&estimator.covariance, &measurement).is_some_and(|distance| distance <= GATE);
        let used = fits && estimator.update(&measurement);
        self.excess = self.excess.or(estimator.excess(&self.settings.limits));
        estimator.replay();
        Ok(used)
    }
}

/// The residual of a pose in units of its own deviations: position, and `Log(Z R⁻¹)`, both errors on the world's side.
fn against(estimator: &Estimator, pose: &PoseMeasurement, whitener: &Matrix6<f64>) -> Measurement<6, 6> {
    let (state, seen) = (&estimator.state, &pose.source_from_sensor);
    let turn = so3::log(&(seen.rotation * state.attitude.inverse()));
    let mut residual = nalgebra::Vector6::zeros();
    residual.fixed_rows_mut::<3>(0).copy_from(&(seen.translation.vector - state.position));
    residual.fixed_rows_mut::<3>(3).copy_from(&turn);
    // Log(Z R⁻¹ Exp(−θ)) = y − J_r⁻¹(y) θ.
    let mut jacobian = SMatrix::<f64, 6, 6>::identity();
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&so3::right_jacobian_inverse(&turn));
    let rows = std::array::from_fn(|k| if k < 3 { at::POSITION + k } else { at::ATTITUDE + k - 3 });
    Measurement { rows, residual: whitener * residual, jacobian: whitener * jacobian, noise: Matrix6::identity() }
}
