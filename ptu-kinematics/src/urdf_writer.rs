//! The pan-tilt unit as a URDF file, for viewers and planners of others.

use nalgebra::Vector3;

use crate::joints::Range;
use crate::settings::PtuSettings;

/// Lower bound that URDF asks of a joint's effort, N m: ours has none.
const EFFORT: f64 = 1.0;

/// See `Ptu::to_urdf`.
pub(crate) fn write(settings: &PtuSettings, robot: &str, max_rate: f64) -> String {
    let vector = |v: &Vector3<f64>| format!("{} {} {}", v.x, v.y, v.z);
    let joint = |name: &str, parent: &str, origin: &Vector3<f64>, axis: &str, limits: &Range| {
        let (origin, Range { min, max }) = (vector(origin), limits);
        format!(
            "  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{name}\"/>\n    \
             <origin xyz=\"{origin}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    \
             <limit lower=\"{min}\" upper=\"{max}\" effort=\"{EFFORT}\" velocity=\"{max_rate}\"/>\n  </joint>\n"
        )
    };
    // Tilt is positive upwards: about -y. A fixed rotation about y by the negative angle lifts the gun.
    let (tip, pitch) = (vector(&settings.tilt_from_tip), 0.0 - settings.gun_pitch);
    format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"body\"/>\n  <link name=\"pan\"/>\n  <link name=\"tilt\"/>\n  \
         <link name=\"nozzle\"/>\n{}{}  <joint name=\"nozzle\" type=\"fixed\">\n    <parent link=\"tilt\"/>\n    \
         <child link=\"nozzle\"/>\n    <origin xyz=\"{tip}\" rpy=\"0 {pitch} 0\"/>\n  </joint>\n</robot>\n",
        escaped(robot),
        joint("pan", "body", &settings.body_from_pan_axis, "0 0 1", &settings.pan_limits),
        joint("tilt", "pan", &settings.pan_from_tilt_axis, "0 -1 0", &settings.tilt_limits),
    )
}

/// Text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
