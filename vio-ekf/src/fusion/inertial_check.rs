//! Whether inertial samples can be believed by themselves, sample by sample.

use nalgebra::Vector3;

use crate::samples::Imu;
use crate::stamp::Stamp;

/// So many equal readings of an axis in a row are no chance, even of a sensor of few bits.
const UNCHANGED: usize = 3;

/// Watches for gaps and for axes that stand still: noise changes a reading, the end of a range does not.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct InertialCheck {
    last: Option<Imu>,
    /// Samples in a row in which an axis of a sensor did not change at all.
    unchanged: usize,
}

impl InertialCheck {
    /// Takes a sample; whether it follows the one before, and all axes move.
    pub(super) fn is_sound(&mut self, sample: &Imu, longest_gap_s: f64) -> bool {
        let last = self.last.replace(*sample);
        let same = |a: &Vector3<f64>, b: &Vector3<f64>| (0..3).any(|k| a[k] == b[k]);
        let stuck = last.is_some_and(|last| same(&last.accel, &sample.accel) || same(&last.gyro, &sample.gyro));
        self.unchanged = if stuck { self.unchanged + 1 } else { 0 };
        self.is_moving() && last.is_none_or(|last| sample.stamp.secs_since(last.stamp) <= longest_gap_s)
    }

    /// Whether all axes have moved lately.
    fn is_moving(&self) -> bool {
        self.unchanged < UNCHANGED
    }

    /// Time of the latest sample.
    pub(super) fn last(&self) -> Option<Stamp> {
        self.last.map(|last| last.stamp)
    }
}
