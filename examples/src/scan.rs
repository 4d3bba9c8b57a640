//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod checkpoint;
mod correction;
mod decode;
mod error;
mod gyroscope;
mod image_source;
mod layouts;
mod live;
mod map_store;
mod mapped;
mod mcap_in;
mod options;
mod pairing;
mod pose_file;
mod pose_source;
mod prediction;
mod quality;
mod ray_cast_check;
mod recent_map;
mod reintegration;
mod report;
mod run;
mod sequence;
mod settings;
mod start;
mod views;

pub use checkpoint::CheckpointSettings;
pub use correction::LoopMetrics;
pub use decode::{Colour, Images};
pub use error::{ScanError, SequenceError};
pub use gyroscope::Gyroscope;
pub use image_source::{ImageSource, ImageTopic};
pub use layouts::open_sequence;
pub use live::LiveSettings;
pub use map_store::Device;
pub use mapped::{Scan, ScanMetrics};
pub use options::{
    FrameRange, in_options, mebibytes, parse_intrinsics, parse_noise, parse_odometry_error, read_body_from_camera,
    read_colour_camera,
};
pub use pose_file::take_poses;
pub use pose_source::{PoseSource, TrackingMetrics};
pub use prediction::OdometryError;
pub use quality::Quality;
pub use ray_cast_check::RayCastCheck;
pub use report::ScanReport;
pub use sequence::{ColourCamera, FrameFiles, Sequence};
pub use settings::ScanSettings;
pub use views::save_views;
