//! The filter after its initialization: one image, or set of points, as the steps of the algorithm.

use nalgebra::{DVector, Unit};

use crate::camera::model::CameraModel;
use crate::error::Error;
use crate::filter::calibration_error::{CalibrationError, calibration_of, given_calibration};
use crate::filter::divergence_monitor::DivergenceMonitor;
use crate::filter::estimator::Estimator;
use crate::filter::image_tracking::{
    align_and_update, detect_landmarks, drop_landmarks, drop_masked, update_templates,
};
use crate::filter::innovation_adaptation::BeforeImage;
use crate::filter::measurements::measurement::Measurement;
use crate::filter::measurements::stationary::stationary_update;
use crate::filter::measurements::update::gated_update;
use crate::filter::point_observation::PointObservation;
use crate::filter::point_tracking::{add_points, drop_points, update_with_points};
use crate::filter::report::{Calibration, FrameReport, LandmarkEstimate, Status};
use crate::filter::sensors::{Input, Sensors};
use crate::filter::settings::Settings;
use crate::filter::stationary::zero_velocity::{inflate_undetected_motion, zero_velocity_propagate};
use crate::filter::tracking_state::TrackingState;
use crate::inertial::initial_state::InitialState;
use crate::samples::Imu;
use crate::stamp::Stamp;
use crate::trace::{event, span};

/// A measurement this much ahead of the inertial samples, in seconds, is waiting for data that does not come.
const MAX_AHEAD: f64 = 0.1;
/// Longest time without a landmark that is followed, s, before the estimate is called dead reckoning though no image says so.
const MAX_UNAIDED: f64 = 0.5;

/// Estimator and landmarks, and whether they can be relied on.
#[derive(Debug, Clone)]
pub(crate) struct Running {
    pub(crate) tracking: TrackingState,
    divergence: DivergenceMonitor,
    /// When an image last followed landmarks, or saw the body at rest.
    last_aided: Option<Stamp>,
}

/// What a step did.
pub(crate) struct Stepped {
    pub(crate) report: FrameReport,
    /// Whether the initialization in motion turned out to have been wrong: then the filter must be initialised anew.
    pub(crate) wrong_start: bool,
}

impl Running {
    /// From a given state.
    pub(crate) fn from_state(initial: &InitialState, sensors: &Sensors) -> Result<Self, Error> {
        Self::from_past_state(initial, sensors.last_sample.as_slice(), sensors)
    }

    /// From a given state, of whose time or earlier the first sample is, and the samples since.
    pub(crate) fn from_past_state(initial: &InitialState, samples: &[Imu], sensors: &Sensors) -> Result<Self, Error> {
        let Some((&sample, since)) = samples.split_first() else {
            return Err(Error::TooFew { what: "inertial samples before the initialization", got: 0, need: 1 });
        };
        initial.check(sample.stamp)?;
        event!(info, stamp = %initial.stamp, "initialised");
        let settings = &sensors.settings;
        let estimator = Estimator::new(sensors.cameras(), sensors.noise, settings, initial, sample);
        let mut tracking = TrackingState::new(estimator, settings.landmarks.max_count, &settings.imu);
        for (sample, before) in since.iter().zip(samples) {
            sample.check_after(Some(before))?;
            tracking.imu(sample);
        }
        Ok(Self { tracking, divergence: DivergenceMonitor::default(), last_aided: Some(initial.stamp) })
    }

    /// From an initialization in motion at a time, which may turn out to have been wrong until another.
    pub(crate) fn on_probation(tracking: TrackingState, time: Stamp, until: Stamp) -> Self {
        Self { tracking, divergence: DivergenceMonitor::on_probation(until), last_aided: Some(time) }
    }

    /// The filter's algorithm for one image, or set of points.
    pub(crate) fn step(&mut self, sensors: &mut Sensors, stamp: Stamp, input: Input<'_>) -> Result<Stepped, Error> {
        let stationary = sensors.stationary.is_stationary(sensors.now_or(stamp));
        let mut report = FrameReport { stationary, ..self.empty_report() };
        let before = self.tracking.estimator.buffer.state_stamp();

        // Preintegrate and propagate, without motion if the body is stationary.
        let Some(lost) = self.propagate_to_image(sensors, stamp, stationary)? else {
            return Ok(Stepped { report, wrong_start: false });
        };
        report.removed = lost;
        let elapsed = self.tracking.estimator.buffer.state_stamp().secs_since(before);
        match input {
            Input::Image => self.use_image(sensors, elapsed, &mut report),
            Input::Points(points) => self.use_points(sensors, points, &mut report),
        }
        Ok(self.finish_step(report, &sensors.settings))
    }

