//! Corners of a path rounded, so that the nozzle's acceleration stays within its limit (handheld paper, Section VII, future work).

use super::lattice::Segment;
use crate::error::Error;

/// A path whose speed changes at constant acceleration around each corner, half of the change before it and half after.
///
/// With a change of speed `dv` and the acceleration `a`, the blend lasts `dv / a` and leaves the corner by `dv^2 / (8 a)`.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundedPath {
    start: f64,
    interval: f64,
    /// Position at each corner, m.
    corners: Vec<f64>,
    /// Speed before each corner and after the last, m/s.
    speeds: Vec<f64>,
    acceleration: f64,
}

impl RoundedPath {
    /// Rounds the corners of a path that is entered with `entry_speed` (m/s). Changes of speed that do not fit into an interval at this
    /// acceleration (m/s^2) take the whole interval; [`Self::peak_acceleration`] tells.
    ///
    /// # Errors
    /// No segments, or an acceleration that is not positive.
    pub fn new(path: &[Segment], entry_speed: f64, acceleration: f64) -> Result<Self, Error> {
        let Some(first) = path.first() else {
            return Err(Error::Knot { index: 0, what: "a path needs at least one segment" });
        };
        if !(acceleration.is_finite() && acceleration > 0.0) {
            let requirement = "finite and greater than 0";
            return Err(Error::Setting { name: "gantry acceleration", value: acceleration, requirement });
        }
        let corners = path.iter().map(|s| s.from).chain(path.last().map(|s| s.to)).collect();
        let speeds = std::iter::once(entry_speed).chain(path.iter().map(|s| (s.to - s.from) / s.duration)).collect();
        Ok(Self { start: first.start, interval: first.duration, corners, speeds, acceleration })
    }

    /// Position (m) and speed (m/s) at a time after the plan's start; before and beyond the path its ends go on straight.
    pub fn at(&self, time: f64) -> (f64, f64) {
        let last = self.corners.len() - 1;
        let place = ((time - self.start) / self.interval).clamp(0.0, last as f64);
        // The nearest corner decides: blends reach half an interval at most.
        let corner = (place.round() as usize).min(last);
        let after = time - self.start - corner as f64 * self.interval;
        let (before, next) = (self.speeds[corner], self.speeds.get(corner + 1).copied().unwrap_or(self.speeds[corner]));
        let half = self.half_blend(next - before);
        if after.abs() >= half {
            let speed = if after < 0.0 { before } else { next };
            return (self.corners[corner] + speed * after, speed);
        }
        let since = after + half;
        let slope = (next - before) / (2.0 * half);
        (self.corners[corner] + before * after + 0.5 * slope * since * since, before + slope * since)
    }

    /// Half of the time in which the speed changes by `change`, s.
    fn half_blend(&self, change: f64) -> f64 {
        (0.5 * change.abs() / self.acceleration).min(0.5 * self.interval)
    }

    /// The largest acceleration of the path, m/s^2.
    pub fn peak_acceleration(&self) -> f64 {
        let changes = self.speeds.windows(2).map(|pair| pair[1] - pair[0]).filter(|change| *change != 0.0);
        changes.map(|change| change.abs() / (2.0 * self.half_blend(change))).fold(0.0, f64::max)
    }
}
