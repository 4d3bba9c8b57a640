//! A second filter beside the first that knows the calibration roughly only, and tells whether it is what was given.

#![allow(clippy::option_option, reason = "nothing yet, nothing found, or a doubt")]

use std::collections::VecDeque;

use nalgebra::{DVector, Matrix3};

use crate::filter::calibration_error::CalibrationError;
use crate::filter::report::{Calibration, Status};
use crate::filter::settings::{CalibrationSettings, Settings};
use crate::filter::state::error_state;
use crate::filter::vio::Vio;
use crate::imu_check::gravity_scale;
use crate::run::calibration_doubt::{CalibrationDoubt, CalibrationPart, describe};
use crate::run::calibration_evidence::{choices, conditioned, contradicted};
use crate::run::calibration_trial::CalibrationTrial;
use crate::run::pair_order::PairOrder;
use crate::samples::{ImageView, Imu};
use crate::stamp::Stamp;

/// Images with landmarks in motion after which it speaks.
const IMAGES: usize = 400;
/// With fewer it does not, if a run ends before.
const FEWEST: usize = 100;
/// Growth of the logarithm of the evidence that frees a part: ours.
const ENOUGH: f64 = 10.0;
/// The deviations of the posterior are taken to be so many times as large: a filter is never as sure as it says. The floors below are not:
/// they were measured.
const CAUTION: f64 = 2.0;
/// Samples that tell the length of gravity: 100 s at 200 Hz.
const MOST_SAMPLES: usize = 20_000;
/// Images that wait at most: 0.4 s at 20 Hz.
const MOST_WAITING: usize = 8;

use CalibrationPart as Part;

/// Rows of each part, and how well the best calibrations agree with each other in it: less is not doubted.
const PARTS: [(Part, usize, &[f64]); 13] = [
    (Part::CameraAttitude, error_state::CAMERA_ATTITUDE, &[1e-3; 3]),
    (Part::CameraPosition, error_state::CAMERA_POSITION, &[5e-3; 3]),
    (Part::Clock, error_state::TIME_OFFSET, &[5e-4]),
    (Part::Accelerometer, error_state::ACCEL_MATRIX, &[2e-3; error_state::MATRIX_SIZE]),
    (Part::Gyroscope, error_state::GYRO_SCALE, &[2e-3; 3]),
    (Part::FocalLength, error_state::INTRINSICS, &[0.4; 2]),
    (Part::PrincipalPoint, error_state::INTRINSICS + 2, &[0.4; 2]),
    (Part::Distortion, error_state::INTRINSICS + 4, &[2e-3; 2]),
    (Part::RollingShutter, error_state::ROW_TIME, &[2e-6]),
    (Part::SecondFocalLength, error_state::SECOND_INTRINSICS, &[0.4; 2]),
    (Part::SecondPrincipalPoint, error_state::SECOND_INTRINSICS + 2, &[0.4; 2]),
    (Part::SecondDistortion, error_state::SECOND_INTRINSICS + 4, &[2e-3; 2]),
    (Part::StereoPose, error_state::SECOND_ATTITUDE, &[1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]),
];

