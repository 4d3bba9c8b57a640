//! The odometry as its callers see it, and one image as the steps of the algorithm.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Unit, Vector2, Vector3};

use super::divergence_monitor::DivergenceMonitor;
use super::estimator::Estimator;
use super::frontend::corner_detector::DetectionCriteria;
use super::frontend::image_frontend::ImageFrontend;
use super::frontend::klt_tracker::KltTracker;
use super::frontend::patch::Patch;
use super::image_tracking::{align_and_update, detect_landmarks, drop_landmarks, drop_masked, update_templates};
use super::initialization::dynamic::result::InitialMotion;
use super::initialization::dynamic_initializer::DynamicInitializer;
use super::initialization::from_initialization::from_initialization;
use super::initialization::static_initializer;
use super::innovation_adaptation::BeforeImage;
use super::measurements::measurement::Measurement;
use super::measurements::pose::BodyPose;
use super::measurements::stationary::stationary_update;
use super::measurements::update::gated_update;
use super::point_observation::{PointObservation, PointPair};
use super::point_tracking::{add_points, drop_points, update_with_points};
use super::report::{Calibration, FrameReport, InitializationStatus, LandmarkEstimate, Status};
use super::settings::Settings;
use super::state::error_state;
use super::state::rolling_shutter::RollingShutter;
use super::stationary::detector::StationaryDetector;
use super::stationary::zero_velocity::{inflate_undetected_motion, zero_velocity_propagate};
use super::stereo::stereo_camera::StereoCamera;
use super::stereo::stereo_points::{check_pairs, update_with_second_points};
use super::tracking_state::TrackingState;
use crate::camera::model::CameraModel;
use crate::camera::model::check_model;
use crate::error::Error;
use crate::error::invalid;
use crate::format::calibration::{CameraCalibration, ImuCalibration};
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::lie::so3;
use crate::samples::{ImageView, Imu, ImuNoise};
use crate::stamp::Stamp;
use crate::trace::{event, span};

/// A measurement this much ahead of the inertial samples, in seconds, is waiting for data that does not come.
const MAX_AHEAD: f64 = 0.1;

/// Longest time without a landmark that is followed, s, before the estimate is called dead reckoning though no image says so.
const MAX_UNAIDED: f64 = 0.5;
/// Points without which nothing can be initialised.
const MIN_FEATURES: usize = 5;

/// A camera, maybe a second one beside it, and an inertial sensor.
///
/// Feed samples and images as they come; an image may arrive up to [`ImuSettings::buffer_samples`](crate::inertial::ImuSettings::buffer_samples)
/// samples late and is used at its own time, with the same result to the last bit. The filter initialises itself, at rest or in
/// motion, or from a state that is given.
///
/// ```
/// use vio_ekf::nalgebra::{Isometry3, Vector3};
/// use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Status, Vio};
/// use vio_ekf::inertial::{InitialSigma, InitialState};
///
/// let mut vio = Vio::new(Camera::euroc(), ImuNoise::default(), Settings::default())?;
/// let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
/// let imu = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
/// vio.imu(&imu(0))?;
/// vio.initialize(&InitialState {
///     stamp: at(0),
///     world_from_body: Isometry3::identity(),
///     velocity_in_body: Vector3::zeros(),
///     gyro_bias: Vector3::zeros(),
///     accel_bias: Vector3::zeros(),
///     sigma: InitialSigma::default(),
/// })?;
/// // Bright tiles on a dark wall; their corners are the landmarks.
/// let bright = |k: usize| k % 752 % 60 < 30 && k / 752 % 60 < 30;
/// let picture: Vec<u8> = (0..752 * 480).map(|k| if bright(k) { 180 } else { 60 }).collect();
/// for k in 1..=20 {
///     vio.imu(&imu(5 * k))?;
///     if k % 10 == 0 {
///         let report = vio.image(at(5 * k), &ImageView::new(752, 480, &picture)?)?;
///         assert_eq!(report.status, Status::Tracking);
///         assert!(report.used > 10 || k == 10, "the first image has nothing to compare with");
///     }
/// }
/// let odometry = vio.output().expect("it has been initialised");
/// assert!(odometry.world_from_body.translation.vector.norm() < 0.01);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Vio {
    camera: Arc<dyn CameraModel>,
    noise: ImuNoise,
    settings: Settings,
    last_sample: Option<Imu>,
    /// None before the initialization.
    tracking: Option<TrackingState>,
    frontend: ImageFrontend,
    /// The second camera.
    stereo: Option<StereoCamera>,
    stationary: StationaryDetector,
    /// Whether the last image was taken at rest.
    was_stationary: bool,
    dynamic_initializer: DynamicInitializer,
    klt_tracker: KltTracker,
    initialization: InitializationStatus,
    divergence: DivergenceMonitor,
    /// When an image last followed landmarks, or saw the body at rest.
    last_aided: Option<Stamp>,
}

