//! The scan before the paint: the robot flies along a surface it has no mesh of, finds out where it is with its own camera and
//! inertial sensor, and maps with its own depth camera. What it paints afterwards is what it has mapped.

mod error;
mod evaluation;
mod fly;
mod localiser;
mod output;
pub(crate) mod route;

pub use error::ScanFlightError;
pub use evaluation::ScanFlightFigures;
pub use fly::ScanFlight;
pub use output::{MAP_FILE, save};
