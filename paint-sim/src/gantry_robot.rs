//! The hardware of a handheld gantry robot and the person who holds it (handheld paper, Section VI-B, Fig. 6).

mod hand_motion;
mod inertial_sensor;
mod pose_sensor;
mod range_sensor;
mod stepper;
mod valve;

pub use hand_motion::{HandMotion, HandSettings, Pass};
pub use inertial_sensor::{InertialReading, InertialSensor, InertialSensorSettings};
pub use pose_sensor::{PoseSensor, PoseSensorSettings};
pub use range_sensor::{RangeSensor, RangeSensorSettings};
pub use stepper::{Stepper, StepperSettings};
pub use valve::{Valve, ValveSettings};
