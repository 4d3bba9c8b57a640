//! Loosely coupled fusion of an inertial sensor and poses.

use nalgebra::{Isometry3, SMatrix, Translation3, UnitQuaternion, Vector3};

use super::filter_state::FilterState;
use super::pose_measurement::PoseMeasurement;
use super::pose_model::{SOURCE, WhitenedPose, first_row};
use super::settings::{FusionSettings, PoseSource};
use super::state_buffer::{FilterContext, StateBuffer};
use crate::error::Error;
use crate::error::invalid;
use crate::inertial::divergence::DivergenceCause;
use crate::inertial::error_state;
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;
use crate::trajectory::is_finite;

/// Most sources of one filter.
const MAX_SOURCES: usize = 8;
/// A pose this much ahead of the inertial samples, in seconds, is waiting for data that does not come.
const MAX_AHEAD: f64 = 0.1;

/// An inertial sensor, and poses of any sources with their own frames, clocks and delays: an error-state Kalman filter after
/// Weiss and Siegwart 2011 and Lynen et al. 2013 (thesis, Paper II, section 4).
///
/// ```text
/// x = (p, v, R, b_g, b_a,  {a, A, t, C, λ, τ} per source)             15 + 14 rows per source
/// z_p = λ A (p + R t) + a      z_R = A R C                            at the pose's stamp plus its offset plus τ
/// ```
///
/// `p, v, R` and the biases move as in [`Vio`](crate::Vio); `(a, A)` is the world in the source's frame, which may drift as a
/// random walk; `(t, C)` is the sensor on the body, λ the scale, τ the error of the assumed time offset. Position and yaw of
/// body and frame cannot be told apart: one of them must be known at the start.
///
/// Poses may arrive in any order within the buffer: each is used at its own time and the states after it are recomputed, so that the
/// estimate is a function of the measurements, to the last bit, and not of the order of their arrival.
///
/// ```
/// use vio_ekf::nalgebra::{Isometry3, Vector3};
/// use vio_ekf::{Imu, ImuNoise, Stamp};
/// use vio_ekf::fusion::{FusionSettings, PoseFusion, PoseMeasurement, PoseSource};
/// use vio_ekf::inertial::{InitialSigma, InitialState};
///
/// let mut fusion = PoseFusion::new(ImuNoise::default(), &[PoseSource::default()], FusionSettings::default())?;
/// let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
/// let imu = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
/// fusion.imu(&imu(0))?;
/// fusion.initialize(&InitialState {
///     stamp: at(0),
///     world_from_body: Isometry3::identity(),
///     velocity_in_body: Vector3::zeros(),
///     gyro_bias: Vector3::zeros(),
///     accel_bias: Vector3::zeros(),
///     sigma: InitialSigma { position: 0.1, ..InitialSigma::default() },
/// })?;
/// for k in 1..=100 {
///     fusion.imu(&imu(5 * k))?;
///     if k % 10 == 0 {
///         // A pose that arrives 30 ms after it was taken.
///         let pose = Isometry3::translation(0.05, 0.0, 0.0);
///         fusion.pose(&PoseMeasurement::isotropic(0, at(5 * k - 30), pose, 0.01, 0.01))?;
///     }
/// }
/// let odometry = fusion.output().expect("it has been initialised");
/// assert!((odometry.world_from_body.translation.vector.x - 0.05).abs() < 0.01);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PoseFusion {
    context: FilterContext,
    last: Option<Imu>,
    buffer: Option<StateBuffer>,
}

/// The estimate of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceEstimate {
    /// Pose of the world in the source's frame.
    pub source_from_world: Isometry3<f64>,
    /// Pose of the source's sensor on the body.
    pub body_from_sensor: Isometry3<f64>,
    /// Length in the source's frame per length in the world.
    pub scale: f64,
    /// Seconds to add to the source's stamps to get the inertial sensor's time.
    pub time_offset_s: f64,
    /// Of the errors of, in this order: position (m) and attitude (rad, in the source's axes, `R_true = Exp(δθ) R`) of
    /// `source_from_world`; position (m) and attitude (rad, in body axes, likewise) of `body_from_sensor`; the scale's
    /// logarithm; the time offset (s).
    pub covariance: SMatrix<f64, SOURCE, SOURCE>,
}

impl PoseFusion {
    /// Refuses noise, sources or settings that cannot be.
    pub fn new(noise: ImuNoise, sources: &[PoseSource], settings: FusionSettings) -> Result<Self, Error> {
        noise.check()?;
        settings.check()?;
        if !(1..=MAX_SOURCES).contains(&sources.len()) {
            return Err(invalid("sources", sources.len() as f64, "must be between 1 and 8"));
        }
        for source in sources {
            source.check()?;
        }
        let context = FilterContext { noise, settings, sources: sources.to_vec() };
        Ok(Self { context, last: None, buffer: None })
    }

