//! Keyframes to find a lost camera by: small blurry images, as PTAM keeps them (Klein and Murray 2008), of depth beside intensity.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::images::{ColourView, DepthView, check_pose};
use crate::tracking::image_level::ImageLevel;

/// Pixels of the small image along a row.
const WIDTH: usize = 40;
/// A keyframe is added this far from all others, metres and radians (ours): tracking starts well from half of it.
const SPACING: [f64; 2] = [0.2, 0.2];

/// Small images of a scan with the poses that they were taken from.
#[derive(Clone, Debug, Default)]
pub struct KeyframeIndex {
    keyframes: Vec<Keyframe>,
    level: ImageLevel,
}

#[derive(Clone, Debug)]
struct Keyframe {
    world_from_camera: Isometry3<f64>,
    image: SmallImage,
}

/// Inverse depth and intensity, each of zero mean and unit length; intensity is empty without colour.
#[derive(Clone, Debug)]
struct SmallImage {
    width: usize,
    channels: [Vec<f32>; 2],
}

impl KeyframeIndex {
    /// Without keyframes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.keyframes.is_empty()
    }

    /// Keeps a frame if no keyframe was taken from near its pose (20 cm and 11 degrees). Returns whether it is kept.
    ///
    /// # Errors
    /// Views or pose that make no sense.
    pub fn add(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<bool, Error> {
        check_pose(world_from_camera)?;
        let near = |keyframe: &Keyframe| {
            let apart = keyframe.world_from_camera.inverse() * world_from_camera;
            apart.translation.vector.norm() < SPACING[0] && apart.rotation.angle() < SPACING[1]
        };
        if self.keyframes.iter().any(near) {
            return Ok(false);
        }
        let image = self.small(depth, colour)?;
        self.keyframes.push(Keyframe { world_from_camera: *world_from_camera, image });
        Ok(true)
    }

    /// The poses of the keyframes most like a frame, the likest first: at most `count`.
    ///
    /// # Errors
    /// Views that make no sense.
    pub fn candidates(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        count: usize,
    ) -> Result<Vec<Isometry3<f64>>, Error> {
        let image = self.small(depth, colour)?;
        let mut ranked: Vec<(f32, usize)> =
            self.keyframes.iter().enumerate().map(|(k, keyframe)| (image.similarity(&keyframe.image), k)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        Ok(ranked.into_iter().take(count).map(|(_, k)| self.keyframes[k].world_from_camera).collect())
    }

    fn small(&mut self, depth: &DepthView, colour: Option<&ColourView>) -> Result<SmallImage, Error> {
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        let factor = depth.width.div_ceil(WIDTH).min(depth.height);
        self.level.read(depth, colour, factor, [1e-3, 1e3]);
        Ok(SmallImage {
            width: self.level.width,
            channels: [
                normalised(&self.level.omega, |omega| omega > 0.0),
                normalised(&self.level.intensity, f32::is_finite),
            ],
        })
    }
}

impl SmallImage {
    /// Mean of the correlations of the channels that both have, `-1..=1`.
    fn similarity(&self, other: &Self) -> f32 {
        let correlation = |k: usize| -> Option<f32> {
            let (a, b) = (&self.channels[k], &other.channels[k]);
            let alike = !a.is_empty() && a.len() == b.len() && self.width == other.width;
            alike.then(|| a.iter().zip(b).map(|(a, b)| a * b).sum())
        };
        let found: Vec<f32> = [0, 1].into_iter().filter_map(correlation).collect();
        if found.is_empty() { -1.0 } else { found.iter().sum::<f32>() / found.len() as f32 }
    }
}

/// Zero mean and unit length over the values that are known; 0 elsewhere.
fn normalised(values: &[f32], known: impl Fn(f32) -> bool) -> Vec<f32> {
    let count = values.iter().filter(|v| known(**v)).count().max(1) as f32;
    let mean = values.iter().filter(|v| known(**v)).sum::<f32>() / count;
    let centred: Vec<f32> = values.iter().map(|&v| if known(v) { v - mean } else { 0.0 }).collect();
    let length = centred.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    centred.into_iter().map(|v| v / length).collect()
}
