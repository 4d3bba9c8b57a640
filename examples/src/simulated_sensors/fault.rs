//! What goes wrong with a simulated robot's sensors.

use vio_ekf::Imu;

/// A fault of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorFault {
    /// Images are black; depth is as it is.
    CameraBlack,
    /// No depth image arrives.
    NoDepth,
    /// Neither arrives.
    NoImages,
    /// Depth is that of a place so far to the side, m: what tracking makes of it is a wrong pose that agrees with the map.
    DepthOfElsewhere(f64),
    /// No inertial sample arrives.
    NoMotion,
    /// Inertial samples arrive so many milliseconds late; in the end all that wait arrive at once.
    LateMotion(i64),
    /// The accelerometer reads at most so much on each axis, m/s².
    Clipped(f64),
    /// The gyroscope's x and y are swapped.
    Swapped,
}

impl SensorFault {
    /// What is left of an inertial sample.
    #[must_use]
    pub fn inertial(self, mut sample: Imu) -> Option<Imu> {
        match self {
            Self::NoMotion => return None,
            Self::Clipped(most) => sample.accel = sample.accel.map(|a| a.clamp(-most, most)),
            Self::Swapped => sample.gyro.swap_rows(0, 1),
            Self::CameraBlack | Self::NoDepth | Self::NoImages | Self::DepthOfElsewhere(_) | Self::LateMotion(_) => {}
        }
        Some(sample)
    }
}

/// A fault with the time in which it is there, milliseconds of the sensors' clock.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultInterval {
    /// What.
    pub fault: SensorFault,
    /// One of inertial samples is that of the vehicle's own sensor instead of the camera's.
    pub of_vehicle: bool,
    /// When.
    pub when: std::ops::Range<i64>,
}