impl Vio {
    /// Refuses a camera, noise or settings that cannot be.
    pub fn new(camera: impl CameraModel + 'static, noise: ImuNoise, settings: Settings) -> Result<Self, Error> {
        let camera: Arc<dyn CameraModel> = Arc::new(camera);
        check_model(camera.as_ref())?;
        noise.check()?;
        settings.check()?;
        let frontend = ImageFrontend::new(camera.as_ref(), &settings.patches);
        Ok(Self {
            camera,
            noise,
            settings,
            last_sample: None,
            tracking: None,
            frontend,
            stereo: None,
            stationary: StationaryDetector::new(settings.stationary),
            was_stationary: false,
            dynamic_initializer: DynamicInitializer::new(settings.dynamic_initialization),
            klt_tracker: KltTracker::default(),
            initialization: InitializationStatus::WaitingForSteadyImu,
            divergence: DivergenceMonitor::default(),
            last_aided: None,
        })
    }

    /// With a second camera fixed beside the first, whose images measure the distances of landmarks: [`image_pair`](Self::image_pair).
    ///
    /// The pose of one camera against the other is taken as known; [`StereoSettings::pixel_sigma`](crate::filter::StereoSettings::pixel_sigma)
    /// covers what is wrong with it. The pose that [`CalibrationSettings`](crate::filter::CalibrationSettings) lets the filter estimate is that
    /// of the first camera on the body.
    pub fn stereo(
        first: impl CameraModel + 'static,
        second: impl CameraModel + 'static,
        noise: ImuNoise,
        settings: Settings,
    ) -> Result<Self, Error> {
        let mono = Self::new(first, noise, settings)?;
        if settings.calibration.row_time_s != 0.0 {
            let rule = "must be 0 with a second camera: rolling shutters are known of one camera alone";
            return Err(invalid("row_time_s", settings.calibration.row_time_s, rule));
        }
        let stereo = StereoCamera::new(mono.camera.as_ref(), Arc::new(second), &settings.patches)?;
        Ok(Self { stereo: Some(stereo), ..mono })
    }

    /// From a calibration as Kalibr and EuRoC folders give it, of one camera or two: the lenses, the noise of the inertial sensor,
    /// and the time offset of the first camera (`timeshift_cam_imu`), which is added to
    /// [`CalibrationSettings::time_offset_s`](crate::filter::CalibrationSettings::time_offset_s), as the time of a row of its shutter
    /// (`line_delay`) is to [`row_time_s`](crate::filter::CalibrationSettings::row_time_s). The filter's body is the inertial sensor:
    /// where that is not the body of the calibration, the cameras are moved into its axes.
    ///
    /// Both images of a pair carry one stamp, that of the first camera's clock.
    pub fn from_calibration(
        cameras: &[CameraCalibration],
        imu: &ImuCalibration,
        mut settings: Settings,
    ) -> Result<Self, Error> {
        let on_imu = |calibration: &CameraCalibration| {
            let mut camera = calibration.camera;
            // An identity is left alone, so that its product does not change the last bits.
            if imu.body_from_imu != Isometry3::identity() {
                camera.body_from_camera = imu.body_from_imu.inverse() * camera.body_from_camera;
            }
            camera
        };
        let (first, second) = match cameras {
            [first] => (first, None),
            [first, second] => (first, Some(second)),
            _ => return Err(invalid("cameras", cameras.len() as f64, "must be one or two")),
        };
        settings.calibration.time_offset_s += first.time_offset_s;
        settings.calibration.row_time_s += first.row_time_s;
        match second {
            Some(second) => Self::stereo(on_imu(first), on_imu(second), imu.noise, settings),
            None => Self::new(on_imu(first), imu.noise, settings),
        }
    }

