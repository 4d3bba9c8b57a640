//! The update of one block by one frame.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::Settings;
use crate::block::{Block, MAX_COLOURS, ONE, SIDE};
use crate::key::Key;
use crate::surface::Surface;
use crate::view::{ColourView, Intrinsics};

/// Colours are taken this close to the surface, in voxels (ours).
const COLOUR_REACH: f32 = 1.5;
/// `1.5 2^23`: adding it rounds a float to an integer, to even at a tie, and leaves the integer in the low bits.
pub(crate) const ROUNDER: f32 = 12_582_912.0;

/// Whether a frame is put in or taken out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    Plus,
    Minus,
}

impl Sign {
    pub(crate) fn opposite(self) -> Self {
        if self == Self::Plus { Self::Minus } else { Self::Plus }
    }
}

/// What an update did.
#[derive(Clone, Copy, Default)]
pub(crate) struct Tally {
    /// Voxels touched.
    pub(crate) voxels: usize,
    /// A counter ran over (plus) or under (minus). The sums wrap, so the opposite update restores the block exactly.
    pub(crate) fault: bool,
}

/// A frame, ready to be applied to any block.
pub(crate) struct Frame<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) colour: Option<ColourSource<'a>>,
    /// `(u z, v z, z)` from a point in the world.
    projection: Matrix3<f64>,
    offset: Vector3<f64>,
    voxel_size: f64,
    pub(crate) truncation: f32,
    /// Steps of the stored distance per metre.
    pub(crate) per_metre: f32,
    pub(crate) colour_reach: f32,
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        surface: &'a Surface,
        intrinsics: &Intrinsics,
        colour: Option<&'a ColourView<'a>>,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Self {
        let k = intrinsics;
        let pixels_from_camera = Matrix3::new(k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0);
        let camera_from_world = world_from_camera.inverse();
        Self {
            surface,
            colour: colour.map(|view| ColourSource::new(view, k)),
            projection: pixels_from_camera * camera_from_world.rotation.to_rotation_matrix().into_inner(),
            offset: pixels_from_camera * camera_from_world.translation.vector,
            voxel_size: settings.voxel_size,
            truncation: settings.truncation() as f32,
            per_metre: (f64::from(ONE) / settings.truncation()) as f32,
            colour_reach: COLOUR_REACH * settings.voxel_size as f32,
        }
    }

    /// Adds the frame to a block, or takes it out. What is touched, and by how much, depends on the frame only.
    pub(crate) fn apply(&self, sign: Sign, key: Key, block: &mut Block) -> Tally {
        match sign {
            Sign::Plus => self.update::<true>(key, block),
            Sign::Minus => self.update::<false>(key, block),
        }
    }

    /// `(u z, v z, z)` of the first voxel of a block.
    pub(crate) fn start(&self, key: Key) -> Vector3<f32> {
        let centre = |c: i32| (f64::from(c) * SIDE as f64 + 0.5) * self.voxel_size;
        let [x, y, z] = key.block().map(centre);
        (self.projection * Vector3::new(x, y, z) + self.offset).cast()
    }

    /// Its change from a voxel to the next, a column for each axis.
    pub(crate) fn step(&self) -> Matrix3<f32> {
        (self.projection * self.voxel_size).cast()
    }

    fn update<const PLUS: bool>(&self, key: Key, block: &mut Block) -> Tally {
        let (start, step) = (self.start(key), self.step());
        let [sx, sy, sz] = [0, 1, 2].map(|axis| step.column(axis).into_owned());
        let mut tally = Tally::default();
        for z in 0..SIDE {
            for y in 0..SIDE {
                let row = start + sy * y as f32 + sz * z as f32;
                let pixels = self.project(&row, &sx);
                for x in 0..SIDE {
                    let pixel = pixels.index[x] as usize;
                    let omega = self.surface.inverse_depth[pixel];
                    // |D - z| <= μ with D = 1/ω; an ω of 0 fails.
                    let depth = pixels.depth[x];
                    if (1.0 - depth * omega).abs() <= self.truncation * omega {
                        let voxel = x + SIDE * (y + SIDE * z);
                        let plane = &self.surface.planes[pixel];
                        // The plane's inverse depth at the voxel's own pixel coordinates: free of the rounding.
                        let at_voxel = omega + plane.slope[0] * pixels.du[x] + plane.slope[1] * pixels.dv[x];
                        let distance = plane.offset * (1.0 - depth * at_voxel);
                        tally.fault |= self.observe::<PLUS>(block, voxel, distance, plane.weight);
                        if distance.abs() < self.colour_reach
                            && let Some(rgb) = self.colour.as_ref().and_then(|c| c.at(pixels.u[x], pixels.v[x]))
                        {
                            tally.fault |= observe_colour::<PLUS>(&mut block.colour[voxel], rgb);
                        }
                        tally.voxels += 1;
                    }
                }
            }
        }
        tally
    }

    /// Projects a row of voxels; those outside the image get the extra entry, which is never fused.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches the row is projected in vector registers")]
    fn project(&self, row: &Vector3<f32>, step: &Vector3<f32>) -> Pixels {
        let outside = self.surface.planes.len() as u32;
        let (right, bottom) = ((self.surface.width - 1) as f32, (self.surface.height - 1) as f32);
        let width = self.surface.width as i32;
        let mut out = Pixels { index: [0; SIDE], depth: LANES, u: LANES, v: LANES, du: LANES, dv: LANES };
        for x in 0..SIDE {
            let along = x as f32;
            let z = row.z + step.z * along;
            let inverse = 1.0 / z;
            let u = (row.x + step.x * along) * inverse;
            let v = (row.y + step.y * along) * inverse;
            out.depth[x] = z;
            out.u[x] = (u + ROUNDER) - ROUNDER;
            out.v[x] = (v + ROUNDER) - ROUNDER;
            out.du[x] = u - out.u[x];
            out.dv[x] = v - out.v[x];
            let inside = (z > 0.0) & (out.u[x] >= 0.0) & (out.u[x] <= right) & (out.v[x] >= 0.0) & (out.v[x] <= bottom);
            let index = rounded(v).wrapping_mul(width).wrapping_add(rounded(u)).cast_unsigned();
            out.index[x] = if inside { index } else { outside };
        }
        out
    }

    /// Adds a distance, metres, to a voxel or takes it out; returns whether a counter ran over or under.
    #[inline(always)]
    fn observe<const PLUS: bool>(&self, block: &mut Block, voxel: usize, distance: f32, weight: f32) -> bool {
        let q = (distance * self.per_metre).clamp(-ONE as f32, ONE as f32);
        let (q, weight) = (rounded(q), weight as u16);
        let (sum, total) = (&mut block.distance[voxel], &mut block.weight[voxel]);
        if PLUS {
            *sum = sum.wrapping_add(q * i32::from(weight));
            let (next, over) = total.overflowing_add(weight);
            *total = next;
            over
        } else {
            *sum = sum.wrapping_sub(q * i32::from(weight));
            let (next, under) = total.overflowing_sub(weight);
            *total = next;
            // No sum of observations can leave this range: what was taken out was not in.
            under || i64::from(*sum).abs() > i64::from(next) * i64::from(ONE)
        }
    }
}

