//! The inertial sensor of a vehicle that the flight simulator moves.

use nalgebra::{Isometry3, Vector3};
use paint_sim::flight::{GRAVITY, Vehicle};
use vio_ekf::{Imu, ImuNoise, Stamp};

use super::normal;

/// Streams of random numbers: white noise, walk of the bias and its start, of gyroscope and accelerometer.
const STREAMS: [[i64; 3]; 2] = [[1, 2, 3], [4, 5, 6]];
/// Standard deviation of the biases at the start, rad/s and m/s²: of a sensor that was calibrated at rest.
const FIRST_BIAS: [f64; 2] = [2e-3, 3e-2];

/// Samples with white noise and wandering biases, of the mean rate and the mean specific force since the sample before, as a sensor that
/// integrates gives them.
pub struct SimulatedImu {
    noise: ImuNoise,
    seed: u64,
    biases: [Vector3<f64>; 2],
    count: i64,
    before: (Stamp, Isometry3<f64>, Vector3<f64>),
}

impl SimulatedImu {
    /// The first interval begins at `stamp`.
    pub fn new(noise: ImuNoise, seed: u64, stamp: Stamp, vehicle: &Vehicle) -> Self {
        let seed = seed ^ 0x1A0_5EED;
        let first = |sensor: usize| FIRST_BIAS[sensor] * normal3(seed, STREAMS[sensor][2], 0);
        let before = (stamp, vehicle.world_from_body(), vehicle.velocity);
        Self { noise, seed, biases: [first(0), first(1)], count: 0, before }
    }

    /// The sample that ends now. Axes of the body.
    pub fn sample(&mut self, stamp: Stamp, vehicle: &Vehicle) -> Imu {
        let (then, pose, velocity) =
            std::mem::replace(&mut self.before, (stamp, vehicle.world_from_body(), vehicle.velocity));
        let dt = stamp.secs_since(then);
        let turn = (pose.rotation.inverse() * self.before.1.rotation).scaled_axis();
        let force = (vehicle.velocity - velocity) / dt + Vector3::z() * GRAVITY;
        // At the middle of the interval, as the samples are integrated.
        let middle = pose.rotation * nalgebra::UnitQuaternion::from_scaled_axis(0.5 * turn);
        let truth = [turn / dt, middle.inverse_transform_vector(&force)];
        self.count += 1;
        let ImuNoise { gyro_density, gyro_walk, accel_density, accel_walk } = self.noise;
        let densities = [[gyro_density, gyro_walk], [accel_density, accel_walk]];
        let [gyro, accel] = [0, 1].map(|sensor| {
            let [white, walk] = densities[sensor];
            self.biases[sensor] += walk * dt.sqrt() * normal3(self.seed, STREAMS[sensor][1], self.count);
            truth[sensor] + self.biases[sensor] + white / dt.sqrt() * normal3(self.seed, STREAMS[sensor][0], self.count)
        });
        Imu { stamp, gyro, accel }
    }
}

fn normal3(seed: u64, stream: i64, index: i64) -> Vector3<f64> {
    Vector3::new(0, 1, 2).map(|axis| normal(seed, stream, 3 * index + axis))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn stamp(k: i64) -> Stamp {
        Stamp::from_nanos(5_000_000 * k)
    }

    /// Level flight in a circle at constant speed: the gyroscope reads v/r about z, the accelerometer v²/r to the left, and gravity.
    #[test]
    fn a_level_circle_is_sensed_as_in_the_textbook() {
        let (radius, speed) = (2.0, 1.5);
        let at = |k: i64| {
            let angle = speed / radius * 5e-3 * k as f64;
            let mut vehicle = Vehicle::at_rest(Point3::new(radius * angle.sin(), -radius * angle.cos(), 1.0), angle);
            vehicle.velocity = speed * Vector3::new(angle.cos(), angle.sin(), 0.0);
            vehicle
        };
        let mut imu = SimulatedImu::new(ImuNoise::ZERO, 1, stamp(0), &at(0));
        imu.biases = [Vector3::zeros(); 2];
        for k in 1..200 {
            let sample = imu.sample(stamp(k), &at(k));
            assert!((sample.gyro - Vector3::new(0.0, 0.0, speed / radius)).norm() < 1e-9, "{}", sample.gyro);
            let force = Vector3::new(0.0, speed * speed / radius, GRAVITY);
            assert!((sample.accel - force).norm() < 1e-5, "{}", sample.accel);
        }
    }

    /// At rest, the spread of samples is the density over the root of the interval.
    #[test]
    fn white_noise_has_its_density() {
        let vehicle = Vehicle::at_rest(Point3::origin(), 0.0);
        let noise = ImuNoise { gyro_walk: 0.0, accel_walk: 0.0, ..ImuNoise::default() };
        let mut imu = SimulatedImu::new(noise, 3, stamp(0), &vehicle);
        let bias = imu.biases[1].x;
        let count = 20_000;
        let squares: f64 = (1..=count).map(|k| (imu.sample(stamp(k), &vehicle).accel.x - bias).powi(2)).sum();
        let sigma = noise.accel_density / 5e-3_f64.sqrt();
        assert!(((squares / count as f64).sqrt() / sigma - 1.0).abs() < 0.02);
    }
}