    /// Initialises, or initialises again, from a given state. There must be an inertial sample, and the state must not be before it.
    pub fn initialize(&mut self, initial: &InitialState) -> Result<(), Error> {
        let Some(sample) = self.last_sample else {
            return Err(Error::TooFew { what: "inertial samples before the initialization", got: 0, need: 1 });
        };
        initial.check(sample.stamp)?;
        event!(info, stamp = %initial.stamp, "initialised");
        self.reset();
        let estimator = Estimator::new(self.camera.as_ref(), self.noise, &self.settings, initial, sample);
        self.tracking = Some(TrackingState::new(estimator, self.settings.landmarks.max_count, &self.settings.imu));
        self.last_aided = Some(initial.stamp);
        Ok(())
    }

    /// Drops the estimate. The filter tries to initialise itself from here on.
    pub fn reset(&mut self) {
        self.tracking = None;
        self.last_aided = None;
        self.divergence = DivergenceMonitor::default();
        self.dynamic_initializer = DynamicInitializer::new(self.settings.dynamic_initialization);
        self.klt_tracker = KltTracker::default();
    }

    /// From here on no landmark of the first camera lies where the mask, of the size of its images, is 0: propellers, legs, the robot
    /// itself.
    pub fn set_mask(&mut self, mask: &ImageView) -> Result<(), Error> {
        self.frontend.detector.set_mask(&mask.checked(self.camera.image_size())?);
        Ok(())
    }

