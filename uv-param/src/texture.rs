//! From what is known about the surface to the texels of its chart.

mod gutter;
mod texel_map;

use crate::chart::SurfacePoint;
use crate::disk::Disk;
use crate::error::Error;
pub use gutter::{Gutter, GutterTexel, WeightedTexels};
pub use texel_map::TexelMap;

/// An image over a [`TexelMap`] with `CHANNELS` values per texel (1 = grey, 3 = linear RGB), row-major, row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture<const CHANNELS: usize> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values; zero where nothing is known.
    pub texels: Vec<[f32; CHANNELS]>,
    /// Whether the texel has a value.
    pub filled: Vec<bool>,
}

impl<const CHANNELS: usize> Texture<CHANNELS> {
    /// Asks `sample` for the value of every covered texel.
    pub fn from_sampler(map: &TexelMap, sample: impl Fn(SurfacePoint) -> [f32; CHANNELS]) -> Self {
        let texels = map.cells.iter().map(|cell| cell.map_or([0.0; CHANNELS], &sample)).collect();
        let filled = map.cells.iter().map(Option::is_some).collect();
        Self { width: map.width, height: map.height, texels, filled }
    }

    /// Interpolates values given per vertex of the INPUT mesh (colours, heights, densities); average linear values, not
    /// sRGB ones.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is one value per input vertex; [`Error::NonFiniteValue`].
    pub fn from_vertices(map: &TexelMap, disk: &Disk, values: &[[f32; CHANNELS]]) -> Result<Self, Error> {
        if values.len() != disk.source_vertex_count() {
            return Err(Error::Length {
                what: "vertex values",
                expected: disk.source_vertex_count(),
                found: values.len(),
            });
        }
        if let Some(index) = values.iter().position(|value| !value.iter().all(|x| x.is_finite())) {
            return Err(Error::NonFiniteValue { what: "vertex values", index });
        }
        Ok(Self::from_sampler(map, |at| {
            let corners = disk.faces()[at.face as usize].map(|v| values[disk.vertex_source()[v as usize] as usize]);
            std::array::from_fn(|channel| {
                at.barycentric.iter().zip(corners).map(|(b, corner)| b * f64::from(corner[channel])).sum::<f64>() as f32
            })
        }))
    }

    /// Reads an image that the INPUT mesh already carries: `corner_uv` holds the uv of the three corners of every input
    /// face (in whatever convention `image` understands), `image` is asked with an input face and a uv, once per covered texel.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is one entry per input face; [`Error::NonFiniteValue`].
    pub fn from_image(
        map: &TexelMap,
        disk: &Disk,
        corner_uv: &[[[f32; 2]; 3]],
        image: impl Fn(u32, [f64; 2]) -> [f32; CHANNELS],
    ) -> Result<Self, Error> {
        if corner_uv.len() != disk.source_face_count() {
            return Err(Error::Length {
                what: "corner_uv",
                expected: disk.source_face_count(),
                found: corner_uv.len(),
            });
        }
        if let Some(index) = corner_uv.iter().position(|face| !face.iter().flatten().all(|x| x.is_finite())) {
            return Err(Error::NonFiniteValue { what: "corner_uv", index });
        }
        Ok(Self::from_sampler(map, |at| {
            let face = at.face as usize;
            let input = disk.face_source()[face];
            let source = corner_uv[input as usize];
            let mut uv = [0.0; 2];
            for (k, b) in at.barycentric.iter().enumerate() {
                let corner = source[disk.source_corner(face, k)];
                uv[0] += b * f64::from(corner[0]);
                uv[1] += b * f64::from(corner[1]);
            }
            image(input, uv)
        }))
    }

    /// Grows the filled texels outwards by `rings` texels, each new one the mean of its filled neighbours (of eight), so
    /// that filtering across the border of the chart reads no background.
    pub fn dilate(&mut self, rings: usize) {
        let mut border: Vec<usize> = (0..self.texels.len()).filter(|&i| !self.filled[i]).collect();
        for _ in 0..rings {
            let grown: Vec<(usize, [f32; CHANNELS])> =
                border.iter().filter_map(|&i| self.neighbour_mean(i).map(|mean| (i, mean))).collect();
            if grown.is_empty() {
                return;
            }
            for (i, mean) in grown {
                self.texels[i] = mean;
                self.filled[i] = true;
            }
            border.retain(|&i| !self.filled[i]);
        }
    }

    fn neighbour_mean(&self, i: usize) -> Option<[f32; CHANNELS]> {
        let (column, row) = (i % self.width, i / self.width);
        let mut sum = [0.0; CHANNELS];
        let mut count = 0.0;
        for y in row.saturating_sub(1)..=(row + 1).min(self.height - 1) {
            for x in column.saturating_sub(1)..=(column + 1).min(self.width - 1) {
                let j = y * self.width + x;
                if self.filled[j] {
                    sum.iter_mut().zip(self.texels[j]).for_each(|(s, value)| *s += value);
                    count += 1.0;
                }
            }
        }
        (count > 0.0).then(|| sum.map(|s| s / count))
    }
}

impl Texture<3> {
    /// The grey texture of linear RGB: Rec. 709 luminance, linear.
    pub fn luminance(&self) -> Texture<1> {
        Texture {
            width: self.width,
            height: self.height,
            texels: self.texels.iter().map(|&rgb| [luminance(rgb)]).collect(),
            filled: self.filled.clone(),
        }
    }
}

/// Rec. 709 luminance of linear RGB: `0.2126 R + 0.7152 G + 0.0722 B`. The thesis works on grey textures and does not say
/// which grey.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Linear value of an sRGB-encoded one, both in [0, 1] (IEC 61966-2-1).
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
