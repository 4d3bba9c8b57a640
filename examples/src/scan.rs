//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod arguments;
mod checkpoint;
mod decode;
mod error;
mod execute;
mod image_source;
mod imu_file;
mod layouts;
mod live;
mod mapped;
mod mcap_in;
mod messages;
mod options;
mod pairing;
mod pose_file;
mod ray_cast_check;
mod report;
mod run;
mod sequence;
mod settings;
mod start;
mod views;

pub use arguments::Arguments;
pub use checkpoint::CheckpointSettings;
pub use decode::{Colour, Images};
pub use error::{ScanError, SequenceError};
pub use execute::execute;
pub use image_source::{ImageSource, ImageTopic};
pub use layouts::open_sequence;
pub use live::LiveSettings;
pub use mapped::{Scan, ScanMetrics};
pub use options::FrameRange;
pub use ray_cast_check::RayCastCheck;
pub use report::ScanReport;
pub use sequence::{ColourCamera, FrameFiles, Sequence};
pub use settings::ScanSettings;