    /// Takes an inertial sample; stamps must increase.
    pub fn imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        if let Err(error) = sample.check_after(self.last_sample.as_ref()) {
            event!(warn, %error, "inertial sample refused");
            return Err(error);
        }
        self.last_sample = Some(*sample);
        self.stationary.imu(sample);
        match &mut self.tracking {
            Some(tracking) => tracking.imu(sample),
            None => self.dynamic_initializer.imu(sample),
        }
        Ok(self.status())
    }

    /// Takes an image of the camera.
    ///
    /// `stamp` is the middle of the exposure by the camera's clock. The image must be of the camera's size.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        let image = image.checked(self.camera.image_size())?;
        if let Some(stereo) = &mut self.stereo {
            stereo.set_image(None);
        }
        self.process_image(stamp, &image)
    }

    /// Takes the images that both cameras took at the same moment. Where one of a pair is lost, that of the first camera may be
    /// given to [`image`](Self::image) alone.
    ///
    /// `stamp` is the middle of the exposure by the cameras' clock. Both images must be of their camera's size; a filter that was not
    /// made by [`stereo`](Self::stereo) refuses them.
    pub fn image_pair(&mut self, stamp: Stamp, first: &ImageView, second: &ImageView) -> Result<FrameReport, Error> {
        let first = first.checked(self.camera.image_size())?;
        let stereo = self.stereo.as_mut().ok_or(NO_SECOND_CAMERA)?;
        stereo.set_image(Some(&second.checked(stereo.rig.camera.image_size())?));
        self.process_image(stamp, &first)
    }

    /// The filter's algorithm for one image.
    fn process_image(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        span!("image");
        self.frontend.set_image(image);
        let now = self.now_or(stamp);
        if self.stationary.is_imu_stationary(now) {
            self.stationary.image(&mut self.frontend, &self.settings.patches);
        }
        if self.tracking.is_none() {
            return self.initialize_with_image(stamp);
        }
        let stationary = self.stationary.is_stationary(now);
        let mut report = FrameReport { stationary, ..self.empty_report() };
        let before = self.state_stamp();

        // Preintegrate and propagate, without motion if the body is stationary.
        let Some(lost) = self.propagate_to_image(stamp, stationary)? else { return Ok(report) };
        report.removed = lost;
        let elapsed = before.zip(self.state_stamp()).map_or(0.0, |(before, now)| now.secs_since(before));

        let Self { tracking: Some(tracking), frontend, stereo, camera, settings, .. } = self else {
            return Ok(report);
        };
        if !stationary {
            tracking.drift_templates(camera.as_ref(), &settings.patches, elapsed);
            if frontend.detector.has_mask() {
                drop_masked(tracking, &frontend.detector, camera.as_ref(), &mut report);
            }
            let before = BeforeImage::new(&tracking.estimator);
            // Align patches and update, landmark by landmark.
            align_and_update(tracking, &frontend.pyramid, camera.as_ref(), settings, &mut report);
            // Manage landmarks.
            drop_landmarks(tracking, settings, &mut report);
            update_templates(tracking, &frontend.pyramid, camera.as_ref(), settings);
            if let Some(stereo) = stereo {
                stereo.update_distances(&mut tracking.estimator, &frontend.pyramid, camera.as_ref(), settings);
            }
            if report.used > 0 {
                tracking.adapt_imu(&before, &settings.imu);
            }
        }
        let enough = settings.patches.start_detection_ratio * settings.landmarks.max_count as f64;
        if (tracking.tracks.len() as f64) < enough {
            report.added = detect_landmarks(tracking, frontend, stereo.as_ref(), camera.as_ref(), settings);
        }
        Ok(self.check_divergence(report))
    }

    /// Takes the points that a tracker of the caller found in an image.
    ///
    /// `stamp` is the middle of the exposure by the camera's clock. Each point carries independent noise of
    /// [`LandmarkSettings::pixel_sigma`](crate::filter::LandmarkSettings::pixel_sigma). Landmarks that are not among the points are
    /// dropped; points that are new take their place while there is room, in the order given.
    pub fn points(&mut self, stamp: Stamp, points: &[PointObservation]) -> Result<FrameReport, Error> {
        if let Some(index) = points.iter().position(|p| p.pixel.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "point", index });
        }
        let now = self.now_or(stamp);
        self.stationary.points(now, points, self.settings.landmarks.pixel_sigma);
        if self.tracking.is_none() {
            return self.initialize_with_points(stamp, points);
        }
        let stationary = self.stationary.is_stationary(now);
        let mut report = FrameReport { stationary, ..self.empty_report() };
        let Some(lost) = self.propagate_to_image(stamp, stationary)? else { return Ok(report) };
        report.removed = lost;
        if let Self { tracking: Some(tracking), camera, settings, .. } = self {
            let before = BeforeImage::new(&tracking.estimator);
            update_with_points(tracking, points, camera.as_ref(), settings, &mut report);
            if report.used > 0 {
                tracking.select_accel_matrix(&before, &settings.imu);
            }
            drop_points(tracking, settings, &mut report);
            report.added = add_points(tracking, points, camera.as_ref(), settings);
        }
        Ok(self.check_divergence(report))
    }

    /// As [`points`](Self::points) with a second camera: the filter must have been made by [`stereo`](Self::stereo). All pixels of
    /// both images carry independent noise.
    pub fn point_pairs(&mut self, stamp: Stamp, pairs: &[PointPair]) -> Result<FrameReport, Error> {
        check_pairs(pairs)?;
        let stereo = self.stereo.as_mut().ok_or(NO_SECOND_CAMERA)?;
        // Taken out and put back, so that its memory is claimed once.
        let mut first = std::mem::take(&mut stereo.points);
        first.clear();
        first.extend(pairs.iter().map(|pair| pair.first));
        let report = self.points(stamp, &first);
        let Self { stereo: Some(stereo), tracking, settings, .. } = self else { return report };
        stereo.points = first;
        let report = report?;
        if let Some(tracking) = tracking {
            update_with_second_points(tracking, (stamp, pairs), &stereo.rig, settings, &report);
        }
        Ok(report)
    }

    /// Takes a pose of the body in the filter's world that somebody else has measured; see [`update`](Self::update) for its time and
    /// for what is returned.
    ///
    /// The errors of successive poses are taken as independent. For errors that last for a time τ, of poses dt apart, divide
    /// the information by `2 τ / dt`.
    pub fn pose(&mut self, pose: &BodyPose) -> Result<bool, Error> {
        self.update(pose.stamp, &pose.measurement()?)
    }

    /// Takes a measurement of any other sensor: a position fix, a barometer, a range, a wheel.
    ///
    /// Its time is by the inertial sensor's clock, not before that of the last image or measurement; a measurement and an image of
    /// the same time must come in the order image, measurement. [`UnifiedVio`](crate::fusion::UnifiedVio) sees to the order of images and
    /// poses. Returns whether it was used: it is not before the initialization, nor if its gate refuses it.
    pub fn update<const M: usize, const C: usize>(
        &mut self,
        stamp: Stamp,
        measurement: &impl Measurement<M, C>,
    ) -> Result<bool, Error> {
        let Some(tracking) = &mut self.tracking else { return Ok(false) };
        let (rows, count) = (measurement.rows(), tracking.estimator.covariance.size());
        if let Some(&row) = rows.iter().find(|row| **row >= count) {
            return Err(Error::NoSuch { what: "row of the error state", index: row, count });
        }
        check_time(&tracking.estimator, stamp, measurement.name())?;
        let before = tracking.estimator.buffer.state_stamp();
        if stamp > before {
            if self.was_stationary && self.stationary.is_stationary(tracking.estimator.buffer.now()) {
                zero_velocity_propagate(&mut tracking.estimator, stamp, &self.settings.stationary);
            } else {
                tracking.propagate_to(stamp);
            }
            // The drift of templates since the last image is counted from here on at the next one.
            if tracking.tracks.iter().any(|track| track.patch.is_some()) {
                let elapsed = tracking.estimator.buffer.state_stamp().secs_since(before);
                tracking.drift_templates(self.camera.as_ref(), &self.settings.patches, elapsed);
            }
        }
        let used = gated_update(&mut tracking.estimator, measurement);
        if used {
            self.last_aided = Some(tracking.estimator.buffer.state_stamp());
        }
        self.divergence.check_state(&tracking.estimator, &self.settings.divergence);
        tracking.estimator.update_prediction();
        Ok(used)
    }

    /// Whether the estimate can be used.
    pub fn status(&self) -> Status {
        match (&self.tracking, self.divergence.cause()) {
            (None, _) => Status::Uninitialised(self.initialization),
            (Some(_), Some(cause)) => Status::Diverged(cause),
            (Some(tracking), None) => {
                let now = tracking.estimator.buffer.now();
                let aided = |last: Stamp| now.secs_since(last) <= MAX_UNAIDED;
                if self.last_aided.is_some_and(aided) { Status::Tracking } else { Status::DeadReckoning }
            }
        }
    }

    /// The estimate at the time of the latest sample; `None` before the initialization.
    pub fn output(&self) -> Option<Odometry> {
        self.tracking.as_ref().map(|tracking| tracking.estimator.odometry())
    }

    /// The calibration of camera and accelerometer at the last image; `None` before the initialization.
    pub fn calibration(&self) -> Option<Calibration> {
        self.tracking.as_ref().map(|TrackingState { estimator, .. }| Calibration {
            body_from_camera: estimator.state.body_from_camera(),
            time_offset_s: estimator.state.time_offset,
            covariance: estimator.covariance.block(error_state::CAMERA_POSITION, error_state::CAMERA_POSITION),
            accel_matrix: estimator.state.accel_matrix(),
            accel_matrix_sigma: Matrix3::from_fn(|r, c| {
                estimator.covariance.variance(error_state::ACCEL_MATRIX + 3 * r + c).max(0.0).sqrt()
            }),
        })
    }

    /// Seconds to add to the camera's stamps, as they are known now.
    pub(crate) fn time_offset_s(&self) -> f64 {
        let nominal = self.settings.calibration.time_offset_s;
        self.tracking.as_ref().map_or(nominal, |tracking| tracking.estimator.state.time_offset)
    }

    /// The landmarks that are followed, as they are estimated at the last image.
    pub fn landmarks(&self) -> impl Iterator<Item = LandmarkEstimate> + '_ {
        let tracking = self.tracking.iter();
        tracking.flat_map(|TrackingState { estimator, tracks, .. }| {
            tracks.iter().enumerate().map(|(slot, track)| {
                let landmark = &estimator.state.landmarks[slot];
                let bearing_in_camera = landmark.bearing.direction();
                LandmarkEstimate {
                    id: track.id,
                    bearing_in_camera: Unit::new_unchecked(bearing_in_camera),
                    pixel: self.camera.project(&bearing_in_camera),
                    inverse_distance: landmark.inverse_distance.value,
                    inverse_distance_sigma: estimator.covariance.variance(error_state::landmark(slot) + 2).sqrt(),
                    failures: track.failures,
                }
            })
        })
    }

    /// The camera as it was given.
    pub fn camera(&self) -> &dyn CameraModel {
        self.camera.as_ref()
    }

    /// The second camera as it was given; refused where there is none.
    pub(crate) fn second_camera(&self) -> Result<&dyn CameraModel, Error> {
        self.stereo.as_ref().map(|stereo| stereo.rig.camera.as_ref()).ok_or(NO_SECOND_CAMERA)
    }

    /// Propagates to the time of an image. `None` if the filter was initialised after the image; otherwise the number of landmarks
    /// lost on the way.
    fn propagate_to_image(&mut self, stamp: Stamp, stationary: bool) -> Result<Option<usize>, Error> {
        let Some(tracking) = &mut self.tracking else { return Ok(None) };
        let calibration = &self.settings.calibration;
        if calibration.stamp_jitter_s > 0.0 {
            tracking.estimator.reset_time_offset(calibration.time_offset_s, calibration.stamp_jitter_s);
        }
        let time = stamp.plus_secs(tracking.estimator.state.time_offset);
        let state_stamp = tracking.estimator.buffer.state_stamp();
        if time <= state_stamp && tracking.estimator.buffer.is_at_start() {
            return Ok(None);
        }
        if time <= state_stamp {
            event!(warn, %time, now = %state_stamp, "image refused: it is too late");
            return Err(Error::Late { what: "image", stamp: time, now: state_stamp });
        }
        check_time(&tracking.estimator, time, "image")?;
        span!("propagate");
        let was_stationary = std::mem::replace(&mut self.was_stationary, stationary);
        if !stationary {
            return Ok(Some(tracking.propagate_to(time)));
        }
        tracking.rested = true;
        let settings = &self.settings.stationary;
        let angle = self.stationary.undetected_angle(self.camera.as_ref());
        zero_velocity_propagate(&mut tracking.estimator, time, settings);
        if !was_stationary {
            inflate_undetected_motion(&mut tracking.estimator, angle);
        }
        if let Some(mean) = self.stationary.take_certain_mean(time) {
            stationary_update(&mut tracking.estimator, &mean, angle, settings);
        }
        Ok(Some(0))
    }

    /// The end of every image: the divergence test, and the prediction from the image until now.
    fn check_divergence(&mut self, mut report: FrameReport) -> FrameReport {
        if let Some(tracking) = &mut self.tracking {
            let wrong = self.divergence.check_image(&tracking.estimator, &self.settings.divergence, &report);
            report.consecutive_outliers = self.divergence.consecutive_outliers();
            tracking.estimator.update_prediction();
            // New landmarks tell nothing yet, unless there are no others: then they are the first.
            let first = report.added > 0 && report.added == tracking.tracks.len();
            let aided = report.used > 0 || report.stationary || first;
            // Not the time of the state: at rest that stays behind.
            self.last_aided = aided.then(|| tracking.estimator.buffer.now());
            event!(
                debug,
                used = report.used,
                rejected = report.rejected,
                removed = report.removed,
                added = report.added,
                "image done"
            );
            if wrong {
                event!(warn, "start in motion taken back");
                self.reset();
            }
        }
        report.status = self.status();
        report
    }

    /// Tries to initialise, at rest or in motion, when an image has been set.
    fn initialize_with_image(&mut self, stamp: Stamp) -> Result<FrameReport, Error> {
        self.initialize_at_rest()?;
        if self.tracking.is_none() && self.settings.dynamic_initialization.enabled {
            self.track_before_initialization(stamp);
            self.count_features(self.klt_tracker.observations().count());
        }
        let Self { tracking: Some(tracking), frontend, stereo, camera, settings, .. } = self else {
            return Ok(self.empty_report());
        };
        // The image that the initialization was made with has the first landmarks.
        let added = detect_landmarks(tracking, frontend, stereo.as_ref(), camera.as_ref(), settings);
        let report = FrameReport { added, ..self.empty_report() };
        Ok(self.check_divergence(report))
    }

    /// The same with points.
    fn initialize_with_points(&mut self, stamp: Stamp, points: &[PointObservation]) -> Result<FrameReport, Error> {
        self.initialize_at_rest()?;
        if let Self { tracking: Some(tracking), camera, settings, .. } = self {
            let added = add_points(tracking, points, camera.as_ref(), settings);
            let report = FrameReport { added, ..self.empty_report() };
            return Ok(self.check_divergence(report));
        }
        if self.settings.dynamic_initialization.enabled {
            let (time, camera) = (self.unsynchronized_time(stamp), Arc::clone(&self.camera));
            let observed = points.iter().filter_map(|p| Some((p.id, camera.bearing(&p.pixel)?.into_inner())));
            if let Some(motion) = self.dynamic_initializer.image(time, observed, camera.as_ref(), self.settings.gravity)
            {
                let pixel = |id| points.iter().find(|p| p.id == id).map(|p| (p.pixel, None));
                self.initialize_in_motion(time, &motion, pixel);
            }
        }
        self.count_features(points.len());
        let added = self.tracking.as_ref().map_or(0, |tracking| tracking.tracks.len());
        Ok(FrameReport { added, ..self.empty_report() })
    }

    /// Too few points keep every initialization waiting, unless something else is wrong already.
    fn count_features(&mut self, count: usize) {
        if count < MIN_FEATURES && self.initialization != InitializationStatus::GravityMismatch {
            self.initialization = InitializationStatus::WaitingForFeatures;
        }
    }

    /// Initialises from the means of a stationary period.
    fn initialize_at_rest(&mut self) -> Result<(), Error> {
        let Some(sample) = self.last_sample else { return Ok(()) };
        self.initialization = static_initializer::status(&self.stationary, sample.stamp, &self.settings);
        if self.initialization != InitializationStatus::WaitingForStationaryImages {
            return Ok(());
        }
        let found = static_initializer::initial_state(&mut self.stationary, sample.stamp, &self.settings);
        let Some((initial, mean)) = found else { return Ok(()) };
        self.initialize(&initial)?;
        let angle = self.stationary.undetected_angle(self.camera.as_ref());
        if let Some(tracking) = &mut self.tracking {
            tracking.rested = true;
            stationary_update(&mut tracking.estimator, &mean, angle, &self.settings.stationary);
        }
        Ok(())
    }

    /// Tracks points into the current image, and initialises if they tell the motion.
    fn track_before_initialization(&mut self, stamp: Stamp) {
        let time = self.unsynchronized_time(stamp);
        let ImageFrontend { pyramid, detector, .. } = &mut self.frontend;
        let rotation = self.dynamic_initializer.rotation_since_image(time);
        let criteria = DetectionCriteria::from(&self.settings.patches);
        self.klt_tracker.track(rotation, pyramid, (detector, &criteria), self.camera.as_ref());
        let shutter = RollingShutter::new(self.camera.as_ref(), &self.settings);
        let turn =
            self.camera.body_from_camera().rotation.inverse() * self.last_sample.map_or(Vector3::zeros(), |s| s.gyro);
        // Each back to the time of the stamp, as far as the gyroscope tells.
        let observed = self.klt_tracker.observations().map(|(id, direction)| {
            match self.klt_tracker.pixel(id).map(|pixel| shutter.delay(&pixel)) {
                Some(delay) if delay != 0.0 => (id, so3::exp(&(turn * delay)) * direction),
                _ => (id, direction),
            }
        });
        let motion = self.dynamic_initializer.image(time, observed, self.camera.as_ref(), self.settings.gravity);
        if let Some(motion) = motion {
            // The reset of the initialization would clear it.
            let tracker = std::mem::take(&mut self.klt_tracker);
            let pyramid = self.frontend.pyramid.clone();
            self.initialize_in_motion(time, &motion, |id| {
                let pixel = tracker.pixel(id)?;
                Some((pixel, Some(Patch::extract(&pyramid, &pixel)?)))
            });
        }
    }

    /// Initialises from the motion at the time of an image. `observe` gives the pixel of a point, by its id, in that image, and its
    /// patch.
    fn initialize_in_motion(
        &mut self,
        time: Stamp,
        motion: &InitialMotion,
        observe: impl FnMut(u64) -> Option<(Vector2<f64>, Option<Patch>)>,
    ) {
        let samples: Vec<Imu> = self.dynamic_initializer.samples().copied().collect();
        let sensors = (self.camera.as_ref(), self.noise, &self.settings);
        let Some(tracking) = from_initialization(sensors, time, motion, &samples, observe) else { return };
        event!(info, stamp = %time, landmarks = tracking.tracks.len(), "initialised in motion");
        self.reset();
        let ids = tracking.tracks.iter().map(|track| track.id + 1);
        self.frontend.next_id = ids.fold(self.frontend.next_id, u64::max);
        let probation = time.plus_secs(self.settings.dynamic_initialization.probation_s);
        self.divergence = DivergenceMonitor::on_probation(probation);
        self.tracking = Some(tracking);
        self.last_aided = Some(time);
    }

    /// Time of the latest sample; before the first that of an image.
    fn now_or(&self, stamp: Stamp) -> Stamp {
        self.last_sample.map_or(stamp, |sample| sample.stamp)
    }

    /// Time of an image by the inertial sensor's clock, as far as that is known before the initialization.
    fn unsynchronized_time(&self, stamp: Stamp) -> Stamp {
        stamp.plus_secs(self.settings.calibration.time_offset_s)
    }

    fn state_stamp(&self) -> Option<Stamp> {
        self.tracking.as_ref().map(|tracking| tracking.estimator.buffer.state_stamp())
    }

    fn empty_report(&self) -> FrameReport {
        FrameReport::empty(self.status())
    }
}

const NO_SECOND_CAMERA: Error = Error::NoSuch { what: "camera", index: 1, count: 1 };

/// Refuses times before that of the state, or far ahead of the samples.
fn check_time(estimator: &Estimator, stamp: Stamp, what: &'static str) -> Result<(), Error> {
    let state_stamp = estimator.buffer.state_stamp();
    if stamp < state_stamp {
        return Err(Error::Late { what, stamp, now: state_stamp });
    }
    if stamp.secs_since(estimator.buffer.latest().stamp) > MAX_AHEAD {
        return Err(Error::OutOfRange { stamp, first: state_stamp, last: estimator.buffer.now() });
    }
    Ok(())
}
