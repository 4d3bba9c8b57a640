use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::bearing::Bearing;
use super::estimator::{bearing_part, bearing_rows};
use super::update::{Iteration, Linearised, iterate, mahalanobis};
use super::{FrameReport, Track, Vio};
use crate::{Camera, Error, Stamp};

/// A landmark seen by a tracker of the caller's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointObservation {
    /// The same for the same landmark in all images.
    pub id: u64,
    /// Where it is, pixels.
    pub pixel: Vector2<f64>,
}

impl Vio {
    /// Takes the points that a tracker of the caller found in an image.
    ///
    /// `stamp` is the middle of the exposure by the camera's clock. Each point carries independent noise of
    /// [`LandmarkSettings::pixel_sigma`](super::LandmarkSettings::pixel_sigma). Landmarks that are not among the points are
    /// dropped; points that are new take their place while there is room, in the order given.
    pub fn points(&mut self, stamp: Stamp, points: &[PointObservation]) -> Result<FrameReport, Error> {
        if let Some(index) = points.iter().position(|p| p.pixel.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "point", index });
        }
        let now = self.last.map_or(stamp, |sample| sample.stamp);
        self.rest.points(now, points, self.settings.landmarks.pixel_sigma);
        self.unnoticed = self.rest.unnoticed(&self.camera);
        if self.estimator.is_none() {
            self.start_at_rest()?;
            if self.estimator.is_some() {
                let report = FrameReport { added: self.admit(points), ..self.report() };
                return Ok(self.conclude(report));
            }
            if self.settings.moving.enabled {
                self.scout_points(stamp, points);
            }
            return Ok(FrameReport { added: self.tracks.len(), ..self.report() });
        }
        let at_rest = self.rest.is_at_rest(now);
        let mut report = FrameReport { at_rest, ..self.report() };
        let Some(removed) = self.expose(stamp, at_rest)? else { return Ok(report) };
        report.removed = removed;
        self.measure(points, at_rest, &mut report);
        report.added = self.admit(points);
        Ok(self.conclude(report))
    }

    /// Updates with all landmarks that are among the points, unless the body rests, and drops the others.
    fn measure(&mut self, points: &[PointObservation], at_rest: bool, report: &mut FrameReport) {
        let Some(estimator) = &mut self.estimator else { return };
        let offset = estimator.state.time_offset;
        let noise = Matrix2::identity() * self.settings.landmarks.pixel_sigma.powi(2);
        let iteration = Iteration { limit: self.settings.gates.iterations, tolerance: 1e-3 };

        for track in &mut self.tracks {
            track.seen = false;
        }
        for point in points {
            let Some(slot) = self.tracks.iter().position(|t| t.id == point.id) else { continue };
            let track = &mut self.tracks[slot];
            track.seen = true;
            if at_rest {
                continue;
            }
            let state = &estimator.state;
            let landmark = state.landmarks[slot];
            let (rate, late) = (estimator.tangent_rate(&landmark), state.time_offset - offset);
            let measurement =
                iterate(&estimator.covariance, bearing_rows(slot), iteration, Vector3::zeros(), |delta| {
                    let bearing = landmark.bearing.boxplus(&(bearing_part(delta) + rate * (late + delta[2])));
                    let (pixel, by_bearing) = project(&self.camera, &bearing)?;
                    let mut jacobian = Matrix2x3::zeros();
                    jacobian.fixed_columns_mut::<2>(0).copy_from(&by_bearing);
                    jacobian.set_column(2, &(by_bearing * rate));
                    Some(Linearised { residual: point.pixel - pixel, jacobian, noise })
                });
            let gate = self.settings.gates.mahalanobis;
            let fits = |m| mahalanobis(&estimator.covariance, m).is_some_and(|d| d <= gate);
            match measurement {
                Some(m) if fits(&m) && estimator.update(&m) => {
                    report.used += 1;
                    track.misses = 0;
                }
                _ => {
                    report.rejected += 1;
                    track.misses += 1;
                }
            }
        }
        for slot in (0..self.tracks.len()).rev() {
            let track = &self.tracks[slot];
            if !track.seen || track.misses >= self.settings.gates.misses {
                self.tracks.swap_remove(slot);
                estimator.remove(slot);
                report.removed += 1;
            }
        }
    }

    /// Starts landmarks with points that are new, while there is room; returns how many.
    fn admit(&mut self, points: &[PointObservation]) -> usize {
        let Some(estimator) = &mut self.estimator else { return 0 };
        let before = self.tracks.len();
        for point in points {
            if self.tracks.len() == self.settings.features {
                break;
            }
            if self.tracks.iter().any(|t| t.id == point.id) {
                continue;
            }
            let Some(direction) = self.camera.bearing(&point.pixel) else { continue };
            let bearing = Bearing::new(&direction);
            let Some((_, by_bearing)) = project(&self.camera, &bearing) else { continue };
            let Some(warp) = by_bearing.try_inverse() else { continue };
            let covariance = warp * warp.transpose() * self.settings.landmarks.pixel_sigma.powi(2);
            estimator.add(bearing, warp, &covariance);
            self.tracks.push(Track { id: point.id, misses: 0, seen: true, patch: None });
        }
        self.tracks.len() - before
    }

    /// Shows points to the scout, and starts if that has found the motion.
    fn scout_points(&mut self, stamp: Stamp, points: &[PointObservation]) {
        let time = self.inertial_time(stamp);
        let camera = self.camera;
        let seen = points.iter().filter_map(|p| Some((p.id, camera.bearing(&p.pixel)?.into_inner())));
        if let Some(motion) = self.scout.image(time, seen, &camera, self.settings.gravity) {
            self.start_in_motion(time, &motion, |id| points.iter().find(|p| p.id == id).map(|p| (p.pixel, None)));
        }
    }
}

/// Pixel of a bearing and its derivative by the bearing's tangent coordinates.
pub(crate) fn project(camera: &Camera, bearing: &Bearing) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (pixel, jacobian) = camera.project_with_jacobian(&bearing.direction())?;
    Some((pixel, jacobian * bearing.differential()))
}
