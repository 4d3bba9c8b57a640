use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::bearing::Bearing;
use super::covariance::Measurement;
use super::detect::{Demands, Detector};
use super::estimator::{Estimator, bearing_part, bearing_rows};
use super::patch::{Comparison, LEVELS, Patch};
use super::points::project;
use super::pyramid::Pyramid;
use super::settings::{PatchSettings, Settings};
use super::state::at;
use super::update::{Iteration, Linearised, iterate, mahalanobis};
use super::{FrameReport, Track, Vio};
use crate::{Camera, Error, ImageView, Stamp};

/// Spacing of the places at which a patch is looked for first, in pixels of its coarsest level: half of what the
/// iteration reaches from.
const SEED_SPACING: f64 = 1.0;
/// Most such places to either side of the prediction.
const MAX_SEEDS: i32 = 12;
/// Iterations on the coarsest level alone.
const COARSE_ITERATIONS: usize = 4;

/// The memory of the image side.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    pyramid: Pyramid,
    detector: Detector,
}

impl Sight {
    pub(crate) fn new(camera: &Camera, settings: &PatchSettings) -> Self {
        let pyramid = Pyramid::new(camera.width, camera.height, settings.first_level, LEVELS);
        let detector = Detector::new(pyramid.corners(), settings.corner_threshold);
        Self { pyramid, detector }
    }
}

/// What came of looking for a landmark.
enum Look {
    /// Part of it is outside the image.
    Outside,
    /// Nothing there fits.
    Lost,
    /// Found, with what the comparison at the solution left unexplained.
    Found(Measurement<2, 3>),
}

