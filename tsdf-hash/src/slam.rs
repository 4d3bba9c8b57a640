//! Dense SLAM as a whole: depth images in, trajectory, map, mesh and keyframes out.
//!
//! [`Slam`] locates a frame ([`Frontend`]: motion model, tracking against the map, relocalisation), fuses it, and looks for loops; where one
//! is closed the trajectory is corrected at once and the map follows, frame by frame, to the bit. (Thesis Paper I, algorithm 1.)

mod backend;
mod camera_check;
mod correction;
mod frame_memory;
mod frame_source;
mod frontend;
mod frontend_state;
mod gyroscope;
mod key_view;
mod local_map;
#[cfg(feature = "pose-graph")]
mod loop_correction;
mod motion_model;
mod outcome;
mod quality;
mod reintegration;
mod self_calibration;
mod settings;
mod state;
mod system;
mod trajectory_text;
mod wrong_minimum;

pub use camera_check::CameraDoubt;
pub use correction::Correction;
pub use frame_memory::FrameMemory;
pub use frame_source::{ColourImage, ColourPixels, DepthPixels, FrameImages, FrameSource};
pub use frontend::{Frontend, Located};
pub use frontend_state::FrontendState;
pub use gyroscope::Gyroscope;
pub use local_map::LocalMap;
pub use motion_model::{MotionModel, OdometryError, StampedPose};
pub use outcome::{Event, FrameOutcome, LeftOut, PlacedFrame, SlamStatistics};
pub use quality::Quality;
pub use settings::{PoseSource, SlamSettings};
pub use state::SlamState;
pub use system::Slam;
pub use trajectory_text::{trajectory_from_tum, trajectory_to_tum};

pub use crate::device_map::{Device, DeviceMap};
pub use crate::error::BoxedError;
