//! A KLT tracker (Lucas and Kanade 1981) whose prediction comes from the gyroscope: tracks points before there is a state.

use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};

use crate::camera::model::CameraModel;
use crate::filter::frontend::corner_detector::{CornerDetector, DetectionCriteria};
use crate::filter::frontend::patch::Patch;
use crate::filter::frontend::pyramid::Pyramid;

/// Points that are tracked.
const MAX_POINTS: usize = 40;
/// New ones are detected when there are fewer.
const MIN_POINTS: usize = 30;
/// Grid of initial guesses: count to either side, and spacing in pixels.
const SEARCH_GRID: (i32, f64) = (4, 2.0);
/// The same of a point that has not been followed yet: nothing predicts its flow, which at 8 m/s and 20 images a second is 60 pixels
/// for what is 3 m away.
const FIRST_SEARCH_GRID: (i32, f64) = (15, 4.0);
/// Iterations of the alignment.
const ITERATIONS: usize = 10;
/// Largest share of a patch's energy that may remain as residual.
const MAX_RESIDUAL_RATIO: f64 = 0.3;

/// The points that are tracked.
#[derive(Debug, Clone, Default)]
pub(crate) struct KltTracker {
    tracks: Vec<Track>,
    next_id: u64,
}

#[derive(Debug, Clone)]
struct Track {
    id: u64,
    patch: Patch,
    pixel: Vector2<f64>,
    direction: Vector3<f64>,
    /// Motion between the last two images beyond that of the rotation, pixels: the prediction of the next. `None` until then.
    flow: Option<Vector2<f64>>,
    /// Warp of the patch by the rotations since the point was first seen.
    warp: Matrix2<f64>,
}

impl KltTracker {
    /// Tracks all points into the next image; `rotation` is the body's in the meantime.
    pub(crate) fn track(
        &mut self,
        rotation: Option<UnitQuaternion<f64>>,
        pyramid: &Pyramid,
        (detector, criteria): (&mut CornerDetector, &DetectionCriteria),
        camera: &dyn CameraModel,
    ) {
        match rotation {
            Some(rotation) => {
                let attitude = camera.body_from_camera().rotation;
                let rotation = attitude.inverse() * rotation.inverse() * attitude;
                self.tracks.retain_mut(|track| track.track(&rotation, pyramid, camera).is_some());
            }
            None => self.tracks.clear(),
        }
        if self.tracks.len() >= MIN_POINTS {
            return;
        }
        detector.detect(pyramid, &self.tracks.iter().map(|track| track.pixel), criteria);
        while self.tracks.len() < MAX_POINTS {
            let Some((pixel, patch)) = detector.take_best(pyramid, criteria) else { break };
            let Some(direction) = camera.bearing(&pixel) else { continue };
            let (id, flow, warp) = (self.next_id, None, Matrix2::identity());
            self.tracks.push(Track { id, patch, pixel, direction: direction.into_inner(), flow, warp });
            self.next_id += 1;
        }
    }

    /// Ids and directions.
    pub(crate) fn observations(&self) -> impl Iterator<Item = (u64, Vector3<f64>)> {
        self.tracks.iter().map(|track| (track.id, track.direction))
    }

    /// Pixel of a point in the last image.
    pub(crate) fn pixel(&self, id: u64) -> Option<Vector2<f64>> {
        self.tracks.iter().find(|track| track.id == id).map(|track| track.pixel)
    }
}

impl Track {
    /// Tracks the point into the next image, or gives it up.
    fn track(&mut self, rotation: &UnitQuaternion<f64>, pyramid: &Pyramid, camera: &dyn CameraModel) -> Option<()> {
        let rotated = camera.project(&(rotation * self.direction))?;
        let moved = |x: f64, y: f64| {
            let bearing = camera.bearing(&(self.pixel + Vector2::new(x, y)))?;
            camera.project(&(rotation * bearing.into_inner()))
        };
        self.warp = Matrix2::from_columns(&[moved(1.0, 0.0)? - rotated, moved(0.0, 1.0)? - rotated]) * self.warp;
        let predicted = rotated + self.flow.unwrap_or_default();
        let first = self.flow.is_none();
        let pixel = self
            .search(&predicted, SEARCH_GRID, pyramid)
            .or_else(|| first.then(|| self.search(&predicted, FIRST_SEARCH_GRID, pyramid))?)?;
        self.direction = camera.bearing(&pixel)?.into_inner();
        self.flow = Some(pixel - rotated);
        self.pixel = pixel;
        Some(())
    }

    /// Where the patch is, within a grid of guesses around a pixel or two of them beyond.
    fn search(&self, around: &Vector2<f64>, (count, spacing): (i32, f64), pyramid: &Pyramid) -> Option<Vector2<f64>> {
        let (patch, warp) = (&self.patch, &self.warp);
        let offsets =
            (-count..=count).flat_map(|y| (-count..=count).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
        let guesses = offsets.filter_map(|offset| {
            let pixel = around + offset * spacing;
            Some((patch.compare_coarse(pyramid, &pixel, warp)?.ssd, pixel))
        });
        let (_, mut pixel) = guesses.reduce(|best, other| if other.0 < best.0 { other } else { best })?;
        let farthest = (f64::from(count) + 2.0) * spacing;
        for _ in 0..ITERATIONS {
            let comparison = patch.compare(pyramid, &pixel, warp)?;
            let step = warp * comparison.information.try_inverse()? * comparison.gradient;
            pixel += step;
            if step.norm() < 0.01 {
                let found = comparison.residual <= MAX_RESIDUAL_RATIO * comparison.energy
                    && (pixel - around).amax() <= farthest;
                return found.then_some(pixel);
            }
        }
        None
    }
}