/// The nearest integer, to even at a tie, of a float below `2^22` in magnitude.
#[inline(always)]
fn rounded(x: f32) -> i32 {
    (x + ROUNDER).to_bits().wrapping_sub(ROUNDER.to_bits()).cast_signed()
}

#[inline(always)]
fn observe_colour<const PLUS: bool>(sums: &mut [u16; 4], rgb: [u16; 3]) -> bool {
    let mut fault = false;
    for (sum, c) in sums.iter_mut().zip([rgb[0], rgb[1], rgb[2], 1]) {
        let (next, wrapped) = if PLUS { sum.overflowing_add(c) } else { sum.overflowing_sub(c) };
        *sum = next;
        fault |= wrapped;
    }
    fault || sums[3] > MAX_COLOURS
}

const LANES: [f32; SIDE] = [0.0; SIDE];

/// A row of projected voxels.
struct Pixels {
    index: [u32; SIDE],
    depth: [f32; SIDE],
    /// The pixel.
    u: [f32; SIDE],
    v: [f32; SIDE],
    /// From the pixel's centre to the voxel's projection.
    du: [f32; SIDE],
    dv: [f32; SIDE],
}

/// The colour image, seen through the pixels of the depth image.
pub(crate) struct ColourSource<'a> {
    pub(crate) view: &'a ColourView<'a>,
    /// Colour column = `scale u + shift`, likewise the row.
    pub(crate) scale: [f32; 2],
    pub(crate) shift: [f32; 2],
}

impl<'a> ColourSource<'a> {
    fn new(view: &'a ColourView<'a>, depth: &Intrinsics) -> Self {
        let c = &view.intrinsics;
        let scale = [c.fx / depth.fx, c.fy / depth.fy];
        let shift = [c.cx - scale[0] * depth.cx, c.cy - scale[1] * depth.cy];
        Self { view, scale: scale.map(|s| s as f32), shift: shift.map(|s| s as f32) }
    }

    /// Six-bit colour of a depth pixel; `None` outside the colour image.
    #[inline(always)]
    fn at(&self, u: f32, v: f32) -> Option<[u16; 3]> {
        let [cu, cv] = [u * self.scale[0] + self.shift[0] + 0.5, v * self.scale[1] + self.shift[1] + 0.5];
        let inside = cu >= 0.0 && cv >= 0.0 && cu < self.view.width as f32 && cv < self.view.height as f32;
        let start = 3 * (cv as usize * self.view.width + cu as usize);
        let rgb = self.view.rgb8.get(start..start + 3).filter(|_| inside)?;
        Some([rgb[0], rgb[1], rgb[2]].map(|c| (u16::from(c) * 63 + 127) / 255))
    }
}
