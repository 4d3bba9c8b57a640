//! What a keyframe saw, in few bytes: inverse depth of 16 bits, on a plane linear in the pixel, and grey of 8 bits.

use crate::images::Intrinsics;
use crate::keyframes::plane_coder::{decode, encode};
use crate::ray_cast::pixel::UNSEEN;
use crate::tracking::image_level::ImageLevel;

/// A depth image, at most about 320 pixels wide, and its intensities.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CompressedFrame {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) intrinsics: Intrinsics,
    /// Inverse depth of the largest value, 1/m.
    pub(crate) most: f32,
    pub(crate) depth: Vec<u8>,
    /// Empty without colour.
    pub(crate) grey: Vec<u8>,
}

/// What an unseen pixel gets: no colour was seen there, either.
const UNSEEN_GREY: i32 = UNSEEN[0] as i32;

impl CompressedFrame {
    pub(crate) fn new(level: &ImageLevel) -> Self {
        let most = level.omega.iter().fold(1e-6_f32, |most, omega| most.max(*omega));
        let scale = f32::from(u16::MAX) / most;
        // 0 is "no depth": what was measured is 1 at least.
        let omega = level.omega.iter().map(|o| if *o > 0.0 { ((o * scale).round() as i32).max(1) } else { 0 });
        let grey = level.intensity.iter().map(|i| if i.is_nan() { UNSEEN_GREY } else { i.round() as i32 });
        let pack = |values: Vec<i32>| if values.is_empty() { Vec::new() } else { encode(&values, level.width) };
        let [fx, fy] = level.focal.map(f64::from);
        let [cx, cy] = level.centre.map(f64::from);
        Self {
            width: level.width,
            height: level.height,
            intrinsics: Intrinsics { fx, fy, cx, cy },
            most,
            depth: pack(omega.collect()),
            grey: pack(grey.collect()),
        }
    }

    /// Metres, 0 where there is none; `None` if the bytes are no image of this size.
    pub(crate) fn metres(&self) -> Option<Vec<f32>> {
        let scale = self.most / f32::from(u16::MAX);
        let values = decode(&self.depth, self.width, self.width * self.height)?;
        Some(values.into_iter().map(|v| if v > 0 { 1.0 / (v as f32 * scale) } else { 0.0 }).collect())
    }

    /// R, G and B of each pixel, equal; empty without colour; `None` if the bytes are no image of this size.
    pub(crate) fn rgb(&self) -> Option<Vec<u8>> {
        if self.grey.is_empty() {
            return Some(Vec::new());
        }
        let values = decode(&self.grey, self.width, self.width * self.height)?;
        values.into_iter().map(|v| u8::try_from(v).ok()).flat_map(|v| [v; 3]).collect()
    }

    /// The image that it was made of, as far as it was kept; `None` if the bytes are no image of this size.
    pub(crate) fn level(&self) -> Option<ImageLevel> {
        let &Self { width, height, intrinsics: Intrinsics { fx, fy, cx, cy }, .. } = self;
        let omega = self.metres()?.into_iter().map(|z| if z > 0.0 { 1.0 / z } else { 0.0 }).collect();
        let intensity = self.rgb()?.chunks_exact(3).map(|rgb| f32::from(rgb[0])).collect();
        let (focal, centre) = ([fx as f32, fy as f32], [cx as f32, cy as f32]);
        Some(ImageLevel { width, height, focal, centre, omega, intensity, gradient: Vec::new() })
    }

    /// Bytes of both.
    pub(crate) fn bytes(&self) -> usize {
        self.depth.len() + self.grey.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(width: usize, omega: Vec<f32>) -> ImageLevel {
        ImageLevel {
            width,
            height: omega.len() / width,
            focal: [300.0, -300.0],
            centre: [3.0, 2.0],
            omega,
            ..ImageLevel::default()
        }
    }

    #[test]
    fn depth_comes_back_to_the_step_and_planes_cost_little() {
        // A slope, an edge, holes, and the largest and smallest values beside each other.
        let omega: Vec<f32> = (0..64 * 48)
            .map(|k| match (k % 64, k / 64) {
                (20..30, 10..20) => 0.0,
                (x, _) if x < 16 => 2.0,
                (x, 30) => {
                    if x % 2 == 0 {
                        4.0
                    } else {
                        1e-4
                    }
                }
                (x, y) => 0.3 + 0.004 * x as f32 + 0.002 * y as f32,
            })
            .collect();
        let packed = CompressedFrame::new(&level(64, omega.clone()));
        assert!(packed.depth.len() < omega.len(), "{} bytes", packed.depth.len());
        let metres = packed.metres().unwrap();
        for (z, omega) in metres.iter().zip(&omega) {
            assert_eq!(*z > 0.0, *omega > 0.0);
            if *z > 0.0 {
                assert!((1.0 / z - omega).abs() <= 4.0 / 65535.0, "{z} {omega}");
            }
        }
        let mut cut = packed.clone();
        cut.depth.pop();
        assert_eq!(cut.metres(), None);
    }

    #[test]
    fn grey_comes_back_and_what_is_no_grey_does_not() {
        let mut seen = level(16, vec![1.0; 16 * 12]);
        seen.intensity = (0..16 * 12).map(|k| if k == 5 { f32::NAN } else { (k * 7 % 256) as f32 + 0.3 }).collect();
        let packed = CompressedFrame::new(&seen);
        let rgb = packed.rgb().unwrap();
        for (k, pixel) in rgb.as_chunks::<3>().0.iter().enumerate() {
            let expected = if k == 5 { UNSEEN[0] } else { (k * 7 % 256) as u8 };
            assert_eq!(*pixel, [expected; 3], "{k}");
        }
        // The bytes of an image whose values do not fit.
        let wide = CompressedFrame { grey: packed.depth.clone(), ..packed.clone() };
        assert_eq!(wide.rgb(), None);
        assert_eq!(CompressedFrame::new(&level(16, vec![1.0; 16])).rgb(), Some(Vec::new()));
    }
}
