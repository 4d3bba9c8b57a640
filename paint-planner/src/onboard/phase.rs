//! What the robot is doing, what it is told, and what it asks for.

use std::fmt;

use nalgebra::Point3;

use super::failsafe::Cause;

/// The phases of a flight. The valve opens in [`Phase::Paint`] only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// On the ground until the autopilot knows where it is.
    Wait,
    /// On the ground until it follows our set-points with its motors on.
    Arm,
    /// Straight up to the height of the plan's start, or above a station that is higher.
    TakeOff,
    /// To where the plan starts or goes on, and a moment of rest there.
    Approach,
    /// Along the plan.
    Paint,
    /// In its place with the valve shut, and why.
    Hold(Cause),
    /// Back over the place of the start.
    Return,
    /// Down, by the autopilot itself.
    Land,
    /// On the ground with motors off.
    Done,
    /// Given up, and why.
    Aborted(Cause),
}

impl Phase {
    /// Whether it is in the air under our set-points: then a cause of a failsafe ends it.
    pub fn is_guarded(self) -> bool {
        matches!(self, Self::TakeOff | Self::Approach | Self::Paint | Self::Hold(_) | Self::Return)
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wait => f.write_str("wait"),
            Self::Arm => f.write_str("arm"),
            Self::TakeOff => f.write_str("take off"),
            Self::Approach => f.write_str("approach"),
            Self::Paint => f.write_str("paint"),
            Self::Hold(cause) => write!(f, "hold: {}", cause.text()),
            Self::Return => f.write_str("return"),
            Self::Land => f.write_str("land"),
            Self::Done => f.write_str("done"),
            Self::Aborted(cause) => write!(f, "aborted: {}", cause.text()),
        }
    }
}

/// What the autopilot is asked for until it does it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// To follow our set-points.
    Offboard,
    /// To follow our set-points and turn its motors on. In simulation only: on a vehicle it is the pilot who arms.
    Arm,
    /// To land where it is.
    Land,
}

/// What the state machine is told in a control step.
#[derive(Debug, Clone, Copy)]
pub struct Situation {
    /// Time, s.
    pub now: f64,
    /// Why the flight must not go on.
    pub cause: Option<Cause>,
    /// Where the robot takes itself to be.
    pub position: Point3<f64>,
    /// Its heading, rad.
    pub heading: f64,
    /// Whether the autopilot takes itself to be there too.
    pub ready: bool,
    /// Whether the motors may turn.
    pub armed: bool,
}
