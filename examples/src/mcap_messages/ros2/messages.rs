//! Messages of ROS 2 that are only written, and the definitions of all that are. Fields are named there.

use serde::Serialize;

use super::definition::{
    COLOUR, COMPRESSED_IMAGE, DURATION, HEADER, MARKER, MESH_FILE, POINT, POSE, Part, QUATERNION, REGION, RosMessage,
    TIME, TRANSFORM, TRANSFORM_STAMPED, UV, VECTOR,
};
use crate::mcap_messages::cdr::{self, Header, Pose, PoseStamped};

/// `tf2_msgs/msg/TFMessage`.
#[derive(Serialize)]
pub(crate) struct Transforms(pub(crate) Vec<cdr::TransformStamped>);

/// `sensor_msgs/msg/JointState`.
#[derive(Serialize)]
pub(crate) struct JointState {
    pub(crate) header: Header,
    pub(crate) name: Vec<String>,
    pub(crate) position: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) effort: Vec<f64>,
}

/// `sensor_msgs/msg/CameraInfo`.
#[derive(Default, Serialize)]
pub(crate) struct CameraInfo {
    pub(crate) first: cdr::CameraInfo,
    /// Row by row, as the next.
    pub(crate) r: [f64; 9],
    pub(crate) p: [f64; 12],
    pub(crate) binning: [u32; 2],
    pub(crate) region: Region,
}

/// `sensor_msgs/RegionOfInterest`; zeros are the whole image.
#[derive(Default, Serialize)]
pub(crate) struct Region {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
    do_rectify: bool,
}

/// `std_msgs/msg/String`.
#[derive(Serialize)]
pub(crate) struct Text(pub(crate) String);

/// `rcl_interfaces/msg/Log`.
#[derive(Serialize)]
pub(crate) struct Log {
    /// Seconds and nanoseconds.
    pub(crate) stamp: (i32, u32),
    /// 10 for debugging, 20 information, 30 warnings, 40 errors.
    pub(crate) level: u8,
    pub(crate) name: String,
    pub(crate) msg: String,
    pub(crate) file: String,
    pub(crate) function: String,
    pub(crate) line: u32,
}

/// One of `visualization_msgs/msg/MarkerArray`.
#[derive(Default, Serialize)]
pub(crate) struct Marker {
    pub(crate) header: Header,
    pub(crate) ns: String,
    pub(crate) id: i32,
    pub(crate) kind: i32,
    pub(crate) action: i32,
    pub(crate) pose: Pose,
    pub(crate) scale: [f64; 3],
    /// r, g, b, a.
    pub(crate) color: [f32; 4],
    pub(crate) lifetime: (i32, u32),
    pub(crate) frame_locked: bool,
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) colors: Vec<[f32; 4]>,
    pub(crate) texture_resource: String,
    pub(crate) texture: cdr::CompressedImage<'static>,
    pub(crate) uv_coordinates: Vec<[f32; 2]>,
    pub(crate) text: String,
    pub(crate) mesh_resource: String,
    pub(crate) mesh_file: (String, Vec<u8>),
    pub(crate) mesh_use_embedded_materials: bool,
}

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Serialize)]
pub(crate) struct Markers(pub(crate) Vec<Marker>);

impl RosMessage for PoseStamped {
    const NAME: &'static str = "geometry_msgs/msg/PoseStamped";
    const FIELDS: &'static str = "std_msgs/Header header\ngeometry_msgs/Pose pose\n";
    const PARTS: &'static [Part] = &[HEADER, TIME, POSE, POINT, QUATERNION];
}

impl RosMessage for Transforms {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";
    const FIELDS: &'static str = "geometry_msgs/TransformStamped[] transforms\n";
    const PARTS: &'static [Part] = &[TRANSFORM_STAMPED, HEADER, TIME, TRANSFORM, VECTOR, QUATERNION];
}

impl RosMessage for JointState {
    const NAME: &'static str = "sensor_msgs/msg/JointState";
    const FIELDS: &'static str =
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
    const PARTS: &'static [Part] = &[HEADER, TIME];
}

impl RosMessage for cdr::Image<'_> {
    const NAME: &'static str = "sensor_msgs/msg/Image";
    const FIELDS: &'static str = "\
std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
";
    const PARTS: &'static [Part] = &[HEADER, TIME];
}

impl RosMessage for cdr::CompressedImage<'_> {
    const NAME: &'static str = "sensor_msgs/msg/CompressedImage";
    const FIELDS: &'static str = COMPRESSED_IMAGE.1;
    const PARTS: &'static [Part] = &[HEADER, TIME];
}

impl RosMessage for CameraInfo {
    const NAME: &'static str = "sensor_msgs/msg/CameraInfo";
    const FIELDS: &'static str = "\
std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
sensor_msgs/RegionOfInterest roi
";
    const PARTS: &'static [Part] = &[HEADER, TIME, REGION];
}

impl RosMessage for cdr::Imu {
    const NAME: &'static str = "sensor_msgs/msg/Imu";
    const FIELDS: &'static str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
";
    const PARTS: &'static [Part] = &[HEADER, TIME, QUATERNION, VECTOR];
}

impl RosMessage for Text {
    const NAME: &'static str = "std_msgs/msg/String";
    const FIELDS: &'static str = "string data\n";
}

impl RosMessage for Log {
    const NAME: &'static str = "rcl_interfaces/msg/Log";
    const FIELDS: &'static str = "\
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
";
    const PARTS: &'static [Part] = &[TIME];
}

impl RosMessage for Markers {
    const NAME: &'static str = "visualization_msgs/msg/MarkerArray";
    const FIELDS: &'static str = "visualization_msgs/Marker[] markers\n";
    const PARTS: &'static [Part] =
        &[MARKER, HEADER, TIME, POSE, POINT, QUATERNION, VECTOR, COLOUR, DURATION, COMPRESSED_IMAGE, UV, MESH_FILE];
}
