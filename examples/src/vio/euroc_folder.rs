//! Folders in the layout of the EuRoC data set (ASL): `mav0/cam0`, `mav0/imu0` and, if known, the truth.

use std::path::{Path, PathBuf};

use vio_ekf::Stamp;
use vio_ekf::format::calibration;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::format::{asl, euroc, tum};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::run::GroundTruth;

use super::error::{VioError, read_text};
use super::recording::{Images, Recording};

/// Files that take the place of those in the folder.
#[derive(Debug, Clone, Default)]
pub struct Overrides {
    /// Kalibr's camera chain; its first camera is used.
    pub cameras: Option<PathBuf>,
    /// Kalibr's inertial file.
    pub imu: Option<PathBuf>,
    /// True poses, TUM or EuRoC text.
    pub truth: Option<PathBuf>,
    /// Topics of the first and the second camera in an MCAP file.
    pub camera_topics: Vec<String>,
    /// Topic of the inertial sensor there.
    pub imu_topic: Option<String>,
}

/// Opens a folder that holds `mav0`, or is it. Images are read later.
///
/// # Errors
/// [`VioError`] names the file and what is wrong with it.
pub fn open_euroc(folder: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    let root = inside(folder);
    if !root.join("cam0").is_dir() || !root.join("imu0").is_dir() {
        let why = "expected the folders mav0/cam0 and mav0/imu0, as in the EuRoC data set".into();
        return Err(VioError::Unusable { recording: folder.display().to_string(), why });
    }
    let camera = camera(&root, overrides, 0)?;
    let imu = ImuCalibration { body_from_imu: Isometry3::identity(), ..imu(&root, overrides)? };
    let images = images(&root, 0)?;
    let table = root.join("imu0/data.csv");
    let samples = asl::read_imu(&read_text(&table)?).map_err(|error| VioError::malformed(&table, &error))?;
    let name = folder.display().to_string();
    let truth = truth(&root, overrides)?;
    Ok(Recording {
        name,
        camera,
        imu,
        samples,
        images: Images::Files(images),
        second: None,
        truth,
        unused: Vec::new(),
        assumed: Vec::new(),
        mask: None,
    })
}

/// The folder with the sensors: `mav0` below a folder, or itself.
pub(super) fn inside(folder: &Path) -> PathBuf {
    let below = folder.join("mav0");
    if below.is_dir() { below } else { folder.to_path_buf() }
}

/// The inertial sensor. The pose that it is given is that of the folder's body.
pub(super) fn imu(root: &Path, overrides: &Overrides) -> Result<ImuCalibration, VioError> {
    if let Some(path) = &overrides.imu {
        return calibration::read_kalibr_imu(&read_text(path)?).map_err(|error| VioError::malformed(path, &error));
    }
    let path = root.join("imu0/sensor.yaml");
    calibration::read_asl_imu(&read_text(&path)?).map_err(|error| VioError::malformed(&path, &error))
}

/// Camera `which` on the inertial sensor.
pub(super) fn camera(root: &Path, overrides: &Overrides, which: usize) -> Result<CameraCalibration, VioError> {
    if let Some(path) = &overrides.cameras {
        // Kalibr's chain is relative to the inertial sensor already.
        let chain = calibration::read_kalibr_cameras(&read_text(path)?);
        let chain = chain.map_err(|error| VioError::malformed(path, &error))?;
        return chain.get(which).copied().ok_or_else(|| VioError::malformed(path, &"holds one camera only"));
    }
    let path = root.join(format!("cam{which}/sensor.yaml"));
    let camera = calibration::read_asl_camera(&read_text(&path)?);
    let mut camera = camera.map_err(|error| VioError::malformed(&path, &error))?;
    camera.camera.body_from_camera = imu(root, overrides)?.body_from_imu.inverse() * camera.camera.body_from_camera;
    Ok(camera)
}

/// Times and files of the images of camera `which`.
pub(super) fn images(root: &Path, which: usize) -> Result<Vec<(Stamp, PathBuf)>, VioError> {
    let folder = root.join(format!("cam{which}"));
    let table = folder.join("data.csv");
    let listed = asl::read_images(&read_text(&table)?).map_err(|error| VioError::malformed(&table, &error))?;
    Ok(listed.into_iter().map(|(stamp, name)| (stamp, folder.join("data").join(name))).collect())
}

/// What is known of the motion: the file named, else the ones that public recordings have.
fn truth(root: &Path, overrides: &Overrides) -> Result<Option<GroundTruth>, VioError> {
    let usual = ["state_groundtruth_estimate0/data.csv", "mocap0/data.csv"].map(|name| root.join(name));
    let Some(path) = overrides.truth.as_ref().or_else(|| usual.iter().find(|path| path.is_file())) else {
        return Ok(None);
    };
    read_truth(path).map(Some)
}

/// Reads poses: comma-separated as EuRoC writes them, else TUM's columns.
pub(super) fn read_truth(path: &Path) -> Result<GroundTruth, VioError> {
    let text = read_text(path)?;
    let is_data = |line: &&str| !line.trim().is_empty() && !line.starts_with(['#', '\u{feff}']);
    let in_file = |error: vio_ekf::Error| VioError::malformed(path, &error);
    if text.lines().find(is_data).is_some_and(|line| line.contains(',')) {
        let states = euroc::read(&text).map_err(in_file)?;
        return Ok(GroundTruth { trajectory: states.trajectory, velocities_in_world: states.velocities_in_world });
    }
    Ok(GroundTruth { trajectory: tum::read(&text).map_err(in_file)?, velocities_in_world: Vec::new() })
}
