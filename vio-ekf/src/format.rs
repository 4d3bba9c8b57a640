//! The text formats trajectories come in. Readers take the whole text, writers return it; files are the caller's.
//!
//! All readers skip a byte order mark, blank lines and lines that start with `#`, and accept CRLF line ends. Everything
//! else that is not exactly what the format says is refused with the number of the line, with one exception: a pose that
//! repeats the stamp of the pose before is dropped, because public files hold such (the ground truth of TUM fr2/desk has
//! one among 20,957). Stamps that go back are refused.

pub mod asl;
pub mod calibration;
pub mod euroc;
pub mod kitti;
pub mod tum;

pub use crate::stamp::InvalidStamp;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::error::Error;
use crate::stamp::Stamp;
use crate::stamp::scaled_integer;
use crate::trajectory::Trajectory;

/// Quaternions are printed with few digits in some files; more than this off unit length is another column.
const QUATERNION_NORM_TOLERANCE: f64 = 0.01;

/// One line that holds data.
struct Line<'a> {
    format: &'static str,
    number: usize,
    text: &'a str,
}

/// The lines that hold data, with their numbers.
fn data_lines<'a>(format: &'static str, text: &'a str) -> impl Iterator<Item = Line<'a>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    text.lines()
        .enumerate()
        .map(move |(index, line)| Line { format, number: index + 1, text: line.trim() })
        .filter(|line| !line.text.is_empty() && !line.text.starts_with('#'))
}

impl Line<'_> {
    fn error(&self, what: String) -> Error {
        Error::Line { format: self.format, line: self.number, what }
    }

    /// Appends a pose, unless it repeats the stamp before: then it is dropped and the answer is `false`.
    fn push(&self, trajectory: &mut Trajectory, stamp: Stamp, pose: Isometry3<f64>) -> Result<bool, Error> {
        if trajectory.stamps().last() == Some(&stamp) {
            return Ok(false);
        }
        trajectory.push(stamp, pose).map_err(|error| self.error(error.to_string()))?;
        Ok(true)
    }

    fn number(&self, column: usize, field: &str) -> Result<f64, Error> {
        match field.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(format!("column {} is `{field}`, not a finite number", column + 1))),
        }
    }

    /// The first column, in units of `10^power` nanoseconds.
    fn stamp(&self, field: &str, power: i32) -> Result<Stamp, Error> {
        scaled_integer(field, power)
            .map(Stamp::from_nanos)
            .ok_or_else(|| self.error(format!("column 1 is `{field}`, not a time that fits 64-bit nanoseconds")))
    }

    /// Position and quaternion given as `w` and `(x, y, z)`.
    fn pose(&self, position: [f64; 3], w: f64, xyz: [f64; 3]) -> Result<Isometry3<f64>, Error> {
        let quaternion = Quaternion::from_parts(w, Vector3::from(xyz));
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
            return Err(self.error(format!("the quaternion has length {norm}, not 1: check the order of the columns")));
        }
        let rotation = UnitQuaternion::new_normalize(quaternion);
        Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position)), rotation))
    }
}
