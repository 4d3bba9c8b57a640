//! The estimator: a camera, maybe a second one, an inertial sensor, an iterated Kalman filter around the body.

mod bearing;
mod bends;
pub(crate) mod covariance;
mod detect;
mod distance;
mod estimator;
mod external;
mod follower;
pub(crate) mod history;
mod images;
mod inherit;
pub(crate) mod interval;
#[cfg(test)]
mod jacobians;
mod landmarks;
mod look;
mod moving;
#[cfg(test)]
mod moving_tests;
mod pair;
#[cfg(test)]
mod pair_tests;
mod patch;
#[cfg(test)]
mod patches;
mod point_pairs;
mod points;
mod propagate;
mod pyramid;
mod relative;
mod report;
mod rest;
mod scout;
mod settings;
mod start;
pub(crate) mod state;
mod trust;
pub(crate) mod update;

use nalgebra::{Isometry3, Translation3};

pub use bearing::Bearing;
pub use estimator::CoreCovariance;
pub use moving::MovingSettings;
pub use pair::PairSettings;
pub use point_pairs::PointPair;
pub use points::PointObservation;
pub use report::{Calibration, Excess, FrameReport, Odometry, Status, Waiting};
pub use rest::RestSettings;
pub use settings::{CalibrationSettings, GateSettings, LandmarkSettings, LimitSettings, PatchSettings, Settings};
pub use start::{Start, StartSigma};
pub use trust::SensorSettings;

use crate::{Camera, Error, Imu, ImuNoise, Stamp};
use estimator::Estimator;
use follower::Follower;
use images::Sight;
use pair::Second;
use patch::Patch;
use rest::Rest;
use scout::Scout;
use state::at;

/// A camera this much ahead of the inertial samples, in seconds, is waiting for data that does not come.
const MAX_AHEAD: f64 = 0.1;

/// Contradictions in a row that show a start in motion to have been wrong.
const DOUBTED: u32 = 3;

/// A camera, maybe a second one beside it, and an inertial sensor.
///
/// Feed samples and images as they come; an image may arrive up to [`Settings::history_samples`] samples late and is used
/// at its own time, with the same result to the last bit. The filter starts by itself, at rest or in motion, or from a
/// state that is given.
///
/// ```
/// use vio_ekf::nalgebra::{Isometry3, Vector3};
/// use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Start, StartSigma, Status, Vio};
///
/// let mut vio = Vio::new(Camera::euroc(), ImuNoise::default(), Settings::default())?;
/// let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
/// let imu = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
/// vio.imu(&imu(0))?;
/// vio.start(&Start {
///     stamp: at(0),
///     world_from_body: Isometry3::identity(),
///     velocity_in_body: Vector3::zeros(),
///     gyro_bias: Vector3::zeros(),
///     accel_bias: Vector3::zeros(),
///     sigma: StartSigma::default(),
/// })?;
/// let picture: Vec<u8> = (0..752 * 480).map(|k| if (k % 752 / 40 + k / 752 / 40) % 2 == 0 { 60 } else { 180 }).collect();
/// for k in 1..=20 {
///     vio.imu(&imu(5 * k))?;
///     if k % 10 == 0 {
///         let report = vio.image(at(5 * k), &ImageView::new(752, 480, &picture)?)?;
///         assert_eq!(report.status, Status::Tracking);
///     }
/// }
/// let odometry = vio.output().expect("it has been started");
/// assert!(odometry.world_from_body.translation.vector.norm() < 0.01);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Vio {
    camera: Camera,
    noise: ImuNoise,
    settings: Settings,
    last: Option<Imu>,
    estimator: Option<Estimator>,
    tracks: Vec<Track>,
    sight: Sight,
    /// The other camera of a pair.
    second: Option<Second>,
    rest: Rest,
    scout: Scout,
    follower: Follower,
    /// Until then a start in motion may turn out to have been wrong.
    doubtful: Option<Stamp>,
    /// Whether the image before was taken at rest.
    rested: bool,
    /// Angle that a rest may hide, rad.
    unnoticed: f64,
    /// Images in a row that contradict the prediction.
    contradictions: u32,
    excess: Option<Excess>,
    waiting: Waiting,
    /// Name of the next landmark.
    next_id: u64,
}

/// What is remembered of a landmark besides its state.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    id: u64,
    /// Failures in a row.
    misses: u32,
    /// Whether the current frame saw it.
    seen: bool,
    /// What it looks like; none for a point of the caller's own.
    patch: Option<Patch>,
}

impl Vio {
    /// Refuses a camera, noise or settings that cannot be.
    pub fn new(camera: Camera, noise: ImuNoise, settings: Settings) -> Result<Self, Error> {
        camera.check()?;
        noise.check()?;
        settings.check()?;
        Ok(Self {
            camera,
            noise,
            settings,
            last: None,
            estimator: None,
            tracks: Vec::with_capacity(settings.features),
            sight: Sight::new(&camera, &settings.patches),
            second: None,
            rest: Rest::new(settings.rest),
            scout: Scout::new(settings.moving),
            follower: Follower::default(),
            doubtful: None,
            rested: false,
            unnoticed: Rest::new(settings.rest).unnoticed(&camera),
            contradictions: 0,
            excess: None,
            waiting: Waiting::ForSteadiness,
            next_id: 0,
        })
    }

