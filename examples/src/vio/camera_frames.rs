//! The images of a recording, read one after the other.

use vio_ekf::{Error, Stamp};

use super::grey_image::GreyImage;
use super::mcap_in::read_images;
use super::recording::{Images, Recording, SecondCamera};

/// Images of both cameras whose stamps differ by no more, ns, were taken together.
const MAX_STAMP_DIFFERENCE: i64 = 1_000_000;

/// An image that was due.
pub struct CameraFrame {
    /// Middle of the exposure by the camera's clock.
    pub stamp: Stamp,
    /// The image, or why there is none.
    pub picture: Result<GreyImage, String>,
    /// The image that a second camera took together with it, if there is one.
    pub second: Option<Result<GreyImage, String>>,
}

/// Reads the images one after the other, as they are asked for, each with that of the second camera.
pub fn camera_frames(recording: &Recording) -> impl Iterator<Item = CameraFrame> + Send + '_ {
    first_camera(&recording.images).map(|(stamp, picture)| {
        let second = recording.second.as_ref().and_then(|camera| second_image(camera, stamp));
        CameraFrame { stamp, picture, second }
    })
}

fn first_camera(images: &Images) -> Box<dyn Iterator<Item = (Stamp, Result<GreyImage, String>)> + Send + '_> {
    match images {
        Images::Files(files) => Box::new(files.iter().map(|(stamp, path)| (*stamp, GreyImage::read(path)))),
        Images::Mcap { path, topic, .. } => read_images(path.clone(), topic.clone()),
    }
}

/// The image that the second camera took together with one of the first, or why it cannot be used; `None` if there is none.
fn second_image(second: &SecondCamera, stamp: Stamp) -> Option<Result<GreyImage, String>> {
    let earliest = stamp.nanos().saturating_sub(MAX_STAMP_DIFFERENCE);
    let next = second.images.partition_point(|(other, _)| other.nanos() < earliest);
    let (other, path) = second.images.get(next)?;
    (other.nanos() <= stamp.nanos().saturating_add(MAX_STAMP_DIFFERENCE)).then(|| {
        let picture = GreyImage::read(path)?;
        let (given, expected) = ((picture.width, picture.height), (second.camera.width, second.camera.height));
        if given == expected {
            Ok(picture)
        } else {
            Err(format!("{}: {}", path.display(), Error::ImageSize { given, expected }))
        }
    })
}