/// A part, its first row, and the floors of its rows.
type Rows = (Part, usize, &'static [f64]);

/// What is wrong with both cameras of a pair as easily as with one.
const BOTH: [[Part; 2]; 3] = [
    [Part::FocalLength, Part::SecondFocalLength],
    [Part::PrincipalPoint, Part::SecondPrincipalPoint],
    [Part::Distortion, Part::SecondDistortion],
];

/// Filters that know the calibration roughly, the most probable first: all of it may be a little wrong, or the lenses much, or place and
/// clock of the camera. A filter that is to learn much of everything at once loses its way.
pub(super) fn hypotheses(vio: &Vio) -> Vec<Vio> {
    let given = vio.settings();
    let all = given.with_rough_calibration();
    let (lenses, place) = (all.calibration.of_lenses_only(), all.calibration.of_place_only());
    let rough = [all, Settings { calibration: lenses, ..*given }, Settings { calibration: place, ..*given }];
    rough.iter().filter_map(|settings| vio.with_settings(settings).ok()).collect()
}

/// The same, and then those of the first of two cameras: two lose their way earlier.
fn hypotheses_of_both(vio: &Vio) -> Vec<Vio> {
    let alone = vio.first_camera_alone();
    std::iter::once(vio).chain(&alone).flat_map(hypotheses).collect()
}

/// The second filter.
#[derive(Debug, Clone)]
pub(super) struct CalibrationWatch {
    /// The filter before its start, as it was given.
    given: Vio,
    stage: Stage,
    order: Option<PairOrder>,
    /// What is tried after a divergence, the last first.
    remaining: Vec<Vio>,
    images: usize,
    /// The latest, in order.
    samples: VecDeque<Imu>,
    /// Images for which there are no samples yet.
    waiting: VecDeque<(Stamp, Pixels, Option<Pixels>)>,
}

/// What it does.
#[allow(clippy::large_enum_variant, reason = "there is one of them")]
#[derive(Debug, Clone)]
enum Stage {
    /// Finds the calibration.
    Search(Vio),
    /// Has found one that is not what was given, and tries it.
    Trial(CalibrationTrial),
}

/// Columns, rows, and the grey values.
type Pixels = (usize, usize, Vec<u8>);

fn view((width, height, data): &Pixels) -> Option<ImageView<'_>> {
    ImageView::new(*width, *height, data).ok()
}

impl CalibrationWatch {
    /// Beside a filter; `None` where that estimates its calibration itself, or has no lens that can be estimated.
    pub(super) fn beside(vio: &Vio) -> Option<Self> {
        let given = vio.settings();
        vio.camera().kalibr()?;
        let sure = CalibrationSettings {
            time_offset_s: given.calibration.time_offset_s,
            // It is estimated where nothing else is.
            time_offset_sigma_s: given.calibration.time_offset_sigma_s,
            row_time_s: given.calibration.row_time_s,
            ..CalibrationSettings::default()
        };
        if given.calibration != sure {
            return None;
        }
        let order = vio.camera_pair().map(|cameras| PairOrder::new(cameras, given));
        let mut remaining = hypotheses_of_both(vio);
        remaining.reverse();
        let stage = Stage::Search(remaining.pop()?);
        let given = vio.with_settings(given).ok()?;
        Some(Self { given, stage, order, remaining, images: 0, samples: VecDeque::new(), waiting: VecDeque::new() })
    }

    pub(super) fn imu(&mut self, sample: &Imu) {
        match &mut self.stage {
            // What is refused is told by the first filter.
            Stage::Search(vio) => drop(vio.imu(sample)),
            Stage::Trial(trial) => trial.imu(sample),
        }
        if self.samples.len() == MOST_SAMPLES {
            self.samples.pop_front();
        }
        self.samples.push_back(*sample);
    }

    /// Stamp of the latest sample.
    pub(super) fn latest(&self) -> Option<Stamp> {
        self.samples.back().map(|sample| sample.stamp)
    }

    /// Takes the images of a time; what it finds once it has seen enough, after which it is not needed any more. By its own idea of the
    /// camera's clock they may be early: then they wait for the samples.
    pub(super) fn images(
        &mut self,
        stamp: Stamp,
        first: &ImageView,
        second: Option<&ImageView>,
    ) -> Option<Option<CalibrationDoubt>> {
        let owned = |image: &ImageView| (image.width, image.height, image.data.to_vec());
        self.waiting.push_back((stamp, owned(first), second.map(owned)));
        while let Some((stamp, ..)) = self.waiting.front() {
            let time = stamp.plus_secs(self.time_offset_s());
            if self.latest().is_none_or(|latest| latest < time) && self.waiting.len() < MOST_WAITING {
                break;
            }
            let Some((stamp, first, second)) = self.waiting.pop_front() else { break };
            let Some(first) = view(&first) else { continue };
            let second = second.as_ref().and_then(view);
            if let Some(found) = self.due_images(stamp, &first, second.as_ref()) {
                return Some(found);
            }
        }
        None
    }

