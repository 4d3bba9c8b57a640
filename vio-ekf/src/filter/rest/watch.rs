use nalgebra::Vector2;

use crate::Stamp;
use crate::filter::PointObservation;

/// Points that are watched at most.
const WATCHED: usize = 64;
/// As many must be in sight.
const ENOUGH: usize = 5;
/// Images over which the place of a point is averaged before others are compared with it.
const REFERENCE: u32 = 5;
/// The median of normal numbers has this many times the deviation of their mean: √(π/2).
const MEDIAN: f64 = 1.253;
/// Deviations of a median that are taken for noise.
const NOISE: f64 = 3.0;

/// Points of a caller's own tracker, watched for motion.
///
/// Each is too noisy to tell half a pixel by itself, but all of them move together: the image shifts, turns or grows. So what is
/// judged is the median of their shifts to the right, downwards, outwards and around.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    since: Option<Stamp>,
    images: u32,
    points: Vec<Watched>,
    shifts: [Vec<f64>; 4],
}

#[derive(Debug, Clone, Copy)]
struct Watched {
    id: u64,
    /// Mean over the first images, pixels.
    place: Vector2<f64>,
    seen: bool,
}

/// What the watched points say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict {
    pub(super) still: bool,
    /// Motion of the image that is not told from noise, pixels.
    pub(super) tolerance: f64,
}

impl Watch {
    pub(super) fn new() -> Self {
        Self {
            since: None,
            images: 0,
            points: Vec::with_capacity(WATCHED),
            shifts: std::array::from_fn(|_| Vec::with_capacity(WATCHED)),
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

    /// Compares points of noise `sigma` with where they were; `pixels` may go unnoticed. None if too few are left to tell: then the
    /// watch begins with this image.
    pub(super) fn judge(
        &mut self,
        now: Stamp,
        points: &[PointObservation],
        (sigma, pixels): (f64, f64),
    ) -> Option<Verdict> {
        self.compare(points);
        let count = self.points.len();
        if count < ENOUGH {
            self.points.clear();
            let begun = |p: &PointObservation| Watched { id: p.id, place: p.pixel, seen: true };
            self.points.extend(points.iter().take(WATCHED).map(begun));
            (self.since, self.images) = (Some(now), 1);
            return None;
        }
        let noise = sigma * ((1.0 + 1.0 / f64::from(self.images)) / count as f64).sqrt();
        let tolerance = pixels + NOISE * MEDIAN * noise;
        let still = self.shifts.iter_mut().all(|shifts| {
            let (_, median, _) = shifts.select_nth_unstable_by(count / 2, f64::total_cmp);
            median.abs() < tolerance
        });
        if still && self.images < REFERENCE {
            self.images += 1;
            for watched in &mut self.points {
                if let Some(found) = points.iter().find(|point| point.id == watched.id) {
                    watched.place += (found.pixel - watched.place) / f64::from(self.images);
                }
            }
        }
        Some(Verdict { still, tolerance })
    }

    /// The shifts of all watched points; those that are no longer seen are dropped.
    fn compare(&mut self, points: &[PointObservation]) {
        let centre = self.points.iter().map(|p| p.place).sum::<Vector2<f64>>() / self.points.len().max(1) as f64;
        self.shifts.iter_mut().for_each(Vec::clear);
        for watched in &mut self.points {
            let found = points.iter().find(|point| point.id == watched.id);
            watched.seen = found.is_some();
            let Some(found) = found else { continue };
            let shift = found.pixel - watched.place;
            let outwards = (watched.place - centre).try_normalize(1e-9).unwrap_or_else(Vector2::x);
            let around = Vector2::new(-outwards.y, outwards.x);
            let parts = [shift.x, shift.y, shift.dot(&outwards), shift.dot(&around)];
            for (all, part) in self.shifts.iter_mut().zip(parts) {
                all.push(part);
            }
        }
        self.points.retain(|point| point.seen);
    }
}
