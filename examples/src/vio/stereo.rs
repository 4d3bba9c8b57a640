//! The second camera of an EuRoC/ASL folder.

use std::path::Path;

use super::error::VioError;
use super::euroc_folder::{Overrides, camera, images, inside, open_euroc};
use super::recording::{Images, Recording, SecondCamera};

/// As [`open_euroc`], with `mav0/cam1` as a second camera. A chain of Kalibr must hold both.
///
/// # Errors
/// [`VioError`] names the file and what is wrong with it.
pub fn open_euroc_stereo(folder: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    let recording = open_euroc(folder, overrides)?;
    let root = inside(folder);
    if !root.join("cam1").is_dir() {
        let why = "there is no second camera: expected the folder mav0/cam1".into();
        return Err(VioError::Unusable { recording: recording.name, why });
    }
    let camera = camera(&root, overrides, 1)?.camera;
    let images = Images::Files(images(&root, 1)?);
    Ok(Recording { second: Some(SecondCamera { camera, images }), ..recording })
}
