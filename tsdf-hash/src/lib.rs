//! Dense mapping: a voxel-hashed truncated signed distance field with exactly reversible fusion, and its mesh.
pub use nalgebra;

mod block;
mod candidates;
mod error;
mod fuse;
mod key;
mod map;
mod mesh;
mod parallel;
mod settings;
mod store;
mod surface;
mod table;
mod view;

pub use error::Error;
pub use map::{FrameReport, Map};
pub use mesh::{Mesh, write_ply};
pub use settings::{NoiseModel, Settings};
pub use view::{ColourView, DepthData, DepthView, Intrinsics};
