//! The values of one section of a calibration file, checked; what is wrong is named by key and line.

use nalgebra::{Isometry3, Matrix3};

use super::schema::{FORMAT, Field, Numbers, OpenCvMatrix};
use crate::camera::nearest_pose;
use crate::error::Error;

/// Rotations are printed with few digits in some files; more than this off is not a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Where a section stands.
pub(super) struct Section<'a> {
    /// `cam0.`, or nothing if the whole file is the section.
    pub(super) prefix: &'a str,
    /// Its first line, counted from 1.
    pub(super) line: u64,
}

#[allow(clippy::ref_option, reason = "a field is what the schema gives: a key that may be missing")]
impl Section<'_> {
    pub(super) fn refuse(&self, line: u64, key: &str, what: &str) -> Error {
        let what = format!("`{}{key}`: {what}", self.prefix);
        Error::Line { format: FORMAT, line: line as usize, what }
    }

    /// The value of a key that must be there, and its line.
    pub(super) fn required<'b, T>(&self, key: &str, field: &'b Field<T>) -> Result<(&'b T, u64), Error> {
        let found = field.as_ref().ok_or_else(|| self.refuse(self.line, key, "is missing"))?;
        Ok((&found.value, found.referenced.line()))
    }

    /// Exactly `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&self, key: &str, field: &Field<Numbers>) -> Result<[f64; N], Error> {
        let (Numbers(numbers), line) = self.required(key, field)?;
        let wrong = |word| self.refuse(line, key, &format!("`{word}` is not a finite number"));
        let numbers = numbers.as_ref().map_err(wrong)?;
        let count = |_| self.refuse(line, key, &format!("expected {N} numbers, found {}", numbers.len()));
        numbers.as_slice().try_into().map_err(count)
    }

    /// One number.
    pub(super) fn number(&self, key: &str, field: &Field<Numbers>) -> Result<f64, Error> {
        self.numbers(key, field).map(|[value]| value)
    }

    /// One number, if the key is there.
    pub(super) fn optional(&self, key: &str, field: &Field<Numbers>) -> Result<Option<f64>, Error> {
        field.is_some().then(|| self.number(key, field)).transpose()
    }

    /// A rigid motion as four rows of four.
    pub(super) fn pose(&self, key: &str, field: &Field<Numbers>) -> Result<Isometry3<f64>, Error> {
        let m = self.numbers::<16>(key, field)?;
        let row = |r: usize| [m[4 * r], m[4 * r + 1], m[4 * r + 2], m[4 * r + 3]];
        let rows = [row(0), row(1), row(2)];
        let rotation = Matrix3::from_fn(|r, c| rows[r][c]);
        let error = (rotation * rotation.transpose() - Matrix3::identity()).norm();
        if error > ROTATION_TOLERANCE || rotation.determinant() < 0.0 || row(3) != [0.0, 0.0, 0.0, 1.0] {
            let (_, line) = self.required(key, field)?;
            return Err(self.refuse(line, key, "is not a rigid motion: check its sixteen numbers"));
        }
        Ok(nearest_pose(&rows))
    }

    /// The pose of the sensor on the body in an ASL folder.
    pub(super) fn asl_pose(&self, matrix: Option<&OpenCvMatrix>) -> Result<Isometry3<f64>, Error> {
        self.pose("T_BS.data", matrix.map_or(&None, |matrix| &matrix.data))
    }
}
