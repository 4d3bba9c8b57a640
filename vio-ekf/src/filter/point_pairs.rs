use nalgebra::{Matrix2, Matrix2x4, Vector2, Vector4};

use super::distance::InverseDistance;
use super::estimator::Estimator;
use super::pair::Second;
use super::points::PointObservation;
use super::settings::Settings;
use super::state::{Landmark, at};
use super::update::{Iteration, Linearised, iterate, mahalanobis};
use super::{FrameReport, Vio};
use crate::{Error, Stamp};

/// A landmark seen by a tracker of the caller's own, maybe in the images of both cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointPair {
    /// What the first camera sees.
    pub first: PointObservation,
    /// Where it is in the image that the second camera took at the same moment, pixels; none if it is not seen there.
    pub second: Option<Vector2<f64>>,
}

impl Vio {
    /// As [`points`](Self::points) with a second camera: the filter must have been made by [`stereo`](Self::stereo). All pixels of
    /// both images carry independent noise.
    pub fn point_pairs(&mut self, stamp: Stamp, pairs: &[PointPair]) -> Result<FrameReport, Error> {
        let Some(mut second) = self.second.take() else {
            return Err(Error::NoSuch { what: "camera", index: 1, count: 1 });
        };
        let report = self.take_pairs(stamp, pairs, &mut second);
        self.second = Some(second);
        report
    }

    fn take_pairs(&mut self, stamp: Stamp, pairs: &[PointPair], second: &mut Second) -> Result<FrameReport, Error> {
        let wrong = |pair: &PointPair| pair.second.is_some_and(|pixel| pixel.iter().any(|v| !v.is_finite()));
        if let Some(index) = pairs.iter().position(wrong) {
            return Err(Error::NonFinite { what: "point in the second image", index });
        }
        second.points.clear();
        second.points.extend(pairs.iter().map(|pair| pair.first));
        let report = self.points(stamp, &second.points)?;
        let Some(estimator) = &mut self.estimator else { return Ok(report) };
        // The offset by which the exposure was placed, before this image's landmarks had changed it.
        let offset = estimator.history.anchor().secs_since(stamp);
        let known = self.tracks.len() - report.added.min(self.tracks.len());
        for pair in pairs {
            let slot = self.tracks.iter().position(|track| track.id == pair.first.id);
            let (Some(slot), Some(pixel)) = (slot, pair.second) else { continue };
            let is_new = slot >= known;
            if is_new {
                second.place_first(estimator, slot, &pixel, &self.settings);
            } else if report.at_rest {
                continue;
            }
            second.correct_point(estimator, slot, &pixel, offset, &self.settings);
        }
        estimator.replay();
        Ok(report)
    }
}

impl Second {
    /// Lets a new landmark begin where both cameras see it, as uncertain as any other: the update that follows weighs the pixels.
    fn place_first(&self, estimator: &mut Estimator, slot: usize, pixel: &Vector2<f64>, settings: &Settings) {
        let landmark = estimator.state.landmarks[slot];
        let mut near = landmark.inverse_distance.value;
        for _ in 0..settings.gates.iterations {
            let Some(place) = self.place(&Landmark { inverse_distance: InverseDistance::new(near), ..landmark }) else {
                return;
            };
            let step = place.slope.dot(&(pixel - place.pixel)) / place.slope.norm_squared();
            near += step;
            if step.abs() * place.slope.norm() < 0.01 {
                break;
            }
        }
        let most = 1.0 / settings.pair.nearest_m;
        // What is too far to be told from infinity stays where it is expected to be.
        if !(f64::MIN_POSITIVE..most).contains(&near) {
            return;
        }
        let row = at::landmark(slot) + 2;
        let deviation = settings.landmarks.inverse_distance_sigma * landmark.inverse_distance.value.max(near);
        estimator.state.landmarks[slot].inverse_distance = InverseDistance::new(near);
        estimator.covariance.isolate(row, deviation * deviation);
    }

    /// Updates with a pixel of the second image.
    fn correct_point(
        &self,
        estimator: &mut Estimator,
        slot: usize,
        pixel: &Vector2<f64>,
        offset: f64,
        settings: &Settings,
    ) {
        let noise = Matrix2::identity() * settings.landmarks.pixel_sigma.powi(2);
        let landmark = estimator.state.landmarks[slot];
        let (rate, late) = (estimator.tangent_rate(&landmark), estimator.state.time_offset - offset);
        let row = at::landmark(slot);
        let rows = [row, row + 1, row + 2, at::TIME_OFFSET];
        let iteration = Iteration { limit: settings.gates.iterations, tolerance: 1e-3 };
        let measurement = iterate(&estimator.covariance, rows, iteration, Vector4::zeros(), |delta| {
            let (place, jacobian) = self.look(&landmark, &rate, late, delta)?;
            Some(Linearised { residual: pixel - place, jacobian, noise })
        });
        if let Some(measurement) = measurement
            && mahalanobis(&estimator.covariance, &measurement).is_some_and(|d| d <= settings.gates.mahalanobis)
        {
            estimator.update(&measurement);
        }
    }

    /// Pixel of a landmark after a trial step of bearing, inverse distance and time, and its derivative by that step.
    pub(super) fn look(
        &self,
        landmark: &Landmark,
        rate: &Vector2<f64>,
        late: f64,
        delta: &Vector4<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x4<f64>)> {
        let moved = Landmark {
            bearing: landmark.bearing.boxplus(&(delta.fixed_rows::<2>(0) + rate * (late + delta[3]))),
            inverse_distance: InverseDistance::new(landmark.inverse_distance.value + delta[2]),
            // Then the place's deformation is the derivative by the tangent coordinates.
            warp: Matrix2::identity(),
        };
        let place = self.place(&moved)?;
        let mut jacobian = Matrix2x4::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&place.warp);
        jacobian.set_column(2, &place.slope);
        jacobian.set_column(3, &(place.warp * rate));
        Some((place.pixel, jacobian))
    }
}
