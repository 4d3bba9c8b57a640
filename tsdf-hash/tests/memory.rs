//! Bytes as an allocator counts them: caps that hold at the worst moment, a flight without end, and files that lie.
//!
//! `unsafe` is allowed in this file only: a global allocator cannot be written without it. It hands every call to the
//! system's allocator unchanged and counts beside it.

#![allow(unsafe_code, reason = "the counting allocator; see above")]
#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

#[allow(dead_code, reason = "the scenes of the other tests, of which these need a part")]
#[path = "it/scene.rs"]
mod scene;

#[path = "it/random.rs"]
mod random;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::{Seek, SeekFrom, Write};

use nalgebra::{Isometry3, Point3};
use random::Random;
use scene::{Shot, look_at, room};
use tsdf_hash::storage::{MapFile, MemoryLimits};
use tsdf_hash::{Error, Map, Settings};
use twox_hash::XxHash3_64;

/// Bytes that a thread holds, and the most it has held at once.
#[derive(Clone, Copy)]
struct ReloadedBlock {
    now: isize,
    peak: isize,
}

/// Size of a block as it lies in active memory.
const BLOCK: usize = 14 * 512;

thread_local! {
    static ALL: Cell<ReloadedBlock> = const { Cell::new(ReloadedBlock { now: 0, peak: 0 }) };
    static BLOCKS: Cell<ReloadedBlock> = const { Cell::new(ReloadedBlock { now: 0, peak: 0 }) };
}

fn count(size: usize, sign: isize) {
    let add = |held: &Cell<ReloadedBlock>| {
        let now = held.get().now + sign * size as isize;
        held.set(ReloadedBlock { now, peak: held.get().peak.max(now) });
    };
    // Threads that end have no counter any more.
    let _ = ALL.try_with(add);
    if size == BLOCK {
        let _ = BLOCKS.try_with(add);
    }
}

struct Counting;

// SAFETY: every call is the system allocator's, with the caller's own arguments.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(layout.size(), -1);
        unsafe { System.dealloc(pointer, layout) }
    }

    // Growth in place is counted as if old and new stood side by side.
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, 1);
        count(layout.size(), -1);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What is held now, in all and as blocks; the peaks begin anew.
fn mark() -> [isize; 2] {
    [&ALL, &BLOCKS].map(|held| {
        let now = held.get().now;
        held.set(ReloadedBlock { now, peak: now });
        now
    })
}

/// The most that was held since the peaks began, beyond `start`.
fn peaks(start: [isize; 2]) -> [usize; 2] {
    [ALL.get().peak - start[0], BLOCKS.get().peak - start[1]].map(|bytes| bytes as usize)
}

fn scratch(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("tsdf-hash-memory-{name}-{}", std::process::id()))
}

/// A turn in the room at 1 cm with 8 MiB for active memory, half of that for evicted blocks, and the disk.
fn room_in_eight_mebibytes(frames: usize, shrink: usize) {
    const CAP: usize = 8 << 20;
    const HOST: usize = 4 << 20;
    let shots = room::tour(frames, shrink, &Isometry3::identity());
    let start = mark();
    let mut free = Map::new(Settings::default()).unwrap();
    // What a call needs for itself: images in working form, lists of blocks.
    let mut work = 0;
    for shot in &shots {
        mark();
        free.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
        work = work.max(peaks(start)[0] - free.bytes());
    }
    let memory = MemoryLimits { host_bytes: HOST, disk_bytes: 256 << 20, ..MemoryLimits::default() };
    let settings = Settings { max_bytes: CAP, memory, ..Settings::default() };
    let start = mark();
    let mut map = Map::with_swap(settings, &scratch("room")).unwrap();
    for shot in &shots {
        mark();
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
        let [all, blocks] = peaks(start);
        let memory = map.memory();
        // Evicted blocks are blocks, too, until they are compressed.
        assert!(blocks <= CAP + HOST, "{blocks} bytes of blocks");
        assert!(all <= CAP + HOST + work, "{all} bytes, {work} of them in work; {memory:?}");
        assert!(memory.active_bytes <= CAP && memory.host_bytes <= HOST && memory.disk_bytes <= 256 << 20);
    }
    let [all, blocks] = peaks(start);
    println!("last frame: {all} bytes at most, {blocks} of blocks, {work} in work; {:?}", map.memory());
    assert!(free.bytes() > 10 * CAP);
    assert_eq!((map.hash(), map.blocks()), (free.hash(), free.blocks()));
    assert_eq!(map.consolidated().unwrap().hash(), free.hash());
}

