//! Spray deposit with exact books, Kubelka-Munk appearance, a renderer, and the closed-loop flight that paints.

pub mod colour;
mod error;
pub mod film;
pub mod flight;
pub mod km;
pub mod paint;
pub mod render;
mod rng;
pub mod spray;
pub mod surface;

pub use nalgebra;

pub use colour::ciede2000;
pub use error::Error;
pub use film::{Books, Film, Texel};
pub use flight::{FlightLog, FlightSettings, FlightStatistics, PanTilt, Reference, ReferenceState, fly};
pub use paint::{Paint, Substrate};
pub use render::{Camera, Frame, Lights, render};
pub use spray::{Shot, SprayModel};
pub use surface::{Hit, Surface, TriangleSurface};
