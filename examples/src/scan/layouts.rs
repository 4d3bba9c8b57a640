//! The layouts that data sets come in.
//!
//! | layout | images | poses | depth units per metre | camera |
//! |---|---|---|---|---|
//! | 7-Scenes, 3DMatch | `frame-N.depth.png`, `frame-N.color.{jpg,png}` | `frame-N.pose.txt`, 4x4 | 1000 | `camera-intrinsics.txt`, 3x3, there or one folder up |
//! | TUM | `depth.txt`, `rgb.txt` | `groundtruth.txt`, `t x y z qx qy qz qw` | 5000, or `intrinsics.txt` | `intrinsics.txt`, else 525, 525, 319.5, 239.5 |
//! | ICL-NUIM | `depth/N.png`, `color/N.png` | `pose.txt`, `x y z qx qy qz qw` | 5000 | 481.2, -480, 319.5, 239.5 |
//! | MCAP | topics of depth and colour images, of ROS 2 or Foxglove | transforms to the depth camera's frame | 1000, or metres | `CameraInfo` or `CameraCalibration` |
//! | Redwood | `depth/`, `color/` | `trajectory.log`, 4x4 | 1000 | the JSON file, else 525, 525, 319.5, 239.5 |
//!
//! All poses are `world_from_camera`; one with a number that is not finite means that the recorder had lost the camera. `intrinsics.txt` is one line, `width height fx fy cx cy units_per_metre`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::Intrinsics;
use vio_ekf::format::tum as tum_format;
use vio_ekf::{Stamp, Trajectory};

use super::error::SequenceError;
use super::image_source::ImageSource;
use super::mcap_in::open_mcap;
use super::pairing::{NEAREST, nearest};
use super::sequence::{FrameFiles, Sequence};

type Result<T> = std::result::Result<T, SequenceError>;

/// Frames per second of recordings that carry no stamps.
const RATE: f64 = 30.0;
/// The published camera of the TUM and Redwood recordings where no file says otherwise.
const USUAL_CAMERA: Intrinsics = Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };
/// The published camera of ICL-NUIM; its y points up.
const ICL_CAMERA: Intrinsics = Intrinsics { fx: 481.2, fy: -480.0, cx: 319.5, cy: 239.5 };

/// Recognises the layout of a folder, or a recording in one file, and lists its frames.
///
/// # Errors
/// [`SequenceError`]; images themselves are read later, by [`Images::read`](super::Images::read).
pub fn open_sequence(folder: &Path) -> Result<Sequence> {
    let sequence = if folder.is_file() {
        open_mcap(folder)?
    } else if folder.join("depth.txt").is_file() {
        tum(folder)?
    } else if folder.join("trajectory.log").is_file() {
        redwood(folder)?
    } else if folder.join("pose.txt").is_file() && folder.join("depth").is_dir() {
        icl(folder)?
    } else if let Some(frames) = seven_scenes(folder)? {
        frames
    } else {
        return Err(SequenceError::UnknownLayout { folder: folder.display().to_string() });
    };
    if sequence.frames.is_empty() {
        return Err(SequenceError::malformed(folder, 0, "the sequence has no frame"));
    }
    Ok(sequence)
}

