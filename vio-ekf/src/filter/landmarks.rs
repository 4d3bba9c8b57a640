//! Landmarks come, tell what to expect of others, and go.

use nalgebra::{Matrix1, Matrix2, Vector1};

use super::bearing::Bearing;
use super::covariance::Measurement;
use super::distance::InverseDistance;
use super::estimator::Estimator;
use super::state::{Landmark, at};

impl Estimator {
    /// Adds a landmark seen in the current image, of which nothing is known but that it is among the others; there must be room.
    /// `covariance` is that of its tangent coordinates.
    pub(crate) fn add(&mut self, bearing: Bearing, warp: Matrix2<f64>, covariance: &Matrix2<f64>) {
        let expected = self.state.expected.value;
        let row = self.covariance.size() + 2;
        self.add_at(bearing, warp, covariance, (expected, (self.landmarks.inverse_distance_sigma * expected).powi(2)));
        self.covariance.add_row(row, 1.0, at::EXPECTED);
    }

    /// Adds a landmark whose inverse distance has been measured, with a variance: that tells of the others, too.
    pub(crate) fn add_measured(
        &mut self,
        bearing: Bearing,
        warp: Matrix2<f64>,
        covariance: &Matrix2<f64>,
        (inverse_distance, variance): (f64, f64),
    ) {
        let expected = self.state.expected.value;
        self.update(&Measurement {
            rows: [at::EXPECTED],
            residual: Vector1::new(inverse_distance - expected),
            jacobian: Matrix1::new(1.0),
            noise: Matrix1::new(variance + (self.landmarks.inverse_distance_sigma * expected).powi(2)),
        });
        self.add_at(bearing, warp, covariance, (inverse_distance, variance));
    }

    /// Adds a landmark with an inverse distance, and its variance, that nothing else depends on.
    pub(super) fn add_at(
        &mut self,
        bearing: Bearing,
        warp: Matrix2<f64>,
        covariance: &Matrix2<f64>,
        (inverse_distance, variance): (f64, f64),
    ) {
        let landmark = Landmark { bearing, inverse_distance: InverseDistance::new(inverse_distance), warp };
        let row = self.covariance.size();
        self.state.landmarks.push(landmark);
        self.covariance.grow(at::LANDMARK);
        self.enter_bearing(row, &landmark, covariance);
        self.covariance.inflate(row + 2, variance);
    }

    /// Expects new landmarks to be as far away as those that there are.
    pub(crate) fn expect(&mut self) {
        let count = self.state.landmarks.len();
        if count == 0 {
            return;
        }
        let share = 1.0 / count as f64;
        let mean = self.state.landmarks.iter().map(|landmark| landmark.inverse_distance.value * share).sum::<f64>();
        self.state.expected = InverseDistance::new(mean);
        self.covariance.isolate(at::EXPECTED, 0.0);
        for slot in 0..count {
            self.covariance.add_row(at::EXPECTED, share, at::landmark(slot) + 2);
        }
        self.covariance.inflate(at::EXPECTED, (self.landmarks.inverse_distance_sigma * mean).powi(2) * share);
    }

    /// Brings the covariance in step with inverse distances that have become smaller.
    pub(super) fn settle(&mut self) {
        let landmarks = self.state.landmarks.iter_mut().map(|landmark| &mut landmark.inverse_distance).enumerate();
        for (row, distance) in landmarks
            .map(|(slot, distance)| (at::landmark(slot) + 2, distance))
            .chain([(at::EXPECTED, &mut self.state.expected)])
        {
            let factor = distance.settle();
            if factor < 1.0 {
                self.covariance.scale(row, factor);
            }
        }
    }

    /// Makes a landmark's bearing that of another point, seen in the current image exactly where the old one is believed
    /// to be, and as far away.
    pub(crate) fn renew(&mut self, slot: usize, warp: Matrix2<f64>, bearing: &Matrix2<f64>) {
        let row = at::landmark(slot);
        self.state.landmarks[slot].warp = warp;
        self.covariance.isolate(row, 0.0);
        self.covariance.isolate(row + 1, 0.0);
        self.enter_bearing(row, &self.state.landmarks[slot].clone(), bearing);
    }

    /// The covariance of a bearing that is new. Seen at the true time of the exposure but entered at the assumed one, it
    /// inherits the clock's error.
    fn enter_bearing(&mut self, row: usize, landmark: &Landmark, bearing: &Matrix2<f64>) {
        let rate = self.tangent_rate(landmark);
        for k in 0..2 {
            if self.covariance.variance(at::TIME_OFFSET) > 0.0 {
                self.covariance.add_row(row + k, -rate[k], at::TIME_OFFSET);
            }
        }
        for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            self.covariance.row_mut(row + r)[row + c] += bearing[(r, c)];
        }
    }

    /// Drops a landmark; the last one takes its slot.
    pub(crate) fn remove(&mut self, slot: usize) {
        self.state.landmarks.swap_remove(slot);
        self.covariance.swap_remove(at::landmark(slot), at::LANDMARK);
    }

    /// Lets all bearings become less certain, rad² per axis.
    pub(crate) fn diffuse(&mut self, variance: f64) {
        for row in (at::HEAD..self.covariance.size()).step_by(at::LANDMARK) {
            self.covariance.inflate(row, variance);
            self.covariance.inflate(row + 1, variance);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::{Camera, Imu, ImuNoise, Settings, Stamp, Start, StartSigma};

    #[test]
    fn landmarks_know_together_what_one_knows_of_the_scene() {
        let stamp = Stamp::from_nanos(0);
        let sample = Imu { stamp, gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
        let start = Start {
            stamp,
            world_from_body: Isometry3::identity(),
            velocity_in_body: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            sigma: StartSigma::default(),
        };
        let settings = Settings::default();
        let mut estimator = Estimator::new(&Camera::euroc(), ImuNoise::default(), &settings, &start, sample);
        let bearing = Bearing::new(&Vector3::z_axis());
        for _ in 0..4 {
            estimator.add(bearing, Matrix2::identity(), &Matrix2::identity());
        }
        let prior = settings.landmarks;
        let of = |sigma: f64| (sigma * prior.inverse_distance).powi(2);
        let (common, own) = (of(prior.common_sigma), of(prior.inverse_distance_sigma));
        let row = |slot: usize| at::landmark(slot) + 2;
        for (one, other) in [(0, 3), (2, 1), (2, 2)] {
            let expected = common + if one == other { own } else { 0.0 };
            assert!((estimator.covariance.row(row(one))[row(other)] - expected).abs() < 1e-12, "{one}, {other}");
        }
        // One that is measured well tells of the others as one that differs from them by its own deviation.
        estimator.add_measured(bearing, Matrix2::identity(), &Matrix2::identity(), (0.4, 0.0));
        let gain = common / (common + own);
        let moved = prior.inverse_distance + gain * (0.4 - prior.inverse_distance);
        assert!((estimator.state.expected.value - moved).abs() < 1e-12);
        assert!((estimator.state.landmarks[1].inverse_distance.value - moved).abs() < 1e-12);
        assert!((estimator.covariance.variance(at::EXPECTED) - common * (1.0 - gain)).abs() < 1e-12);
    }
}
