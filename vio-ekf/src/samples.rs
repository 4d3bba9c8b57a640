//! What the sensors give: inertial samples, their noise, images.

use nalgebra::Vector3;

use crate::error::Error;
use crate::stamp::Stamp;
use crate::trajectory::same_length;

/// One sample of an inertial measurement unit, in the axes of the unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imu {
    /// Time of the sample.
    pub stamp: Stamp,
    /// Angular rate, rad/s.
    pub gyro: Vector3<f64>,
    /// Specific force, m/s²: a unit at rest with its z axis up reads `(0, 0, +9.81)`.
    pub accel: Vector3<f64>,
}

impl Imu {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.gyro.iter().chain(self.accel.iter()).all(|v| v.is_finite())
    }

    /// Refuses a sample that is not finite, or not after the last one.
    pub(crate) fn check_after(&self, last: Option<&Self>) -> Result<(), Error> {
        if !self.is_finite() {
            return Err(Error::NonFinite { what: "inertial sample", index: 0 });
        }
        match last {
            Some(last) if self.stamp <= last.stamp => {
                Err(Error::NotIncreasing { index: 0, previous: last.stamp, stamp: self.stamp })
            }
            _ => Ok(()),
        }
    }
}

/// A grey image, borrowed: 8 bits per pixel, row by row from the top, without padding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageView<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` grey values.
    pub data: &'a [u8],
}

impl<'a> ImageView<'a> {
    /// Refuses data of another length than `width · height`.
    pub fn new(width: usize, height: usize, data: &'a [u8]) -> Result<Self, Error> {
        same_length("image data", data.len(), "width times height", width.saturating_mul(height))?;
        Ok(Self { width, height, data })
    }

    /// Refuses an image that is not of the expected width and height, or not of its own: the fields are public.
    pub(crate) fn checked(&self, expected: (usize, usize)) -> Result<Self, Error> {
        let given = (self.width, self.height);
        if given != expected {
            return Err(Error::ImageSize { given, expected });
        }
        Self::new(self.width, self.height, self.data)
    }
}

/// Noise of an inertial measurement unit as continuous-time densities, the numbers a Kalibr file holds.
///
/// White noise of a sample is density times the square root of the rate; a bias walks by walk times the square root of
/// the time that passes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ImuNoise {
    /// White noise of the gyroscope, rad/s/√Hz; ADIS16448 of the EuRoC vehicle: 1.6968e-4.
    pub gyro_density: f64,
    /// Random walk of the gyroscope's bias, rad/s²/√Hz; ADIS16448: 1.9393e-5.
    pub gyro_walk: f64,
    /// White noise of the accelerometer, m/s²/√Hz; ADIS16448: 2e-3.
    pub accel_density: f64,
    /// Random walk of the accelerometer's bias, m/s³/√Hz; ADIS16448: 3e-3.
    pub accel_walk: f64,
}

impl Default for ImuNoise {
    /// The sensor of the EuRoC data set (Burri et al. 2016).
    fn default() -> Self {
        Self { gyro_density: 1.6968e-4, gyro_walk: 1.9393e-5, accel_density: 2e-3, accel_walk: 3e-3 }
    }
}

impl ImuNoise {
    /// No noise and constant biases.
    pub const ZERO: Self = Self { gyro_density: 0.0, gyro_walk: 0.0, accel_density: 0.0, accel_walk: 0.0 };

    /// Refuses densities that are negative or not finite.
    pub fn check(&self) -> Result<(), Error> {
        let fields = [
            ("gyro_density", self.gyro_density),
            ("gyro_walk", self.gyro_walk),
            ("accel_density", self.accel_density),
            ("accel_walk", self.accel_walk),
        ];
        crate::error::all_not_negative(&fields)
    }
}
