//! Whether inertial samples can be believed by themselves, sample by sample.

use nalgebra::Vector3;

use crate::samples::Imu;

/// So many equal readings of an axis in a row are no chance, even of a sensor of few bits.
const UNCHANGED: usize = 3;

/// Watches for axes that stand still: noise changes a reading, the end of a range does not.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct InertialCheck {
    last: Option<Imu>,
    /// Samples in a row in which an axis of a sensor did not change at all.
    unchanged: usize,
}

impl InertialCheck {
    /// Takes a sample; whether all axes have moved lately.
    pub(super) fn moves(&mut self, sample: &Imu) -> bool {
        let last = self.last.replace(*sample);
        let same = |a: &Vector3<f64>, b: &Vector3<f64>| (0..3).any(|k| a[k] == b[k]);
        let stuck = last.is_some_and(|last| same(&last.accel, &sample.accel) || same(&last.gyro, &sample.gyro));
        self.unchanged = if stuck { self.unchanged + 1 } else { 0 };
        self.unchanged < UNCHANGED
    }
}
