//! The images of a recording, read one after the other.

use std::path::Path;

use vio_ekf::run::{RecordedFrame, pair_by_stamp};
use vio_ekf::{Error, Stamp};

use super::grey_image::GreyImage;
use super::mcap_in::read_images;
use super::recording::{Images, Recording, SecondCamera};
use crate::interruption;

/// Images of both cameras whose stamps differ by no more, s, were taken together.
const MAX_STAMP_DIFFERENCE_S: f64 = 1e-3;

/// Reads the images one after the other, as they are asked for, each with that of the second camera.
pub fn camera_frames(recording: &Recording) -> impl Iterator<Item = RecordedFrame<GreyImage>> + Send + '_ {
    let second = recording.second.as_ref();
    let seconds = second.into_iter().flat_map(|second| images(&second.images));
    // A recording that somebody interrupts has ended.
    let first = images(&recording.images).take_while(|_| !interruption::is_requested());
    pair_by_stamp(first, seconds, MAX_STAMP_DIFFERENCE_S).map(move |(stamp, first, taken_with)| {
        let taken_with = second.zip(taken_with);
        RecordedFrame {
            stamp,
            picture: first.decode(),
            second: taken_with.map(|(camera, (stamp, encoded))| decode_second(camera, stamp, encoded)),
        }
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

/// An image of the second camera, or why it cannot be used.
fn decode_second(camera: &SecondCamera, stamp: Stamp, encoded: Encoded<'_>) -> Result<GreyImage, String> {
    let picture = encoded.decode().and_then(|picture| {
        let (given, expected) = ((picture.width, picture.height), (camera.camera.width, camera.camera.height));
        if given == expected { Ok(picture) } else { Err(Error::ImageSize { given, expected }.to_string()) }
    });
    picture.map_err(|why| format!("second camera, image of {stamp} s: {why}"))
}
