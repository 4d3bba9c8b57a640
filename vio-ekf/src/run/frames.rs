//! The images of a recording, and those of two cameras brought together by their stamps.

use crate::samples::ImageView;
use crate::sim::Frame;
use crate::stamp::Stamp;

/// Something that holds a grey image.
pub trait Picture {
    /// The image, borrowed.
    fn view(&self) -> ImageView<'_>;
}

impl Picture for Frame {
    fn view(&self) -> ImageView<'_> {
        Self::view(self)
    }
}

/// What a recording has at one time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedFrame<P> {
    /// Middle of the exposure by the camera's clock.
    pub stamp: Stamp,
    /// The image of the first camera, or why it cannot be read.
    pub picture: Result<P, String>,
    /// The image that a second camera took together with it, if there is one, or why it cannot be read.
    pub second: Option<Result<P, String>>,
}

impl<P> RecordedFrame<P> {
    /// An image of one camera.
    pub fn single(stamp: Stamp, picture: P) -> Self {
        Self { stamp, picture: Ok(picture), second: None }
    }
}

/// Brings the images of two cameras together: those of the second whose stamps differ by no more than `max_difference_s` from one of
/// the first were taken with it. Both by rising stamps; images of the second camera alone are dropped.
pub fn pair_by_stamp<A, B>(
    first: impl Iterator<Item = (Stamp, A)>,
    second: impl Iterator<Item = (Stamp, B)>,
    max_difference_s: f64,
) -> impl Iterator<Item = (Stamp, A, Option<(Stamp, B)>)> {
    let mut second = second.peekable();
    first.map(move |(stamp, image)| {
        let (earliest, latest) = (stamp.plus_secs(-max_difference_s), stamp.plus_secs(max_difference_s));
        while second.next_if(|(other, _)| *other < earliest).is_some() {}
        (stamp, image, second.next_if(|(other, _)| *other <= latest))
    })
}
