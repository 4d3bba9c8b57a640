//! The window of images and inertial samples that an initialization in motion is solved over.

use nalgebra::{SVector, UnitQuaternion, Vector3};

use crate::inertial::preintegration::ImuPreintegration;

/// Unknowns besides the points: velocity and gravity at the first image, biases of gyroscope and accelerometer.
pub(crate) const GLOBAL: usize = 12;
pub(super) const VELOCITY: usize = 0;
pub(super) const GRAVITY: usize = 3;
pub(super) const BIASES: usize = 6;

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
}
