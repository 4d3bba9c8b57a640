//! Odometry in a stored map: poses from the map correct it, and stand in for it while it cannot be believed.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3};

use super::contradiction::{Contradiction, Verdict};
use super::fault_isolation::FaultIsolation;
use super::imu_pair::ImuPair;
use super::map_pose::MapPose;
use super::pose_measurement::PoseMeasurement;
use super::unified::{UnifiedSettings, UnifiedVio};
use crate::camera::model::CameraModel;
use crate::error::Error;
use crate::filter::Settings;
use crate::inertial::initial_state::{InitialSigma, InitialState};
use crate::inertial::odometry::Odometry;
use crate::samples::{ImageView, Imu};
use crate::stamp::Stamp;

/// Settings of [`MapAidedVio`]. Ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapAidedSettings {
    /// The estimator; its frame of poses is the map. Two inertial sensors are joined once each of them is sound.
    pub unified: UnifiedSettings,
    /// Seconds from one pose in the map to the next; 0.1.
    pub pose_interval_s: f64,
    /// What the map itself is off, m and rad per axis: the same for all images of a place, so no number of poses averages it away; 2e-3, 1e-3.
    pub map_sigma: [f64; 2],
    /// Time after which the error of a pose in the map is another one, s; 0.3.
    pub map_correlation_s: f64,
    /// A position that is less well known is not trusted, m along the axis where it is known least; 0.01.
    pub trusted_sigma_m: f64,
    /// Nor is one that the map has not confirmed for so long, s; 0.5.
    pub trusted_age_s: f64,
    /// Nor, after a start in motion, is one that the map has not confirmed so many times in a row; 10.
    pub trusted_confirmations: usize,
    /// A pose in the map that is off the expected one by more than this, m and rad, and by more than three deviations of both, contradicts it;
    /// 0.02, 0.02.
    pub contradiction: [f64; 2],
    /// Poses in the map follow from each other if they are off by no more than this, by the inertial samples between them or at constant
    /// velocity where those have a gap, m and rad; 0.1, 0.1.
    pub jump: [f64; 2],
    /// Inertial samples farther apart than this, s, end the odometry, and without one for so long it is not trusted; 0.02.
    pub longest_gap_s: f64,
    /// Two gyroscopes that differ by more than this in a tenth of a second, rad/s, contradict each other; 0.05.
    pub gyro_difference: f64,
    /// A map that has jumped off an odometry and stays as far off it is believed after so long, s: until then it may be a place that looks like
    /// another; 6.
    pub longest_jump_s: f64,
    /// Without an inertial sample for so long, s, the odometry's last pose is moved on, not to be trusted, and then the map's; 0.1.
    pub coast_s: f64,
    /// Poses in the map in a row that must follow from each other before the odometry starts again, and, after one that contradicted it alone,
    /// that must confirm it before it is trusted; 2.
    pub confirmations: usize,
}

impl Default for MapAidedSettings {
    fn default() -> Self {
        Self {
            unified: UnifiedSettings::default(),
            pose_interval_s: 0.1,
            map_sigma: [2e-3, 1e-3],
            map_correlation_s: 0.3,
            trusted_sigma_m: 0.01,
            trusted_age_s: 0.5,
            trusted_confirmations: 10,
            contradiction: [0.02, 0.02],
            jump: [0.1, 0.1],
            longest_gap_s: 0.02,
            gyro_difference: 0.05,
            longest_jump_s: 6.0,
            coast_s: 0.1,
            confirmations: 2,
        }
    }
}

/// Where the body is in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AidedPose {
    /// Pose in the world of the map.
    pub world_from_body: Isometry3<f64>,
    /// Standard deviation of the position along the axis where it is known least, m; infinite where it is from the map.
    pub position_sigma_m: f64,
    /// The same of the attitude, rad.
    pub attitude_sigma_rad: f64,
    /// Whether the map stands in for the odometry: the last pose in it, moved on.
    pub from_map: bool,
    /// Whether something may be done that must not miss.
    pub trusted: bool,
    /// Poses of the same number follow from each other; at every change of the source it rises.
    pub source: usize,
}

/// Standard deviation of the velocity at a start, m/s: of a body that stands, and of one that moves.
const STANDING: f64 = 0.05;
const MOVING: f64 = 0.1;
/// Inertial samples are kept for so long, s: a pose in the map comes no later than this, and the one before it is no older.
const KEPT: f64 = 0.5;

