//! Parallax of tracked points between two sets of them.

use nalgebra::Vector2;

use crate::filter::point_observation::PointObservation;
use crate::stamp::Stamp;

/// Points that are compared at most.
const MAX_POINTS: usize = 64;
/// As many must be in view.
const MIN_POINTS: usize = 5;
/// Images over which the reference pixel of a point is averaged.
const REFERENCE_IMAGES: u32 = 5;
/// The median of normal numbers has this many times the deviation of their mean: √(π/2).
const MEDIAN_FACTOR: f64 = 1.253;
/// Deviations of a median that are taken for noise.
const NOISE_DEVIATIONS: f64 = 3.0;

/// Detects parallax of patches, or of the points of a caller's own tracker.
///
/// Each may be too noisy to tell half a pixel by itself, but all of them move together: the image shifts, turns or grows. So the
/// test is on the median of their shifts to the right, downwards, outwards and around.
#[derive(Debug, Clone)]
pub(super) struct ParallaxCheck {
    since: Option<Stamp>,
    images: u32,
    points: Vec<ReferencePoint>,
    shifts: [Vec<f64>; 4],
}

#[derive(Debug, Clone, Copy)]
struct ReferencePoint {
    id: u64,
    /// Mean over the first images, pixels.
    pixel: Vector2<f64>,
    in_view: bool,
}

/// Outcome of the check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ParallaxResult {
    pub(super) stationary: bool,
    /// Parallax that is not told from noise, pixels.
    pub(super) tolerance: f64,
}

impl ParallaxCheck {
    pub(super) fn new() -> Self {
        Self {
            since: None,
            images: 0,
            points: Vec::with_capacity(MAX_POINTS),
            shifts: std::array::from_fn(|_| Vec::with_capacity(MAX_POINTS)),
        }
    }

    /// Begins anew with the next image.
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.since = None;
    }

    /// Seconds since its first image.
    pub(super) fn age(&self, now: Stamp) -> f64 {
        self.since.map_or(0.0, |since| now.secs_since(since))
    }

    /// Compares points of noise `sigma` with where they were; `pixels` is tolerated besides. None if too few are left: then
    /// this image becomes the reference.
    pub(super) fn check(
        &mut self,
        now: Stamp,
        points: &[PointObservation],
        (sigma, pixels): (f64, f64),
    ) -> Option<ParallaxResult> {
        self.compare(points);
        let count = self.points.len();
        if count < MIN_POINTS {
            self.points.clear();
            let reference = |p: &PointObservation| ReferencePoint { id: p.id, pixel: p.pixel, in_view: true };
            self.points.extend(points.iter().take(MAX_POINTS).map(reference));
            (self.since, self.images) = (Some(now), 1);
            return None;
        }
        let noise = sigma * ((1.0 + 1.0 / f64::from(self.images)) / count as f64).sqrt();
        let tolerance = pixels + NOISE_DEVIATIONS * MEDIAN_FACTOR * noise;
        let stationary = self.shifts.iter_mut().all(|shifts| {
            let (_, median, _) = shifts.select_nth_unstable_by(count / 2, f64::total_cmp);
            median.abs() < tolerance
        });
        if stationary && self.images < REFERENCE_IMAGES {
            self.images += 1;
            for reference in &mut self.points {
                if let Some(found) = points.iter().find(|point| point.id == reference.id) {
                    reference.pixel += (found.pixel - reference.pixel) / f64::from(self.images);
                }
            }
        }
        Some(ParallaxResult { stationary, tolerance })
    }

    /// The shifts of all points; those out of view are dropped.
    fn compare(&mut self, points: &[PointObservation]) {
        let centre = self.points.iter().map(|p| p.pixel).sum::<Vector2<f64>>() / self.points.len().max(1) as f64;
        self.shifts.iter_mut().for_each(Vec::clear);
        for reference in &mut self.points {
            let found = points.iter().find(|point| point.id == reference.id);
            reference.in_view = found.is_some();
            let Some(found) = found else { continue };
            let shift = found.pixel - reference.pixel;
            let outwards = (reference.pixel - centre).try_normalize(1e-9).unwrap_or_else(Vector2::x);
            let around = Vector2::new(-outwards.y, outwards.x);
            let parts = [shift.x, shift.y, shift.dot(&outwards), shift.dot(&around)];
            for (all, part) in self.shifts.iter_mut().zip(parts) {
                all.push(part);
            }
        }
        self.points.retain(|point| point.in_view);
    }
}
