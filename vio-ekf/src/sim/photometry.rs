//! From light to grey levels: exposure, gain, vignetting and noise.

use std::sync::OnceLock;

use super::render::{TILE, TILE_HEIGHT, TILE_WIDTH};
use super::rng::{derive, mix};
use crate::camera::Camera;
use crate::error::Error;
use crate::error::{all_not_negative, invalid};
use crate::eval::chi2;

/// What happens to the light between the lens and the file.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Photometry {
    /// Time the shutter is open, s; a frame's stamp is its middle. 8 ms, as indoors.
    pub exposure_s: f64,
    /// Poses over which the exposure is averaged, 1 to 64; 3. They also sample different places of each pixel.
    pub poses: usize,
    /// Standard deviation of the noise of a dark pixel, grey levels; 1.6.
    pub read_noise: f64,
    /// Variance added per grey level of signal, grey levels; 0.015, with which the noise at mid grey is 2 grey levels.
    pub shot_noise: f64,
    /// Light that is missing in the corner of the image, share from 0 to 1; 0.3.
    pub vignetting: f64,
    /// Changes of the gain. Where several apply their factors multiply.
    pub gains: Vec<Gain>,
}

/// A span of time in which the image is brighter or darker: a step of the exposure, or with factor 0 a black-out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Gain {
    /// Start, s after the start of the motion.
    pub from_s: f64,
    /// End, s after the start of the motion.
    pub until_s: f64,
    /// Factor of the brightness.
    pub factor: f64,
    /// Grey levels added.
    pub offset: f64,
}

impl Default for Photometry {
    fn default() -> Self {
        Self { exposure_s: 0.008, poses: 3, read_noise: 1.6, shot_noise: 0.015, vignetting: 0.3, gains: Vec::new() }
    }
}

impl Photometry {
    /// No blur, noise or vignetting.
    pub fn ideal() -> Self {
        Self { exposure_s: 0.0, poses: 3, read_noise: 0.0, shot_noise: 0.0, vignetting: 0.0, gains: Vec::new() }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        if !(1..=64).contains(&self.poses) {
            return Err(invalid("poses", self.poses as f64, "must be 1 to 64 poses for an exposure"));
        }
        if !(0.0..=1.0).contains(&self.vignetting) {
            return Err(invalid("vignetting", self.vignetting, "must be a share between 0 and 1"));
        }
        for gain in &self.gains {
            all_not_negative(&[("factor", gain.factor)])?;
            if !(gain.from_s <= gain.until_s && gain.offset.is_finite()) {
                return Err(invalid("from_s", gain.from_s, "must not be after until_s, and the offset finite"));
            }
        }
        all_not_negative(&[
            ("exposure_s", self.exposure_s),
            ("read_noise", self.read_noise),
            ("shot_noise", self.shot_noise),
        ])
    }

    /// Factor and offset at a time after the start of the motion.
    fn gain_at(&self, since_s: f64) -> (f32, f32) {
        let active = self.gains.iter().filter(|g| (g.from_s..g.until_s).contains(&since_s));
        let (factor, offset) = active.fold((1.0, 0.0), |(f, o), g| (f * g.factor, o + g.offset));
        (factor as f32, offset as f32)
    }

    /// The sensor's state for one frame.
    pub(super) fn sensor(&self, since_s: f64, seed: u64) -> Sensor {
        let (gain, offset) = self.gain_at(since_s);
        let (read, shot) = ((self.read_noise * self.read_noise) as f32, self.shot_noise as f32);
        Sensor { gain, offset, read, shot, seed, quantiles: quantiles() }
    }

    /// Share of the light that reaches each pixel of a tile; 0 outside the lens model.
    pub(super) fn light(&self, camera: &Camera, left: usize, top: usize) -> [f32; TILE] {
        let centre = ((camera.width as f64 - 1.0) / 2.0, (camera.height as f64 - 1.0) / 2.0);
        let corner = centre.0 * centre.0 + centre.1 * centre.1;
        std::array::from_fn(|i| {
            let (x, y) = ((left + i % TILE_WIDTH) as f64, (top + i / TILE_WIDTH) as f64);
            let square = (x - centre.0).powi(2) + (y - centre.1).powi(2);
            let seen = camera.bearing(&nalgebra::Vector2::new(x, y)).is_some();
            if seen { (1.0 - self.vignetting * square / corner.max(1.0)) as f32 } else { 0.0 }
        })
    }
}

/// Turns light into grey levels.
pub(super) struct Sensor {
    gain: f32,
    offset: f32,
    read: f32,
    shot: f32,
    seed: u64,
    quantiles: &'static [f32],
}

impl Sensor {
    /// Grey levels of tile `index`; the same whatever was rendered before.
    pub(super) fn expose(&self, index: usize, light: &[f32; TILE], radiance: &[f32; TILE]) -> [u8; TILE] {
        let mut noise = [0.0_f32; TILE];
        if self.read > 0.0 || self.shot > 0.0 {
            let stream = derive(self.seed, index as u64);
            for (group, four) in noise.chunks_exact_mut(4).enumerate() {
                let bits = mix(stream.wrapping_add(group as u64));
                for (k, value) in four.iter_mut().enumerate() {
                    *value = self.quantiles[(bits >> (16 * k)) as usize & (QUANTILES - 1)];
                }
            }
        }
        std::array::from_fn(|i| {
            let signal = (radiance[i] * light[i] * self.gain + self.offset).clamp(0.0, 1000.0);
            let value = signal + (self.read + self.shot * signal).sqrt() * noise[i];
            (value + 0.5).clamp(0.0, 255.0) as u8
        })
    }
}

const QUANTILES: usize = 4096;

/// The normal distribution cut into slices of equal probability: drawing one at random draws from the distribution,
/// ending at 3.7 standard deviations.
fn quantiles() -> &'static [f32] {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    TABLE.get_or_init(|| (0..QUANTILES).map(|i| normal_quantile((i as f64 + 0.5) / QUANTILES as f64) as f32).collect())
}

/// The quantile of a normal is the signed root of that of chi-square with one degree of freedom.
fn normal_quantile(p: f64) -> f64 {
    let square = chi2::quantile((2.0 * p - 1.0).abs(), 1).unwrap_or(0.0);
    square.sqrt().copysign(p - 0.5)
}

/// Tiles that cover an image: columns and rows.
pub(super) fn tiling(camera: &Camera) -> (usize, usize) {
    (camera.width.div_ceil(TILE_WIDTH), camera.height.div_ceil(TILE_HEIGHT))
}