/// [`UnifiedVio`] in a stored map, with tests of what it is given. Inertial samples that stand still or have gaps end the odometry at once, and so
/// do two gyroscopes that contradict each other; of two sensors, the sound one, or the one whose turns are the map's, then goes on alone. So do
/// two poses in the map that follow from each other and contradict the expected ones, farther the second time; after the first the odometry is
/// not trusted, but where little of the map is in view, or a place looks like another, the map may be the one that errs. The map's poses, moved
/// on, stand in for an odometry that has ended, not to be trusted, until enough of them follow from each other; the odometry then starts anew.
#[derive(Debug, Clone)]
pub struct MapAidedVio {
    vio: UnifiedVio,
    settings: MapAidedSettings,
    pair: Option<ImuPair>,
    /// Of each sensor by itself: joined, the noise of one would hide that the other stands still.
    isolation: FaultIsolation,
    /// The latest inertial samples, of both sensors where there are two, as far back as they can be believed, and the time of the last one.
    recent: VecDeque<Imu>,
    newest: Option<Stamp>,
    gravity: f64,
    /// When the map confirmed the odometry last, and how many times it has to before that is trusted.
    confirmed: Option<Stamp>,
    to_confirm: usize,
    contradiction: Contradiction,
    last: Option<MapPose>,
    /// Poses in the map that have followed from each other since the odometry was given up; `None` while it goes on.
    recovering: Option<usize>,
    source: usize,
}

impl MapAidedVio {
    /// Not started yet.
    ///
    /// # Errors
    /// As [`UnifiedVio::new`].
    pub fn new(camera: impl CameraModel + 'static, vio: Settings, settings: MapAidedSettings) -> Result<Self, Error> {
        let pair = settings.unified.imu_pair.map(ImuPair::new).transpose()?;
        let noise = pair.as_ref().map_or(settings.unified.imu, ImuPair::noise);
        let second =
            settings.unified.imu_pair.map_or_else(UnitQuaternion::identity, |pair| pair.body_from_second.rotation);
        let unified = UnifiedSettings { imu: noise, imu_pair: None, ..settings.unified };
        Ok(Self {
            vio: UnifiedVio::new(camera, vio, unified)?,
            settings,
            pair,
            isolation: FaultIsolation::new(second, settings.gyro_difference),
            recent: VecDeque::new(),
            newest: None,
            gravity: vio.gravity,
            confirmed: None,
            to_confirm: 0,
            contradiction: Contradiction::new(
                settings.contradiction.map(|bound| 0.5 * bound),
                settings.trusted_age_s,
                settings.longest_jump_s,
            ),
            last: None,
            recovering: None,
            source: 0,
        })
    }

    /// The estimator.
    pub fn unified(&self) -> &UnifiedVio {
        &self.vio
    }

    /// Starts a body that stands and was found in the map. At least one inertial sample must have come. Returns its pose.
    ///
    /// # Errors
    /// As [`UnifiedVio::initialize`]; information without an inverse.
    pub fn start(&mut self, found: &PoseMeasurement) -> Result<Isometry3<f64>, Error> {
        let pose = self.map_pose(None, found);
        let [position, attitude] = self.spread(found)?;
        self.initialize(&pose, [position, attitude, STANDING])?;
        self.last = Some(pose);
        Ok(pose.world_from_body)
    }

    /// How far away things are now, as a depth image says: near a surface an odometry that starts again with the usual distance takes what passes
    /// by for a speed that it does not have. See [`Vio::expect_distance`](crate::Vio::expect_distance).
    ///
    /// # Errors
    /// As there.
    pub fn expect_distance(&mut self, distance: f64, share: f64) -> Result<(), Error> {
        self.vio.expect_distance(distance, share)
    }

    /// Takes a sample of the inertial sensor.
    ///
    /// # Errors
    /// As [`UnifiedVio::imu`].
    pub fn imu(&mut self, sample: &Imu) -> Result<(), Error> {
        let believed = self.check(0, sample)?;
        let Some(pair) = &mut self.pair else {
            self.take(sample)?;
            // It is all there is.
            if !believed {
                self.forget_samples();
            }
            return Ok(());
        };
        if believed {
            pair.first(sample)?;
        }
        self.drain_pair()
    }

    /// Takes a sample of the second inertial sensor, in its own axes.
    ///
    /// # Errors
    /// As [`UnifiedVio::second_imu`].
    pub fn second_imu(&mut self, sample: &Imu) -> Result<(), Error> {
        if self.pair.is_none() {
            return Err(Error::NoSuch { what: "inertial sensor", index: 1, count: 1 });
        }
        if self.check(1, sample)?
            && let Some(pair) = &mut self.pair
        {
            pair.second(sample)?;
        }
        self.drain_pair()
    }

    /// Whether a sample of a sensor is believed.
    fn check(&mut self, which: usize, sample: &Imu) -> Result<bool, Error> {
        let before = self.isolation.believed();
        self.isolation.take(which, sample, KEPT)?;
        Ok(self.isolate(before)[which])
    }

    /// Which sensors are believed. Where one no longer is, what the odometry has read of it lately is not either.
    fn isolate(&mut self, before: [bool; 2]) -> [bool; 2] {
        let believed = self.isolation.believed();
        if (0..2).any(|k| before[k] && !believed[k]) {
            self.forget_samples();
        }
        believed
    }

