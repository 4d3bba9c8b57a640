//! The frame of a mesh file: where it lies, which way is up in it, how long its unit is.
//!
//! A surveyed mesh lies hundreds of kilometres from the origin of its coordinates, a model of a scanner is in millimetres, and few formats say
//! which axis points up. What can be told from the mesh is told here; what cannot is `None`, and the caller asks.

mod origin;
mod unit;
mod up;

pub use origin::{Recentred, recentre};
pub use unit::Unit;
pub use up::{Up, UpEvidence, up_axis};
