//! Trajectories as text of the TUM benchmark: `stamp x y z qx qy qz qw` per line, seconds and metres.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Quaternions may be off unit length by this, as they are written with few digits.
const TOLERANCE: f64 = 1e-3;
/// Such are of unit length.
const ROUNDING: f64 = 1e-12;

/// Stamps (seconds) and poses as TUM text: stamps with nine decimals, numbers with the fewest digits that read back to the same `f64`.
pub fn trajectory_to_tum(trajectory: &[(f64, Isometry3<f64>)]) -> String {
    let mut text = String::new();
    for (stamp, pose) in trajectory {
        let nanos = (stamp * 1e9).round() as i64;
        let (sign, magnitude) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        let (whole, fraction) = (magnitude / 1_000_000_000, magnitude % 1_000_000_000);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{sign}{whole}.{fraction:09} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads TUM text; lines that begin with `#` are left out.
///
/// # Errors
/// The line, and what is wrong with it.
pub fn trajectory_from_tum(text: &str) -> Result<Vec<(f64, Isometry3<f64>)>, String> {
    let mut trajectory = Vec::new();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
    {
        let refuse = |why: &str| format!("line {}: {why}", number + 1);
        let columns: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [stamp, x, y, z, qx, qy, qz, qw] = columns[..] else {
            return Err(refuse("expected 8 numbers, t tx ty tz qx qy qz qw"));
        };
        let rotation = Quaternion::new(qw, qx, qy, qz);
        if !columns.iter().all(|c| c.is_finite()) || (rotation.norm() - 1.0).abs() > TOLERANCE {
            return Err(refuse("a number is not finite, or the quaternion is not of unit length"));
        }
        if trajectory.last().is_some_and(|(last, _)| *last >= stamp) {
            return Err(refuse("its stamp is not after the one before"));
        }
        let translation = Translation3::from(Vector3::new(x, y, z));
        // What was written by us reads back to the bit.
        let is_unit = (rotation.norm() - 1.0).abs() < ROUNDING;
        let rotation =
            if is_unit { UnitQuaternion::new_unchecked(rotation) } else { UnitQuaternion::new_normalize(rotation) };
        trajectory.push((stamp, Isometry3::from_parts(translation, rotation)));
    }
    Ok(trajectory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_reads_back_to_the_bit() {
        let pose = |k: f64| Isometry3::new(Vector3::new(0.1 * k, -k, k * k), Vector3::new(0.3, 0.1 * k, -0.2));
        let stamps = [-1.25, 0.0, 1.0 / 3.0, 1_305_031_102.175_304];
        let trajectory: Vec<_> = stamps.iter().map(|t| (*t, pose(*t / 1e9))).collect();
        let text = trajectory_to_tum(&trajectory);
        assert!(text.starts_with("-1.250000000 ") && text.contains("\n0.333333333 "), "{text}");
        let again = trajectory_from_tum(&format!("# t tx ty tz\n\n{text}")).unwrap();
        assert_eq!(trajectory_to_tum(&again), text);
        for ((stamp, pose), (expected, expected_pose)) in again.iter().zip(&trajectory) {
            assert!((stamp - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{stamp}");
            assert_eq!(pose, expected_pose);
        }
        for wrong in ["1 2 3", "1 0 0 0 0 0 0 2", "1 NaN 0 0 0 0 0 1", "2 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1"] {
            assert!(trajectory_from_tum(wrong).unwrap_err().starts_with("line "), "{wrong}");
        }
    }
}
