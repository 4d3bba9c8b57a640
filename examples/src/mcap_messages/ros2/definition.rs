//! The definition of a message as recordings carry it: its fields, then those of every type in it.

use serde::Serialize;

/// A ROS 2 message, its fields in the order of its definition.
pub(crate) trait RosMessage: Serialize {
    /// `package/msg/Name`.
    const NAME: &'static str;
    /// A field a line, type and name.
    const FIELDS: &'static str;
    /// The types in it, and those in these.
    const PARTS: &'static [Part] = &[];
}

/// A type of message that others hold: `package/Name`, and its fields.
pub(crate) type Part = (&'static str, &'static str);

pub(crate) const TIME: Part = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
pub(crate) const DURATION: Part = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n");
pub(crate) const HEADER: Part = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
pub(crate) const COLOUR: Part = ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n");
pub(crate) const VECTOR: Part = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
pub(crate) const POINT: Part = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
pub(crate) const QUATERNION: Part = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
pub(crate) const POSE: Part =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
pub(crate) const TRANSFORM: Part =
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n");
pub(crate) const TRANSFORM_STAMPED: Part = (
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
);
pub(crate) const REGION: Part = (
    "sensor_msgs/RegionOfInterest",
    "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
);
pub(crate) const COMPRESSED_IMAGE: Part =
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n");
pub(crate) const UV: Part = ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n");
pub(crate) const MESH_FILE: Part = ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n");
pub(crate) const MARKER: Part = (
    "visualization_msgs/Marker",
    "\
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
",
);

/// The definition of a message with those of its parts, as rosbag2 writes it into MCAP files (`ros2msg`).
pub(crate) fn definition<M: RosMessage>() -> String {
    let part = |(name, fields): &Part| format!("{}\nMSG: {name}\n{fields}", "=".repeat(80));
    std::iter::once(M::FIELDS.to_string()).chain(M::PARTS.iter().map(part)).collect()
}
