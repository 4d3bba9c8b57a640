//! Loosely coupled fusion: an inertial sensor, and poses that others have measured.

mod belief;
mod imu_pair;
mod measurement;
mod model;
#[cfg(test)]
mod model_tests;
mod settings;
mod timeline;
mod unified;

use nalgebra::{Isometry3, Matrix6, SMatrix, Translation3};

pub use imu_pair::{ImuPair, ImuPairSettings};
pub use measurement::PoseMeasurement;
pub use settings::{AlignmentSettings, FusionSettings, MountSettings, PoseSource};
pub use unified::{Tally, UnifiedSettings, UnifiedVio};

use crate::error::invalid;
use crate::filter::state::at;
use crate::trajectory::is_finite;
use crate::{Error, Excess, Imu, ImuNoise, Odometry, Stamp, Start};
use belief::Belief;
use model::{FRAME, first_row};
use timeline::{Rules, Timeline};

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
/// Poses may come in any order within the history: each is put at its own time and what follows is done again, so that the
/// estimate is a function of what is known, to the last bit, and not of the order in which it became known.
///
/// ```
/// use vio_ekf::nalgebra::{Isometry3, Vector3};
/// use vio_ekf::{FusionSettings, Imu, ImuNoise, PoseFusion, PoseMeasurement, PoseSource, Stamp, Start, StartSigma};
///
/// let mut fusion = PoseFusion::new(ImuNoise::default(), &[PoseSource::default()], FusionSettings::default())?;
/// let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
/// let imu = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
/// fusion.imu(&imu(0))?;
/// fusion.start(&Start {
///     stamp: at(0),
///     world_from_body: Isometry3::identity(),
///     velocity_in_body: Vector3::zeros(),
///     gyro_bias: Vector3::zeros(),
///     accel_bias: Vector3::zeros(),
///     sigma: StartSigma { position: 0.1, ..StartSigma::default() },
/// })?;
/// for k in 1..=100 {
///     fusion.imu(&imu(5 * k))?;
///     if k % 10 == 0 {
///         // A pose that arrives 30 ms after it was taken.
///         let pose = Isometry3::translation(0.05, 0.0, 0.0);
///         fusion.pose(&PoseMeasurement::isotropic(0, at(5 * k - 30), pose, 0.01, 0.01))?;
///     }
/// }
/// let odometry = fusion.output().expect("it has been started");
/// assert!((odometry.world_from_body.translation.vector.x - 0.05).abs() < 0.01);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PoseFusion {
    noise: ImuNoise,
    sources: Vec<PoseSource>,
    settings: FusionSettings,
    last: Option<Imu>,
    timeline: Option<Timeline>,
}

/// A pose on its way into the filter.
#[derive(Debug, Clone, PartialEq)]
struct Pose {
    measurement: PoseMeasurement,
    whitener: Matrix6<f64>,
}

