//! A frame applied to blocks on the device: what is uploaded, run and read back.

use wgpu::{Buffer, BufferUsages};

use crate::blocks::block_key::BlockKey;
use crate::error::Error;
use crate::gpu::device::{Device, Program};
use crate::gpu::pool::Pool;
use crate::gpu::scratch::{Scratch, spread};
use crate::images::ColourData;
use crate::integration::integrator::Frame;
use crate::integration::plane::Plane;

const SOURCE: &str = concat!(include_str!("exact.wgsl"), include_str!("fuse.wgsl"));
/// Bytes of the program's `Frame`, and of the windows at which it is seen.
const FRAME_BYTES: usize = 160;
const WINDOW: usize = 256;
/// A plane and a rim.
const PIXEL_BYTES: usize = 20;
/// Passes that one submission can hold: one that counts and one for each page.
const MOST_PASSES: usize = 5;
/// Marks a slot that holds something else yet.
const FRESH: u32 = 1 << 31;

/// What a pass does; the values are the program's.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Counts the voxels that a frame would touch in blocks that do not exist.
    Count = 0,
    Integrate = 1,
    Deintegrate = 2,
}

/// What a frame did to a block.
#[derive(Clone, Copy, Default)]
pub(super) struct UpdateCount(u32);

impl UpdateCount {
    /// Voxels touched.
    pub(super) fn voxels(self) -> usize {
        (self.0 & 0xffff) as usize
    }

    /// A counter ran over or under; the opposite update restores the block exactly.
    pub(super) fn overflow(self) -> bool {
        self.0 & 1 << 16 != 0
    }

    /// Some voxel has a weight.
    pub(super) fn observed(self) -> bool {
        self.0 & 1 << 17 != 0
    }
}

/// The program and its buffers, which grow with the images and the number of blocks.
pub(super) struct Fuser {
    program: Program,
    uniform: Buffer,
    pixels: Scratch,
    blocks: Scratch,
    counts: Scratch,
    staging: Scratch,
}

/// Blocks of one page, or of none.
pub(super) struct Pass<'a> {
    pub(super) mode: Mode,
    pub(super) page: usize,
    /// Blocks of this pass, with their slots in the page.
    pub(super) blocks: &'a [(BlockKey, u32)],
}

