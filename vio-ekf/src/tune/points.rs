//! A recording of points instead of images, on which noise settings are tried thousands of times.

use nalgebra::{Isometry3, Point3, Translation3, Vector2, Vector3};

use super::{NoisePoint, Score, with_factors};
use crate::camera::Camera;
use crate::error::Error;
use crate::eval::align::Alignment;
use crate::eval::ate::ate;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::Settings;
use crate::filter::vio::Vio;
use crate::inertial::initial_state::{InitialSigma, InitialState};
use crate::inertial::odometry::Odometry;
use crate::lie::so3;
use crate::samples::{Imu, ImuNoise};
use crate::sim::{ImuModel, Rng};
use crate::stamp::Stamp;
use crate::trajectory::spline::{Motion, Spline};

/// Time between two images, ns.
const IMAGE_STEP: i64 = 50_000_000;
/// Distance of the walls from the path, m.
const WALLS: f64 = 2.5;
/// Points on the walls.
const POINTS: usize = 300;

/// A flight before points that are found exactly but for white noise: cheap enough to be run thousands of times.
///
/// What it lacks of the world: images, hence patches, blur, and corners that wander.
#[derive(Debug, Clone)]
pub struct PointRecording {
    camera: Camera,
    samples: Vec<Imu>,
    images: Vec<(Stamp, Vec<PointObservation>)>,
    truth: Vec<Motion>,
    start: InitialState,
}

impl PointRecording {
    /// Records a motion. `pixel_sigma` is the standard deviation of each coordinate of a point, pixels.
    pub fn simulate(
        spline: &Spline,
        camera: &Camera,
        imu: &ImuModel,
        pixel_sigma: f64,
        gravity: f64,
        seed: u64,
    ) -> Result<Self, Error> {
        camera.check()?;
        let recording = imu.record(spline, gravity, seed)?;
        let mut rng = Rng::new(seed ^ 0x706f_696e_7473);
        let (first, last) = spline.span();
        let points = points_around(spline, &mut rng)?;
        let (mut images, mut truth) = (Vec::new(), Vec::new());
        let stamps = (1..).map(|k| Stamp::from_nanos(first.nanos() + k * IMAGE_STEP));
        for stamp in stamps.take_while(|stamp| *stamp < last) {
            let motion = spline.sample(stamp)?;
            images.push((stamp, see(&points, camera, &motion.world_from_body, pixel_sigma, &mut rng)));
            truth.push(motion);
        }
        let (gyro_bias, accel_bias) = recording.biases_at(first);
        let start = drawn_start(&spline.sample(first)?, first, [gyro_bias, accel_bias], &mut rng);
        Ok(Self { camera: *camera, samples: recording.samples, images, truth, start })
    }

    /// Runs the filter with the noise scaled by some factors, and scores it.
    pub fn score(&self, noise: &ImuNoise, settings: &Settings, point: &NoisePoint) -> Result<Score, Error> {
        let (noise, settings) = with_factors(noise, settings, point);
        let mut vio = Vio::new(self.camera, noise, settings)?;
        let (mut reference, mut estimate, mut sums) = (Vec::new(), Vec::new(), [0.0; 3]);
        let mut samples = self.samples.iter();
        if let Some(sample) = samples.next() {
            vio.imu(sample)?;
            vio.initialize(&self.start)?;
        }
        for ((stamp, seen), motion) in self.images.iter().zip(&self.truth) {
            for sample in samples.by_ref() {
                vio.imu(sample)?;
                if sample.stamp >= *stamp {
                    break;
                }
            }
            let report = vio.points(*stamp, seen)?;
            let Some(odometry) = vio.output().filter(|_| report.status.has_estimate()) else { break };
            reference.push(motion.world_from_body);
            estimate.push(odometry.world_from_body);
            for (sum, nees) in sums.iter_mut().zip(nees(&odometry, motion)) {
                *sum += nees;
            }
        }
        let count = estimate.len() as f64;
        let lost = 1.0 - count / self.images.len() as f64;
        let error = ate(&reference, &estimate, Alignment::PosYaw).map_or(1.0, |ate| ate.position.rmse);
        Ok(Score { ate: error, nees: sums.map(|sum| sum / count.max(1.0)), lost })
    }
}

/// Points on the walls of a box around the motion.
fn points_around(spline: &Spline, rng: &mut Rng) -> Result<Vec<Point3<f64>>, Error> {
    let (first, last) = spline.span();
    let (mut min, mut max) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    let stamps = (0..).map(|k| Stamp::from_nanos(first.nanos() + 4 * k * IMAGE_STEP));
    for stamp in stamps.take_while(|stamp| *stamp <= last) {
        let position = spline.sample(stamp)?.world_from_body.translation.vector;
        (min, max) = (min.inf(&position), max.sup(&position));
    }
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5 + Vector3::repeat(WALLS));
    let on_wall = |_| {
        let mut point = Vector3::from_fn(|_, _| rng.between(-1.0, 1.0));
        let axis = (rng.uniform() * 3.0) as usize % 3;
        point[axis] = point[axis].signum();
        Point3::from(middle + point.component_mul(&half))
    };
    Ok((0..POINTS).map(on_wall).collect())
}

fn see(
    points: &[Point3<f64>],
    camera: &Camera,
    world_from_body: &Isometry3<f64>,
    sigma: f64,
    rng: &mut Rng,
) -> Vec<PointObservation> {
    let camera_from_world = (world_from_body * camera.body_from_camera).inverse();
    let mut seen = Vec::new();
    for (id, point) in points.iter().enumerate() {
        let noise = Vector2::new(rng.normal(), rng.normal()) * sigma;
        let pixel = camera.project(&(camera_from_world * point).coords).filter(|pixel| camera.contains(pixel, 0.0));
        seen.extend(pixel.map(|pixel| PointObservation { id: id as u64, pixel: pixel + noise }));
    }
    seen
}

/// A start drawn around the truth: one that is exact would make any covariance look consistent.
fn drawn_start(motion: &Motion, stamp: Stamp, biases: [Vector3<f64>; 2], rng: &mut Rng) -> InitialState {
    let sigma = InitialSigma::default();
    let pose = motion.world_from_body;
    let tilt = rng.normal_vector().component_mul(&Vector3::new(sigma.tilt, sigma.tilt, 0.0));
    InitialState {
        stamp,
        world_from_body: Isometry3::from_parts(
            Translation3::from(pose.translation.vector),
            so3::exp(&-tilt) * pose.rotation,
        ),
        velocity_in_body: pose.rotation.inverse() * motion.velocity_in_world - rng.normal_vector() * sigma.velocity,
        gyro_bias: biases[0] - rng.normal_vector() * sigma.gyro_bias,
        accel_bias: biases[1] - rng.normal_vector() * sigma.accel_bias,
        sigma,
    }
}

/// Normalised squared errors of position, attitude and velocity; 1e6, the end of the scale, if there is no covariance.
fn nees(odometry: &Odometry, truth: &Motion) -> [f64; 3] {
    let pose = truth.world_from_body;
    let errors = [
        pose.translation.vector - odometry.world_from_body.translation.vector,
        so3::log(&(pose.rotation * odometry.world_from_body.rotation.inverse())),
        pose.rotation.inverse() * truth.velocity_in_world - odometry.velocity_in_body,
    ];
    std::array::from_fn(|k| {
        let row = [0, 6, 3][k];
        let block = odometry.covariance.fixed_view::<3, 3>(row, row).into_owned();
        block.cholesky().map_or(1e6, |factor| errors[k].dot(&factor.solve(&errors[k])))
    })
}
