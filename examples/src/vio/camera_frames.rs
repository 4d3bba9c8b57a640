//! The images of a recording, read one after the other.

use std::iter::Peekable;
use std::path::Path;

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
    let mut second = recording.second.as_ref().map(|second| (second, images(&second.images).peekable()));
    images(&recording.images).map(move |(stamp, decode)| {
        let second = second.as_mut().and_then(|(camera, images)| second_image(camera, images, stamp));
        CameraFrame { stamp, picture: decode.decode(), second }
    })
}

/// An image that is not decoded yet.
enum Encoded<'a> {
    File(&'a Path),
    Message(Result<GreyImage, String>),
}

impl Encoded<'_> {
    fn decode(self) -> Result<GreyImage, String> {
        match self {
            Self::File(path) => GreyImage::read(path),
            Self::Message(picture) => picture,
        }
    }
}

type EncodedImages<'a> = Box<dyn Iterator<Item = (Stamp, Encoded<'a>)> + Send + 'a>;

fn images(images: &Images) -> EncodedImages<'_> {
    match images {
        Images::Files(files) => Box::new(files.iter().map(|(stamp, path)| (*stamp, Encoded::File(path)))),
        Images::Mcap { path, topic, .. } => Box::new(
            read_images(path.clone(), topic.clone()).map(|(stamp, picture)| (stamp, Encoded::Message(picture))),
        ),
    }
}

/// The image that the second camera took together with one of the first, or why it cannot be used; `None` if there is none.
fn second_image(
    camera: &SecondCamera,
    images: &mut Peekable<EncodedImages<'_>>,
    stamp: Stamp,
) -> Option<Result<GreyImage, String>> {
    let earliest = stamp.nanos().saturating_sub(MAX_STAMP_DIFFERENCE);
    let latest = stamp.nanos().saturating_add(MAX_STAMP_DIFFERENCE);
    while images.next_if(|(other, _)| other.nanos() < earliest).is_some() {}
    let (other, encoded) = images.next_if(|(other, _)| other.nanos() <= latest)?;
    let picture = encoded.decode().and_then(|picture| {
        let (given, expected) = ((picture.width, picture.height), (camera.camera.width, camera.camera.height));
        if given == expected { Ok(picture) } else { Err(Error::ImageSize { given, expected }.to_string()) }
    });
    Some(picture.map_err(|why| format!("second camera, image of {other} s: {why}")))
}
