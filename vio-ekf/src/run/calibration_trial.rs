//! Whether a calibration that was found serves better than the one that was given: filters anew, over the images that follow.

use crate::filter::report::Status;
use crate::filter::vio::Vio;
use crate::format::calibration::CameraCalibration;
use crate::run::calibration_doubt::{CalibrationDoubt, CalibrationPart};
use crate::samples::{ImageView, Imu};
use crate::stamp::Stamp;

/// Images that each filter follows, and the fewest that are compared where a recording ends before.
const COMPARED: usize = 200;
const FEWEST: usize = 50;
/// What a part has to take off the contradiction, as a share of it, and the accelerometer besides, whose scale and axes every filter
/// finds by itself where it has to, unless it reads gravity too long or too short: ours.
const PART: f64 = 0.03;
const ACCELEROMETER: f64 = 0.07;

/// Filters that have not started when it begins.
///
/// What a filter finds that estimates all of a calibration at once may be wrong where the motion tells little, and it is surer of that
/// than it may be, because it has linearised at wrong values. A filter that takes it as given pays for it: its inertial samples and
/// images contradict each other more than those of the filter before.
#[derive(Debug, Clone)]
pub(super) struct CalibrationTrial {
    /// The first is as it was given.
    filters: Vec<Contender>,
    images: usize,
}

#[derive(Debug, Clone)]
struct Contender {
    doubt: Option<CalibrationDoubt>,
    vio: Vio,
    has_diverged: bool,
    /// Contradiction by image; `None` for those that it did not follow.
    contradictions: Vec<Option<f64>>,
}

impl CalibrationTrial {
    /// Images after which it ends in any case.
    pub(super) const MOST: usize = 400;

    /// `given` has not started. What cannot be put in place of what was given is left out.
    pub(super) fn new(given: &Vio, doubts: Vec<CalibrationDoubt>) -> Self {
        let found = doubts.into_iter().filter_map(|doubt| Some((corrected(given, &doubt)?, Some(doubt))));
        let all = std::iter::once((given.clone(), None)).chain(found);
        let contender = |(vio, doubt)| Contender { doubt, vio, has_diverged: false, contradictions: Vec::new() };
        Self { filters: all.map(contender).collect(), images: 0 }
    }

    /// What is tried.
    pub(super) fn doubts(&self) -> Vec<CalibrationDoubt> {
        self.filters.iter().filter_map(|contender| contender.doubt.clone()).collect()
    }

    pub(super) fn imu(&mut self, sample: &Imu) {
        for Contender { doubt, vio, .. } in &mut self.filters {
            let mut read = [*sample];
            if let Some(doubt) = doubt {
                doubt.correct_samples(&mut read);
            }
            // What is refused is told by the filter that is watched.
            let _ = vio.imu(&read[0]);
        }
    }

    /// The latest idea of the camera's clock.
    pub(super) fn time_offset_s(&self) -> f64 {
        self.filters.iter().map(|contender| contender.vio.time_offset_s()).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Takes the images of a time; whether enough has been seen.
    pub(super) fn images(&mut self, stamp: Stamp, first: &ImageView, second: Option<&ImageView>) -> bool {
        self.images += 1;
        for contender in &mut self.filters {
            contender.step(stamp, first, second);
        }
        let is_done = |contender: &Contender| contender.has_diverged || contender.followed() >= COMPARED;
        self.images >= Self::MOST || self.filters.iter().all(is_done)
    }

    /// What is left of the doubt; all of it where too little was seen, or nothing serves. A calibration with which a filter does not start,
    /// or not for long, where another does, is out. There gravity alone does not decide, as a biased accelerometer may not start in flight
    /// either, unless images doubt the accelerometer, too.
    pub(super) fn finish(&self) -> Option<CalibrationDoubt> {
        let most = self.filters.iter().map(Contender::followed).max().unwrap_or(0);
        let serves = |one: &&Contender| most >= FEWEST && !one.has_diverged && 2 * one.followed() > most;
        let bears_out = |one: &Contender| serves(&one) && (one.doubt.is_none() || one.doubts_accelerometer());
        let is_borne_out = self.filters.iter().any(|one| !one.by_gravity() && bears_out(one));
        let may_win = |one: &&Contender| serves(one) && (is_borne_out || !one.by_gravity());
        let running: Vec<&Contender> = self.filters.iter().filter(may_win).collect();
        let compared: Vec<usize> =
            (0..self.images).filter(|&k| running.iter().all(|one| one.contradictions[k].is_some())).collect();
        let sum = |one: &Contender| one.price() * compared.iter().filter_map(|&k| one.contradictions[k]).sum::<f64>();
        // Of equals the first, which is what was given.
        let best = running.into_iter().min_by(|a, b| sum(a).total_cmp(&sum(b)));
        best.or_else(|| self.filters.iter().skip(1).find(|one| !one.by_gravity()))?.doubt.clone()
    }
}

impl Contender {
    fn step(&mut self, stamp: Stamp, first: &ImageView, second: Option<&ImageView>) {
        let before = self.vio.contradiction();
        let given = match second {
            _ if self.has_diverged => return self.contradictions.push(None),
            Some(second) => self.vio.image_pair(stamp, first, second),
            None => self.vio.image(stamp, first),
        };
        let followed = given.ok().filter(|report| {
            self.has_diverged = matches!(report.status, Status::Diverged(_));
            report.used > 0 && !report.stationary
        });
        self.contradictions.push(followed.and_then(|_| Some(self.vio.contradiction()? - before?)));
    }

