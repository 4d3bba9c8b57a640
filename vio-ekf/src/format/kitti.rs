//! KITTI odometry: twelve numbers per line, the upper 3x4 block of the pose matrix row by row, no stamps.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::data_lines;
use crate::error::Error;

/// Entries of `RᵀR` may be this far from the identity; the files print six or seven digits.
const ORTHOGONALITY_TOLERANCE: f64 = 1e-3;

/// Reads poses. The printed matrices are rotations only to their printed digits; each is replaced by the nearest one.
///
/// Pair the result with stamps by [`crate::Trajectory::new`] where a `times.txt` is at hand, or give it to
/// [`crate::eval::ate`] and [`crate::eval::rpe`] as it is.
///
/// ```
/// let poses = vio_ekf::format::kitti::read("1 0 0 5 0 1 0 6 0 0 1 7\n")?;
/// assert_eq!(poses[0].translation.z, 7.0);
/// assert_eq!(vio_ekf::format::kitti::write(&poses), "1 0 0 5 0 1 0 6 0 0 1 7\n");
/// # Ok::<(), vio_ekf::Error>(())
/// ```
pub fn read(text: &str) -> Result<Vec<Isometry3<f64>>, Error> {
    let mut poses = Vec::new();
    for line in data_lines("KITTI", text) {
        let mut m = [0.0; 12];
        let mut columns = 0;
        for (column, field) in line.text.split_whitespace().enumerate() {
            if column < 12 {
                m[column] = line.number(column, field)?;
            }
            columns = column + 1;
        }
        if columns != 12 {
            return Err(line.error(format!("{columns} columns, expected 12 (three rows of [R | t])")));
        }
        let matrix = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        let error = matrix.transpose() * matrix - Matrix3::identity();
        if error.iter().any(|v| v.is_nan() || v.abs() > ORTHOGONALITY_TOLERANCE) || matrix.determinant() < 0.0 {
            return Err(line.error("the left 3x3 block is not a rotation".to_owned()));
        }
        let rotation = UnitQuaternion::from_rotation_matrix(&nearest_rotation(matrix));
        let pose = Isometry3::from_parts(Translation3::from(Vector3::new(m[3], m[7], m[11])), rotation);
        if !crate::trajectory::is_finite(&pose) {
            return Err(line.error("a position beyond 1e100 m".to_owned()));
        }
        poses.push(pose);
    }
    if poses.is_empty() {
        return Err(Error::TooFew { what: "poses in the KITTI text", got: 0, need: 1 });
    }
    Ok(poses)
}

/// Writes poses; numbers with the fewest digits that read back to the same `f64`.
pub fn write(poses: &[Isometry3<f64>]) -> String {
    let mut text = String::with_capacity(poses.len() * 240);
    for pose in poses {
        let matrix = pose.to_homogeneous();
        for row in 0..3 {
            for column in 0..4 {
                let end = if (row, column) == (2, 3) { '\n' } else { ' ' };
                // Writing to a String cannot fail.
                let _ = write!(text, "{}{end}", matrix[(row, column)]);
            }
        }
    }
    text
}

/// The orthogonal factor of the polar decomposition, by Newton's iteration `X ← (X + X⁻ᵀ)/2`.
fn nearest_rotation(mut matrix: Matrix3<f64>) -> Rotation3<f64> {
    // The error is squared each time: 1e-3, 1e-6, 1e-12, rounding.
    for _ in 0..4 {
        if let Some(inverse) = matrix.try_inverse() {
            matrix = (matrix + inverse.transpose()) * 0.5;
        }
    }
    Rotation3::from_matrix_unchecked(matrix)
}