#[test]
fn a_room_fits_eight_mebibytes() {
    room_in_eight_mebibytes(20, 2);
}

#[test]
#[ignore = "the same with all images, ten times the work"]
fn a_room_fits_eight_mebibytes_image_by_image() {
    room_in_eight_mebibytes(60, 1);
}

/// A corridor along x, 3 m wide and 2.5 m high, with a pillar every 10 m, seen from a flight through it.
fn corridor(x: f64) -> Shot {
    let pose = look_at(Point3::new(x, 0.3, 1.2), Point3::new(x + 4.0, -0.2, 1.0));
    Shot::take((160, 120), [110.0; 2], pose, |o, d| {
        let plane = |k: usize, c: f64| Some((c - o[k]) / d[k]).filter(|t| *t > 0.0);
        let walls = [plane(1, -1.5), plane(1, 1.5), plane(2, 0.0), plane(2, 2.5)].into_iter().flatten();
        let pillars = (0..3).filter_map(|k| {
            let at = 10.0 * ((o.x / 10.0).floor() + f64::from(k));
            plane(0, at).filter(|t| (o.y + t * d.y - 1.2).abs() < 0.3)
        });
        walls.chain(pillars).reduce(f64::min).filter(|t| *t < 8.0)
    })
}

#[test]
fn a_kilometre_of_corridor_fits_what_ten_metres_need() {
    let (active, host) = (1 << 20, 6 << 20);
    let memory = MemoryLimits { host_bytes: host, disk_bytes: 1 << 30, ..MemoryLimits::default() };
    let settings = Settings { voxel_size: 0.1, max_bytes: active, max_depth: 8.0, memory, ..Settings::default() };
    let start = mark();
    let mut map = Map::with_swap(settings, &scratch("corridor")).unwrap();
    let (mut first, mut ten, mut most, mut disk) = (None, 0, 0, Vec::new());
    for metre in 0..1000 {
        let shot = corridor(f64::from(metre));
        // One metre in half a second.
        map.integrate_at(0.5 * f64::from(metre), &shot.view(), None, &shot.world_from_camera).unwrap();
        drop(shot);
        let memory = map.memory();
        assert!(memory.active_bytes <= active && memory.host_bytes <= host, "{memory:?}");
        // From when the evicted blocks have filled their RAM.
        if memory.disk_bytes > 0 {
            let now = ALL.get().now - start[0];
            // From pillar to pillar, and all the way.
            let from = *first.get_or_insert(metre);
            most = most.max(now);
            ten = if metre < from + 10 { most } else { ten };
            disk.push(memory.disk_bytes);
        }
    }
    let from = first.unwrap();
    println!("{ten} bytes in ten metres at {from} m, never more than {most} from there on; {:?}", map.memory());
    assert!(from < 700 && 2 * disk[disk.len() - 1] > 3 * disk[disk.len() / 2]);
    // What the thread holds is flat, and below the caps and what a call keeps for the next one.
    assert!(most <= ten + (1 << 16) && most as usize <= active + host + 64 * 160 * 120);
    // Nothing is lost on the way, and nothing is left behind.
    let whole = map.consolidated().unwrap();
    assert!(whole.blocks() == map.blocks() && whole.hash() == map.hash());
    drop((map, whole, disk));
    // A line printed above may be kept by the harness.
    assert!(ALL.get().now - start[0] < 1024);
}

/// Makes all checksums of the head right again, as far as the sections it names exist.
fn seal(bytes: &mut [u8]) {
    if bytes.len() < 152 {
        return;
    }
    for k in 0..5 {
        let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        let (at, length) = (number(24 + 24 * k), number(32 + 24 * k));
        if let Some(section) = at.checked_add(length).and_then(|end| bytes.get(at..end)) {
            let sum = XxHash3_64::oneshot(section);
            bytes[40 + 24 * k..48 + 24 * k].copy_from_slice(&sum.to_le_bytes());
        }
    }
    let sum = XxHash3_64::oneshot(&bytes[..144]);
    bytes[144..152].copy_from_slice(&sum.to_le_bytes());
}

