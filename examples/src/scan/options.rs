//! What a command line says about a recording: its camera, which frames, and what the errors of the map are called there.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use tsdf_hash::{Intrinsics, NoiseModel};

use super::error::SequenceError;
use super::sequence::{ColourCamera, FrameFiles};

/// `FX,FY,CX,CY`, pixels.
///
/// # Errors
/// What was expected.
pub(super) fn parse_intrinsics(text: &str) -> Result<Intrinsics, String> {
    let [fx, fy, cx, cy] = numbers(text, "FX,FY,CX,CY")?;
    if fx == 0.0 || fy == 0.0 {
        return Err("focal lengths must not be 0".into());
    }
    Ok(Intrinsics { fx, fy, cx, cy })
}

/// `BASE,QUADRATIC,NEAREST` of a [`NoiseModel`].
///
/// # Errors
/// What was expected.
pub(super) fn parse_noise(text: &str) -> Result<NoiseModel, String> {
    let [base, quadratic, nearest] = numbers(text, "BASE,QUADRATIC,NEAREST")?;
    Ok(NoiseModel { base, quadratic, nearest })
}

/// `DEGREES,METRES`: standard deviations of the motion from one frame to the next; in radians and metres.
///
/// # Errors
/// What was expected.
pub(super) fn parse_odometry_error(text: &str) -> Result<[f64; 2], String> {
    let [degrees, metres] = numbers(text, "DEGREES,METRES")?;
    if degrees <= 0.0 || metres <= 0.0 {
        return Err("standard deviations must be above 0".into());
    }
    Ok([degrees.to_radians(), metres])
}

fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let words: Vec<&str> = text.split(',').collect();
    let found: Vec<f64> = words.iter().filter_map(|w| w.trim().parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    match found.try_into() {
        Ok(numbers) if words.len() == N => Ok(numbers),
        _ => Err(format!("expected {expected}, finite numbers with commas between them")),
    }
}

/// Some of the frames of a sequence: `A..B:STEP`, of which each part may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    first: usize,
    end: usize,
    step: usize,
}

impl FrameRange {
    /// Reads `A..B:STEP`; B is not included.
    ///
    /// # Errors
    /// What was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let refuse = || format!("expected A..B:STEP, for example 100..400:2, ..50 or 10.., found \"{text}\"");
        let number = |word: &str, default: usize| {
            if word.is_empty() { Ok(default) } else { word.parse().map_err(|_| refuse()) }
        };
        let (range, step) = text.split_once(':').unwrap_or((text, "1"));
        let (first, end) = range.split_once("..").ok_or_else(refuse)?;
        let found = Self { first: number(first, 0)?, end: number(end, usize::MAX)?, step: number(step, 1)? };
        if found.step == 0 || found.first >= found.end { Err(refuse()) } else { Ok(found) }
    }

    /// Those frames, in their order.
    pub fn of(&self, frames: Vec<FrameFiles>) -> Vec<FrameFiles> {
        let length = self.end.saturating_sub(self.first);
        frames.into_iter().skip(self.first).take(length).step_by(self.step).collect()
    }
}

/// Reads a colour camera that stands beside the depth camera: 16 numbers of the matrix `depth_from_colour`, row by row, and, if it is
/// another camera, `fx fy cx cy` after them.
///
/// # Errors
/// [`SequenceError`].
pub(super) fn read_colour_camera(path: &Path) -> Result<ColourCamera, SequenceError> {
    let numbers = read_numbers(path)?;
    let expected = "the 16 numbers of depth_from_colour and, if need be, fx fy cx cy";
    let (depth_from_colour, rest) = isometry(path, &numbers, expected)?;
    let intrinsics = match *rest {
        [] => None,
        [fx, fy, cx, cy] => Some(Intrinsics { fx, fy, cx, cy }),
        _ => return Err(unexpected(path, expected, numbers.len())),
    };
    Ok(ColourCamera { depth_from_colour, intrinsics })
}

/// Reads where a camera is on a body: 16 numbers of the matrix `body_from_camera`, row by row.
///
/// # Errors
/// [`SequenceError`].
pub(super) fn read_body_from_camera(path: &Path) -> Result<Isometry3<f64>, SequenceError> {
    let numbers = read_numbers(path)?;
    let expected = "the 16 numbers of body_from_camera";
    let (body_from_camera, rest) = isometry(path, &numbers, expected)?;
    if rest.is_empty() { Ok(body_from_camera) } else { Err(unexpected(path, expected, numbers.len())) }
}

fn read_numbers(path: &Path) -> Result<Vec<f64>, SequenceError> {
    let text = std::fs::read_to_string(path).map_err(|e| SequenceError::unreadable(path, &e))?;
    let number = |word: &str| {
        let found = word.parse().ok().filter(|x: &f64| x.is_finite());
        found.ok_or_else(|| SequenceError::malformed(path, 0, format!("\"{word}\" is no finite number")))
    };
    text.split_whitespace().map(number).collect()
}

/// A 4x4 matrix, row by row, and the numbers after it.
fn isometry<'a>(path: &Path, numbers: &'a [f64], expected: &str) -> Result<(Isometry3<f64>, &'a [f64]), SequenceError> {
    let (m, rest) = numbers.split_at_checked(16).ok_or_else(|| unexpected(path, expected, numbers.len()))?;
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    if (rotation * rotation.transpose() - Matrix3::identity()).norm() > 1e-3 || rotation.determinant() < 0.0 {
        return Err(SequenceError::malformed(path, 0, "the upper left 3x3 is not a rotation"));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok((Isometry3::from_parts(Vector3::new(m[3], m[7], m[11]).into(), rotation), rest))
}

fn unexpected(path: &Path, expected: &str, found: usize) -> SequenceError {
    SequenceError::malformed(path, 0, format!("expected {expected}, found {found} numbers"))
}

/// Bytes of so many MiB.
///
/// # Errors
/// When they cannot be counted.
pub(super) fn mebibytes(option: &str, count: usize) -> Result<usize, String> {
    count.checked_mul(1 << 20).ok_or_else(|| format!("{option} {count}: more bytes than there are addresses"))
}

/// An error of the map in the words of the command line: options, not fields.
pub(super) fn in_options(message: &str) -> String {
    // The longer names first: some hold a shorter one.
    const NAMES: [(&str, &str); 9] = [
        ("settings: ", ""),
        ("memory.host_bytes", "--host-mib"),
        ("memory.disk_bytes", "--disk-mib"),
        ("max_bytes", "--active-mib"),
        ("voxel_size", "--voxel"),
        ("min_depth..max_depth", "0.2 m..--max-depth"),
        ("max_depth", "--max-depth"),
        ("depth scale", "--depth-scale"),
        ("noise.", "--noise: "),
    ];
    NAMES.iter().fold(message.to_string(), |text, (field, option)| text.replace(field, option))
}
