//! Frames that can be looked at again: the map is corrected by taking them out where they were and fusing them where they belong.

use crate::error::{BoxedError, Error};
use crate::images::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

/// Where [`Slam`](crate::slam::Slam) reads a frame again: after a loop was closed, or once a lost camera is found. A recording, or a store
/// in memory ([`FrameMemory`](crate::slam::FrameMemory)).
///
/// Closures that read a frame by its number are sources, too.
pub trait FrameSource {
    /// Reads a frame again; the same pixels, to the bit, as [`Slam::frame`](crate::slam::Slam::frame) was given. `frame` is its number,
    /// as [`FrameOutcome::frame`](crate::slam::FrameOutcome::frame) has it.
    ///
    /// # Errors
    /// Whatever the source meets.
    fn read(&mut self, frame: usize) -> Result<FrameImages, BoxedError>;

    /// A frame that may be read again later. A recording has it anyway.
    fn store(&mut self, _frame: usize, _depth: &DepthView, _colour: Option<&ColourView>) {}

    /// A stored frame that is not read again.
    fn discard(&mut self, _frame: usize) {}
}

impl<F: FnMut(usize) -> Result<FrameImages, BoxedError>> FrameSource for F {
    fn read(&mut self, frame: usize) -> Result<FrameImages, BoxedError> {
        self(frame)
    }
}

/// Reads a frame; a failure names it.
pub(crate) fn read_again(source: &mut impl FrameSource, frame: usize) -> Result<FrameImages, Error> {
    source.read(frame).map_err(|source| Error::FrameSource { frame, source })
}

/// The images of a frame, owned.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameImages {
    /// Pixels per row of the depth image.
    pub width: usize,
    /// Its rows.
    pub height: usize,
    /// Its pixels, as [`DepthData`] has them.
    pub depth: DepthPixels,
    /// Its camera.
    pub intrinsics: Intrinsics,
    /// The colour image, if there is one.
    pub colour: Option<ColourImage>,
}

/// Depth pixels, owned; see [`DepthData`].
#[derive(Clone, Debug, PartialEq)]
pub enum DepthPixels {
    /// Integers.
    U16 {
        /// `width * height` values.
        data: Vec<u16>,
        /// Units per metre.
        scale: f64,
    },
    /// Metres.
    F32(Vec<f32>),
}

/// A colour image, owned; see [`ColourView`].
#[derive(Clone, Debug, PartialEq)]
pub struct ColourImage {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Its pixels.
    pub pixels: ColourPixels,
    /// The camera.
    pub intrinsics: Intrinsics,
}

/// Colour pixels, owned; see [`ColourData`].
#[derive(Clone, Debug, PartialEq)]
pub enum ColourPixels {
    /// `3 * width * height` bytes.
    Rgb8(Vec<u8>),
    /// `3 * width * height` values.
    Rgb16(Vec<u16>),
}

impl FrameImages {
    /// Copies views.
    pub fn of(depth: &DepthView, colour: Option<&ColourView>) -> Self {
        let pixels = match depth.data {
            DepthData::U16 { data, scale } => DepthPixels::U16 { data: data.to_vec(), scale },
            DepthData::F32 { data } => DepthPixels::F32(data.to_vec()),
        };
        let colour = colour.map(|view| ColourImage {
            width: view.width,
            height: view.height,
            pixels: match view.data {
                ColourData::Rgb8(data) => ColourPixels::Rgb8(data.to_vec()),
                ColourData::Rgb16(data) => ColourPixels::Rgb16(data.to_vec()),
            },
            intrinsics: view.intrinsics,
        });
        Self { width: depth.width, height: depth.height, depth: pixels, intrinsics: depth.intrinsics, colour }
    }

    /// The depth image.
    pub fn depth(&self) -> DepthView<'_> {
        let data = match &self.depth {
            DepthPixels::U16 { data, scale } => DepthData::U16 { data, scale: *scale },
            DepthPixels::F32(data) => DepthData::F32 { data },
        };
        DepthView { width: self.width, height: self.height, data, intrinsics: self.intrinsics }
    }

    /// The colour image, if there is one.
    pub fn colour(&self) -> Option<ColourView<'_>> {
        let colour = self.colour.as_ref()?;
        let data = match &colour.pixels {
            ColourPixels::Rgb8(data) => ColourData::Rgb8(data),
            ColourPixels::Rgb16(data) => ColourData::Rgb16(data),
        };
        Some(ColourView { width: colour.width, height: colour.height, data, intrinsics: colour.intrinsics })
    }
}