    fn due_images(
        &mut self,
        stamp: Stamp,
        first: &ImageView,
        second: Option<&ImageView>,
    ) -> Option<Option<CalibrationDoubt>> {
        if let (Some(order), Some(second)) = (&mut self.order, second)
            && let Some([given, exchanged]) = order.pair(first, second)
        {
            let words = format!(
                "the images of the two cameras are exchanged: of the corners {given} are found in the other image as they are given, \
                 {exchanged} the other way round"
            );
            let (parts, given_pose) = (vec![Part::CameraOrder], self.given.camera().body_from_camera());
            let (clock_change_s, row_time_change_s) = (0.0, 0.0);
            return Some(Some(CalibrationDoubt {
                parts,
                found: None,
                by_gravity: false,
                given_pose,
                clock_change_s,
                row_time_change_s,
                words,
            }));
        }
        let vio = match &mut self.stage {
            Stage::Search(vio) => vio,
            Stage::Trial(trial) => return trial.images(stamp, first, second).then(|| trial.finish()),
        };
        let given = match second {
            Some(second) if vio.second_camera().is_ok() => vio.image_pair(stamp, first, second),
            _ => vio.image(stamp, first),
        };
        // What it cannot take is told by the first filter.
        let report = given.ok()?;
        match report.status {
            Status::Diverged(_) => {
                // It must leave the others, too, while it learns.
                let Some(next) = self.remaining.pop() else { return Some(None) };
                (self.stage, self.images) = (Stage::Search(next), 0);
            }
            Status::Uninitialised(_) => self.images = 0,
            _ => self.images += usize::from(report.used > 0 && !report.stationary),
        }
        if self.images < IMAGES {
            return None;
        }
        let mut doubts = self.doubts().unwrap_or_default();
        doubts.extend(self.by_gravity());
        if doubts.is_empty() {
            return Some(None);
        }
        self.try_out(doubts);
        None
    }

    /// The offset of the camera's clock as far as it is known now.
    pub(super) fn time_offset_s(&self) -> f64 {
        match &self.stage {
            Stage::Search(vio) => vio.time_offset_s(),
            Stage::Trial(trial) => trial.time_offset_s(),
        }
    }

    /// What it has found so far.
    pub(super) fn finish(&self) -> Option<CalibrationDoubt> {
        match &self.stage {
            Stage::Search(_) if !self.has_seen_enough() => None,
            Stage::Search(_) => self.doubts()?.into_iter().next(),
            Stage::Trial(trial) => trial.finish(),
        }
    }

    /// What is doubted, first all of it, then [less](choices): some of what a filter finds of everything at once is not so. Empty where
    /// nothing is.
    fn doubts(&self) -> Option<Vec<CalibrationDoubt>> {
        let Stage::Search(vio) = &self.stage else { return None };
        let CalibrationError { error, mut posterior, mut prior } = vio.calibration_error()?;
        let rows = |(_, first, floor): &Rows| (*first..first + floor.len()).collect::<Vec<usize>>();
        let estimated = |part: &&Rows| prior.get((part.1, part.1)).is_some_and(|v| *v > 0.0);
        let parts: Vec<&Rows> = PARTS.iter().filter(estimated).collect();
        posterior *= CAUTION * CAUTION;
        for (row, floor) in parts.iter().flat_map(|(_, first, floor)| (*first..).zip(floor.iter())) {
            posterior[(row, row)] += floor * floor;
            prior[(row, row)] += floor * floor;
        }
        let groups: Vec<Vec<usize>> = parts.iter().map(|part| rows(part)).collect();
        let named: Vec<Part> = parts.iter().map(|part| part.0).collect();
        let single = (0..groups.len()).map(|k| vec![k]);
        let both =
            BOTH.iter().filter_map(|both| both.iter().map(|part| named.iter().position(|p| p == part)).collect());
        let both: Vec<Vec<usize>> = both.collect();
        let steps: Vec<Vec<usize>> = single.chain(both.iter().cloned()).collect();
        let chosen = contradicted(&error, (&posterior, &prior), (&groups, &steps), ENOUGH);

        let doubt = |free: Vec<usize>| {
            let error = conditioned(&error, &posterior, (&groups, &free))?;
            let calibration = vio.calibration_at(&error)?;
            let parts: Vec<Part> = free.into_iter().map(|k| named[k]).collect();
            let words: Vec<String> = parts.iter().map(|part| describe(*part, &calibration, &self.given)).collect();
            Some(CalibrationDoubt {
                parts,
                found: Some(calibration),
                by_gravity: false,
                given_pose: self.given.camera().body_from_camera(),
                clock_change_s: error[error_state::TIME_OFFSET],
                row_time_change_s: error[error_state::ROW_TIME],
                words: words.join("; "),
            })
        };
        Some(choices(&chosen, &both).into_iter().filter_map(doubt).collect())
    }

