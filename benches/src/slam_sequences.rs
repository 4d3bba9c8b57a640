//! Five rendered RGB-D-inertial sequences of the lengths and speeds of Table 5.1 of Paper I, and the dense SLAM over them.

mod camera;
mod flight;
mod run;
mod sequence;
mod solid;
mod world;

pub use camera::{DepthCamera, Shot};
pub use run::{Figures, Limits, See, run};
pub use sequence::{ALL, Published, Sequence};