impl Vio {
    /// Takes an image of the camera.
    ///
    /// `stamp` is the middle of the exposure by the camera's clock. The image must be of the camera's size.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        let image = image.checked(&self.camera)?;
        if let Some(second) = &mut self.second {
            second.show(None);
        }
        self.shown(stamp, &image)
    }

    /// Takes an image of the first camera; that of the second, if there is one, has been taken.
    pub(super) fn shown(&mut self, stamp: Stamp, image: &ImageView) -> Result<FrameReport, Error> {
        let Sight { pyramid, detector } = &mut self.sight;
        pyramid.fill(image);
        let now = self.last.map_or(stamp, |sample| sample.stamp);
        if self.rest.is_steady(now) {
            self.rest.image(pyramid, detector, &demands(&self.settings.patches));
        }
        if self.estimator.is_none() {
            self.start_at_rest()?;
            if self.estimator.is_none() && self.settings.moving.enabled {
                self.scout(stamp);
            }
            if self.estimator.is_none() {
                return Ok(self.report());
            }
            // The image that the start was made with has the first landmarks.
            let added = self.refill();
            let report = FrameReport { added, ..self.report() };
            return Ok(self.conclude(report));
        }
        let at_rest = self.rest.is_at_rest(now);
        let mut report = FrameReport { at_rest, ..self.report() };
        let before = self.anchor();
        let Some(removed) = self.expose(stamp, at_rest)? else { return Ok(report) };
        report.removed = removed;
        if !at_rest {
            let elapsed = before.zip(self.anchor()).map_or(0.0, |(before, now)| now.secs_since(before));
            self.follow(&mut report, elapsed);
        }
        if (self.tracks.len() as f64) < self.settings.patches.refill * self.settings.features as f64 {
            report.added = self.refill();
        }
        Ok(self.conclude(report))
    }

    /// Shows an image to the scout, and starts if that has found the motion.
    fn scout(&mut self, stamp: Stamp) {
        let time = self.inertial_time(stamp);
        let Sight { pyramid, detector } = &mut self.sight;
        let turn = self.scout.turn(time);
        self.follower.image(turn, pyramid, (detector, &demands(&self.settings.patches)), &self.camera);
        let Some(motion) = self.scout.image(time, self.follower.seen(), &self.camera, self.settings.gravity) else {
            return;
        };
        let (pyramid, follower) = (self.sight.pyramid.clone(), self.follower.clone());
        self.start_in_motion(time, &motion, |id| {
            let pixel = follower.pixel(id)?;
            Some((pixel, Some(Patch::take(&pyramid, &pixel)?)))
        });
    }

    /// Time of the last image.
    fn anchor(&self) -> Option<Stamp> {
        self.estimator.as_ref().map(|estimator| estimator.history.anchor())
    }

    /// Looks for all landmarks and updates with what is found.
    fn follow(&mut self, report: &mut FrameReport, elapsed: f64) {
        let Some(estimator) = &mut self.estimator else { return };
        let drift = self.settings.patches.drift / self.camera.fx.min(self.camera.fy);
        estimator.diffuse(drift * drift * elapsed);
        let pyramid = &self.sight.pyramid;
        let offset = estimator.state.time_offset;

        for (slot, track) in self.tracks.iter_mut().enumerate() {
            let late = estimator.state.time_offset - offset;
            track.seen = true;
            let look = track.patch.as_ref().map_or(Look::Outside, |patch| {
                look_for(estimator, slot, late, patch, pyramid, &self.camera, &self.settings)
            });
            match look {
                Look::Found(measurement) if estimator.update(&measurement) => {
                    report.used += 1;
                    track.misses = 0;
                }
                Look::Outside => track.seen = false,
                _ => {
                    report.rejected += 1;
                    track.misses += 1;
                }
            }
        }
        for slot in (0..self.tracks.len()).rev() {
            let track = &self.tracks[slot];
            let near = estimator.state.landmarks[slot].inverse_distance.value;
            if !track.seen || track.misses >= self.settings.gates.misses || near > MAX_INVERSE_DISTANCE {
                self.tracks.swap_remove(slot);
                estimator.remove(slot);
                report.removed += 1;
            }
        }
        for (slot, track) in self.tracks.iter_mut().enumerate() {
            if track.misses == 0 {
                refresh(estimator, slot, track, pyramid, &self.camera, &self.settings.patches);
            }
        }
        if let Some(second) = &self.second {
            second.correct(estimator, pyramid, &self.camera, &self.settings);
        }
    }

    /// Starts landmarks in the free slots; returns how many.
    fn refill(&mut self) -> usize {
        let Some(estimator) = &mut self.estimator else { return 0 };
        let Sight { pyramid, detector } = &mut self.sight;
        let patches = &self.settings.patches;
        let demands = demands(patches);
        let (camera, state) = (&self.camera, &estimator.state);
        let present = state.landmarks.iter().filter_map(|l| camera.project(&l.bearing.direction()));
        detector.detect(pyramid, &present, &demands);
        let before = self.tracks.len();
        while self.tracks.len() < self.settings.features {
            let Some((pixel, patch)) = detector.pick(pyramid, &demands) else { break };
            let Some(direction) = camera.bearing(&pixel) else { continue };
            let bearing = Bearing::new(&direction);
            let Some((_, by_bearing)) = project(camera, &bearing) else { continue };
            let Some(warp) = by_bearing.try_inverse() else { continue };
            let covariance = warp * warp.transpose() * patches.pixel_sigma.powi(2);
            let second = self.second.as_ref();
            match second.and_then(|second| second.first_sight(&patch, (&bearing, &warp), &self.settings)) {
                Some(measured) => estimator.add_measured(bearing, warp, &covariance, measured),
                None => estimator.add(bearing, warp, &covariance),
            }
            self.tracks.push(Track { id: self.next_id, misses: 0, seen: true, patch: Some(patch) });
            self.next_id += 1;
        }
        self.tracks.len() - before
    }
}

fn demands(patches: &PatchSettings) -> Demands {
    Demands { score: patches.score, nearest: patches.nearest, farthest: patches.farthest }
}

/// Inverse distance beyond which a landmark cannot be followed, 1/m.
const MAX_INVERSE_DISTANCE: f64 = 20.0;