    fn drain_pair(&mut self) -> Result<(), Error> {
        while let Some(sample) = self.pair.as_mut().and_then(ImuPair::read) {
            self.take(&sample)?;
        }
        Ok(())
    }

    fn take(&mut self, sample: &Imu) -> Result<(), Error> {
        self.vio.imu(sample)?;
        let gap = self.newest.replace(sample.stamp).map_or(0.0, |newest| sample.stamp.secs_since(newest));
        if gap > self.settings.longest_gap_s {
            self.forget_samples();
        }
        self.recent.push_back(*sample);
        // One is kept that is older.
        while self.recent.get(1).is_some_and(|second| sample.stamp.secs_since(second.stamp) > KEPT) {
            self.recent.pop_front();
        }
        Ok(())
    }

    /// What has come lately is not believed.
    fn forget_samples(&mut self) {
        self.recent.clear();
        if self.recovering.is_none() {
            self.give_up();
        }
    }

    /// Takes an image; see [`UnifiedVio::image`].
    ///
    /// # Errors
    /// As [`UnifiedVio::image`].
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<(), Error> {
        self.vio.image(stamp, image)
    }

    /// Takes what the map says of a moment: a pose, or nothing. `expected` is what [`pose`](Self::pose) said then. Returns whether the map
    /// confirms it.
    ///
    /// # Errors
    /// As [`UnifiedVio::pose`].
    pub fn map(&mut self, found: Option<&PoseMeasurement>, expected: Option<&AidedPose>) -> Result<bool, Error> {
        let Some(found) = found else {
            self.last = None;
            return Ok(false);
        };
        let pose = self.map_pose(self.last, found);
        if let Some(last) = self.last {
            let before = self.isolation.believed();
            let turn = last.world_from_body.rotation.inverse() * pose.world_from_body.rotation;
            self.isolation.map_turn([last.stamp, pose.stamp], &turn);
            self.isolate(before);
        }
        let follows = self.last.is_some_and(|last| {
            let expected = last.later_by(pose.stamp, &self.recent, self.gravity);
            agree(&expected, &pose.world_from_body, self.settings.jump)
        });
        self.last = Some(pose);
        if self.vio.output().is_none() && self.recovering.is_none() {
            self.give_up();
        }
        if let Some(count) = self.recovering {
            let count = if follows { count + 1 } else { 0 };
            self.recovering = Some(count);
            let covered = self.recent.front().is_some_and(|first| first.stamp <= pose.since);
            if covered && count >= self.settings.confirmations {
                let [position, attitude] = self.spread(found)?;
                let pose = pose.with_velocity_by(&self.recent, self.gravity);
                self.initialize(&pose, [position, attitude, MOVING])?;
                self.to_confirm = self.settings.trusted_confirmations;
            }
            return Ok(false);
        }
        // What was expected of another source says nothing.
        let expected = expected.filter(|expected| expected.source == self.source);
        let [position, attitude] = self.spread(found)?;
        let agrees = |expected: &AidedPose| {
            let [shift, turn] = self.settings.contradiction;
            let within = [shift.max(3.0 * expected.position_sigma_m.hypot(position)), turn.max(3.0 * attitude)];
            agree(&expected.world_from_body, &pose.world_from_body, within)
        };
        if let Some(expected) = expected {
            let poses = [&expected.world_from_body, &pose.world_from_body];
            match self.contradiction.weigh(pose.stamp, poses, (agrees(expected), follows)) {
                Verdict::Confirmed => {}
                Verdict::Doubted => {
                    self.confirmed = None;
                    self.to_confirm = self.to_confirm.max(self.settings.confirmations);
                    return Ok(false);
                }
                Verdict::OdometryErrs => {
                    self.give_up();
                    return Ok(false);
                }
            }
            self.confirmed = Some(pose.stamp);
            self.to_confirm = self.to_confirm.saturating_sub(1);
        }
        let settings = &self.settings;
        let independent = (2.0 * settings.map_correlation_s / settings.pose_interval_s).max(1.0);
        let information = self.covariance(found)?.cholesky().map(|factor| factor.inverse() / independent);
        if let Some(information) = information {
            self.vio.pose(&PoseMeasurement { information, ..*found })?;
        }
        Ok(expected.is_some())
    }

    /// Takes that the map shows what is expected of a moment, without fixing all of the pose: before a plane, say. That confirms the odometry as
    /// long as it knows its position well enough by itself. Returns whether it does.
    pub fn seen(&mut self, stamp: Stamp, expected: Option<&AidedPose>) -> bool {
        self.last = None;
        let confirms = self.recovering.is_none() && expected.is_some_and(|expected| expected.source == self.source);
        if confirms {
            self.confirmed = Some(stamp);
        }
        confirms
    }

