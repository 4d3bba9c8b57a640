//! The odometry as its callers see it.

use std::sync::Arc;

use nalgebra::{DVector, Isometry3};

use crate::camera::model::{CameraModel, check_model};
use crate::error::{Error, invalid};
use crate::filter::calibration_error::CalibrationError;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::initializing::Initializing;
use crate::filter::measurements::measurement::Measurement;
use crate::filter::measurements::pose::BodyPose;
use crate::filter::point_observation::{PointObservation, PointPair};
use crate::filter::report::{Calibration, FrameReport, LandmarkEstimate, Status};
use crate::filter::running::Running;
use crate::filter::sensors::{Input, Sensors};
use crate::filter::settings::Settings;
use crate::filter::stationary::detector::StationaryDetector;
use crate::filter::stereo::stereo_camera::StereoCamera;
use crate::filter::stereo::stereo_points::{check_pairs, update_with_second_points};
use crate::format::calibration::{CameraCalibration, ImuCalibration};
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::samples::{ImageView, Imu, ImuNoise};
use crate::stamp::Stamp;
use crate::trace::{event, span};

/// What a calibration file knows of a camera's clock, s. The middle of an exposure is where its light is; two tenths of a millisecond
/// at 3 rad/s move all landmarks by a quarter of a pixel at once, and a filter that is sure of its clock takes that for motion.
const CLOCK_SIGMA_S: f64 = 1e-3;

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
    sensors: Sensors,
    state: State,
}

#[derive(Debug, Clone)]
enum State {
    Initializing(Box<Initializing>),
    Running(Box<Running>),
}

impl Vio {
    /// Refuses a camera, noise or settings that cannot be.
    pub fn new(camera: impl CameraModel + 'static, noise: ImuNoise, settings: Settings) -> Result<Self, Error> {
        let camera: Arc<dyn CameraModel> = Arc::new(camera);
        check_model(camera.as_ref())?;
        noise.check()?;
        settings.check()?;
        let frontend = ImageFrontend::new(camera.as_ref(), &settings.patches);
        let stationary = StationaryDetector::new(settings.stationary);
        let state = State::new(&settings);
        let (last_sample, stereo, was_stationary) = (None, None, false);
        let sensors = Sensors { camera, noise, settings, last_sample, frontend, stereo, stationary, was_stationary };
        Ok(Self { sensors, state })
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
        let mut mono = Self::new(first, noise, settings)?;
        if settings.calibration.row_time_s != 0.0 {
            let rule = "must be 0 with a second camera: rolling shutters are known of one camera alone";
            return Err(invalid("row_time_s", settings.calibration.row_time_s, rule));
        }
        let stereo = StereoCamera::new(mono.camera(), Arc::new(second), &settings.patches)?;
        mono.sensors.stereo = Some(stereo);
        Ok(mono)
    }

