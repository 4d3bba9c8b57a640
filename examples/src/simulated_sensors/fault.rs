//! What goes wrong with a simulated robot's sensors.

use serde::{Deserialize, Serialize};
use vio_ekf::Imu;

/// A fault of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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

/// A fault with the time in which it is there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultInterval {
    /// What.
    pub fault: SensorFault,
    /// One of inertial samples is that of the vehicle's own sensor instead of the camera's.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_vehicle: bool,
    /// Since when, s after the flight's first paint.
    pub from: f64,
    /// Until when, s.
    pub until: f64,
}

impl FaultInterval {
    /// Whether it is there so many seconds after the first paint.
    pub fn contains(&self, time: f64) -> bool {
        (self.from..self.until).contains(&time)
    }

    /// Whether times and sizes are numbers that something can be done with.
    pub fn is_sound(&self) -> bool {
        let sound = match self.fault {
            SensorFault::DepthOfElsewhere(off) => off.is_finite(),
            SensorFault::LateMotion(ms) => ms >= 0,
            SensorFault::Clipped(most) => most.is_finite() && most >= 0.0,
            _ => true,
        };
        sound && self.from >= 0.0 && self.until >= self.from
    }
}