/// What the filter believes of a source.
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
    pub covariance: SMatrix<f64, FRAME, FRAME>,
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
        Ok(Self { noise, sources: sources.to_vec(), settings, last: None, timeline: None })
    }

    /// Starts, or starts again, from a given state. There must be an inertial sample, and the state must not be before it.
    pub fn start(&mut self, start: &Start) -> Result<(), Error> {
        let Some(sample) = self.last else {
            return Err(Error::TooFew { what: "inertial samples before the start", got: 0, need: 1 });
        };
        start.check(sample.stamp)?;
        let belief = Belief::new(start, &self.sources);
        let rules = Rules { noise: &self.noise, settings: &self.settings, sources: &self.sources };
        self.timeline = Some(Timeline::new(belief, sample, &rules));
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
        Ok(world_from_sensor * source.mount.body_from_sensor.inverse())
    }

    /// Takes an inertial sample; stamps must increase.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), Error> {
        if !sample.is_finite() {
            return Err(Error::NonFinite { what: "inertial sample", index: 0 });
        }
        if let Some(last) = &self.last
            && sample.stamp <= last.stamp
        {
            return Err(Error::NotIncreasing { index: 0, previous: last.stamp, stamp: sample.stamp });
        }
        self.last = Some(*sample);
        if let Some(timeline) = &mut self.timeline {
            let rules = Rules { noise: &self.noise, settings: &self.settings, sources: &self.sources };
            timeline.imu(*sample, &rules);
        }
        Ok(())
    }

    /// Takes a pose. Before the start it is checked, not used. It may be up to 0.1 s ahead of the samples.
    ///
    /// An error means that it was not taken: older than the history, far ahead, a second one of the same source and time, or
    /// not a pose.
    pub fn pose(&mut self, pose: &PoseMeasurement) -> Result<(), Error> {
        let source = self.source(pose.source)?;
        let whitener = pose.whitener()?;
        let shift = (source.time_offset_s * 1e9).round() as i64;
        let Some(timeline) = &mut self.timeline else { return Ok(()) };
        let stamp = Stamp::from_nanos(pose.stamp.nanos().saturating_add(shift));
        let room = timeline.make_room();
        let (settled, now) = (timeline.settled(), timeline.now());
        // Checkpoints are at place 0 of their time.
        let place = (stamp, 1 + pose.source);
        if place <= settled {
            return Err(Error::Late { what: "pose", stamp, now: settled.0 });
        }
        if timeline.holds(place) {
            return Err(Error::NotIncreasing { index: pose.source, previous: stamp, stamp });
        }
        if stamp.secs_since(now) > MAX_AHEAD || !room {
            return Err(Error::OutOfRange { stamp, first: settled.0, last: now });
        }
        let rules = Rules { noise: &self.noise, settings: &self.settings, sources: &self.sources };
        timeline.pose(Pose { measurement: *pose, whitener }, place, &rules);
        Ok(())
    }

    /// The estimate at the time of the latest sample; `None` before the start.
    pub fn output(&self) -> Option<Odometry> {
        let timeline = self.timeline.as_ref()?;
        let belief = timeline.latest();
        let core = &belief.core;
        let step = timeline.since.step_from(&core.velocity, &core.attitude, self.settings.gravity);
        Some(Odometry {
            stamp: timeline.now(),
            world_from_body: step.end(&core.position, &core.attitude),
            velocity_in_body: step.velocity,
            rate_in_body: timeline.sample().gyro - core.gyro_bias,
            gyro_bias: core.gyro_bias,
            accel_bias: core.accel_bias,
            covariance: step.carry(&belief.covariance.block::<{ at::CORE }, { at::CORE }>(0, 0)),
        })
    }

    /// What is believed of a source, at its last pose; `None` before the start or if there is no such source.
    pub fn source_estimate(&self, source: usize) -> Option<SourceEstimate> {
        let belief = self.timeline.as_ref()?.latest();
        let frame = belief.frames.get(source)?;
        let first = first_row(source);
        let pose = |parts: &(nalgebra::Vector3<f64>, nalgebra::UnitQuaternion<f64>)| {
            Isometry3::from_parts(Translation3::from(parts.0), parts.1)
        };
        Some(SourceEstimate {
            source_from_world: pose(&frame.alignment),
            body_from_sensor: pose(&frame.sensor),
            scale: frame.scale,
            time_offset_s: self.sources[source].time_offset_s + frame.late,
            covariance: belief.covariance.block(first, first),
        })
    }

    /// Poses refused in a row, of whatever source; 0 after one that was used.
    pub fn refused(&self) -> u32 {
        self.timeline.as_ref().map_or(0, |timeline| timeline.latest().refused)
    }

    /// The limit that the estimate has exceeded, if any: it is then given up until [`start`](Self::start).
    pub fn diverged(&self) -> Option<Excess> {
        self.timeline.as_ref().and_then(|timeline| timeline.latest().excess)
    }

    fn source(&self, index: usize) -> Result<&PoseSource, Error> {
        self.sources.get(index).ok_or(Error::NoSuch { what: "source", index, count: self.sources.len() })
    }
}
