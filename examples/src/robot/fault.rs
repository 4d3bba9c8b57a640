//! What goes wrong on purpose, to see what the robot does.

use std::str::FromStr;

use mavlink::dialects::common::{EstimatorStatusFlags, MavMessage};

use crate::simulated_sensors::{FaultInterval, SensorFault};

/// The autopilot says what has changed in it within this time, s: it obeys its pilot after 8 to 12 ms, and its messages are as far apart.
const REPORT: f64 = 0.02;

/// What fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum FaultKind {
    /// The off-board link carries nothing, neither way.
    Link,
    /// No pose arrives.
    Pose,
    /// The stamps of the autopilot's messages are three seconds late.
    Clock,
    /// The autopilot's estimator says that it knows no position.
    Estimate,
    /// The battery is nearly empty.
    Battery,
    /// The pilot takes over: he wants it to land.
    Mode,
    /// The autopilot is ended and started anew.
    Restart,
    /// The on-board program is ended.
    Program,
    /// Pan and tilt stay where they are.
    Servo,
    /// The camera's images are black.
    Camera,
    /// No depth image arrives.
    Depth,
    /// Neither image arrives.
    Images,
    /// Depth is that of a place 10 cm to the side: tracking offers a wrong pose.
    Elsewhere,
    /// No sample of the camera's inertial sensor arrives.
    Imu,
    /// Its samples are 100 ms late.
    Late,
    /// Its accelerometer reads at most 9 m/s² on an axis.
    Clipped,
    /// Its gyroscope's x and y are swapped.
    Swapped,
}

/// A fault in a time of the flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// What fails.
    pub kind: FaultKind,
    /// When, seconds after the first paint phase began.
    pub at: f64,
    /// For how long, s; infinite for what does not come back.
    pub duration: f64,
}

impl Fault {
    /// Whether it lasts at a time.
    pub fn holds(&self, time: f64) -> bool {
        (self.at..self.at + self.duration).contains(&time)
    }

    /// Whether the valve may not be open at a time: from one control step after the cause on. What only the autopilot knows is a cause
    /// when it says so.
    pub(super) fn forbids_paint(&self, time: f64, control_step: f64) -> bool {
        let said = match self.kind {
            FaultKind::Link | FaultKind::Pose | FaultKind::Restart | FaultKind::Program => 0.0,
            FaultKind::Clock | FaultKind::Estimate | FaultKind::Battery | FaultKind::Mode => REPORT,
            // The robot may go on for as long as its paint meets its aim.
            _ => return false,
        };
        (self.at + said + control_step - 1e-9..self.at + self.duration).contains(&time)
    }

    /// That of a sensor by which the robot localises itself, as its senses are told.
    pub(super) fn of_sensors(&self) -> Option<FaultInterval> {
        let fault = match self.kind {
            FaultKind::Camera => SensorFault::CameraBlack,
            FaultKind::Depth => SensorFault::NoDepth,
            FaultKind::Images => SensorFault::NoImages,
            FaultKind::Elsewhere => SensorFault::DepthOfElsewhere(0.1),
            FaultKind::Imu => SensorFault::NoMotion,
            FaultKind::Late => SensorFault::LateMotion(100),
            FaultKind::Clipped => SensorFault::Clipped(9.0),
            FaultKind::Swapped => SensorFault::Swapped,
            _ => return None,
        };
        Some(FaultInterval { fault, of_vehicle: false, from: self.at, until: self.at + self.duration })
    }
}

impl FaultKind {
    /// What the fault makes of a message of the autopilot.
    pub(super) fn distort(self, message: &mut MavMessage) {
        match (self, message) {
            (Self::Clock, MavMessage::ATTITUDE_QUATERNION(m)) => m.time_boot_ms = m.time_boot_ms.wrapping_add(3000),
            (Self::Clock, MavMessage::LOCAL_POSITION_NED(m)) => m.time_boot_ms = m.time_boot_ms.wrapping_add(3000),
            (Self::Estimate, MavMessage::ESTIMATOR_STATUS(m)) => m.flags = EstimatorStatusFlags::ESTIMATOR_ATTITUDE,
            (Self::Battery, MavMessage::SYS_STATUS(m)) => m.battery_remaining = 7,
            _ => {}
        }
    }
}

impl FromStr for Fault {
    type Err = String;

    /// `link@12+3`: kind, when, for how long.
    fn from_str(text: &str) -> Result<Self, String> {
        let usage = || {
            format!(
                "{text}: give KIND@SECONDS+DURATION with link, pose, clock, estimate, mode, servo, camera, depth, images, elsewhere, imu, late, \
                 clipped or swapped for KIND, or KIND@SECONDS with battery, restart or program"
            )
        };
        let seconds = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0).ok_or_else(usage);
        let (kind, times) = text.split_once('@').ok_or_else(usage)?;
        let kind = clap::ValueEnum::from_str(kind, false).map_err(|_| usage())?;
        let lasting = matches!(kind, FaultKind::Battery | FaultKind::Restart | FaultKind::Program);
        match (lasting, times.split_once('+')) {
            (true, None) => Ok(Self { kind, at: seconds(times)?, duration: f64::INFINITY }),
            (false, Some((at, duration))) => Ok(Self { kind, at: seconds(at)?, duration: seconds(duration)? }),
            _ => Err(usage()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_and_bad_ones_are_refused() {
        assert_eq!("link@12.5+3".parse(), Ok(Fault { kind: FaultKind::Link, at: 12.5, duration: 3.0 }));
        assert_eq!("restart@2".parse(), Ok(Fault { kind: FaultKind::Restart, at: 2.0, duration: f64::INFINITY }));
        for bad in ["link", "link@", "link@3", "link@-1+2", "link@1+nan", "restart@1+1", "engine@1+1"] {
            assert!(bad.parse::<Fault>().unwrap_err().contains("KIND@SECONDS"), "{bad}");
        }
    }
}
