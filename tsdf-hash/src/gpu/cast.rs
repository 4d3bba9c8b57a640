//! What the map looks like from a pose, seen on the device.
//!
//! The processor picks the blocks in view and sorts them into squares of pixels, as for a cast of its own; the device
//! looks which of them the surface crosses, unpacks those and casts the rays.

use wgpu::{Buffer, BufferUsages};

use crate::blocks::block_key::BlockKey;
use crate::error::Error;
use crate::gpu::device::{Device, Program};
use crate::gpu::pool::{MAX_PAGES, OTHER_BINDINGS, Pool};
use crate::gpu::scratch::{Scratch, spread};
use crate::ray_cast::camera::Camera;
use crate::ray_cast::march::{GRAZING_TOLERANCE, MIN_SLOPE, MIN_STEP};
use crate::ray_cast::tiles::Tiles;
use crate::ray_cast::unpacked::{ALL, CellRange, VisibleBlock, in_view};
use crate::ray_cast::view::View;

const EXACT: &str = include_str!("exact.wgsl");
const FIELDS: &str = include_str!("fields.wgsl");
const CAST: &str = include_str!("cast.wgsl");
/// Bytes of the programs' uniforms, and where each window starts.
const REQUEST_BYTES: usize = 16;
const VIEW_BYTES: usize = 80;
const WINDOW: usize = 256;
/// Words of a pixel.
const PIXEL_WORDS: usize = 6;
/// Bytes of a block with its border, unpacked.
const FIELD_BYTES: usize = 12 * ALL;
const ABSENT: u32 = u32::MAX;

/// The programs and their buffers.
pub(super) struct Caster {
    range: Program,
    unpack: Program,
    cast: Program,
    uniform: Buffer,
    blocks: Scratch,
    ranges: Scratch,
    fields: Scratch,
    scene: Scratch,
    pixels: Scratch,
    staging: Scratch,
    tiles: Tiles,
}