impl Fuser {
    pub(super) fn new(device: &Device) -> Result<Self, Error> {
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        Ok(Self {
            program: device.program("fuse", SOURCE, &[false, false, true, true])?,
            uniform: device.buffer("frame", MOST_PASSES * WINDOW, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?,
            pixels: Scratch::new("pixels", storage),
            blocks: Scratch::new("block list", storage),
            counts: Scratch::new("counts", storage | BufferUsages::COPY_SRC),
            staging: Scratch::new("counts on their way", BufferUsages::MAP_READ | BufferUsages::COPY_DST),
        })
    }

    /// Uploads what a frame is made of, for all passes until the next frame.
    pub(super) fn load(&mut self, device: &Device, frame: &Frame) -> Result<(), Error> {
        let planes = &frame.plane_image.planes;
        let colours = frame.colour.as_ref().map_or(ColourData::Rgb8(&[]), |colour| colour.data);
        let words = match colours {
            ColourData::Rgb8(data) => data.len().div_ceil(4),
            ColourData::Rgb16(data) => data.len().div_ceil(2),
        };
        let pixels = self.pixels.of(device, PIXEL_BYTES * planes.len() + 4 * words)?;
        // A pixel that is not fused may hold NaN, which a program may take for anything.
        let fused = |plane: &Plane| if plane.scaled_omega > 0.0 { *plane } else { Plane::NONE };
        let plane_words = |plane: &Plane| {
            let Plane { offset, scaled_omega, scaled_slope } = fused(plane);
            [offset, scaled_omega, scaled_slope[0], scaled_slope[1]].map(f32::to_bits)
        };
        device.write_groups(pixels, 0, planes.iter().map(plane_words))?;
        device.write(pixels, 16 * planes.len(), frame.plane_image.rims.rims.iter().map(|rim| rim.0))?;
        let start = PIXEL_BYTES * planes.len();
        match colours {
            ColourData::Rgb8(data) => {
                let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
                device.write(pixels, start, data.chunks(4).map(word))
            }
            ColourData::Rgb16(data) => {
                let word = |pair: &[u16]| pair.iter().rev().fold(0, |word, &value| word << 16 | u32::from(value));
                device.write(pixels, start, data.chunks(2).map(word))
            }
        }
    }

    /// Runs the passes in one submission and returns the counts of their blocks, pass by pass.
    pub(super) fn run(
        &mut self,
        device: &Device,
        pool: &Pool,
        frame: &Frame,
        passes: &[Pass],
    ) -> Result<Vec<UpdateCount>, Error> {
        let mut commands = self.record(device, pool, frame, passes)?;
        let bytes = 4 * total(passes);
        let staging = self.staging.of(device, bytes)?;
        commands.copy_buffer_to_buffer(self.counts.of(device, bytes)?, 0, staging, 0, bytes as u64);
        device.run_and_read(commands, staging, bytes, |words| {
            words.iter().map(|&word| UpdateCount(u32::from_ne_bytes(word))).collect()
        })
    }

    /// Hands the passes over without waiting for them.
    pub(super) fn submit(&mut self, device: &Device, pool: &Pool, frame: &Frame, passes: &[Pass]) -> Result<(), Error> {
        if total(passes) == 0 {
            return Ok(());
        }
        let commands = self.record(device, pool, frame, passes)?;
        device.queue.submit([commands.finish()]);
        device.check()
    }

    fn record(
        &mut self,
        device: &Device,
        pool: &Pool,
        frame: &Frame,
        passes: &[Pass],
    ) -> Result<wgpu::CommandEncoder, Error> {
        let total = total(passes);
        let blocks = self.blocks.of(device, 16 * total)?;
        let counts = self.counts.of(device, 4 * total)?;
        let pixels = self.pixels.of(device, 0)?;
        let mut commands = device.commands();
        let mut first = 0;
        for (k, pass) in passes.iter().enumerate() {
            if pass.blocks.is_empty() {
                continue;
            }
            device.write_groups(
                blocks,
                16 * first,
                pass.blocks.iter().map(|&(key, slot)| {
                    let start = frame.start(key);
                    [start.x.to_bits(), start.y.to_bits(), start.z.to_bits(), slot]
                }),
            )?;
            let words = uniform(frame, pass.mode, first, pass.blocks.len());
            device.write(&self.uniform, k * WINDOW, words.into_iter())?;
            let storage = [blocks, pixels, counts, &pool.pages[pass.page]];
            let group = device.bind(&self.program, FRAME_BYTES, &self.uniform, &storage);
            self.program.dispatch(&mut commands, &group, k * WINDOW, spread(pass.blocks.len()));
            first += pass.blocks.len();
        }
        Ok(commands)
    }
}

fn total(passes: &[Pass]) -> usize {
    passes.iter().map(|pass| pass.blocks.len()).sum()
}

/// The slot of a block that is new there.
pub(super) fn fresh(slot: u32) -> u32 {
    slot | FRESH
}

/// The program's `Frame`.
fn uniform(frame: &Frame, mode: Mode, first: usize, count: usize) -> [u32; FRAME_BYTES / 4] {
    let mut words = [0; FRAME_BYTES / 4];
    let step = frame.step();
    for axis in 0..3 {
        for k in 0..3 {
            words[4 * axis + k] = step[(k, axis)].to_bits();
        }
    }
    let plane_image = frame.plane_image;
    words[12..14].copy_from_slice(&[plane_image.width as u32, plane_image.height as u32]);
    if let Some(colour) = &frame.colour {
        words[14..16].copy_from_slice(&colour.last.map(f32::to_bits));
        words[16..18].copy_from_slice(&colour.scale.map(f32::to_bits));
        words[18..20].copy_from_slice(&colour.shift.map(f32::to_bits));
        words[22] = (PIXEL_BYTES / 4 * plane_image.planes.len()) as u32;
        words[23] = if matches!(colour.data, ColourData::Rgb8(_)) { 1 } else { 2 };
        words[28..30].copy_from_slice(&[colour.width as u32, u32::from(colour.is_aligned)]);
    }
    words[20..22].copy_from_slice(&[frame.reach[0], frame.colour_reach].map(f32::to_bits));
    words[30] = frame.reach[1].to_bits();
    words[31] = 4 * plane_image.planes.len() as u32;
    let [behind, before] = frame.rim_reach;
    let lengths = [behind, before, frame.half_voxel, frame.pixel, frame.per_metre];
    words[32..37].copy_from_slice(&lengths.map(f32::to_bits));
    words[24..27].copy_from_slice(&[mode as u32, first as u32, count as u32]);
    words
}
