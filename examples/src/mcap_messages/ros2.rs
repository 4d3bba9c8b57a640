//! Recordings that ROS 2 tools read whole: every message in CDR, its definition beside it, profile `ros2`.

mod convert;
mod definition;
mod messages;
mod transcode;
mod writer;

pub(crate) use definition::RosMessage;
pub(crate) use messages::{CameraInfo, CompressedImage, Image, Pose, PoseStamped, Text, TransformStamped, Transforms};
pub(crate) use transcode::write_ros2_beside;
pub(crate) use writer::Ros2Writer;
