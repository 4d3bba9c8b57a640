//! How the camera turned between two frames, as a gyroscope on it has it.

use nalgebra::{UnitQuaternion, Vector3};

use crate::error::Error;

/// Between samples that are farther apart nothing is known, seconds (ours).
const LONGEST_GAP: f64 = 0.1;
/// Least share of what is new that the bias takes from a tracked motion (ours): at first it is the mean of all of them.
const LEAST_GAIN: f64 = 0.05;
/// Samples that are forgotten at once: seldom, as the rest moves up.
const KEPT: usize = 4096;
/// No gyroscope is off by more, rad/s: what a frame says beyond that is a mistake of the tracker.
const LARGEST_BIAS: f64 = 0.2;

/// The angular rate of the camera, along its axes, and what of it is bias.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gyroscope {
    /// Seconds, and rad/s.
    rates: Vec<(f64, Vector3<f64>)>,
    bias: Vector3<f64>,
    learned: usize,
}

impl Gyroscope {
    /// Without samples.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a sample: seconds, on the clock of the images, and the angular rate of the camera along its own axes, rad/s.
    ///
    /// # Errors
    /// [`Error::InvalidTime`] unless it comes after the sample before; [`Error::InvalidSample`] for a rate that is not finite.
    pub fn add(&mut self, stamp: f64, rate_in_camera: Vector3<f64>) -> Result<(), Error> {
        let last = self.rates.last().map_or(f64::NEG_INFINITY, |(last, _)| *last);
        if !(stamp.is_finite() && stamp > last) {
            return Err(Error::InvalidTime { time: stamp, last });
        }
        if !rate_in_camera.iter().all(|rate| rate.is_finite()) {
            return Err(Error::InvalidSample { what: "angular rate", stamp });
        }
        self.rates.push((stamp, rate_in_camera));
        Ok(())
    }

    /// Forgets samples that no turn from `stamp` on needs.
    pub(crate) fn forget_before(&mut self, stamp: f64) {
        let first = self.rates.partition_point(|(at, _)| *at <= stamp).saturating_sub(1);
        if first >= KEPT {
            self.rates.drain(..first);
        }
    }

    /// The bias, and the motions that it was learned from.
    pub(crate) fn learned(&self) -> (Vector3<f64>, usize) {
        (self.bias, self.learned)
    }

    /// Takes the bias of an earlier run.
    pub(crate) fn restore(&mut self, bias: Vector3<f64>, learned: usize) {
        (self.bias, self.learned) = (bias, learned);
    }

    /// What is taken for bias, rad/s.
    pub fn bias(&self) -> &Vector3<f64> {
        &self.bias
    }

    /// `camera_then_from_camera_now`: the integral of the rate without the bias; `None` where samples are missing.
    pub fn turn(&self, then: f64, now: f64) -> Option<UnitQuaternion<f64>> {
        let begin = self.rates.partition_point(|(stamp, _)| *stamp <= then).checked_sub(1)?;
        let mut turn = UnitQuaternion::identity();
        for pair in self.rates[begin..].windows(2) {
            let [(from, a), (to, b)] = [pair[0], pair[1]];
            if to - from > LONGEST_GAP {
                return None;
            }
            let (start, stop) = (from.max(then), to.min(now));
            // The rate in the middle of the part that counts.
            let share = (0.5 * (start + stop) - from) / (to - from);
            turn *= UnitQuaternion::from_scaled_axis((a + share * (b - a) - self.bias) * (stop - start));
            if to >= now {
                return Some(turn);
            }
        }
        None
    }

    /// A motion was tracked, `camera_then_from_camera_now`: what the gyroscope has beyond it is bias.
    pub fn learn(&mut self, then: f64, now: f64, tracked: &UnitQuaternion<f64>) {
        let Some(turn) = self.turn(then, now).filter(|_| now > then) else { return };
        let off = (tracked.inverse() * turn).scaled_axis() / (now - then);
        if off.norm() <= LARGEST_BIAS {
            self.learned += 1;
            self.bias += off * (1.0 / self.learned as f64).max(LEAST_GAIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns at a rate that grows, with a bias, 100 times a second; the true turn between two stamps is known in closed form.
    fn gyroscope(bias: Vector3<f64>) -> Gyroscope {
        let rate = |t: f64| Vector3::new(0.0, 0.5 + 2.0 * t, 0.0) + bias;
        let rates = (0..=200).map(|k| 0.01 * f64::from(k)).map(|t| (t, rate(t))).collect();
        Gyroscope { rates, bias: Vector3::zeros(), learned: 0 }
    }

    fn truth(then: f64, now: f64) -> UnitQuaternion<f64> {
        let angle = 0.5 * (now - then) + now * now - then * then;
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, angle, 0.0))
    }

    #[test]
    fn a_turn_is_the_integral_of_the_rate_between_samples_too() {
        let gyroscope = gyroscope(Vector3::zeros());
        for (then, now) in [(0.0, 1.0), (0.123, 0.1271), (0.5037, 1.9)] {
            let found = gyroscope.turn(then, now).unwrap();
            assert!(found.angle_to(&truth(then, now)) < 1e-9, "{then} {now}");
        }
        // Before the first sample, after the last one, over a gap.
        assert!(gyroscope.turn(-0.1, 0.5).is_none() && gyroscope.turn(1.5, 2.1).is_none());
        let mut holed = gyroscope;
        holed.rates.drain(100..115);
        assert!(holed.turn(0.5, 1.5).is_none() && holed.turn(1.2, 1.5).is_some());
    }

    #[test]
    fn the_bias_is_learned_from_tracked_motions_but_not_from_a_mistake() {
        let bias = Vector3::new(0.01, -0.02, 0.03);
        let mut gyroscope = gyroscope(bias);
        assert!(gyroscope.turn(0.0, 1.0).unwrap().angle_to(&truth(0.0, 1.0)) > 0.03);
        for k in 0..10 {
            let (then, now) = (0.1 * f64::from(k), 0.1 * f64::from(k + 1));
            gyroscope.learn(then, now, &truth(then, now));
        }
        gyroscope.learn(1.0, 1.1, &UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 1.0)));
        assert!((gyroscope.bias - bias).norm() < 1e-3, "{}", gyroscope.bias);
        assert!(gyroscope.turn(1.0, 1.5).unwrap().angle_to(&truth(1.0, 1.5)) < 1e-3);
    }
}
