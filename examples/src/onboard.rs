//! The robot's own programs: what runs on board, and the sensors that a simulated flight gives it.

mod approach;
mod localisation;
mod localised_flight;
mod piece;

pub use approach::Approach;
pub use localisation::{LocalisationError, MapUpdate, OnboardLocalisation, read_map};
pub use localised_flight::{LocalisationFigures, LocalisedFlight};
pub use piece::Piece;