    /// From a calibration as Kalibr and EuRoC folders give it, of one camera or two: the lenses, the noise of the inertial sensor,
    /// and the time offset of the first camera (`timeshift_cam_imu`), which is added to
    /// [`CalibrationSettings::time_offset_s`](crate::filter::CalibrationSettings::time_offset_s), as the time of a row of its shutter
    /// (`line_delay`) is to [`row_time_s`](crate::filter::CalibrationSettings::row_time_s). The filter's body is the inertial sensor:
    /// where that is not the body of the calibration, the cameras are moved into its axes. The clock is taken as known to a millisecond, and
    /// estimated from there, unless
    /// [`time_offset_sigma_s`](crate::filter::CalibrationSettings::time_offset_sigma_s) says how well: 0, exactly.
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
        settings.calibration.time_offset_sigma_s.get_or_insert(CLOCK_SIGMA_S);
        settings.calibration.row_time_s += first.row_time_s;
        match second {
            Some(second) => Self::stereo(on_imu(first), on_imu(second), imu.noise, settings),
            None => Self::new(on_imu(first), imu.noise, settings),
        }
    }

    /// Initialises, or initialises again, from a given state. There must be an inertial sample, and the state must not be before it.
    pub fn initialize(&mut self, initial: &InitialState) -> Result<(), Error> {
        self.state = State::Running(Box::new(Running::from_state(initial, &self.sensors)?));
        Ok(())
    }

    /// The same from a state of the past, as a map or a motion capture gives it late: with the samples since then, of which the first one is
    /// at its time or before, and the last one the latest that the filter was given.
    pub fn initialize_past(&mut self, initial: &InitialState, samples: &[Imu]) -> Result<(), Error> {
        let latest = samples.last().map(|sample| sample.stamp);
        if let (Some(stamp), Some(now)) = (latest, self.sensors.last_sample.map(|sample| sample.stamp))
            && stamp != now
        {
            return Err(Error::Late { what: "last sample since the initial state", stamp, now });
        }
        self.state = State::Running(Box::new(Running::from_past_state(initial, samples, &self.sensors)?));
        Ok(())
    }

    /// How far away, m, and within which share of it, the camera sees things where the filter starts from here on:
    /// [`inverse_distance`](crate::filter::LandmarkSettings::inverse_distance) and `shared_sigma` of the settings.
    ///
    /// # Errors
    /// What is not positive.
    pub fn expect_distance(&mut self, distance: f64, share: f64) -> Result<(), Error> {
        let mut settings = self.sensors.settings;
        (settings.landmarks.inverse_distance, settings.landmarks.shared_sigma) = (1.0 / distance, share);
        settings.check()?;
        self.sensors.settings = settings;
        Ok(())
    }

    /// Drops the estimate. The filter tries to initialise itself from here on.
    pub fn reset(&mut self) {
        self.state = State::new(&self.sensors.settings);
    }

    /// From here on no landmark of the first camera lies where the mask, of the size of its images, is 0: propellers, legs, the robot
    /// itself.
    pub fn set_mask(&mut self, mask: &ImageView) -> Result<(), Error> {
        let mask = mask.checked(self.sensors.camera.image_size())?;
        self.sensors.frontend.detector.set_mask(&mask);
        Ok(())
    }

    /// Takes an inertial sample; stamps must increase.
    pub fn imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        if let Err(error) = sample.check_after(self.sensors.last_sample.as_ref()) {
            event!(warn, %error, "inertial sample refused");
            return Err(error);
        }
        self.sensors.last_sample = Some(*sample);
        self.sensors.stationary.imu(sample);
        match &mut self.state {
            State::Running(running) => running.tracking.imu(sample),
            State::Initializing(initializing) => initializing.imu(sample),
        }
        Ok(self.status())
    }

    /// Takes an image of the camera.
    ///
    /// `stamp` is the middle of the exposure by the camera's clock. The image must be of the camera's size.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        let image = image.checked(self.sensors.camera.image_size())?;
        if let Some(stereo) = &mut self.sensors.stereo {
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
        let first = first.checked(self.sensors.camera.image_size())?;
        let stereo = self.sensors.stereo.as_mut().ok_or(NO_SECOND_CAMERA)?;
        stereo.set_image(Some(&second.checked(stereo.rig.camera.image_size())?));
        self.process_image(stamp, &first)
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
        let now = self.sensors.now_or(stamp);
        let Sensors { stationary, settings, .. } = &mut self.sensors;
        stationary.points(now, points, settings.landmarks.pixel_sigma);
        self.step(stamp, Input::Points(points))
    }

    /// As [`points`](Self::points) with a second camera: the filter must have been made by [`stereo`](Self::stereo). All pixels of
    /// both images carry independent noise.
    pub fn point_pairs(&mut self, stamp: Stamp, pairs: &[PointPair]) -> Result<FrameReport, Error> {
        check_pairs(pairs)?;
        let stereo = self.sensors.stereo.as_mut().ok_or(NO_SECOND_CAMERA)?;
        // Taken out and put back, so that its memory is claimed once.
        let mut first = std::mem::take(&mut stereo.points);
        first.clear();
        first.extend(pairs.iter().map(|pair| pair.first));
        let report = self.points(stamp, &first);
        let Sensors { stereo: Some(stereo), settings, .. } = &mut self.sensors else { return report };
        stereo.points = first;
        let report = report?;
        if let State::Running(running) = &mut self.state {
            update_with_second_points(&mut running.tracking, (stamp, pairs), &stereo.rig, settings, &report);
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
        match &mut self.state {
            State::Running(running) => running.update(&self.sensors, stamp, measurement),
            State::Initializing(_) => Ok(false),
        }
    }

    /// Whether the estimate can be used.
    pub fn status(&self) -> Status {
        match &self.state {
            State::Initializing(initializing) => Status::Uninitialised(initializing.status),
            State::Running(running) => running.status(),
        }
    }

    /// The estimate at the time of the latest sample; `None` before the initialization.
    pub fn output(&self) -> Option<Odometry> {
        self.running().map(|running| running.tracking.estimator.odometry())
    }

    /// The calibration of camera and accelerometer at the last image; `None` before the initialization.
    pub fn calibration(&self) -> Option<Calibration> {
        self.running().map(Running::calibration)
    }

    /// Both cameras, if there are two.
    pub(crate) fn camera_pair(&self) -> Option<[Arc<dyn CameraModel>; 2]> {
        let second = &self.sensors.stereo.as_ref()?.rig.camera;
        Some([Arc::clone(&self.sensors.camera), Arc::clone(second)])
    }

    /// How far the calibration is from what was given; `None` before the initialization.
    pub(crate) fn calibration_error(&self) -> Option<CalibrationError> {
        self.running().map(|running| running.calibration_error(&self.sensors))
    }

    /// The calibration that is so far from what was given; `None` before the initialization.
    pub(crate) fn calibration_at(&self, error: &DVector<f64>) -> Option<Calibration> {
        self.running().map(|running| running.calibration_at(error, &self.sensors))
    }

    /// How much images and inertial samples have contradicted each other since the initialization, a sum over images.
    pub(crate) fn contradiction(&self) -> Option<f64> {
        Some(self.running()?.tracking.innovations.contradiction())
    }

    /// A filter that has not started, with other cameras of the same sizes.
    pub(crate) fn with_cameras(&self, cameras: &[CameraCalibration], settings: &Settings) -> Result<Self, Error> {
        let mut changed = self.with_settings(settings)?;
        let sensors = &mut changed.sensors;
        if let [first, others @ ..] = cameras {
            check_model(&first.camera)?;
            sensors.camera = Arc::new(first.camera);
            sensors.settings.calibration.time_offset_s = first.time_offset_s;
            sensors.settings.calibration.row_time_s = first.row_time_s;
            if let [second] = others {
                sensors.stereo = Some(StereoCamera::new(&first.camera, Arc::new(second.camera), &settings.patches)?);
            }
        }
        Ok(changed)
    }

    /// A filter of the first of two cameras that has not started.
    pub(crate) fn first_camera_alone(&self) -> Option<Self> {
        let mut alone = self.with_settings(self.settings()).ok()?;
        alone.sensors.stereo.take().map(|_| alone)
    }

    /// A filter of the same sensors that has not started, with other settings.
    pub(crate) fn with_settings(&self, settings: &Settings) -> Result<Self, Error> {
        settings.check()?;
        let mut sensors = self.sensors.clone();
        sensors.settings = *settings;
        Ok(Self { state: State::new(settings), sensors })
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.sensors.settings
    }

    /// Seconds to add to the camera's stamps, as they are known now.
    pub(crate) fn time_offset_s(&self) -> f64 {
        let nominal = self.sensors.settings.calibration.time_offset_s;
        self.running().map_or(nominal, |running| running.tracking.estimator.state.time_offset)
    }

    /// The landmarks that are followed, as they are estimated at the last image.
    pub fn landmarks(&self) -> impl Iterator<Item = LandmarkEstimate> + '_ {
        self.running().into_iter().flat_map(|running| running.landmarks(self.camera()))
    }

    /// The camera as it was given.
    pub fn camera(&self) -> &dyn CameraModel {
        self.sensors.camera.as_ref()
    }

    /// The second camera as it was given; refused where there is none.
    pub(crate) fn second_camera(&self) -> Result<&dyn CameraModel, Error> {
        self.sensors.stereo.as_ref().map(|stereo| stereo.rig.camera.as_ref()).ok_or(NO_SECOND_CAMERA)
    }

    fn running(&self) -> Option<&Running> {
        match &self.state {
            State::Running(running) => Some(running),
            State::Initializing(_) => None,
        }
    }

    /// An image, with that of the second camera already taken.
    fn process_image(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        span!("image");
        let now = self.sensors.now_or(stamp);
        let Sensors { frontend, stationary, settings, .. } = &mut self.sensors;
        frontend.set_image(image);
        stationary.image(now, frontend, &settings.patches);
        self.step(stamp, Input::Image)
    }

    /// A step of the state that the filter is in, and the change to the other.
    fn step(&mut self, stamp: Stamp, input: Input<'_>) -> Result<FrameReport, Error> {
        let stepped = match &mut self.state {
            State::Running(running) => running.step(&mut self.sensors, stamp, input)?,
            State::Initializing(initializing) => match initializing.step(&mut self.sensors, stamp, input)? {
                None => return Ok(FrameReport::empty(self.status())),
                Some((running, stepped)) => {
                    self.state = State::Running(Box::new(running));
                    stepped
                }
            },
        };
        if stepped.wrong_start {
            event!(warn, "start in motion taken back");
            self.reset();
        }
        Ok(FrameReport { status: self.status(), ..stepped.report })
    }
}

impl State {
    fn new(settings: &Settings) -> Self {
        Self::Initializing(Box::new(Initializing::new(settings.dynamic_initialization)))
    }
}

const NO_SECOND_CAMERA: Error = Error::NoSuch { what: "camera", index: 1, count: 1 };