/// Uniform in `0..bound`.
fn below(random: &mut Random, bound: usize) -> usize {
    (random.uniform() * bound as f64) as usize
}

fn mutate(good: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..=below(random, 3) {
        let length = bytes.len();
        if length == 0 {
            break;
        }
        // Half of all mutations go where the lengths are.
        let at = if below(random, 2) == 0 { below(random, length.min(300)) } else { below(random, length) };
        let to = (at + 1 + below(random, 40)).min(length);
        match below(random, 7) {
            0 => bytes[at] ^= 1 << below(random, 8),
            1 => bytes[at] = below(random, 256) as u8,
            2 => bytes[at..to].fill(if below(random, 2) == 0 { 0 } else { 255 }),
            3 => bytes.truncate(at.max(1)),
            4 => drop(bytes.drain(at..to)),
            5 => drop(bytes.splice(at..at, std::iter::repeat_n(below(random, 256) as u8, to - at)).count()),
            _ => {
                let from = below(random, length - (to - at) + 1);
                bytes.copy_within(from..from + (to - at), at);
            }
        }
    }
    bytes
}

/// All that a caller can read from a file: hash and number of blocks, mesh, metadata.
type Contents = (u64, usize, Option<tsdf_hash::mesh::Mesh>, BTreeMap<String, Vec<u8>>);

fn read_all(path: &std::path::Path) -> Result<Contents, Error> {
    let file = MapFile::open(path)?;
    let (mesh, metadata) = (file.mesh()?, file.metadata()?);
    let settings = Settings { max_bytes: 1 << 24, threads: 1, memory: MemoryLimits::default(), ..*file.settings() };
    let map = file.into_map(settings, None)?;
    Ok((map.hash(), map.blocks(), mesh, metadata))
}

fn fuzz(mutations: usize) {
    let shot = Shot::take((24, 18), [20.0; 2], look_at(Point3::origin(), Point3::new(1.0, 0.2, 0.1)), |o, d| {
        Some((1.0 - o.x) / d.x)
    });
    let mut map = Map::new(Settings { voxel_size: 0.05, ..Settings::default() }).unwrap();
    for k in 0..3 {
        let pose = Isometry3::translation(0.0, 0.05 * f64::from(k), 0.0) * shot.world_from_camera;
        map.integrate(&shot.view(), None, &pose).unwrap();
    }
    let path = scratch(&format!("fuzz-{mutations}"));
    let metadata = [("camera".to_string(), vec![3; 20]), ("place".to_string(), b"wall".to_vec())].into();
    map.save(&path, Some(&map.mesh()), &metadata).unwrap();
    let (good, expected) = (std::fs::read(&path).unwrap(), read_all(&path).unwrap());
    let mut random = Random::new(1);
    let mut file = std::fs::File::options().write(true).open(&path).unwrap();
    let (mut accepted, mut sealed_accepted, mut most) = (0, 0, 0);
    for _ in 0..mutations {
        let mut bytes = mutate(&good, &mut random);
        let sealed = below(&mut random, 3) == 0;
        if sealed {
            seal(&mut bytes);
        }
        // Written over, not anew: that is what disks are slow at.
        file.set_len(bytes.len().max(1) as u64).unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        file.write_all(&bytes).unwrap();
        let start = mark();
        let read = read_all(&path);
        most = most.max(peaks(start)[0]);
        match read {
            // With checksums made to fit, this is another map, mesh or text, honestly stored.
            Ok(_) if sealed => sealed_accepted += 1,
            Ok(found) => {
                accepted += 1;
                assert!(found == expected, "a file that differs was accepted");
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    std::fs::remove_file(&path).unwrap();
    println!(
        "{mutations} mutations of {} bytes: {accepted} the same, {sealed_accepted} sealed, {most} bytes",
        good.len()
    );
    assert!(accepted < mutations / 50 && sealed_accepted > mutations / 1000);
    // The file, its index and its blocks, unpacked: nothing that a length field asks for beyond.
    assert!(most < 4 * BLOCK * map.blocks() + 8 * good.len(), "{most}");
}

#[test]
fn no_mutation_of_a_file_passes() {
    fuzz(20_000);
}

/// `cargo test --release -p tsdf-hash --test memory -- --ignored --nocapture no_mutation`
#[test]
#[ignore = "a minute"]
fn no_mutation_of_a_file_passes_among_many() {
    fuzz(300_000);
}
