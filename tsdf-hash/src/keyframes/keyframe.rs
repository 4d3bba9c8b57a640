//! One keyframe, in memory and as bytes.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::images::Intrinsics;
use crate::keyframes::compressed_frame::CompressedFrame;
use crate::keyframes::small_image::SmallImage;
use crate::place_recognition::descriptor::Descriptor;
use crate::place_recognition::features::{Feature, features as found_in};

/// A place: where it was seen from, what it looks like, how deep it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Keyframe {
    pub(crate) world_from_camera: Isometry3<f64>,
    pub(crate) image: SmallImage,
    /// What it saw; `None` once it had to make room.
    pub(crate) frame: Option<CompressedFrame>,
    /// Corners that it can be recognised by.
    pub(crate) features: Vec<Feature>,
}

/// No image of a keyframe has more pixels along a side.
const LARGEST: u32 = 4096;

impl Keyframe {
    /// Bytes in memory, about.
    pub(crate) fn bytes(&self) -> usize {
        let image: usize = self.image.channels.iter().map(|channel| 4 * channel.len()).sum();
        let features = self.features.len() * size_of::<Feature>();
        size_of::<Self>() + image + features + self.frame.as_ref().map_or(0, CompressedFrame::bytes)
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
        u32s(&[self.features.len() as u32]);
        for feature in &self.features {
            u32s(&feature.point.map(f32::to_bits));
            u32s(&feature.descriptor.0.map(|word| [word as u32, (word >> 32) as u32]).concat());
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

    /// Of a file with features, or of one from before there were any: they are then found in what the keyframe saw.
    pub(crate) fn read(input: &mut ByteReader, with_features: bool) -> Result<Self, Error> {
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
        let mut features = Vec::new();
        let count = if with_features { input.u32()? } else { 0 };
        for _ in 0..count {
            features.push(read_feature(input)?);
        }
        let (width, height) = (input.u32()?, input.u32()?);
        if width == 0 && height == 0 {
            return Ok(Self { world_from_camera, image, frame: None, features });
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
        let level = if most > 0.0 && most.is_finite() { frame.level() } else { None };
        let level = level.ok_or_else(|| input.bad())?;
        if !with_features {
            features = found_in(&level);
        }
        Ok(Self { world_from_camera, image, frame: Some(frame), features })
    }
}

fn read_feature(input: &mut ByteReader) -> Result<Feature, Error> {
    let mut point = [0.0; 3];
    for number in &mut point {
        *number = f32::from_bits(input.u32()?);
    }
    let mut descriptor = Descriptor::default();
    for word in &mut descriptor.0 {
        *word = input.u64()?;
    }
    if point.iter().any(|number| !number.is_finite()) {
        return Err(input.bad());
    }
    Ok(Feature { point, descriptor })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::image_level::ImageLevel;

    /// Squares on a wall at two metres.
    fn keyframe() -> Keyframe {
        let (width, height) = (160, 120);
        let grey = |k: usize| if (k % width / 17 + k / width / 13).is_multiple_of(2) { 40.0 } else { 200.0 };
        let level = ImageLevel {
            width,
            height,
            focal: [150.0; 2],
            centre: [79.5, 59.5],
            omega: vec![0.5; width * height],
            intensity: (0..width * height).map(grey).collect(),
            gradient: Vec::new(),
        };
        let (image, frame) = (SmallImage::new(&level), Some(CompressedFrame::new(&level)));
        Keyframe { world_from_camera: Isometry3::identity(), image, frame, features: found_in(&level) }
    }

    /// A file from before there were features: they are found in what was stored.
    #[test]
    fn an_old_keyframe_gets_its_features() {
        let new = keyframe();
        assert!(new.features.len() > 20, "{}", new.features.len());
        let mut bytes = Vec::new();
        new.write(&mut bytes);
        let begin = 56 + 12 + new.image.channels.iter().map(|channel| 4 + 4 * channel.len()).sum::<usize>();
        bytes.drain(begin..begin + 4 + 44 * new.features.len());
        let old = Keyframe::read(&mut ByteReader::new(&bytes, 0, "the keyframes"), false).unwrap();
        assert_eq!(old.features.len(), new.features.len());
        for (old, new) in old.features.iter().zip(&new.features) {
            assert_eq!(old.descriptor, new.descriptor);
            assert!(old.point.iter().zip(&new.point).all(|(a, b)| (a - b).abs() < 1e-4), "{old:?} {new:?}");
        }
    }
}