    /// Initialises, or initialises again, from a given state. There must be an inertial sample, and the state must not be before it.
    pub fn initialize(&mut self, initial: &InitialState) -> Result<(), Error> {
        let Some(sample) = self.last else {
            return Err(Error::TooFew { what: "inertial samples before the initialization", got: 0, need: 1 });
        };
        initial.check(sample.stamp)?;
        let state = FilterState::new(initial, &self.context.sources);
        self.buffer = Some(StateBuffer::new(state, sample, &self.context));
        Ok(())
    }

    /// Where the body is if a pose is right and its source is as assumed: something to start from.
    pub fn body_at(&self, pose: &PoseMeasurement) -> Result<Isometry3<f64>, Error> {
        let source = self.source(pose.source)?;
        if !is_finite(&pose.source_from_sensor) {
            return Err(Error::NonFinite { what: "pose of source", index: pose.source });
        }
        let (alignment, seen) = (&source.alignment.source_from_world, &pose.source_from_sensor);
        let world_from_source = alignment.rotation.inverse();
        let position = world_from_source * (seen.translation.vector - alignment.translation.vector) / source.scale;
        let world_from_sensor = Isometry3::from_parts(Translation3::from(position), world_from_source * seen.rotation);
        Ok(world_from_sensor * source.extrinsics.body_from_sensor.inverse())
    }

    /// Takes an inertial sample; stamps must increase.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), Error> {
        sample.check_after(self.last.as_ref())?;
        self.last = Some(*sample);
        if let Some(buffer) = &mut self.buffer {
            buffer.imu(*sample, &self.context);
        }
        Ok(())
    }

    /// Takes a pose. Before the initialization it is checked, not used. It may be up to 0.1 s ahead of the samples.
    ///
    /// An error means that it was not taken: older than the buffer, far ahead, a second one of the same source and time, or
    /// not a pose.
    pub fn pose(&mut self, pose: &PoseMeasurement) -> Result<(), Error> {
        let source = self.source(pose.source)?;
        let whitener = pose.whitener()?;
        let shift = (source.time_offset_s * 1e9).round() as i64;
        let Some(buffer) = &mut self.buffer else { return Ok(()) };
        let stamp = Stamp::from_nanos(pose.stamp.nanos().saturating_add(shift));
        let room = buffer.make_room();
        let (oldest, now) = (buffer.oldest(), buffer.now());
        // Checkpoints come first at their time.
        let order = (stamp, 1 + pose.source);
        if order <= oldest {
            return Err(Error::Late { what: "pose", stamp, now: oldest.0 });
        }
        if buffer.contains(order) {
            return Err(Error::NotIncreasing { index: pose.source, previous: stamp, stamp });
        }
        if stamp.secs_since(now) > MAX_AHEAD || !room {
            return Err(Error::OutOfRange { stamp, first: oldest.0, last: now });
        }
        buffer.pose(WhitenedPose { measurement: *pose, whitener }, order, &self.context);
        Ok(())
    }

    /// The estimate at the time of the latest sample; `None` before the initialization.
    pub fn output(&self) -> Option<Odometry> {
        let buffer = self.buffer.as_ref()?;
        let state = buffer.latest();
        let covariance = state.covariance.block::<{ error_state::CORE }, { error_state::CORE }>(0, 0);
        Some(Odometry::predict(&state.core, &covariance, buffer.prediction(), self.context.settings.gravity))
    }

    /// The estimate of a source, at its last pose; `None` before the initialization or if there is no such source.
    pub fn source_estimate(&self, source: usize) -> Option<SourceEstimate> {
        let state = self.buffer.as_ref()?.latest();
        let source_state = state.sources.get(source)?;
        let first = first_row(source);
        let pose =
            |parts: &(Vector3<f64>, UnitQuaternion<f64>)| Isometry3::from_parts(Translation3::from(parts.0), parts.1);
        Some(SourceEstimate {
            source_from_world: pose(&source_state.alignment),
            body_from_sensor: pose(&source_state.sensor),
            scale: source_state.scale,
            time_offset_s: self.context.sources[source].time_offset_s + source_state.time_offset_error,
            covariance: state.covariance.block(first, first),
        })
    }

    /// Poses that failed their gate in a row, of whatever source; 0 after one that was used.
    pub fn consecutive_outliers(&self) -> u32 {
        self.buffer.as_ref().map_or(0, |buffer| buffer.latest().consecutive_outliers)
    }

    /// The limit that the estimate has exceeded, if any: it is then given up until [`initialize`](Self::initialize).
    pub fn diverged(&self) -> Option<DivergenceCause> {
        self.buffer.as_ref().and_then(|buffer| buffer.latest().divergence_cause)
    }

    fn source(&self, index: usize) -> Result<&PoseSource, Error> {
        let sources = &self.context.sources;
        sources.get(index).ok_or(Error::NoSuch { what: "source", index, count: sources.len() })
    }
}
