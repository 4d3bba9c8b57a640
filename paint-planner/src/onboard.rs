//! What a robot that paints decides on board, fed step by step: phases and ways between them, failsafes, sorties. It knows neither links
//! nor sensors, and times are those of whoever runs it.

mod failsafe;
mod guidance;
mod phase;
mod phases;
mod sorties;
mod straight_way;

pub use failsafe::{Cause, FailsafeSettings, Watched, WatchedPose};
pub use guidance::{FlightPlan, Guidance, Guided};
pub use phase::{Phase, Request, Situation};
pub use phases::Phases;
pub use sorties::{Endurance, Sortie, sorties};
pub use straight_way::{StraightWay, minimum_jerk};
