//! The colours of a frame, and their sums.

use crate::blocks::voxel_block::MAX_COLOURS;
use crate::images::{ColourData, ColourView, Intrinsics};
use crate::integration::plane_image::PlaneImage;
use crate::integration::voxel_lanes::ProjectedVoxels;
use crate::rounding::{ROUNDER, rounded};

/// The colour image, seen from the depth image.
pub(crate) struct ColourSource<'a> {
    pub(crate) data: ColourData<'a>,
    pub(crate) width: usize,
    /// Whether its pixels are those of the depth image.
    pub(crate) is_aligned: bool,
    /// Colour column = `scale u + shift`, likewise the row.
    pub(crate) scale: [f32; 2],
    pub(crate) shift: [f32; 2],
    /// The last column and the last row.
    pub(crate) last: [f32; 2],
}

impl<'a> ColourSource<'a> {
    pub(crate) fn new(view: &'a ColourView<'a>, depth: &Intrinsics, surface: &PlaneImage) -> Self {
        let c = &view.intrinsics;
        let scale = [c.fx / depth.fx, c.fy / depth.fy];
        let shift = [c.cx - scale[0] * depth.cx, c.cy - scale[1] * depth.cy];
        let last = [view.width, view.height].map(|side| (side - 1) as f32);
        let is_aligned = (view.width, view.height) == (surface.width, surface.height) && c == depth;
        Self {
            data: view.data,
            width: view.width,
            is_aligned,
            scale: scale.map(|s| s as f32),
            shift: shift.map(|s| s as f32),
            last,
        }
    }

    /// Six-bit colour of the pixel nearest to the projection; `None` outside the colour image.
    #[inline(always)]
    pub(crate) fn at(&self, lanes: &ProjectedVoxels, x: usize) -> Option<[u16; 3]> {
        let pixel = if self.is_aligned {
            lanes.index[x] as usize
        } else {
            let i = (lanes.u[x] * self.scale[0] + self.shift[0] + ROUNDER) - ROUNDER;
            let j = (lanes.v[x] * self.scale[1] + self.shift[1] + ROUNDER) - ROUNDER;
            if !(i >= 0.0 && i <= self.last[0] && j >= 0.0 && j <= self.last[1]) {
                return None;
            }
            rounded(j) as usize * self.width + rounded(i) as usize
        };
        let start = 3 * pixel;
        match self.data {
            ColourData::Rgb8(data) => {
                let rgb = data.get(start..start + 3)?;
                Some([six_bits(rgb[0]), six_bits(rgb[1]), six_bits(rgb[2])])
            }
            ColourData::Rgb16(data) => {
                let rgb = data.get(start..start + 3)?;
                Some([rgb[0], rgb[1], rgb[2]].map(|c| ((u32::from(c) * 63 + 32767) / 65535) as u16))
            }
        }
    }
}

/// Adds a colour to sums or takes it out; returns whether a counter ran over or under.
#[inline(always)]
pub(crate) fn accumulate_colour<const INTEGRATE: bool>(sums: &mut [u16; 4], rgb: [u16; 3]) -> bool {
    for (sum, c) in sums.iter_mut().zip([rgb[0], rgb[1], rgb[2], 1]) {
        *sum = if INTEGRATE { sum.wrapping_add(c) } else { sum.wrapping_sub(c) };
    }
    let [r, g, b, n] = *sums;
    // A sum that ran under is at least 65536 - 63, more than 63 n for any other n than the one just refused.
    let most = n.wrapping_mul(63);
    n > MAX_COLOURS || (!INTEGRATE && (r > most || g > most || b > most))
}

/// `round(63 c / 255)`.
#[inline(always)]
fn six_bits(c: u8) -> u16 {
    ((u32::from(c) * 253 + 505) >> 10) as u16
}
