//! A flight through a room full of points: exact motion, noisy inertial samples, noisy pixels, and filters run on them.

use nalgebra::{Isometry3, Point3, Translation3, Vector2, Vector3};
use vio_ekf::camera::CameraModel;
use vio_ekf::filter::PointObservation;
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::sim::{forward_pinhole, observe_points, swaying_flight};
use vio_ekf::trajectory::{Motion, Spline};
use vio_ekf::{Camera, Error, Imu, ImuNoise, Odometry, Settings, Stamp, Vio, nalgebra};

use super::rng::Rng;

pub(crate) const GRAVITY: f64 = 9.81;
/// 200 Hz.
const IMU_STEP: i64 = 5_000_000;
/// 20 Hz.
const IMAGES_EVERY: i64 = 10;

/// A pinhole that looks along the body's x axis.
pub(crate) fn camera() -> Camera {
    forward_pinhole()
}

/// Sways and turns through a room of about 8 m, never twice the same way.
pub(crate) fn spline(seed: u64, seconds: f64) -> Spline {
    let mut rng = Rng::new(seed);
    swaying_flight(&std::array::from_fn(|_| rng.vector() * std::f64::consts::PI), seconds).unwrap()
}

/// Points on the walls of a room of 9 m.
pub(crate) fn points(seed: u64, count: usize) -> Vec<Point3<f64>> {
    let mut rng = Rng::new(seed ^ 0x5555);
    (0..count)
        .map(|_| {
            let mut point = rng.vector();
            let axis = (rng.bits() % 3) as usize;
            point[axis] = point[axis].signum();
            Point3::from(point.component_mul(&Vector3::new(4.5, 4.5, 3.0)))
        })
        .collect()
}

/// One simulated recording, replayed sample by sample.
pub(crate) struct Flight {
    pub(crate) spline: Spline,
    pub(crate) camera: Camera,
    pub(crate) points: Vec<Point3<f64>>,
    pub(crate) noise: ImuNoise,
    pub(crate) pixel_sigma: f64,
    /// Nanoseconds that the camera's stamps lag: the stamp is the true time minus this.
    pub(crate) time_offset: i64,
    pub(crate) biases: [Vector3<f64>; 2],
    pub(crate) rng: Rng,
}

impl Flight {
    pub(crate) fn new(seed: u64, seconds: f64) -> Self {
        let mut rng = Rng::new(seed.wrapping_mul(7919));
        let biases = [rng.vector() * 0.02, rng.vector() * 0.1];
        let noise = ImuNoise::default();
        let (spline, points) = (spline(seed, seconds), points(seed, 250));
        Self { spline, camera: camera(), points, noise, pixel_sigma: 1.0, time_offset: 0, biases, rng }
    }

    pub(crate) fn first(&self) -> Stamp {
        self.spline.span().0
    }

    /// Stamps of the inertial samples.
    pub(crate) fn stamps(&self) -> impl Iterator<Item = Stamp> + use<> {
        let (first, last) = self.spline.span();
        (0..).map(move |k| Stamp::from_nanos(first.nanos() + k * IMU_STEP)).take_while(move |s| *s <= last)
    }

    pub(crate) fn truth(&self, stamp: Stamp) -> Motion {
        self.spline.sample(stamp).unwrap()
    }

    /// The next inertial sample; the biases walk on.
    pub(crate) fn imu(&mut self, stamp: Stamp) -> Imu {
        let motion = self.truth(stamp);
        let dt = IMU_STEP as f64 * 1e-9;
        let noise = self.noise;
        for (bias, walk) in self.biases.iter_mut().zip([noise.gyro_walk, noise.accel_walk]) {
            *bias += self.rng.normals() * (walk * dt.sqrt());
        }
        Imu {
            stamp,
            gyro: motion.rate_in_body + self.biases[0] + self.rng.normals() * (noise.gyro_density / dt.sqrt()),
            accel: motion.specific_force(GRAVITY)
                + self.biases[1]
                + self.rng.normals() * (noise.accel_density / dt.sqrt()),
        }
    }