    /// Where the body is now; `None` before the start, and where nothing recent says so.
    pub fn pose(&self, now: Stamp) -> Option<AidedPose> {
        let Self { settings, source, .. } = self;
        let silence = self.newest.map_or(f64::INFINITY, |newest| now.secs_since(newest));
        if silence > settings.coast_s || self.recovering.is_some() {
            let last = self.last.filter(|last| now.secs_since(last.stamp) <= settings.trusted_age_s)?;
            let world_from_body = last.later_by(now, &self.recent, self.gravity);
            return Some(AidedPose {
                world_from_body,
                position_sigma_m: f64::INFINITY,
                attitude_sigma_rad: f64::INFINITY,
                from_map: true,
                trusted: false,
                source: *source,
            });
        }
        let odometry = self.vio.output()?;
        let Odometry { stamp, covariance, .. } = odometry;
        let silent = silence > settings.longest_gap_s;
        let world_from_body = odometry.moved_on(now);
        let deviation = |first| largest_deviation(&covariance.fixed_view::<3, 3>(first, first).into_owned());
        let [position_sigma_m, attitude_sigma_rad] = [0, 6].map(deviation);
        let age = self.confirmed.map_or(f64::INFINITY, |confirmed| stamp.secs_since(confirmed));
        let confirmed = !silent && self.to_confirm == 0 && age <= settings.trusted_age_s;
        let trusted = confirmed && position_sigma_m <= settings.trusted_sigma_m;
        let (from_map, source) = (false, *source);
        Some(AidedPose { world_from_body, position_sigma_m, attitude_sigma_rad, from_map, trusted, source })
    }

    /// Nothing that the odometry says is believed until it starts again.
    fn give_up(&mut self) {
        (self.confirmed, self.recovering) = (None, Some(0));
        self.contradiction.forget();
        self.source += 1;
    }

    /// Odometry from a pose in the map at its own time, with the inertial samples since.
    fn initialize(&mut self, pose: &MapPose, [position, attitude, velocity]: [f64; 3]) -> Result<(), Error> {
        let MapPose { stamp, world_from_body, .. } = *pose;
        let [gyro_bias, accel_bias] = [Vector3::zeros(); 2];
        let velocity_in_body = world_from_body.inverse_transform_vector(&pose.velocity);
        let sigma = InitialSigma { position, velocity, yaw: attitude, tilt: attitude, ..InitialSigma::default() };
        let initial = InitialState { stamp, world_from_body, velocity_in_body, gyro_bias, accel_bias, sigma };
        let samples = self.recent.make_contiguous();
        let first = samples.partition_point(|sample| sample.stamp <= stamp).saturating_sub(1);
        self.vio.initialize_past(&initial, &samples[first..])?;
        (self.confirmed, self.recovering) = (Some(stamp), None);
        self.source += 1;
        Ok(())
    }

    fn map_pose(&self, before: Option<MapPose>, found: &PoseMeasurement) -> MapPose {
        let UnifiedSettings { source_from_world, body_from_sensor, .. } = &self.settings.unified;
        MapPose::next(before, found.stamp, found.of_body(source_from_world, body_from_sensor).world_from_body)
    }

    /// The covariance of a pose in the map with what the map itself is off.
    fn covariance(&self, found: &PoseMeasurement) -> Result<Matrix6<f64>, Error> {
        let unusable = Error::NonFinite { what: "information of a pose", index: 0 };
        let own = found.information.cholesky().ok_or(unusable)?.inverse();
        let [shift, turn] = self.settings.map_sigma.map(|sigma| sigma * sigma);
        Ok(own + Matrix6::from_diagonal(&[shift, shift, shift, turn, turn, turn].into()))
    }

    /// Deviations of position and attitude along the axes where they are known least. A registration may call metres unknown that it has found to
    /// a millimetre (before a nearly smooth wall without a prior, say): no filter starts with those, and no pose confirms what it is that far
    /// off. So they are taken for no more than poses may differ by that do not contradict each other.
    fn spread(&self, found: &PoseMeasurement) -> Result<[f64; 2], Error> {
        let covariance = self.covariance(found)?;
        let deviation = |first| largest_deviation(&covariance.fixed_view::<3, 3>(first, first).into_owned());
        let [position, attitude] = self.settings.contradiction;
        Ok([deviation(0).min(position), deviation(3).min(attitude)])
    }
}

/// Whether poses are within so much of each other, m and rad.
fn agree(one: &Isometry3<f64>, other: &Isometry3<f64>, [shift, turn]: [f64; 2]) -> bool {
    (one.translation.vector - other.translation.vector).norm() <= shift
        && one.rotation.angle_to(&other.rotation) <= turn
}

fn largest_deviation(covariance: &nalgebra::Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}
