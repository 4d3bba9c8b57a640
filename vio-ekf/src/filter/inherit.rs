use nalgebra::{Matrix2, SVector};

use super::bearing::Bearing;
use super::estimator::Estimator;
use super::moving::{GLOBAL, Motion};
use super::state::at;

impl Estimator {
    /// Takes over what a window has told, with everything that its errors have in common: were the distances entered as
    /// independent, the scale would seem to be known many times over. `look` tells of a point by its name how it is seen now:
    /// bearing, warp, covariance of the bearing.
    pub(super) fn inherit(
        &mut self,
        motion: &Motion,
        mut look: impl FnMut(u64) -> Option<(Bearing, Matrix2<f64>, Matrix2<f64>)>,
    ) {
        let core = motion.core * motion.covariance * motion.core.transpose();
        for r in 0..at::CORE {
            self.covariance.row_mut(r)[..at::CORE].copy_from_slice(core.column(r).as_slice());
        }
        // The samples' own noise over the window, which that took for none.
        let (time, noise) = (motion.duration, self.noise);
        let tilt = noise.gyro_density.powi(2) * time;
        let velocity = noise.accel_density.powi(2) * time + self.gravity.powi(2) * tilt * time * time / 3.0;
        for (row, variance) in [
            (at::VELOCITY, velocity),
            (at::ATTITUDE, tilt),
            (at::GYRO_BIAS, noise.gyro_walk.powi(2) * time),
            (at::ACCEL_BIAS, noise.accel_walk.powi(2) * time),
        ] {
            let rows = if row == at::ATTITUDE { 2 } else { 3 };
            (row..row + rows).for_each(|row| self.covariance.inflate(row, variance));
        }

        let mut entered: Vec<(usize, SVector<f64, GLOBAL>)> = Vec::with_capacity(motion.landmarks.len());
        for depth in &motion.landmarks {
            if self.covariance.size() + at::LANDMARK > self.covariance.capacity() {
                break;
            }
            let Some((bearing, warp, covariance)) = look(depth.id) else { continue };
            self.add_at(bearing, warp, &covariance, (depth.inverse_distance, depth.variance));
            let row = self.covariance.size() - 1;
            let spread = motion.covariance * depth.gradient;
            let with_core = motion.core * spread;
            for (other, value) in with_core.iter().enumerate() {
                self.covariance.correlate(row, other, *value);
            }
            for (other, gradient) in &entered {
                self.covariance.correlate(row, *other, spread.dot(gradient));
            }
            self.covariance.inflate(row, spread.dot(&depth.gradient));
            entered.push((row, depth.gradient));
        }
        self.expect();
    }
}
