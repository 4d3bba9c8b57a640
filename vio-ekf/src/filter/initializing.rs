//! The filter before its initialization: at rest, or in motion.

use std::sync::Arc;

use nalgebra::{Vector2, Vector3};

use crate::error::Error;
use crate::filter::frontend::corner_detector::DetectionCriteria;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::frontend::klt_tracker::KltTracker;
use crate::filter::frontend::patch::Patch;
use crate::filter::image_tracking::detect_landmarks;
use crate::filter::initialization::dynamic::result::InitialMotion;
use crate::filter::initialization::dynamic_initializer::DynamicInitializer;
use crate::filter::initialization::from_initialization::from_initialization;
use crate::filter::initialization::static_initializer;
use crate::filter::measurements::stationary::stationary_update;
use crate::filter::point_observation::PointObservation;
use crate::filter::point_tracking::add_points;
use crate::filter::report::{FrameReport, InitializationStatus};
use crate::filter::running::{Running, Stepped};
use crate::filter::sensors::{Input, Sensors};
use crate::filter::settings::DynamicInitializationSettings;
use crate::filter::state::rolling_shutter::RollingShutter;
use crate::lie::so3;
use crate::samples::Imu;
use crate::stamp::Stamp;
use crate::trace::event;

/// Points without which nothing can be initialised.
const MIN_FEATURES: usize = 5;

/// What is gathered until the filter can be initialised.
#[derive(Debug, Clone)]
pub(crate) struct Initializing {
    dynamic_initializer: DynamicInitializer,
    klt_tracker: KltTracker,
    /// What is missing.
    pub(crate) status: InitializationStatus,
}

impl Initializing {
    pub(crate) fn new(settings: DynamicInitializationSettings) -> Self {
        Self {
            dynamic_initializer: DynamicInitializer::new(settings),
            klt_tracker: KltTracker::default(),
            status: InitializationStatus::WaitingForSteadyImu,
        }
    }

    /// Takes an inertial sample.
    pub(crate) fn imu(&mut self, sample: &Imu) {
        self.dynamic_initializer.imu(sample);
    }

    /// Tries to initialise, at rest or in motion, with an image or points. The image that the initialization is made with has the
    /// first landmarks.
    pub(crate) fn step(
        &mut self,
        sensors: &mut Sensors,
        stamp: Stamp,
        input: Input<'_>,
    ) -> Result<Option<(Running, Stepped)>, Error> {
        let mut started = self.start_at_rest(sensors)?;
        let dynamic = started.is_none() && sensors.settings.dynamic_initialization.enabled;
        match input {
            Input::Image => {
                if dynamic {
                    started = self.start_with_image(sensors, stamp);
                    self.count_features(self.klt_tracker.observations().count());
                }
                let Some(mut running) = started else { return Ok(None) };
                let Sensors { frontend, stereo, camera, settings, .. } = sensors;
                let added =
                    detect_landmarks(&mut running.tracking, frontend, stereo.as_ref(), camera.as_ref(), settings);
                let stepped = running.finish_step(FrameReport { added, ..running.empty_report() }, settings);
                Ok(Some((running, stepped)))
            }
            Input::Points(points) => {
                if let Some(mut running) = started {
                    let added = add_points(&mut running.tracking, points, sensors.camera.as_ref(), &sensors.settings);
                    let report = FrameReport { added, ..running.empty_report() };
                    let stepped = running.finish_step(report, &sensors.settings);
                    return Ok(Some((running, stepped)));
                }
                if dynamic {
                    started = self.start_with_points(sensors, stamp, points);
                }
                self.count_features(points.len());
                Ok(started.map(|running| {
                    let report = FrameReport { added: running.tracking.tracks.len(), ..running.empty_report() };
                    (running, Stepped { report, wrong_start: false })
                }))
            }
        }
    }

    /// Too few points keep every initialization waiting, unless something else is wrong already.
    fn count_features(&mut self, count: usize) {
        if count < MIN_FEATURES && self.status != InitializationStatus::GravityMismatch {
            self.status = InitializationStatus::WaitingForFeatures;
        }
    }

