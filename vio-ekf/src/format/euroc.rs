//! EuRoC/ASL: comma-separated, nanoseconds, `t, p xyz, q wxyz` (**scalar first**), then velocity and biases if known.

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::data_lines;
use crate::error::Error;
use crate::trajectory::Trajectory;

/// A ground-truth or estimate file with as much as it gives. Vectors that the file lacks are empty.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct States {
    /// Poses `world_from_body`; the body is the IMU.
    pub trajectory: Trajectory,
    /// Velocity of the body in world axes, m/s, one per pose; empty in files of 8 columns.
    pub velocities_in_world: Vec<Vector3<f64>>,
    /// Gyroscope bias in body axes, rad/s, one per pose; empty unless the file has 17 columns.
    pub gyro_biases: Vec<Vector3<f64>>,
    /// Accelerometer bias in body axes, m/s², one per pose; empty unless the file has 17 columns.
    pub accel_biases: Vec<Vector3<f64>>,
}

/// Reads 8 columns (pose), 11 (and velocity) or 17 (and both biases), the same in all lines.
///
/// ```
/// let states = vio_ekf::format::euroc::read("1403636580838555648,1,2,3,1,0,0,0,0.5,0,0\n")?;
/// assert_eq!(states.trajectory.stamps()[0].nanos(), 1_403_636_580_838_555_648);
/// assert_eq!(states.velocities_in_world[0].x, 0.5);
/// assert!(states.gyro_biases.is_empty());
/// # Ok::<(), vio_ekf::Error>(())
/// ```
pub fn read(text: &str) -> Result<States, Error> {
    let mut states = States::default();
    let mut width = None;
    for line in data_lines("EuRoC", text) {
        let fields: Vec<&str> = line.text.split(',').map(str::trim).collect();
        let columns = fields.len();
        if !matches!(columns, 8 | 11 | 17) {
            return Err(line.error(format!("{columns} columns, expected 8 (t p q), 11 (and v) or 17 (and biases)")));
        }
        if *width.get_or_insert(columns) != columns {
            return Err(line.error(format!("{columns} columns, but the lines before had another number")));
        }
        let mut v = [0.0; 17];
        for (column, field) in fields.iter().enumerate().skip(1) {
            v[column] = line.number(column, field)?;
        }
        let pose = line.pose([v[1], v[2], v[3]], v[4], [v[5], v[6], v[7]])?;
        if !line.push(&mut states.trajectory, line.stamp(fields[0], 0)?, pose)? {
            continue;
        }
        if columns >= 11 {
            states.velocities_in_world.push(Vector3::new(v[8], v[9], v[10]));
        }
        if columns == 17 {
            states.gyro_biases.push(Vector3::new(v[11], v[12], v[13]));
            states.accel_biases.push(Vector3::new(v[14], v[15], v[16]));
        }
    }
    if states.trajectory.is_empty() {
        return Err(Error::TooFew { what: "poses in the EuRoC text", got: 0, need: 1 });
    }
    Ok(states)
}

/// Writes the columns that are there, with a header line. Each vector must be empty or as long as the trajectory, and
/// biases need velocities before them.
pub fn write(states: &States) -> Result<String, Error> {
    let count = states.trajectory.len();
    for (name, length) in [
        ("velocities_in_world", states.velocities_in_world.len()),
        ("gyro_biases", states.gyro_biases.len()),
        ("accel_biases", states.accel_biases.len()),
    ] {
        let optional = name == "velocities_in_world" && states.gyro_biases.is_empty()
            || name != "velocities_in_world" && states.gyro_biases.is_empty() && states.accel_biases.is_empty();
        if !(length == count || length == 0 && optional) {
            return Err(Error::LengthMismatch { left: "trajectory", left_len: count, right: name, right_len: length });
        }
    }
    let mut text = String::from("#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z");
    if !states.velocities_in_world.is_empty() {
        text.push_str(",v_x,v_y,v_z");
    }
    if !states.gyro_biases.is_empty() {
        text.push_str(",b_w_x,b_w_y,b_w_z,b_a_x,b_a_y,b_a_z");
    }
    text.push('\n');
    for (index, (stamp, pose)) in states.trajectory.iter().enumerate() {
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        let mut values = vec![p.x, p.y, p.z, q.w, q.x, q.y, q.z];
        for vectors in [&states.velocities_in_world, &states.gyro_biases, &states.accel_biases] {
            values.extend(vectors.get(index).into_iter().flatten());
        }
        text.push_str(&stamp.nanos().to_string());
        for value in values {
            // Writing to a String cannot fail.
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    Ok(text)
}