fn seven_scenes(folder: &Path) -> Result<Option<Sequence>> {
    let depth = numbered(folder, |name| name.strip_prefix("frame-")?.strip_suffix(".depth.png"))?;
    if depth.is_empty() {
        // Sequences often stand one folder below the camera's file.
        let below = folder.join("seq-01");
        return if below.is_dir() { seven_scenes(&below) } else { Ok(None) };
    }
    let camera = ["camera-intrinsics.txt", "../camera-intrinsics.txt"].map(|name| folder.join(name));
    let intrinsics = match camera.iter().find(|path| path.is_file()) {
        Some(path) => matrix_camera(path)?,
        None => return Err(SequenceError::unreadable(&camera[0], &"missing; it holds the 3x3 camera matrix")),
    };
    let mut frames = Vec::with_capacity(depth.len());
    for (number, path) in depth {
        let beside = |ending: &str| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().replace(".depth.png", ending);
            path.with_file_name(name)
        };
        let colour = [".color.jpg", ".color.png"].map(beside).into_iter().find(|path| path.is_file());
        let pose = beside(".pose.txt");
        let (world_from_camera, lost) = if pose.is_file() {
            let values = numbers(&pose, &read(&pose)?)?;
            let found = pose_of_matrix(&values).map_err(|why| SequenceError::malformed(&pose, 0, why))?;
            (found, found.is_none())
        } else {
            (None, false)
        };
        frames.push(FrameFiles {
            stamp: number as f64 / RATE,
            depth: ImageSource::File(path),
            colour: colour.map(ImageSource::File),
            world_from_camera,
            lost,
        });
    }
    Ok(Some(Sequence {
        layout: "7-Scenes",
        intrinsics,
        camera_origin: "camera-intrinsics.txt".into(),
        image_size: None,
        depth_scale: 1000.0,
        scale_origin: "as 7-Scenes has it".into(),
        colour_camera: None,
        angular_rates: Vec::new(),
        frames,
    }))
}

fn tum(folder: &Path) -> Result<Sequence> {
    let file = "intrinsics.txt";
    let (intrinsics, image_size, depth_scale, origin) = match folder.join(file) {
        path if path.is_file() => match numbers(&path, &read(&path)?)?[..] {
            [width, height, fx, fy, cx, cy, scale] => {
                (Intrinsics { fx, fy, cx, cy }, Some([width as usize, height as usize]), scale, file)
            }
            ref other => {
                let why = format!("expected width height fx fy cx cy units_per_metre, found {} numbers", other.len());
                return Err(SequenceError::malformed(&path, 1, why));
            }
        },
        _ => (USUAL_CAMERA, None, 5000.0, "assumed: there is no intrinsics.txt"),
    };
    let depth = listed(&folder.join("depth.txt"))?;
    let colour = match folder.join("rgb.txt") {
        path if path.is_file() => listed(&path)?,
        _ => Vec::new(),
    };
    let colour_stamps: Vec<f64> = colour.iter().map(|(t, _)| *t).collect();
    let truth = match folder.join("groundtruth.txt") {
        path if path.is_file() => tum_poses(&path)?,
        _ => TumPoses::default(),
    };
    let mut frames = Vec::with_capacity(depth.len());
    for (stamp, path) in depth {
        let paired = nearest(&colour_stamps, stamp, NEAREST);
        let lost = truth.is_lost(stamp);
        let world_from_camera = match (&truth.found, Stamp::from_secs(stamp)) {
            // Outside the recorded poses there is none.
            (Some(found), Ok(at)) if !lost => found.pose_at(at).ok(),
            _ => None,
        };
        frames.push(FrameFiles {
            stamp,
            depth: ImageSource::File(path),
            colour: paired.map(|k| ImageSource::File(colour[k].1.clone())),
            world_from_camera,
            lost,
        });
    }
    Ok(Sequence {
        layout: "TUM",
        intrinsics,
        camera_origin: origin.into(),
        image_size,
        depth_scale,
        scale_origin: origin.into(),
        colour_camera: None,
        angular_rates: Vec::new(),
        frames,
    })
}

/// The rows of a file of poses.
#[derive(Default)]
struct TumPoses {
    found: Option<Trajectory>,
    /// Stamps of the rows that are poses, and of those that are not.
    stamps: [Vec<f64>; 2],
}

impl TumPoses {
    /// Whether the row nearest to a stamp is no pose.
    fn is_lost(&self, stamp: f64) -> bool {
        let [found, lost] = [0, 1].map(|k| {
            let apart = self.stamps[k].iter().map(|t| (t - stamp).abs());
            apart.fold(f64::INFINITY, f64::min)
        });
        lost < found
    }
}