    /// What the camera sees at a time, in an order that changes slowly.
    pub(crate) fn see(&mut self, stamp: Stamp) -> Vec<PointObservation> {
        self.see_with(&self.camera.clone(), stamp)
    }

    /// The same with a camera of another lens.
    pub(crate) fn see_with(&mut self, camera: &dyn CameraModel, stamp: Stamp) -> Vec<PointObservation> {
        let world_from_body = self.truth(stamp).world_from_body;
        let Self { points, rng, pixel_sigma, .. } = self;
        let noise = || Vector2::new(rng.normal(), rng.normal()) * *pixel_sigma;
        observe_points(points.iter(), camera, &world_from_body, 0.0, noise)
    }

    /// A start drawn around the truth; position and yaw exact, they are what is measured from.
    pub(crate) fn drawn_start(&mut self, sigma: InitialSigma) -> InitialState {
        let motion = self.truth(self.first());
        let pose = motion.world_from_body;
        let velocity = pose.rotation.inverse() * motion.velocity_in_world;
        let tilt = self.rng.normals().component_mul(&Vector3::new(sigma.tilt, sigma.tilt, sigma.yaw));
        InitialState {
            stamp: self.first(),
            world_from_body: Isometry3::from_parts(
                Translation3::from(pose.translation.vector + self.rng.normals() * sigma.position),
                so3::exp(&-tilt) * pose.rotation,
            ),
            velocity_in_body: velocity - self.rng.normals() * sigma.velocity,
            gyro_bias: self.biases[0] - self.rng.normals() * sigma.gyro_bias,
            accel_bias: self.biases[1] - self.rng.normals() * sigma.accel_bias,
            sigma,
        }
    }

    /// Runs a filter over the flight and shows each estimate after an image, with the truth and the true biases.
    pub(crate) fn run(
        &mut self,
        settings: &Settings,
        start: &InitialState,
        each: impl FnMut(&Odometry, &Motion, &[Vector3<f64>; 2]),
    ) -> Result<Vio, Error> {
        self.run_with(self.camera, settings, start, each)
    }

    /// The same with a camera that is not quite the one that took the pictures.
    pub(crate) fn run_with(
        &mut self,
        assumed: Camera,
        settings: &Settings,
        start: &InitialState,
        mut each: impl FnMut(&Odometry, &Motion, &[Vector3<f64>; 2]),
    ) -> Result<Vio, Error> {
        let mut vio = Vio::new(assumed, self.noise, *settings)?;
        for (k, stamp) in self.stamps().enumerate() {
            let sample = self.imu(stamp);
            vio.imu(&sample)?;
            if k == 0 {
                vio.initialize(start)?;
            } else if k as i64 % IMAGES_EVERY == 0 && stamp < self.spline.span().1 {
                let seen = self.see(stamp);
                vio.points(Stamp::from_nanos(stamp.nanos() - self.time_offset), &seen)?;
                let odometry = vio.output().unwrap();
                if odometry.stamp == stamp {
                    each(&odometry, &self.truth(stamp), &self.biases);
                }
            }
        }
        Ok(vio)
    }
}

/// Normalised squared errors of position, attitude, velocity, both biases: each of mean 3 if the filter is consistent.
pub(crate) fn nees(o: &Odometry, truth: &Motion, biases: &[Vector3<f64>; 2]) -> [f64; 5] {
    let rotation = o.world_from_body.rotation;
    let velocity = truth.world_from_body.rotation.inverse() * truth.velocity_in_world;
    let errors = [
        truth.world_from_body.translation.vector - o.world_from_body.translation.vector,
        velocity - o.velocity_in_body,
        so3::log(&(truth.world_from_body.rotation * rotation.inverse())),
        biases[0] - o.gyro_bias,
        biases[1] - o.accel_bias,
    ];
    let square = |k: usize| {
        let block = o.covariance.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
        // Position and yaw may be known exactly at the start.
        block.cholesky().map_or(f64::NAN, |factor| errors[k].dot(&factor.solve(&errors[k])))
    };
    [square(0), square(2), square(1), square(3), square(4)]
}