    /// Aligns patches and updates, landmark by landmark; then manages landmarks.
    fn use_image(&mut self, sensors: &mut Sensors, elapsed: f64, report: &mut FrameReport) {
        let tracking = &mut self.tracking;
        let Sensors { frontend, stereo, camera, settings, .. } = sensors;
        let given = camera.as_ref();
        let lens = tracking.estimator.state.lens;
        let camera = lens.as_ref().map_or(given, |lens| lens);
        if !report.stationary {
            tracking.drift_templates(camera, &settings.patches, elapsed);
            if frontend.detector.has_mask() {
                drop_masked(tracking, &frontend.detector, camera, report);
            }
            let before = BeforeImage::new(&tracking.estimator);
            align_and_update(tracking, &frontend.pyramid, camera, settings, report);
            let lens = tracking.estimator.state.lens;
            let camera = lens.as_ref().map_or(given, |lens| lens);
            drop_landmarks(tracking, settings, report);
            update_templates(tracking, &frontend.pyramid, camera, settings);
            if let Some(stereo) = stereo {
                stereo.update_distances(&mut tracking.estimator, &frontend.pyramid, camera, settings);
            }
            if report.used > 0 {
                tracking.adapt_imu(&before, &settings.imu);
            }
        }
        let enough = settings.patches.start_detection_ratio * settings.landmarks.max_count as f64;
        if (tracking.tracks.len() as f64) < enough {
            let lens = tracking.estimator.state.lens;
            let camera = lens.as_ref().map_or(given, |lens| lens);
            report.added = detect_landmarks(tracking, frontend, stereo.as_ref(), camera, settings);
        }
    }

    fn use_points(&mut self, sensors: &Sensors, points: &[PointObservation], report: &mut FrameReport) {
        let (tracking, settings) = (&mut self.tracking, &sensors.settings);
        let lens = tracking.estimator.state.lens;
        let camera = lens.as_ref().map_or(sensors.camera.as_ref(), |lens| lens);
        let before = BeforeImage::new(&tracking.estimator);
        update_with_points(tracking, points, camera, settings, report);
        if report.used > 0 {
            tracking.select_accel_matrix(&before, &settings.imu);
        }
        drop_points(tracking, settings, report);
        report.added = add_points(tracking, points, camera, settings);
    }

    /// A measurement of any other sensor, at a time by the inertial sensor's clock; whether it was used.
    pub(crate) fn update<const M: usize, const C: usize>(
        &mut self,
        sensors: &Sensors,
        stamp: Stamp,
        measurement: &impl Measurement<M, C>,
    ) -> Result<bool, Error> {
        let Self { tracking, divergence, last_aided } = self;
        let (rows, count) = (measurement.rows(), tracking.estimator.covariance.size());
        if let Some(&row) = rows.iter().find(|row| **row >= count) {
            return Err(Error::NoSuch { what: "row of the error state", index: row, count });
        }
        check_time(&tracking.estimator, stamp, measurement.name())?;
        let before = tracking.estimator.buffer.state_stamp();
        if stamp > before {
            if sensors.was_stationary && sensors.stationary.is_stationary(tracking.estimator.buffer.now()) {
                zero_velocity_propagate(&mut tracking.estimator, stamp, &sensors.settings.stationary);
            } else {
                tracking.propagate_to(stamp);
            }
            // The drift of templates since the last image is counted from here on at the next one.
            if tracking.tracks.iter().any(|track| track.patch.is_some()) {
                let elapsed = tracking.estimator.buffer.state_stamp().secs_since(before);
                tracking.drift_templates(sensors.camera.as_ref(), &sensors.settings.patches, elapsed);
            }
        }
        let used = gated_update(&mut tracking.estimator, measurement);
        if used {
            *last_aided = Some(tracking.estimator.buffer.state_stamp());
        }
        divergence.check_state(&tracking.estimator, &sensors.settings.divergence);
        tracking.estimator.update_prediction();
        Ok(used)
    }