/// Finds a landmark's patch in the image and turns what is seen into a measurement.
fn look_for(
    estimator: &Estimator,
    slot: usize,
    late: f64,
    patch: &Patch,
    pyramid: &Pyramid,
    camera: &Camera,
    settings: &Settings,
) -> Look {
    let landmark = estimator.state.landmarks[slot];
    let rate = estimator.tangent_rate(&landmark);
    let Some(patch_from_tangent) = landmark.warp.try_inverse() else { return Look::Lost };
    let place = |delta: &Vector3<f64>| {
        let bearing = landmark.bearing.boxplus(&(bearing_part(delta) + rate * (late + delta[2])));
        project(camera, &bearing)
    };
    let Some((pixel, by_bearing)) = place(&Vector3::zeros()) else { return Look::Outside };
    if !Patch::fits(pyramid, &pixel, &(by_bearing * landmark.warp)) {
        return Look::Outside;
    }

    // In tangent coordinates the derivative of what the patch's pixels say is the same wherever the patch is looked for.
    let linearised = |comparison: &Comparison, by_bearing: &Matrix2<f64>| {
        let factor = comparison.information.cholesky()?.l().transpose();
        let own = factor * patch_from_tangent;
        let mut jacobian = Matrix2x3::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&own);
        jacobian.set_column(2, &(own * rate));
        let residual = factor.transpose().solve_lower_triangular(&comparison.moment)?;
        let grey = settings.patches.grey_sigma.powi(2).max(comparison.unexplained / comparison.freedom);
        let floor = own * by_bearing.try_inverse()? * settings.patches.pixel_sigma;
        Some(Linearised { residual, jacobian, noise: Matrix2::identity() * grey + floor * floor.transpose() })
    };
    let (rows, covariance) = (bearing_rows(slot), &estimator.covariance);

    let first = seed(estimator, slot, &by_bearing, pyramid, |delta| {
        let (pixel, by_bearing) = place(delta)?;
        Some(patch.compare_coarse(pyramid, &pixel, &(by_bearing * landmark.warp))?.mismatch)
    });
    let mut coarse = first;
    let iteration = Iteration { limit: COARSE_ITERATIONS, tolerance: 1e-2 };
    let _ = iterate(covariance, rows, iteration, first, |delta| {
        coarse = *delta;
        let (pixel, by_bearing) = place(delta)?;
        linearised(&patch.compare_coarse(pyramid, &pixel, &(by_bearing * landmark.warp))?, &by_bearing)
    });

    let mut last = None;
    let iteration = Iteration { limit: settings.gates.iterations, tolerance: 1e-3 };
    let measurement = iterate(covariance, rows, iteration, coarse, |delta| {
        let (pixel, by_bearing) = place(delta)?;
        let comparison = patch.compare(pyramid, &pixel, &(by_bearing * landmark.warp))?;
        last = Some(comparison);
        linearised(&comparison, &by_bearing)
    });
    let (Some(measurement), Some(comparison)) = (measurement, last) else { return Look::Lost };
    let clear = comparison.unexplained <= settings.patches.unexplained * comparison.energy;
    match mahalanobis(covariance, &measurement) {
        Some(distance) if clear && distance <= settings.gates.mahalanobis => Look::Found(measurement),
        _ => Look::Lost,
    }
}

/// Where to begin: the best of some places along the longer axis of the predicted uncertainty, over two deviations.
fn seed(
    estimator: &Estimator,
    slot: usize,
    by_bearing: &Matrix2<f64>,
    pyramid: &Pyramid,
    mut mismatch: impl FnMut(&Vector3<f64>) -> Option<f64>,
) -> Vector3<f64> {
    let row = at::landmark(slot);
    let bearing = estimator.covariance.block::<2, 2>(row, row);
    let eigen = (by_bearing * bearing * by_bearing.transpose()).symmetric_eigen();
    let longest = eigen.eigenvalues.imax();
    let deviation = eigen.eigenvalues[longest].max(0.0).sqrt();
    let spacing = SEED_SPACING / pyramid.used()[LEVELS - 1].scale;
    let count = ((2.0 * deviation / spacing).floor() as i32).min(MAX_SEEDS);
    let Some(tangent_from_pixel) = by_bearing.try_inverse() else { return Vector3::zeros() };
    let step: Vector2<f64> = tangent_from_pixel * eigen.eigenvectors.column(longest) * spacing;
    let mut best = (f64::INFINITY, Vector3::zeros());
    if count == 0 {
        return best.1;
    }
    for k in -count..=count {
        let delta = (step * f64::from(k)).push(0.0);
        if let Some(mismatch) = mismatch(&delta)
            && mismatch < best.0
        {
            best = (mismatch, delta);
        }
    }
    best.1
}

/// Takes a patch anew where it is now if it is seen at another scale. What is followed from then on is another point: the
/// one that is seen exactly where the filter believes the old one to be.
fn refresh(
    estimator: &mut Estimator,
    slot: usize,
    track: &mut Track,
    pyramid: &Pyramid,
    camera: &Camera,
    settings: &PatchSettings,
) {
    let landmark = estimator.state.landmarks[slot];
    let Some((pixel, by_bearing)) = project(camera, &landmark.bearing) else { return };
    let area = (by_bearing * landmark.warp).determinant();
    if (1.0 / settings.rescale..=settings.rescale).contains(&area) {
        return;
    }
    let (Some(patch), Some(warp)) = (Patch::take(pyramid, &pixel), by_bearing.try_inverse()) else { return };
    if patch.score() < settings.score {
        return;
    }
    track.patch = Some(patch);
    estimator.renew(slot, warp, &(warp * warp.transpose() * settings.pixel_sigma.powi(2)));
}
