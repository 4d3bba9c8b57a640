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

    /// Six-bit R, G, B of the pixel nearest to the projection and a one, sixteen bits each; `None` outside the colour image.
    #[inline(always)]
    pub(crate) fn at(&self, lanes: &ProjectedVoxels, x: usize) -> Option<u64> {
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
                // `round(63 c / 255)` of all three at once: `253 c + 505` has sixteen bits.
                let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(u64::from);
                Some(((r | g << 16 | b << 32) * 253 + 0x01f9_01f9_01f9) >> 10 & 0x003f_003f_003f | 1 << 48)
            }
            ColourData::Rgb16(data) => {
                let rgb = data.get(start..start + 3)?;
                let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(|c| (u64::from(c) * 63 + 32767) / 65535);
                Some(r | g << 16 | b << 32 | 1 << 48)
            }
        }
    }
}

/// Adds a colour to sums or takes it out; returns whether a counter ran over or under. What a sum then carries into the next,
/// the opposite update takes back.
#[inline(always)]
pub(crate) fn accumulate_colour<const INTEGRATE: bool>(sums: &mut [u16; 4], seen: u64) -> bool {
    let [r, g, b, n] = sums.map(u64::from);
    let all = r | g << 16 | b << 32 | n << 48;
    let all = if INTEGRATE { all.wrapping_add(seen) } else { all.wrapping_sub(seen) };
    *sums = [all, all >> 16, all >> 32, all >> 48].map(|sum| sum as u16);
    let [r, g, b, n] = *sums;
    // A sum that ran under is at least 65536 - 63, more than 63 n for any other n than the one just refused.
    let most = n.wrapping_mul(63);
    n > MAX_COLOURS || (!INTEGRATE && (r > most || g > most || b > most))
}
