//! The window of images and inertial samples that an initialization in motion is solved over.

use nalgebra::{SVector, UnitQuaternion, Vector3};

use crate::inertial::preintegration::ImuPreintegration;

/// Unknowns besides the points: velocity and gravity at the first image, biases of gyroscope and accelerometer.
pub(crate) const GLOBAL: usize = 12;
pub(super) const VELOCITY: usize = 0;
pub(super) const GRAVITY: usize = 3;
pub(super) const BIASES: usize = 6;
/// Changes of velocity that stand for the white noise of the accelerometer over the window: spread evenly, three axes each (ours).
pub(super) const CHANGES: usize = 6;
pub(super) const NOISE: usize = 3 * CHANGES;
/// Errors of an outcome: those of the unknowns by the images alone, and the changes of velocity.
pub(crate) const ERRORS: usize = GLOBAL + NOISE;

/// A point in one of the images of the window: index of the image, and the direction in camera axes.
pub(crate) type BearingObservation = (usize, Vector3<f64>);

/// The observations of a window, and the camera that made them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WindowInput<'a> {
    /// Observations of each point, in the order of the images, two at least.
    pub(crate) points: &'a [Vec<BearingObservation>],
    /// Position and attitude of the camera on the body.
    pub(crate) camera: (Vector3<f64>, UnitQuaternion<f64>),
    /// Pixels per radian.
    pub(crate) focal_length: f64,
    /// Magnitude of gravity.
    pub(crate) gravity: f64,
    /// White noise of gyroscope and accelerometer, rad/s/√Hz and m/s²/√Hz.
    pub(crate) densities: [f64; 2],
}

/// Observations and the preintegrated motion between their images.
pub(super) struct InitializationWindow<'a> {
    pub(super) input: &'a WindowInput<'a>,
    /// From the first image to each.
    pub(super) preintegrations: Vec<ImuPreintegration>,
    /// Bias of the gyroscope that the preintegrations were made with; that of the accelerometer was zero.
    pub(super) gyro_bias: Vector3<f64>,
}

impl InitializationWindow<'_> {
    /// Difference of biases from those that the preintegrations were made with.
    pub(super) fn bias_change(&self, biases: &SVector<f64, 6>) -> SVector<f64, 6> {
        let mut change = *biases;
        let mut gyro = change.fixed_rows_mut::<3>(0);
        gyro -= self.gyro_bias;
        change
    }

    fn duration(&self) -> f64 {
        self.preintegrations.last().map_or(0.0, |last| last.duration)
    }

    /// Variance of each change of velocity, (m/s)².
    pub(super) fn change_variance(&self) -> f64 {
        self.input.densities[1].powi(2) * self.duration() / CHANGES as f64
    }

    /// How far each change of velocity has moved the body at a time, m per m/s.
    pub(super) fn moved_by_changes(&self, time: f64) -> [f64; CHANGES] {
        let each = self.duration() / CHANGES as f64;
        std::array::from_fn(|k| (time - each * (k as f64 + 0.5)).max(0.0))
    }
}