impl Caster {
    pub(super) fn new(device: &Device) -> Result<Self, Error> {
        let pages = MAX_PAGES.min(device.bindings - OTHER_BINDINGS);
        let fields = [EXACT, FIELDS, &page_word(pages)].concat();
        let mut writable = vec![false; OTHER_BINDINGS + pages];
        writable[1] = true;
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let read = storage | BufferUsages::COPY_SRC;
        Ok(Self {
            range: device.program("range", &fields, &writable)?,
            unpack: device.program("unpack", &fields, &writable)?,
            cast: device.program("ray_cast", &[EXACT, CAST].concat(), &[false, false, true])?,
            uniform: device.buffer("view", 3 * WINDOW, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?,
            blocks: Scratch::new("blocks in view", storage),
            ranges: Scratch::new("ranges of cells", read),
            fields: Scratch::new("unpacked blocks", storage),
            scene: Scratch::new("scene", storage),
            pixels: Scratch::new("view", read),
            staging: Scratch::new("view on its way", BufferUsages::MAP_READ | BufferUsages::COPY_DST),
            tiles: Tiles::default(),
        })
    }

    /// Fills a view of the right size.
    pub(super) fn fill(
        &mut self,
        device: &Device,
        pool: &Pool,
        camera: &Camera,
        colour: bool,
        view: &mut View,
    ) -> Result<(), Error> {
        let seen = in_view(pool.keys(), camera);
        let ranges = self.ranges(device, pool, &seen)?;
        let crossed: Vec<(BlockKey, CellRange)> =
            seen.into_iter().zip(ranges).filter_map(|(key, range)| Some((key, range?))).collect();
        let places: Vec<VisibleBlock> =
            crossed.iter().enumerate().map(|(k, &(key, range))| VisibleBlock::new(k, key, range, camera)).collect();
        self.tiles.fill(&places, camera);
        let mut commands = device.commands();
        let fields = self.fields.of(device, FIELD_BYTES * crossed.len())?.clone();
        let keys: Vec<BlockKey> = crossed.iter().map(|(key, _)| *key).collect();
        self.record_blocks(device, pool, &keys, Pass { fields: &fields, unpack: true, colour }, &mut commands)?;
        self.cast(device, camera, &places, colour, &fields, &mut commands)?;
        let bytes = 4 * PIXEL_WORDS * view.depth.len();
        let staging = self.staging.of(device, bytes)?;
        commands.copy_buffer_to_buffer(self.pixels.of(device, bytes)?, 0, staging, 0, bytes as u64);
        device.run_and_read(commands, staging, bytes, |words| read_pixels(words, view))
    }

    /// For each block, the range of its cells that the surface crosses.
    fn ranges(&mut self, device: &Device, pool: &Pool, keys: &[BlockKey]) -> Result<Vec<Option<CellRange>>, Error> {
        let bytes = 4 * keys.len();
        let ranges = self.ranges.of(device, bytes)?.clone();
        let mut commands = device.commands();
        self.record_blocks(device, pool, keys, Pass { fields: &ranges, unpack: false, colour: false }, &mut commands)?;
        let staging = self.staging.of(device, bytes)?;
        commands.copy_buffer_to_buffer(&ranges, 0, staging, 0, bytes as u64);
        device.run_and_read(commands, staging, bytes, |words| {
            let range = |word: u32| {
                let corner = |from: u32| [0, 4, 8].map(|shift| (word >> (from + shift) & 15) as u8);
                (word > 0).then(|| [corner(0), corner(12)])
            };
            words.iter().map(|&word| range(u32::from_ne_bytes(word))).collect()
        })
    }

    /// Records a pass over blocks and their upper neighbours.
    fn record_blocks(
        &mut self,
        device: &Device,
        pool: &Pool,
        keys: &[BlockKey],
        pass: Pass,
        commands: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        if keys.is_empty() {
            return Ok(());
        }
        let blocks = self.blocks.of(device, 32 * keys.len())?;
        let place = |key: BlockKey, n: i32| {
            let place = key.neighbour([n & 1, n >> 1 & 1, n >> 2]).and_then(|key| pool.get(key));
            place.map_or(ABSENT, |place| (place.page as u32) << 24 | place.slot)
        };
        let groups = keys.iter().flat_map(|&key| [[0, 1, 2, 3], [4, 5, 6, 7]].map(|half| half.map(|n| place(key, n))));
        let groups: Vec<[u32; 4]> = groups.collect();
        device.write_groups(blocks, 0, groups.into_iter())?;
        let window = usize::from(pass.unpack) * WINDOW;
        device.write(&self.uniform, window, [keys.len() as u32, u32::from(pass.colour), 0, 0].into_iter())?;
        let program = if pass.unpack { &self.unpack } else { &self.range };
        // Pages that do not exist yet are never read: the first one stands in for them.
        let pages = MAX_PAGES.min(device.bindings - OTHER_BINDINGS);
        let pages = (0..pages).map(|page| pool.pages.get(page).unwrap_or(&pool.pages[0]));
        let storage: Vec<&Buffer> = [blocks, pass.fields].into_iter().chain(pages).collect();
        let group = device.bind(program, REQUEST_BYTES, &self.uniform, &storage);
        program.dispatch(commands, &group, window, spread(keys.len()));
        Ok(())
    }

    /// Records the cast itself.
    fn cast(
        &mut self,
        device: &Device,
        camera: &Camera,
        places: &[VisibleBlock],
        colour: bool,
        fields: &Buffer,
        commands: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        let (width, height) = (camera.width, camera.height);
        let mut scene: Vec<u32> = Vec::new();
        let mut step = [0.0; 3];
        for row in 0..height {
            let (start, along) = camera.row(row);
            scene.extend(start.map(f32::to_bits));
            step = along;
        }
        let at_places = scene.len();
        for place in places {
            scene.extend(place.origin.map(f32::to_bits));
            scene.push(place.block as u32);
            scene.extend(place.low.map(f32::to_bits));
            scene.extend(place.high.map(f32::to_bits));
        }
        let at_starts = scene.len();
        scene.extend(&self.tiles.starts);
        let at_lists = scene.len();
        scene.extend(&self.tiles.lists);
        let [x, y, z] = step.map(f32::to_bits);
        let [near, far, truncation] = [camera.min_depth, camera.max_depth, camera.truncation].map(f32::to_bits);
        let [slope, graze, least] = [MIN_SLOPE, GRAZING_TOLERANCE, MIN_STEP].map(f32::to_bits);
        let [at_places, at_starts, at_lists] = [at_places, at_starts, at_lists].map(|at| at as u32);
        let sizes = [width as u32, height as u32, self.tiles.columns as u32, u32::from(colour)];
        let rest = [x, y, z, near, far, truncation, slope, graze, least, at_places, at_starts, at_lists, 0];
        device.write(&self.uniform, 2 * WINDOW, sizes.into_iter().chain(rest).collect::<Vec<_>>().into_iter())?;
        let buffer = self.scene.of(device, 4 * scene.len())?;
        device.write(buffer, 0, scene.into_iter())?;
        let pixels = self.pixels.of(device, 4 * PIXEL_WORDS * width * height)?;
        let group = device.bind(&self.cast, VIEW_BYTES, &self.uniform, &[buffer, fields, pixels]);
        let groups = [width.div_ceil(8) as u32, height.div_ceil(8) as u32];
        self.cast.dispatch(commands, &group, 2 * WINDOW, groups);
        Ok(())
    }
}

/// What to do with blocks.
#[derive(Clone, Copy)]
struct Pass<'a> {
    /// What is written.
    fields: &'a Buffer,
    /// Whether to unpack them, or else to find where the surface crosses them.
    unpack: bool,
    colour: bool,
}

/// The function of the programs that reads a page.
fn page_word(pages: usize) -> String {
    let binding = |page| format!("@group(0) @binding({}) var<storage, read> page_{page}: array<u32>;\n", page + 3);
    let case = |page| format!("case {page}u: {{ return page_{page}[at]; }}\n");
    let bindings: String = (0..pages).map(binding).collect();
    let cases: String = (0..pages).map(case).collect();
    bindings + "fn page_word(page: u32, at: u32) -> u32 {\nswitch page {\n" + &cases + "default: { return 0u; }\n}\n}\n"
}

fn read_pixels(words: &[[u8; 4]], view: &mut View) {
    for (k, pixel) in words.as_chunks::<PIXEL_WORDS>().0.iter().enumerate() {
        let [depth, x, y, z, colour, weight] = pixel.map(u32::from_ne_bytes);
        view.depth[k] = f32::from_bits(depth);
        view.normals[k] = [x, y, z].map(f32::from_bits);
        view.colours[k] = [colour as u8, (colour >> 8) as u8, (colour >> 16) as u8];
        view.weights[k] = weight as u16;
    }
}
