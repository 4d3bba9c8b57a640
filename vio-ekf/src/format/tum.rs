//! TUM RGB-D: `timestamp tx ty tz qx qy qz qw` per line, seconds and metres, **scalar last**.

use std::fmt::Write as _;

use super::data_lines;
use crate::error::Error;
use crate::trajectory::Trajectory;

/// Reads a trajectory. Columns may be separated by any run of spaces and tabs; there must be exactly eight.
///
/// ```
/// let text = "# timestamp tx ty tz qx qy qz qw\n1.5 1 2 3 0 0 0 1\n";
/// let trajectory = vio_ekf::format::tum::read(text)?;
/// assert_eq!(trajectory.poses()[0].translation.y, 2.0);
/// assert_eq!(vio_ekf::format::tum::write(&trajectory), "1.500000000 1 2 3 0 0 0 1\n");
/// # Ok::<(), vio_ekf::Error>(())
/// ```
pub fn read(text: &str) -> Result<Trajectory, Error> {
    let mut trajectory = Trajectory::default();
    for line in data_lines("TUM", text) {
        let fields: Vec<&str> = line.text.split_whitespace().collect();
        if fields.len() != 8 {
            return Err(line.error(format!("{} columns, expected 8 (t tx ty tz qx qy qz qw)", fields.len())));
        }
        let mut v = [0.0; 8];
        for (column, field) in fields.iter().enumerate().skip(1) {
            v[column] = line.number(column, field)?;
        }
        let pose = line.pose([v[1], v[2], v[3]], v[7], [v[4], v[5], v[6]])?;
        line.push(&mut trajectory, line.stamp(fields[0], 9)?, pose)?;
    }
    if trajectory.is_empty() {
        return Err(Error::TooFew { what: "poses in the TUM text", got: 0, need: 1 });
    }
    Ok(trajectory)
}

/// Writes a trajectory: one space between columns and none at the end, as strict readers demand; stamps with nine
/// decimals, numbers with the fewest digits that read back to the same `f64`.
pub fn write(trajectory: &Trajectory) -> String {
    let mut text = String::with_capacity(trajectory.len() * 150);
    for (stamp, pose) in trajectory.iter() {
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{stamp} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    }
    text
}
