//! Dead reckoning from inertial samples alone.

use crate::error::Error;
use crate::error::invalid;
use crate::inertial::core_state::{CoreCovariance, CoreState, set_core_covariance};
use crate::inertial::covariance::Covariance;
use crate::inertial::error_state;
use crate::inertial::imu_buffer::ImuBuffer;
use crate::inertial::imu_noise_estimator::ImuSettings;
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::inertial::preintegration::ImuPreintegration;
use crate::samples::{Imu, ImuNoise};

/// Pose, velocity and their covariance from inertial samples alone: integrated from a given state, corrected by nothing.
///
/// The position's error grows with the cube of the square root of time from noise, with its square from a bias of the
/// accelerometer, and with its cube from one of the gyroscope; the covariance says how far. It is the propagation step of
/// [`Vio`](crate::Vio) (Forster et al. 2017), with the noise that samples show of themselves.
///
/// ```
/// use vio_ekf::nalgebra::{Isometry3, Vector3};
/// use vio_ekf::{Imu, ImuNoise, Stamp};
/// use vio_ekf::inertial::{ImuSettings, InertialOdometry, InitialSigma, InitialState};
///
/// let at = |k: i64| Stamp::from_nanos(k * 5_000_000);
/// // Half a metre per second squared upwards.
/// let sample = |k| Imu { stamp: at(k), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81 + 0.5) };
/// let start = InitialState {
///     stamp: at(0),
///     world_from_body: Isometry3::identity(),
///     velocity_in_body: Vector3::zeros(),
///     gyro_bias: Vector3::zeros(),
///     accel_bias: Vector3::zeros(),
///     sigma: InitialSigma::default(),
/// };
/// let mut odometry = InertialOdometry::new(&start, sample(0), ImuNoise::default(), ImuSettings::default(), 9.81)?;
/// for k in 1..=400 {
///     odometry.imu(&sample(k))?;
/// }
/// let end = odometry.output();
/// assert!((end.world_from_body.translation.z - 0.5 * 0.5 * 2.0 * 2.0).abs() < 1e-9);
/// assert!(end.covariance[(2, 2)].sqrt() > 0.1, "a bias of 0.1 m/s² is 0.2 m by then");
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct InertialOdometry {
    core: CoreState,
    covariance: CoreCovariance,
    noise: ImuNoise,
    gravity: f64,
    buffer: ImuBuffer,
}

impl InertialOdometry {
    /// From a state at the time of a sample or after it; `gravity` in m/s².
    ///
    /// # Errors
    /// [`Error`]: a state before the sample, numbers that are not finite, noise, settings or a gravity out of range.
    pub fn new(
        initial: &InitialState,
        sample: Imu,
        noise: ImuNoise,
        settings: ImuSettings,
        gravity: f64,
    ) -> Result<Self, Error> {
        sample.check_after(None)?;
        initial.check(sample.stamp)?;
        noise.check()?;
        settings.check()?;
        if !(gravity > 0.0 && gravity < 100.0) {
            return Err(invalid("gravity", gravity, "must be positive, in m/s²: 9.81 on earth"));
        }
        let mut covariance = Covariance::new(error_state::CORE, error_state::CORE);
        set_core_covariance(&mut covariance, &initial.sigma);
        Ok(Self {
            core: CoreState::from(initial),
            covariance: covariance.block(0, 0),
            noise,
            gravity,
            buffer: ImuBuffer::new(sample, initial.stamp, settings.buffer_samples).with_noise_estimation(settings),
        })
    }

    /// Takes an inertial sample. Samples until the initial state move nothing.
    ///
    /// # Errors
    /// [`Error`]: a stamp that is not after the one before, numbers that are not finite. The sample is then left out.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), Error> {
        sample.check_after(Some(self.buffer.latest()))?;
        self.buffer.push(*sample);
        let until = self.buffer.now();
        if until <= self.buffer.state_stamp() {
            return Ok(());
        }
        let moved = self.buffer.preintegrate(until, &self.core.imu_correction(), &self.noise);
        let transition = moved.transition(&self.core.velocity, &self.core.attitude, self.gravity);
        let end = transition.end(&self.core.position, &self.core.attitude);
        (self.core.position, self.core.attitude) = (end.translation.vector, end.rotation);
        self.core.velocity = transition.velocity;
        self.covariance = transition.propagate_covariance(&self.covariance);
        self.buffer.advance(until);
        Ok(())
    }

    /// The estimate at the time of the latest sample, in the world of the initial state; covariance as [`Odometry::covariance`] has it.
    pub fn output(&self) -> Odometry {
        let here = ImuPreintegration::default();
        Odometry::predict(&self.core, &self.covariance, (&self.buffer, &here), self.gravity)
    }
}