    /// Factor on the contradiction. What gravity says it says already.
    fn price(&self) -> f64 {
        let parts = self.doubt.as_ref().filter(|doubt| !doubt.by_gravity).map_or(0, |doubt| doubt.parts.len());
        let accelerometer = if parts > 0 && self.doubts_accelerometer() { ACCELEROMETER } else { 0.0 };
        1.0 + PART * parts as f64 + accelerometer
    }

    fn doubts_accelerometer(&self) -> bool {
        self.doubt.as_ref().is_some_and(|doubt| doubt.parts.contains(&CalibrationPart::Accelerometer))
    }

    fn by_gravity(&self) -> bool {
        self.doubt.as_ref().is_some_and(|doubt| doubt.by_gravity)
    }

    fn followed(&self) -> usize {
        self.contradictions.iter().flatten().count()
    }
}

/// A filter with what was found, which goes on to estimate it.
fn corrected(given: &Vio, doubt: &CalibrationDoubt) -> Option<Vio> {
    let settings = given.settings();
    let camera = |camera| CameraCalibration {
        camera,
        rate_hz: None,
        time_offset_s: settings.calibration.time_offset_s,
        row_time_s: settings.calibration.row_time_s,
    };
    let lenses = std::iter::once(given.camera()).chain(given.second_camera().ok());
    let mut cameras = lenses.map(|lens| lens.kalibr().map(camera)).collect::<Option<Vec<_>>>()?;
    doubt.correct(&mut cameras);
    given.with_cameras(&cameras, &doubt.freed(settings)).ok()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::camera::Camera;
    use crate::filter::report::Calibration;
    use crate::filter::settings::Settings;
    use crate::run::calibration_doubt::tests::{doubt, found as found_of};
    use crate::samples::ImuNoise;
    use crate::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};

    /// A flight along a wall, with sound samples.
    fn flight() -> Simulation {
        let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
        let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
        let scenario = Scenario { seed: 6, cameras, room, ..Scenario::default() };
        Simulation::new(painting_flight(6, 10.0).unwrap(), scenario).unwrap()
    }

    /// Gives a flight to trials, whose sensors read a force as `read` says.
    fn follow<const N: usize>(trials: &mut [CalibrationTrial; N], read: [&dyn Fn(Vector3<f64>) -> Vector3<f64>; N]) {
        let simulation = flight();
        let mut samples = simulation.imu(0).unwrap().samples.into_iter().peekable();
        for index in 0..simulation.frame_count(0) {
            let Some(frame) = simulation.frame(0, index).unwrap() else { continue };
            while let Some(sample) = samples.next_if(|sample| sample.stamp <= frame.stamp) {
                for (trial, read) in trials.iter_mut().zip(&read) {
                    trial.imu(&Imu { accel: read(sample.accel), ..sample });
                }
            }
            for trial in trials.iter_mut() {
                trial.images(frame.stamp, &frame.view(), None);
            }
        }
    }

    fn sums(trial: &CalibrationTrial) -> Vec<f64> {
        trial.filters.iter().map(|one| one.contradictions.iter().flatten().sum()).collect()
    }

    fn vio(camera: Camera) -> Vio {
        Vio::new(camera, ImuNoise::default(), Settings::default()).unwrap()
    }

    #[test]
    fn what_serves_worse_is_dropped_and_what_serves_better_stays() {
        let sound = camera_ahead();
        let wrong = Camera { fx: 1.02 * sound.fx, fy: 1.02 * sound.fy, ..sound };
        let mut trials = [(sound, wrong), (wrong, sound)].map(|(given, found)| {
            let doubts = vec![doubt(&given, &found_of(found), CalibrationPart::FocalLength)];
            CalibrationTrial::new(&vio(given), doubts)
        });
        follow(&mut trials, [&|force| force; 2]);
        let [dropped, kept] = trials.each_ref().map(CalibrationTrial::finish);
        assert_eq!(dropped, None, "{:?}", sums(&trials[0]));
        assert!(kept.is_some(), "{:?}", sums(&trials[1]));
    }

    /// Gravity is as long to a sensor out of scale as to a biased one: how it moves tells which of them it is.
    #[test]
    fn a_scale_by_gravity_stays_where_the_accelerometer_is_out_of_scale() {
        let given = camera_ahead();
        let by_gravity = |scale: f64| {
            let found = Calibration { accel_matrix: Matrix3::identity() * scale, ..found_of(given) };
            let doubt = doubt(&given, &found, CalibrationPart::Accelerometer);
            CalibrationTrial::new(&vio(given), vec![CalibrationDoubt { by_gravity: true, ..doubt }])
        };
        let bias = 0.03 * 9.81 * Vector3::z();
        let mut trials = [by_gravity(1.0 / 1.03), by_gravity(1.0 / 1.03)];
        follow(&mut trials, [&|force| 1.03 * force, &|force| force + bias]);
        let [scaled, biased] = trials.each_ref().map(CalibrationTrial::finish);
        assert!(scaled.is_some(), "{:?}", sums(&trials[0]));
        assert_eq!(biased, None, "{:?}", sums(&trials[1]));
        // Beside a filter that did not start it says nothing, but images do.
        let [mut trial, _] = trials;
        trial.filters[0].contradictions.fill(None);
        assert_eq!(trial.finish(), None);
        trial.filters[1].doubt.as_mut().unwrap().by_gravity = false;
        assert!(trial.finish().is_some());
    }
}
