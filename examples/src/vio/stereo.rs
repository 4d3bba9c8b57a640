//! The second camera of an EuRoC/ASL folder.

use std::path::{Path, PathBuf};

use vio_ekf::{Camera, Error, Stamp};

use super::euroc_folder::{Overrides, camera, images, inside};
use super::{GreyImage, Recording, VioError, open_euroc};

/// Images of both cameras whose stamps differ by no more, ns, were taken together.
const MAX_STAMP_DIFFERENCE: i64 = 1_000_000;

/// A second camera, recorded beside the first.
#[derive(Debug, Clone)]
pub struct SecondCamera {
    /// The camera on the body.
    pub camera: Camera,
    /// Its images, by rising stamps.
    images: Vec<(Stamp, PathBuf)>,
}

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
    let images = images(&root, 1)?;
    Ok(Recording { second: Some(SecondCamera { camera, images }), ..recording })
}

impl SecondCamera {
    /// The image that was taken together with one of the first camera, or why it cannot be used; `None` if there is none.
    pub(super) fn picture(&self, stamp: Stamp) -> Option<Result<GreyImage, String>> {
        let next = self
            .images
            .partition_point(|(other, _)| other.nanos() < stamp.nanos().saturating_sub(MAX_STAMP_DIFFERENCE));
        let (other, path) = self.images.get(next)?;
        (other.nanos() <= stamp.nanos().saturating_add(MAX_STAMP_DIFFERENCE)).then(|| {
            let picture = GreyImage::read(path)?;
            let (given, expected) = ((picture.width, picture.height), (self.camera.width, self.camera.height));
            if given == expected {
                Ok(picture)
            } else {
                Err(format!("{}: {}", path.display(), Error::ImageSize { given, expected }))
            }
        })
    }
}