    /// From the means of a stationary period.
    fn start_at_rest(&mut self, sensors: &mut Sensors) -> Result<Option<Running>, Error> {
        let Some(sample) = sensors.last_sample else { return Ok(None) };
        self.status = static_initializer::status(&sensors.stationary, sample.stamp, &sensors.settings);
        if self.status != InitializationStatus::WaitingForStationaryImages {
            return Ok(None);
        }
        let found = static_initializer::initial_state(
            &mut sensors.stationary,
            sample.stamp,
            sensors.camera.as_ref(),
            &sensors.settings,
        );
        let Some((initial, mean)) = found else { return Ok(None) };
        let mut running = Running::from_state(&initial, sensors)?;
        running.tracking.rested = true;
        let angle = sensors.undetected_angle();
        stationary_update(&mut running.tracking.estimator, &mean, angle, &sensors.settings);
        Ok(Some(running))
    }

    /// Tracks points into the current image, and initialises if they tell the motion.
    fn start_with_image(&mut self, sensors: &mut Sensors, stamp: Stamp) -> Option<Running> {
        let time = unsynchronized_time(sensors, stamp);
        let camera = Arc::clone(&sensors.camera);
        let settings = &sensors.settings;
        let ImageFrontend { pyramid, detector, .. } = &mut sensors.frontend;
        let rotation = self.dynamic_initializer.rotation_since_image(time);
        let criteria = DetectionCriteria::from(&settings.patches);
        self.klt_tracker.track(rotation, pyramid, (detector, &criteria), camera.as_ref());
        let shutter = RollingShutter::new(camera.as_ref(), settings.calibration.row_time_s);
        let turn =
            camera.body_from_camera().rotation.inverse() * sensors.last_sample.map_or(Vector3::zeros(), |s| s.gyro);
        // Each back to the time of the stamp, as far as the gyroscope tells.
        let observed = self.klt_tracker.observations().map(|(id, direction)| {
            match self.klt_tracker.pixel(id).map(|pixel| shutter.delay(&pixel)) {
                Some(delay) if delay != 0.0 => (id, so3::exp(&(turn * delay)) * direction),
                _ => (id, direction),
            }
        });
        let motion = self.dynamic_initializer.image(time, observed, camera.as_ref(), (&sensors.noise, settings))?;
        let (tracker, pyramid) = (&self.klt_tracker, sensors.frontend.pyramid.clone());
        self.start_in_motion(sensors, time, &motion, |id| {
            let pixel = tracker.pixel(id)?;
            Some((pixel, Some(Patch::extract(&pyramid, &pixel)?)))
        })
    }

    /// The same with points.
    fn start_with_points(
        &mut self,
        sensors: &mut Sensors,
        stamp: Stamp,
        points: &[PointObservation],
    ) -> Option<Running> {
        let (time, camera) = (unsynchronized_time(sensors, stamp), Arc::clone(&sensors.camera));
        let observed = points.iter().filter_map(|p| Some((p.id, camera.bearing(&p.pixel)?.into_inner())));
        let motion =
            self.dynamic_initializer.image(time, observed, camera.as_ref(), (&sensors.noise, &sensors.settings))?;
        let pixel = |id| points.iter().find(|p| p.id == id).map(|p| (p.pixel, None));
        self.start_in_motion(sensors, time, &motion, pixel)
    }

    /// From the motion at the time of an image. `observe` gives the pixel of a point, by its id, in that image, and its patch.
    fn start_in_motion(
        &self,
        sensors: &mut Sensors,
        time: Stamp,
        motion: &InitialMotion,
        observe: impl FnMut(u64) -> Option<(Vector2<f64>, Option<Patch>)>,
    ) -> Option<Running> {
        let samples: Vec<Imu> = self.dynamic_initializer.samples().copied().collect();
        let known = (sensors.cameras(), sensors.noise, &sensors.settings);
        let tracking = from_initialization(known, time, motion, &samples, observe)?;
        event!(info, stamp = %time, landmarks = tracking.tracks.len(), "initialised in motion");
        let ids = tracking.tracks.iter().map(|track| track.id + 1);
        sensors.frontend.next_id = ids.fold(sensors.frontend.next_id, u64::max);
        let probation = time.plus_secs(sensors.settings.dynamic_initialization.probation_s);
        Some(Running::on_probation(tracking, time, probation))
    }
}

/// Time of an image by the inertial sensor's clock, as far as that is known before the initialization.
fn unsynchronized_time(sensors: &Sensors, stamp: Stamp) -> Stamp {
    stamp.plus_secs(sensors.settings.calibration.time_offset_s)
}