    /// Starts, or starts again, from a given state. There must be an inertial sample, and the state must not be before it.
    pub fn start(&mut self, start: &Start) -> Result<(), Error> {
        let Some(sample) = self.last else {
            return Err(Error::TooFew { what: "inertial samples before the start", got: 0, need: 1 });
        };
        start.check(sample.stamp)?;
        self.reset();
        self.estimator = Some(Estimator::new(&self.camera, self.noise, &self.settings, start, sample));
        Ok(())
    }

    /// Forgets the estimate. The start at rest is tried from here on.
    pub fn reset(&mut self) {
        self.tracks.clear();
        self.estimator = None;
        (self.contradictions, self.excess) = (0, None);
        self.scout = Scout::new(self.settings.moving);
        self.follower = Follower::default();
        self.doubtful = None;
    }

    /// Takes an inertial sample; stamps must increase.
    pub fn imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        if !sample.is_finite() {
            return Err(Error::NonFinite { what: "inertial sample", index: 0 });
        }
        if let Some(last) = &self.last
            && sample.stamp <= last.stamp
        {
            return Err(Error::NotIncreasing { index: 0, previous: last.stamp, stamp: sample.stamp });
        }
        self.last = Some(*sample);
        self.rest.imu(sample);
        if self.estimator.is_none() {
            self.scout.imu(sample);
        }
        if let Some(estimator) = &mut self.estimator {
            if estimator.history.is_full() {
                let tracks = &mut self.tracks;
                estimator.forget(|slot| {
                    tracks.swap_remove(slot);
                });
            }
            estimator.imu(*sample);
        }
        Ok(self.status())
    }

    /// Whether the estimate can be used.
    pub fn status(&self) -> Status {
        match (&self.estimator, self.excess) {
            (None, _) => Status::Uninitialised(self.waiting),
            (Some(_), Some(excess)) => Status::Diverged(excess),
            (Some(_), None) => Status::Tracking,
        }
    }

    /// The estimate at the time of the latest sample; `None` before the start.
    pub fn output(&self) -> Option<Odometry> {
        self.estimator.as_ref().map(Estimator::odometry)
    }

    /// The camera's calibration at the last image; `None` before the start.
    pub fn calibration(&self) -> Option<Calibration> {
        self.estimator.as_ref().map(|estimator| Calibration {
            body_from_camera: Isometry3::from_parts(
                Translation3::from(estimator.state.camera_position),
                estimator.state.camera_attitude,
            ),
            time_offset_s: estimator.state.time_offset,
            covariance: estimator.covariance.block(at::CAMERA_POSITION, at::CAMERA_POSITION),
        })
    }

    /// Time of an image by the inertial sensor's clock, as far as that is known before the start.
    fn inertial_time(&self, stamp: Stamp) -> Stamp {
        later(stamp, self.settings.calibration.time_offset_s)
    }

    /// Moves the filter to the exposure of an image. `None` if there is no filter, or it was started after the exposure;
    /// otherwise the number of landmarks lost on the way.
    fn expose(&mut self, stamp: Stamp, at_rest: bool) -> Result<Option<usize>, Error> {
        let Some(estimator) = &mut self.estimator else { return Ok(None) };
        let clock = &self.settings.calibration;
        if clock.stamp_jitter_s > 0.0 {
            estimator.doubt_clock(clock.time_offset_s, clock.stamp_jitter_s);
        }
        let time = later(stamp, estimator.state.time_offset);
        let anchor = estimator.history.anchor();
        if time <= anchor && estimator.history.is_new() {
            return Ok(None);
        }
        if time <= anchor {
            return Err(Error::Late { what: "image", stamp: time, now: anchor });
        }
        if time.secs_since(estimator.history.latest().stamp) > MAX_AHEAD {
            return Err(Error::OutOfRange { stamp: time, first: anchor, last: estimator.history.now() });
        }
        if at_rest {
            estimator.stay(time, &self.settings.rest);
            if !self.rested {
                estimator.loosen(self.unnoticed);
            }
            if let Some(window) = self.rest.take_certain_window(time) {
                estimator.weigh(&window, self.unnoticed, &self.settings.rest);
            }
            self.rested = true;
            return Ok(Some(0));
        }
        self.rested = false;
        let before = self.tracks.len();
        let tracks = &mut self.tracks;
        estimator.advance(time, |slot| {
            tracks.swap_remove(slot);
        });
        Ok(Some(before - self.tracks.len()))
    }

    /// The end of every image: the divergence test, and the motion since.
    fn conclude(&mut self, mut report: FrameReport) -> FrameReport {
        if let Some(estimator) = &mut self.estimator {
            let contradicted = report.rejected >= 5 && report.rejected > report.used;
            self.contradictions = if contradicted { self.contradictions + 1 } else { 0 };
            let now = estimator.history.anchor();
            let doubtful = self.doubtful.is_some_and(|until| now < until);
            let most = if doubtful { DOUBTED } else { self.settings.limits.contradictions };
            let too_many = self.contradictions >= most;
            let excess = estimator.excess(&self.settings.limits);
            self.excess = self.excess.or(excess).or(too_many.then_some(Excess::Contradiction));
            estimator.replay();
            if doubtful && self.excess.is_some() {
                // The start was wrong: better none than this one.
                self.reset();
            }
        }
        report.status = self.status();
        report
    }

    /// A report on nothing.
    fn report(&self) -> FrameReport {
        FrameReport { status: self.status(), used: 0, rejected: 0, added: 0, removed: 0, at_rest: false }
    }
}

/// A time some seconds later.
fn later(stamp: Stamp, seconds: f64) -> Stamp {
    Stamp::from_nanos(stamp.nanos().saturating_add((seconds * 1e9).round() as i64))
}