fn tum_poses(path: &Path) -> Result<TumPoses> {
    let (mut poses, mut rows) = (TumPoses::default(), String::new());
    for line in read(path)?.lines() {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let lost = numbers.len() == 8 && numbers[1..].iter().any(|x| !x.is_finite());
        if let Some(&stamp) = numbers.first() {
            poses.stamps[usize::from(lost)].push(stamp);
        }
        // A row that is left out stays as an empty line, so that errors name the right one.
        rows.push_str(if lost { "" } else { line });
        rows.push('\n');
    }
    if poses.stamps[0].is_empty() && !poses.stamps[1].is_empty() {
        return Ok(poses);
    }
    poses.found = Some(tum_format::read(&rows).map_err(|e| SequenceError::malformed(path, 0, e.to_string()))?);
    Ok(poses)
}

fn icl(folder: &Path) -> Result<Sequence> {
    let path = folder.join("pose.txt");
    let text = read(&path)?;
    let mut poses = Vec::new();
    for (line, text) in text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty()) {
        let refuse = |why: String| SequenceError::malformed(&path, line + 1, why);
        let v = numbers_of(text).map_err(refuse)?;
        let [x, y, z, i, j, k, w] = v[..] else {
            return Err(refuse(format!("expected x y z qx qy qz qw, found {} numbers", v.len())));
        };
        if !v.iter().all(|x| x.is_finite()) {
            poses.push(None);
            continue;
        }
        let q = Quaternion::new(w, i, j, k);
        if !(0.99..=1.01).contains(&q.norm()) {
            return Err(refuse(format!("the quaternion has length {}, not 1", q.norm())));
        }
        poses.push(Some(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(q))));
    }
    let frames = in_folders(folder, &poses)?;
    Ok(Sequence {
        layout: "ICL-NUIM",
        intrinsics: ICL_CAMERA,
        camera_origin: "as ICL-NUIM publishes it".into(),
        image_size: None,
        depth_scale: 5000.0,
        scale_origin: "as ICL-NUIM has it".into(),
        colour_camera: None,
        angular_rates: Vec::new(),
        frames,
    })
}

fn redwood(folder: &Path) -> Result<Sequence> {
    let path = folder.join("trajectory.log");
    let values = numbers(&path, &read(&path)?)?;
    let mut poses = Vec::new();
    // Three counters, then a matrix.
    for (index, entry) in values.chunks(19).enumerate() {
        let pose = entry.get(3..).ok_or_else(|| "an entry has fewer than 19 numbers".into()).and_then(pose_of_matrix);
        poses.push(pose.map_err(|why| SequenceError::malformed(&path, 5 * index + 1, why))?);
    }
    let camera = folder.join("camera_primesense.json");
    let (intrinsics, origin) = if camera.is_file() {
        (json_camera(&camera)?, "camera_primesense.json")
    } else {
        (USUAL_CAMERA, "assumed: there is no camera_primesense.json")
    };
    Ok(Sequence {
        layout: "Redwood",
        intrinsics,
        camera_origin: origin.into(),
        image_size: None,
        depth_scale: 1000.0,
        scale_origin: "as Redwood has it".into(),
        colour_camera: None,
        angular_rates: Vec::new(),
        frames: in_folders(folder, &poses)?,
    })
}

/// Frames from `depth/N.png` and `color/N.{png,jpg}`, with the poses in the same order.
fn in_folders(folder: &Path, poses: &[Option<Isometry3<f64>>]) -> Result<Vec<FrameFiles>> {
    let depth = numbered(&folder.join("depth"), |name| name.strip_suffix(".png"))?;
    let colour_folder = folder.join("color");
    let mut frames = Vec::with_capacity(depth.len());
    for (index, (_, path)) in depth.into_iter().enumerate() {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let colour = ["png", "jpg"].map(|ending| colour_folder.join(format!("{stem}.{ending}")));
        frames.push(FrameFiles {
            stamp: index as f64 / RATE,
            depth: ImageSource::File(path),
            colour: colour.into_iter().find(|path| path.is_file()).map(ImageSource::File),
            world_from_camera: poses.get(index).copied().flatten(),
            lost: poses.get(index).is_some_and(Option::is_none),
        });
    }
    Ok(frames)
}

