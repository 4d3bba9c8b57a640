//! Recordings that ROS 2 tools read whole: every message in CDR, its definition beside it, profile `ros2`.

mod convert;
mod definition;
mod messages;
mod transcode;
mod writer;

pub(crate) use transcode::write_ros2_beside;
#[cfg(feature = "vio")]
pub(crate) use {
    definition::RosMessage,
    messages::{CameraInfo, Text, Transforms},
    writer::Ros2Writer,
};