    /// Whether the estimate can be used.
    pub(crate) fn status(&self) -> Status {
        if let Some(cause) = self.divergence.cause() {
            return Status::Diverged(cause);
        }
        let now = self.tracking.estimator.buffer.now();
        let aided = |last: Stamp| now.secs_since(last) <= MAX_UNAIDED;
        if self.last_aided.is_some_and(aided) { Status::Tracking } else { Status::DeadReckoning }
    }

    /// The calibration of camera and accelerometer at the last image.
    pub(crate) fn calibration(&self) -> Calibration {
        let Estimator { state, covariance, .. } = &self.tracking.estimator;
        calibration_of(state, covariance)
    }

    /// How far the calibration is from what was given.
    pub(crate) fn calibration_error(&self, sensors: &Sensors) -> CalibrationError {
        CalibrationError::new(&self.tracking.estimator, sensors.cameras(), &sensors.settings)
    }

    /// The calibration that is so far from what was given, with the deviations of the estimate.
    pub(crate) fn calibration_at(&self, error: &DVector<f64>, sensors: &Sensors) -> Calibration {
        let Estimator { state, covariance, .. } = &self.tracking.estimator;
        let mut state = given_calibration(state, sensors.cameras(), &sensors.settings);
        state.correct_head(error.as_slice());
        calibration_of(&state, covariance)
    }

    /// The landmarks that are followed, as they are estimated at the last image.
    pub(crate) fn landmarks<'a>(&'a self, camera: &'a dyn CameraModel) -> impl Iterator<Item = LandmarkEstimate> + 'a {
        let TrackingState { estimator, tracks, .. } = &self.tracking;
        tracks.iter().enumerate().map(move |(slot, track)| {
            let landmark = &estimator.state.landmarks[slot];
            let bearing_in_camera = landmark.bearing.direction();
            LandmarkEstimate {
                id: track.id,
                bearing_in_camera: Unit::new_unchecked(bearing_in_camera),
                pixel: estimator.state.lens.as_ref().map_or(camera, |lens| lens).project(&bearing_in_camera),
                inverse_distance: landmark.inverse_distance.value,
                inverse_distance_sigma: estimator.covariance.variance(estimator.state.landmark_row(slot) + 2).sqrt(),
                failures: track.failures,
            }
        })
    }

    pub(crate) fn empty_report(&self) -> FrameReport {
        FrameReport::empty(self.status())
    }

    /// Propagates to the time of an image. `None` if the filter was initialised after the image; otherwise the number of landmarks
    /// lost on the way.
    fn propagate_to_image(
        &mut self,
        sensors: &mut Sensors,
        stamp: Stamp,
        stationary: bool,
    ) -> Result<Option<usize>, Error> {
        let tracking = &mut self.tracking;
        let calibration = &sensors.settings.calibration;
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
        let was_stationary = std::mem::replace(&mut sensors.was_stationary, stationary);
        if !stationary {
            return Ok(Some(tracking.propagate_to(time)));
        }
        tracking.rested = true;
        let (settings, angle) = (&sensors.settings, sensors.undetected_angle());
        zero_velocity_propagate(&mut tracking.estimator, time, &settings.stationary);
        if !was_stationary {
            inflate_undetected_motion(&mut tracking.estimator, angle);
        }
        if let Some(mean) = sensors.stationary.take_certain_mean(time) {
            stationary_update(&mut tracking.estimator, &mean, angle, settings);
        }
        Ok(Some(0))
    }

    /// The end of every step: the divergence test, and the prediction from the image until now.
    pub(crate) fn finish_step(&mut self, mut report: FrameReport, settings: &Settings) -> Stepped {
        let Self { tracking, divergence, last_aided } = self;
        let wrong_start = divergence.check_image(&tracking.estimator, &settings.divergence, &report);
        report.consecutive_outliers = divergence.consecutive_outliers();
        tracking.estimator.update_prediction();
        // New landmarks tell nothing yet, unless there are no others: then they are the first.
        let first = report.added > 0 && report.added == tracking.tracks.len();
        let aided = report.used > 0 || report.stationary || first;
        // Not the time of the state: at rest that stays behind.
        *last_aided = aided.then(|| tracking.estimator.buffer.now());
        event!(
            debug,
            used = report.used,
            rejected = report.rejected,
            removed = report.removed,
            added = report.added,
            "image done"
        );
        report.status = self.status();
        Stepped { report, wrong_start }
    }
}

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
