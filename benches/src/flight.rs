//! A flight with two inertial sensors, a camera that sees points, and poses from a map that are late, noisy and drift.

use nalgebra::{Isometry3, Point3, Translation3, Vector2, Vector3};
use vio_ekf::filter::PointObservation;
use vio_ekf::fusion::PoseMeasurement;
use vio_ekf::lie::so3;
use vio_ekf::sim::{ImuModel, forward_pinhole, observe_points, swaying_flight};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Error, Imu, ImuNoise, Stamp};

use crate::Rng;

/// Gravity, m/s².
pub const GRAVITY: f64 = 9.81;
/// Noise of a point, pixels.
pub const PIXEL_SIGMA: f64 = 1.0;
/// Time between images, ns, and the time until one has arrived.
const IMAGES: [i64; 2] = [50_000_000, 30_000_000];
/// Time between poses of the map, ns.
const POSES: i64 = 100_000_000;

/// How good the poses of the map are.
#[derive(Debug, Clone, Copy)]
pub struct MapErrors {
    /// Time until a pose has arrived, s.
    pub delay_s: f64,
    /// White noise, m and rad per axis.
    pub white: [f64; 2],
    /// Errors that last (first-order Gauss-Markov): m and rad per axis.
    pub lasting: [f64; 2],
    /// For how long they last, s.
    pub time_s: f64,
}

impl Default for MapErrors {
    fn default() -> Self {
        Self { delay_s: 0.1, white: [0.005, 0.003], lasting: [0.01, 0.003], time_s: 2.0 }
    }
}

impl MapErrors {
    /// Deviations that a filter must assume which takes successive errors as independent: the variance of what lasts counts
    /// `2 τ / dt` times.
    pub fn as_white(&self) -> [f64; 2] {
        let times = 2.0 * self.time_s / (POSES as f64 * 1e-9);
        [0, 1].map(|k| (self.white[k].powi(2) + times * self.lasting[k].powi(2)).sqrt())
    }
}

/// What arrives, in the order in which it does.
#[derive(Debug, Clone)]
pub enum Arrival {
    /// A sample of the head's inertial sensor, which defines the body.
    PrimaryImu(Imu),
    /// A sample of the autopilot's.
    SecondaryImu(Imu),
    /// Points that the camera has seen.
    Points(Stamp, Vec<PointObservation>),
    /// A pose of the body in the world.
    Pose(Box<PoseMeasurement>),
}

/// A flight, recorded.
pub struct Flight {
    /// The motion of the body.
    pub spline: Spline,
    /// The camera.
    pub camera: Camera,
    /// The two sensors.
    pub imus: [ImuModel; 2],
    /// True biases of the first sensor and of the second: gyroscope and accelerometer.
    pub biases: [vio_ekf::sim::ImuRecording; 2],
    /// All that the estimators get.
    pub arrivals: Vec<Arrival>,
}

impl Flight {
    /// Records a flight; `coarse` times the noise of the first sensor is that of the second.
    ///
    /// # Errors
    /// If the motion is too short.
    pub fn record(spline: Spline, seed: u64, coarse: f64, map: &MapErrors) -> Result<Self, Error> {
        let first = ImuModel::default();
        let n = first.noise;
        let noise = ImuNoise {
            gyro_density: coarse * n.gyro_density,
            gyro_walk: coarse * n.gyro_walk,
            accel_density: coarse * n.accel_density,
            accel_walk: coarse * n.accel_walk,
        };
        let body_from_imu = Isometry3::new(Vector3::new(-0.12, 0.03, -0.08), Vector3::new(0.02, -0.03, 1.57));
        let second = ImuModel { noise, rate_hz: 250.0, body_from_imu, ..ImuModel::default() };
        let recorded = [first.record(&spline, GRAVITY, seed)?, second.record(&spline, GRAVITY, seed + 1_000_000)?];
        let mut rng = Rng::new(seed.wrapping_mul(7919));
        let camera = forward_pinhole();
        let mut timed: Vec<(i64, Arrival)> = Vec::new();
        timed.extend(recorded[0].samples.iter().map(|s| (s.stamp.nanos(), Arrival::PrimaryImu(*s))));
        timed.extend(recorded[1].samples.iter().map(|s| (s.stamp.nanos(), Arrival::SecondaryImu(*s))));

        let (begin, end) = spline.span();
        let points = points(&spline, &mut rng)?;
        for stamp in stamps(begin, end, IMAGES[0]) {
            let pose = spline.sample(stamp)?.world_from_body;
            let noise = || Vector2::new(rng.normal(), rng.normal()) * PIXEL_SIGMA;
            let seen = observe_points(&points, &camera, &pose, 0.0, noise);
            timed.push((stamp.nanos() + IMAGES[1], Arrival::Points(stamp, seen)));
        }
        let delay = (map.delay_s * 1e9) as i64;
        let [position, attitude] = map.as_white();
        let keep = (-POSES as f64 * 1e-9 / map.time_s).exp();
        let mut lasting = [0, 1].map(|k| normals(&mut rng) * map.lasting[k]);
        for stamp in stamps(begin, end, POSES) {
            for (k, error) in lasting.iter_mut().enumerate() {
                *error = *error * keep + normals(&mut rng) * (map.lasting[k] * (1.0 - keep * keep).sqrt());
            }
            let truth = spline.sample(stamp)?.world_from_body;
            let [shift, turn] = [0, 1].map(|k| lasting[k] + normals(&mut rng) * map.white[k]);
            let pose = Isometry3::from_parts(
                Translation3::from(truth.translation.vector + shift),
                so3::exp(&turn) * truth.rotation,
            );
            let pose = PoseMeasurement::isotropic(0, stamp, pose, position, attitude);
            timed.push((stamp.nanos() + delay, Arrival::Pose(Box::new(pose))));
        }
        timed.sort_by_key(|(at, _)| *at);
        let arrivals = timed.into_iter().map(|(_, arrival)| arrival).collect();
        Ok(Self { spline, camera, imus: [first, second], biases: recorded, arrivals })
    }
}

fn stamps(begin: Stamp, end: Stamp, step: i64) -> impl Iterator<Item = Stamp> {
    (1..).map(move |k| Stamp::from_nanos(begin.nanos() + k * step)).take_while(move |stamp| *stamp < end)
}

/// Three normal numbers.
pub fn normals(rng: &mut Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.normal())
}

/// Sways and turns through about 8 m, never twice the same way.
///
/// # Errors
/// None that such a motion is known to give; it is checked.
pub fn sway(seed: u64, seconds: f64) -> Result<Spline, Error> {
    let mut rng = Rng::new(seed);
    let phases: [Vector3<f64>; 4] = std::array::from_fn(|_| Vector3::from_fn(|_, _| rng.between(-3.2, 3.2)));
    swaying_flight(&phases, seconds)
}

/// Points on the walls of a room around the motion.
fn points(spline: &Spline, rng: &mut Rng) -> Result<Vec<Point3<f64>>, Error> {
    let (begin, end) = spline.span();
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for stamp in stamps(begin, end, 200_000_000) {
        let position = spline.sample(stamp)?.world_from_body.translation.vector;
        (low, high) = (low.inf(&position), high.sup(&position));
    }
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 + Vector3::repeat(2.5));
    Ok((0..400)
        .map(|_| {
            let mut point = Vector3::from_fn(|_, _| rng.between(-1.0, 1.0));
            let axis = (rng.unit() * 3.0) as usize;
            point[axis] = point[axis].signum();
            Point3::from(middle + point.component_mul(&half))
        })
        .collect())
}
