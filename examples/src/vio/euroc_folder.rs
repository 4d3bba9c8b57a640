//! Folders in the layout of the EuRoC data set (ASL): `mav0/cam0`, `mav0/imu0` and, if known, the truth.

use std::path::{Path, PathBuf};

use vio_ekf::calibration::{self, CameraCalibration, ImuCalibration};
use vio_ekf::{asl, euroc, nalgebra::Isometry3, tum};

use super::error::read_text;
use super::recording::Truth;
use super::{Images, Recording, VioError};

/// Files that take the place of those in the folder.
#[derive(Debug, Clone, Default)]
pub struct Overrides {
    /// Kalibr's camera chain; its first camera is used.
    pub cameras: Option<PathBuf>,
    /// Kalibr's inertial file.
    pub imu: Option<PathBuf>,
    /// True poses, TUM or EuRoC text.
    pub truth: Option<PathBuf>,
}

/// Opens a folder that holds `mav0`, or is it. Images are read later.
///
/// # Errors
/// [`VioError`] names the file and what is wrong with it.
pub fn open_euroc(folder: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    let inside = folder.join("mav0");
    let root = if inside.is_dir() { inside } else { folder.to_path_buf() };
    if !root.join("cam0").is_dir() || !root.join("imu0").is_dir() {
        let why = "expected the folders mav0/cam0 and mav0/imu0, as in the EuRoC data set".into();
        return Err(VioError::Unusable { recording: folder.display().to_string(), why });
    }
    let (camera, imu) = calibrations(&root, overrides)?;
    let table = root.join("cam0/data.csv");
    let listed = asl::read_images(&read_text(&table)?).map_err(|error| VioError::malformed(&table, &error))?;
    let images = listed.into_iter().map(|(stamp, name)| (stamp, root.join("cam0/data").join(name))).collect();
    let table = root.join("imu0/data.csv");
    let samples = asl::read_imu(&read_text(&table)?).map_err(|error| VioError::malformed(&table, &error))?;
    let name = folder.display().to_string();
    Ok(Recording { name, camera, imu, samples, images: Images::Files(images), truth: truth(&root, overrides)? })
}

/// Both calibrations, the camera's relative to the inertial sensor.
fn calibrations(root: &Path, overrides: &Overrides) -> Result<(CameraCalibration, ImuCalibration), VioError> {
    let read = |path: &Path| Ok::<_, VioError>((path.to_path_buf(), read_text(path)?));
    let mut imu = match &overrides.imu {
        Some(path) => read(path).and_then(|(path, text)| {
            calibration::read_kalibr_imu(&text).map_err(|error| VioError::malformed(&path, &error))
        })?,
        None => read(&root.join("imu0/sensor.yaml")).and_then(|(path, text)| {
            calibration::read_asl_imu(&text).map_err(|error| VioError::malformed(&path, &error))
        })?,
    };
    let mut camera = match &overrides.cameras {
        // Kalibr's chain is relative to the inertial sensor already.
        Some(path) => {
            let (path, text) = read(path)?;
            let cameras =
                calibration::read_kalibr_cameras(&text).map_err(|error| VioError::malformed(&path, &error))?;
            imu.body_from_imu = Isometry3::identity();
            cameras[0]
        }
        None => read(&root.join("cam0/sensor.yaml")).and_then(|(path, text)| {
            calibration::read_asl_camera(&text).map_err(|error| VioError::malformed(&path, &error))
        })?,
    };
    camera.camera.body_from_camera = imu.body_from_imu.inverse() * camera.camera.body_from_camera;
    imu.body_from_imu = Isometry3::identity();
    Ok((camera, imu))
}

/// What is known of the motion: the file named, else the ones that public recordings have.
fn truth(root: &Path, overrides: &Overrides) -> Result<Option<Truth>, VioError> {
    let usual = ["state_groundtruth_estimate0/data.csv", "mocap0/data.csv"].map(|name| root.join(name));
    let Some(path) = overrides.truth.as_ref().or_else(|| usual.iter().find(|path| path.is_file())) else {
        return Ok(None);
    };
    read_truth(path).map(Some)
}

/// Reads poses: comma-separated as EuRoC writes them, else TUM's columns.
pub(super) fn read_truth(path: &Path) -> Result<Truth, VioError> {
    let text = read_text(path)?;
    let is_data = |line: &&str| !line.trim().is_empty() && !line.starts_with(['#', '\u{feff}']);
    let in_file = |error: vio_ekf::Error| VioError::malformed(path, &error);
    if text.lines().find(is_data).is_some_and(|line| line.contains(',')) {
        let states = euroc::read(&text).map_err(in_file)?;
        return Ok(Truth { trajectory: states.trajectory, velocities_in_world: states.velocities_in_world });
    }
    Ok(Truth { trajectory: tum::read(&text).map_err(in_file)?, velocities_in_world: Vec::new() })
}
