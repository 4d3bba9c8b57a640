//! The robot's own programs: what runs on board, and the sensors that a simulated flight gives it.

mod approach;
mod localisation;
mod localised_flight;
mod piece;
mod surveyed_map;
mod sway;

pub use approach::Approach;
pub use localisation::{LocalisationError, MapUpdate, OnboardLocalisation, read_map};
pub use localised_flight::{Bridging, LocalisationFigures, LocalisedFlight};
pub use piece::Piece;
pub use surveyed_map::surveyed_map;