/// Files of a folder whose name holds a number, by that number.
fn numbered(folder: &Path, number: impl Fn(&str) -> Option<&str>) -> Result<BTreeMap<u64, PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| SequenceError::unreadable(folder, &e))?;
    let mut found = BTreeMap::new();
    for entry in entries {
        let path = entry.map_err(|e| SequenceError::unreadable(folder, &e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if let Some(value) = number(&name).and_then(|digits| digits.parse().ok()) {
            found.insert(value, path);
        }
    }
    Ok(found)
}

/// A TUM list of images: `stamp path` on each line, `#` begins a comment.
fn listed(path: &Path) -> Result<Vec<(f64, PathBuf)>> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut list: Vec<(f64, PathBuf)> = Vec::new();
    for (line, text) in read(path)?.lines().enumerate() {
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let refuse = |why: &str| SequenceError::malformed(path, line + 1, why);
        let (stamp, file) = text.split_once(char::is_whitespace).ok_or_else(|| refuse("expected: stamp path"))?;
        let stamp: f64 = stamp.parse().ok().filter(|t: &f64| t.is_finite()).ok_or_else(|| refuse("not a stamp"))?;
        if list.last().is_some_and(|(last, _)| stamp <= *last) {
            return Err(refuse("its stamp is not later than the one before: sort the list"));
        }
        list.push((stamp, folder.join(file.trim())));
    }
    Ok(list)
}

fn matrix_camera(path: &Path) -> Result<Intrinsics> {
    match numbers(path, &read(path)?)?[..] {
        [fx, _, cx, _, fy, cy, 0.0, 0.0, 1.0] => Ok(Intrinsics { fx, fy, cx, cy }),
        [_, _, 0.0, _, _, 0.0, _, _, 1.0] => {
            Err(SequenceError::malformed(path, 0, "the camera matrix is transposed: its last row must be 0 0 1"))
        }
        [_, _, _, _, _, _, _, _, _] => {
            Err(SequenceError::malformed(path, 3, "the last row of the camera matrix must be 0 0 1"))
        }
        ref other => Err(SequenceError::malformed(path, 0, format!("expected 3x3 numbers, found {}", other.len()))),
    }
}

fn json_camera(path: &Path) -> Result<Intrinsics> {
    let refuse = |why: String| SequenceError::malformed(path, 0, why);
    let value: serde_json::Value = serde_json::from_str(&read(path)?).map_err(|e| refuse(e.to_string()))?;
    // Column by column.
    let entry = |k: usize| value["intrinsic_matrix"][k].as_f64();
    match (entry(0), entry(4), entry(6), entry(7)) {
        (Some(fx), Some(fy), Some(cx), Some(cy)) => Ok(Intrinsics { fx, fy, cx, cy }),
        _ => Err(refuse("intrinsic_matrix does not hold nine numbers".into())),
    }
}

/// A rigid motion from 16 numbers, row by row; `None` if one of them is not finite.
fn pose_of_matrix(values: &[f64]) -> std::result::Result<Option<Isometry3<f64>>, String> {
    let Ok(m) = <[f64; 16]>::try_from(values) else {
        return Err(format!("expected 4x4 numbers, found {}", values.len()));
    };
    if !m.iter().all(|x| x.is_finite()) {
        return Ok(None);
    }
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let error = (rotation * rotation.transpose() - Matrix3::identity()).norm();
    if error > 1e-3 || rotation.determinant() < 0.0 {
        return Err("the upper left 3x3 is not a rotation".into());
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok(Some(Isometry3::from_parts(Vector3::new(m[3], m[7], m[11]).into(), rotation)))
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| SequenceError::unreadable(path, &e))
}

/// All numbers of a file.
fn numbers(path: &Path, text: &str) -> Result<Vec<f64>> {
    let mut all = Vec::new();
    for (line, text) in text.lines().enumerate() {
        all.extend(numbers_of(text).map_err(|why| SequenceError::malformed(path, line + 1, why))?);
    }
    Ok(all)
}

fn numbers_of(text: &str) -> std::result::Result<Vec<f64>, String> {
    text.split_whitespace().map(|word| word.parse().map_err(|_| format!("\"{word}\" is not a number"))).collect()
}
