//! Frames kept in memory, without loss: each pixel is predicted from its neighbours, the differences take few bits.

use std::collections::BTreeMap;

use crate::error::BoxedError;
use crate::images::{ColourView, DepthView};
use crate::keyframes::plane_coder::{decode, encode};
use crate::slam::frame_source::{ColourPixels, DepthPixels, FrameImages, FrameSource};

/// The source of a [`Slam`](crate::slam::Slam) without a recording: keeps the frames that may be read again. Depth of 16 bits takes about a
/// third of its size, colour of 8 bits half; without loops only the frames of a lost camera are kept.
#[derive(Debug, Default)]
pub struct FrameMemory {
    frames: BTreeMap<usize, PackedFrame>,
}

/// Images whose pixels lie in `depth` and `colour` where these can be packed.
#[derive(Debug)]
struct PackedFrame {
    images: FrameImages,
    depth: Vec<u8>,
    /// Red, green, blue.
    colour: [Vec<u8>; 3],
}

impl FrameMemory {
    /// Without frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of frames that are kept.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether none is kept.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }
}

impl FrameSource for FrameMemory {
    fn read(&mut self, frame: usize) -> Result<FrameImages, BoxedError> {
        let packed = self.frames.get(&frame).ok_or("it was not stored")?;
        packed.unpack().ok_or_else(|| "its bytes are no image".into())
    }

    fn store(&mut self, frame: usize, depth: &DepthView, colour: Option<&ColourView>) {
        self.frames.insert(frame, PackedFrame::new(FrameImages::of(depth, colour)));
    }

    fn discard(&mut self, frame: usize) {
        self.frames.remove(&frame);
    }
}

impl PackedFrame {
    fn new(mut images: FrameImages) -> Self {
        let mut depth = Vec::new();
        if let DepthPixels::U16 { data, .. } = &mut images.depth {
            let values: Vec<i32> = std::mem::take(data).into_iter().map(i32::from).collect();
            depth = encode(&values, images.width);
        }
        let mut colour = <[Vec<u8>; 3]>::default();
        if let Some(image) = &mut images.colour
            && let ColourPixels::Rgb8(data) = &mut image.pixels
        {
            let rgb = std::mem::take(data);
            let channel = |k| rgb.iter().skip(k).step_by(3).map(|v| i32::from(*v)).collect::<Vec<_>>();
            colour = [0, 1, 2].map(|k| encode(&channel(k), image.width));
        }
        Self { images, depth, colour }
    }

    fn unpack(&self) -> Option<FrameImages> {
        let mut images = self.images.clone();
        if let DepthPixels::U16 { data, .. } = &mut images.depth {
            let values = decode(&self.depth, images.width, images.width * images.height)?;
            *data = values.into_iter().map(|v| u16::try_from(v).ok()).collect::<Option<_>>()?;
        }
        if let Some(image) = &mut images.colour
            && let ColourPixels::Rgb8(data) = &mut image.pixels
        {
            let size = image.width * image.height;
            *data = vec![0; 3 * size];
            for (k, channel) in self.colour.iter().enumerate() {
                let values = decode(channel, image.width, size)?;
                for (pixel, value) in data.iter_mut().skip(k).step_by(3).zip(values) {
                    *pixel = u8::try_from(value).ok()?;
                }
            }
        }
        Some(images)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::Intrinsics;
    use crate::slam::frame_source::ColourImage;

    #[test]
    fn what_was_stored_comes_back_to_the_bit() {
        let intrinsics = Intrinsics { fx: 70.0, fy: -70.0, cx: 19.5, cy: 14.5 };
        // A slope with holes and the largest value beside the smallest.
        let depth: Vec<u16> = (0..40 * 30).map(|k| if k % 7 == 0 { 0 } else { 900 + 3 * k }).collect();
        let rgb: Vec<u8> = (0..3 * 20 * 15).map(|k| (k * k % 251) as u8).collect();
        let colour = ColourImage { width: 20, height: 15, pixels: ColourPixels::Rgb8(rgb), intrinsics };
        let wide = ColourPixels::Rgb16((0..3 * 20 * 15).map(|k| 200 * k as u16).collect());
        let frames = [
            (DepthPixels::U16 { data: depth.clone(), scale: 5000.0 }, Some(colour.clone())),
            (DepthPixels::U16 { data: [0, u16::MAX].repeat(600), scale: 1000.0 }, None),
            (
                DepthPixels::F32(depth.iter().map(|d| f32::from(*d) / 3e3).collect()),
                Some(ColourImage { pixels: wide, ..colour }),
            ),
        ];
        let mut memory = FrameMemory::new();
        assert!(memory.is_empty());
        let frames = frames.map(|(depth, colour)| FrameImages { width: 40, height: 30, depth, intrinsics, colour });
        for (k, images) in frames.iter().enumerate() {
            memory.store(10 * k, &images.depth(), images.colour().as_ref());
        }
        for (k, images) in frames.iter().enumerate() {
            assert_eq!(memory.read(10 * k).unwrap(), *images, "{k}");
        }
        memory.discard(10);
        assert_eq!((memory.len(), memory.is_empty(), memory.read(10).is_err()), (2, false, true));
    }
}
