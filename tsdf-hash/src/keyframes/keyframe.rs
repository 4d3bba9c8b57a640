//! One keyframe, in memory and as bytes.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::images::Intrinsics;
use crate::keyframes::compressed_frame::CompressedFrame;
use crate::keyframes::small_image::SmallImage;

/// A place: where it was seen from, what it looks like, how deep it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Keyframe {
    pub(crate) world_from_camera: Isometry3<f64>,
    pub(crate) image: SmallImage,
    /// What it saw; `None` once it had to make room.
    pub(crate) frame: Option<CompressedFrame>,
}

/// No image of a keyframe has more pixels along a side.
const LARGEST: u32 = 4096;

impl Keyframe {
    /// Bytes in memory, about.
    pub(crate) fn bytes(&self) -> usize {
        let image: usize = self.image.channels.iter().map(|channel| 4 * channel.len()).sum();
        size_of::<Self>() + image + self.frame.as_ref().map_or(0, CompressedFrame::bytes)
    }

    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        let mut f64s = |numbers: &[f64]| numbers.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        f64s(self.world_from_camera.translation.vector.as_slice());
        f64s(self.world_from_camera.rotation.coords.as_slice());
        let mut u32s = |numbers: &[u32]| numbers.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        u32s(&[self.image.width as u32]);
        u32s(&self.image.focal.map(f32::to_bits));
        for channel in &self.image.channels {
            u32s(&[channel.len() as u32]);
            u32s(&channel.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        }
        let Some(frame) = &self.frame else {
            u32s(&[0, 0]);
            return;
        };
        let lengths = [frame.depth.len() as u32, frame.grey.len() as u32];
        u32s(&[frame.width as u32, frame.height as u32, frame.most.to_bits(), lengths[0], lengths[1]]);
        let Intrinsics { fx, fy, cx, cy } = frame.intrinsics;
        out.extend([fx, fy, cx, cy].into_iter().flat_map(f64::to_le_bytes));
        out.extend_from_slice(&frame.depth);
        out.extend_from_slice(&frame.grey);
    }

    pub(crate) fn read(input: &mut ByteReader) -> Result<Self, Error> {
        let mut pose = [0.0; 7];
        for number in &mut pose {
            *number = input.f64()?;
        }
        let [x, y, z, i, j, k, w] = pose;
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        let world_from_camera = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        crate::images::check_pose(&world_from_camera).map_err(|_| input.bad())?;
        let width = input.u32()?;
        let focal = [f32::from_bits(input.u32()?), f32::from_bits(input.u32()?)];
        let mut channels = [Vec::new(), Vec::new()];
        for channel in &mut channels {
            let length = input.u32()?;
            if width == 0 || width > LARGEST || !length.is_multiple_of(width) || length / width > LARGEST {
                return Err(input.bad());
            }
            let bytes = input.take(4 * length as usize)?;
            let values = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
            *channel = values.collect();
            if channel.iter().any(|v| !v.is_finite()) {
                return Err(input.bad());
            }
        }
        let image = SmallImage { width: width as usize, focal, channels };
        let (width, height) = (input.u32()?, input.u32()?);
        if width == 0 && height == 0 {
            return Ok(Self { world_from_camera, image, frame: None });
        }
        if width.max(height) > LARGEST || width.min(height) == 0 {
            return Err(input.bad());
        }
        let (most, lengths) = (f32::from_bits(input.u32()?), [input.u32()?, input.u32()?]);
        let [fx, fy, cx, cy] = [input.f64()?, input.f64()?, input.f64()?, input.f64()?];
        let depth = input.take(lengths[0] as usize)?.to_vec();
        let grey = input.take(lengths[1] as usize)?.to_vec();
        let intrinsics = Intrinsics { fx, fy, cx, cy };
        let frame = CompressedFrame { width: width as usize, height: height as usize, intrinsics, most, depth, grey };
        if !(most > 0.0 && most.is_finite()) || frame.metres().is_none() || frame.rgb().is_none() {
            return Err(input.bad());
        }
        Ok(Self { world_from_camera, image, frame: Some(frame) })
    }
}
