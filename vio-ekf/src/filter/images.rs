use super::bearing::Bearing;
use super::detect::{Demands, Detector};
use super::look::{Look, look_for, refresh};
use super::patch::{LEVELS, Patch};
use super::points::project;
use super::pyramid::Pyramid;
use super::settings::PatchSettings;
use super::{FrameReport, Track, Vio};
use crate::{Camera, Error, ImageView, Stamp};

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