    /// The accelerometer, if it does not read gravity as long as it is: out of scale then, or biased, which a filter finds by itself.
    fn by_gravity(&self) -> Option<CalibrationDoubt> {
        let Stage::Search(vio) = &self.stage else { return None };
        let samples: Vec<Imu> = self.samples.iter().copied().collect();
        let scale = gravity_scale(&samples, self.given.settings().gravity)?;
        let error = DVector::zeros(vio.calibration_error()?.error.len());
        let found = Calibration { accel_matrix: Matrix3::identity() * scale, ..vio.calibration_at(&error)? };
        let words = describe(Part::Accelerometer, &found, &self.given);
        Some(CalibrationDoubt {
            parts: vec![Part::Accelerometer],
            found: Some(found),
            by_gravity: true,
            given_pose: self.given.camera().body_from_camera(),
            clock_change_s: 0.0,
            row_time_change_s: 0.0,
            words,
        })
    }
}

/// What a check of a recording needs besides.
impl CalibrationWatch {
    /// The same with one hypothesis alone.
    pub(super) fn with_hypothesis(&self, vio: Vio) -> Self {
        Self { stage: Stage::Search(vio), remaining: Vec::new(), ..self.clone() }
    }

    /// Tries what was found.
    pub(super) fn try_out(&mut self, doubts: Vec<CalibrationDoubt>) {
        self.stage = Stage::Trial(CalibrationTrial::new(&self.given, doubts));
    }

    /// Forgets all that was seen, if something is being tried, and whether it is.
    pub(super) fn restart_trial(&mut self) -> bool {
        let Stage::Trial(trial) = &self.stage else { return false };
        self.try_out(trial.doubts());
        self.samples.clear();
        self.waiting.clear();
        true
    }

    pub(super) fn has_diverged(&self) -> bool {
        matches!(&self.stage, Stage::Search(vio) if matches!(vio.status(), Status::Diverged(_)))
    }

    /// Whether a search has seen enough to be believed.
    pub(super) fn has_seen_enough(&self) -> bool {
        self.images >= FEWEST
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::samples::ImuNoise;

    /// Of a pair: with both cameras first, then with the first of them.
    #[test]
    fn a_pair_that_loses_its_way_is_followed_by_its_first_camera() {
        let (noise, settings) = (ImuNoise::default(), Settings::default());
        let single = Vio::new(Camera::euroc(), noise, settings).unwrap();
        let pair = Vio::stereo(Camera::euroc(), Camera::euroc_right(), noise, settings).unwrap();
        let cameras = |vio: &Vio| -> Vec<usize> {
            let of = |vio: &Vio| if vio.second_camera().is_ok() { 2 } else { 1 };
            hypotheses_of_both(vio).iter().map(of).collect()
        };
        assert_eq!(cameras(&single), [1; 3]);
        assert_eq!(cameras(&pair), [2, 2, 2, 1, 1, 1]);
    }
}
