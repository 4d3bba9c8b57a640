//! Files of others, spoilt: recordings, meshes and pictures with bytes changed, cut out, cut off and put in are read or refused, and
//! nothing else. No panic, no hang, and no more memory than the file is worth.

// A global allocator can only be written with unsafe code; this one counts and passes on.
#![allow(unsafe_code, reason = "counting allocations needs a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::time::{Duration, Instant};

use paintcopter::mesh_io::read_mesh;
use paintcopter::mission_file::MissionFile;
use paintcopter::vio::{Overrides, camera_frames, open_euroc, open_mcap, simulate};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use serde_json::Value;
use vio_ekf::Camera;

use crate::bags::{recompress, write_kalibr_files, write_ros2_bag};
use crate::gltf_meshes::{square_glb, square_gltf};
use crate::scratch::Scratch;
use crate::vio::fixtures::flight;

struct Counting;

thread_local! {
    /// Bytes that this thread holds, and the most that it has held since the peak was reset.
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    PEAK.set(PEAK.get().max(HELD.get()));
}

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What a reader may hold at once: ten times the file, and what decoders and writers of samples claim whatever they read.
fn allowed(file: usize) -> isize {
    10 * file as isize + (16 << 20)
}

/// What is done to a file.
#[derive(Clone, Copy, PartialEq)]
enum Mutation {
    Bytes,
    /// Bytes, after which the checksums of a PNG are made right in most cases.
    Png,
    /// Values of a JSON document, or in the JSON part of a GLB.
    Json,
}

/// A sound file, what is done to it, and who reads it; whether it was read.
struct Kind {
    name: &'static str,
    extension: &'static str,
    bytes: Vec<u8>,
    mutation: Mutation,
    /// What the reader may hold beside [`allowed`], bytes: a drawing becomes a picture, whatever the length of its text.
    more: isize,
    read: Box<dyn Fn(&Path) -> bool>,
}

impl Kind {
    fn new(
        name: &'static str,
        extension: &'static str,
        bytes: Vec<u8>,
        read: impl Fn(&Path) -> bool + 'static,
    ) -> Self {
        Self { name, extension, bytes, mutation: Mutation::Bytes, more: 0, read: Box::new(read) }
    }
}

fn kinds(s: &Scratch) -> Vec<Kind> {
    let tiny = |raw: bool| {
        let mut settings = flight(1.0, raw);
        let model = &mut settings.scenario.cameras[0];
        model.camera = Camera { width: 32, height: 24, fx: 20.0, fy: 20.0, cx: 15.5, cy: 11.5, ..model.camera };
        // Few of both, so that a mutation meets every kind of record.
        model.rate_hz = 4.0;
        settings.scenario.imus[0].rate_hz = 20.0;
        simulate(&settings, &s.0).unwrap();
        std::fs::read(s.0.join("recording.mcap")).unwrap()
    };
    let recording = |name: &'static str, mut bytes: Vec<u8>, overrides: Overrides| {
        drop_checksums(&mut bytes);
        Kind::new(name, "mcap", bytes, move |file| {
            open_mcap(file, &overrides)
                .is_ok_and(|recording| camera_frames(&recording).take(100).filter(|f| f.picture.is_ok()).count() > 0)
        })
    };
    let none = Overrides::default;
    let mut kinds = vec![
        recording("MCAP, raw pixels", tiny(true), none()),
        recording("MCAP of Foxglove, PNG", tiny(false), none()),
    ];
    for (name, compression) in [("MCAP, LZ4", "lz4"), ("MCAP, Zstandard", "zstd")] {
        recompress(&s.0.join("recording.mcap"), &s.0.join("packed.mcap"), compression);
        kinds.push(recording(name, std::fs::read(s.0.join("packed.mcap")).unwrap(), none()));
    }
    let folder = open_euroc(&s.0, &none()).unwrap();
    write_kalibr_files(s, &folder);
    let frames: Vec<_> = camera_frames(&folder).collect();
    let kalibr = || Overrides {
        cameras: Some(s.0.join("cameras.yaml")),
        imu: Some(s.0.join("imu.yaml")),
        ..Overrides::default()
    };
    for (name, compressed) in [("MCAP of ROS 2, raw", false), ("MCAP of ROS 2, PNG", true)] {
        let file = s.0.join("bag.mcap");
        write_ros2_bag(&file, &folder.samples, &frames, compressed);
        kinds.push(recording(name, std::fs::read(&file).unwrap(), kalibr()));
    }

    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list \
                  uchar int vertex_indices\nend_header\n";
    let mesh = |name: &'static str, bytes: Vec<u8>| {
        let (_, extension) = name.split_once('.').unwrap_or(("", "ply"));
        let extension = extension.split(',').next().unwrap_or_default();
        Kind::new(name, extension, bytes, |file| read_mesh(file).is_ok())
    };
    kinds
        .push(mesh("PLY, text", format!("ply\nformat ascii 1.0\n{header}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").into_bytes()));
    let mut binary = format!("ply\nformat binary_little_endian 1.0\n{header}").into_bytes();
    binary.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    binary.push(3);
    binary.extend([0_i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    kinds.push(mesh("PLY, binary", binary));

    let picture = |name: &'static str, image: image::DynamicImage| {
        let mut png = std::io::Cursor::new(Vec::new());
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let kind = Kind::new(name, "png", png.into_inner(), |file| paintcopter::vio::GreyImage::read(file).is_ok());
        Kind { mutation: Mutation::Png, ..kind }
    };
    let grey = image::GrayImage::from_fn(40, 30, |x, y| image::Luma([(x * y % 251) as u8]));
    let deep = image::ImageBuffer::from_fn(20, 15, |x, y| image::Luma([(x * y * 200) as u16]));
    kinds.push(picture("PNG, 8 bits", image::DynamicImage::ImageLuma8(grey)));
    kinds.push(picture("PNG, 16 bits", image::DynamicImage::ImageLuma16(deep)));

    kinds.push(mesh("mesh.glb, bytes", square_glb()));
    kinds.push(Kind { mutation: Mutation::Json, ..mesh("mesh.glb, its document", square_glb()) });
    let (document, buffer) = square_gltf("buffer.bin");
    s.write("buffer.bin", buffer);
    kinds.push(Kind { mutation: Mutation::Json, ..mesh("mesh.gltf, with its buffer beside it", document) });
    s.write("paint.mtl", "newmtl a\nKd 1 0.5 0\nmap_Kd none.png\n");
    kinds.push(mesh("mesh.obj", OBJ.into()));
    kinds.push(mesh("mesh.off", b"OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n".to_vec()));
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    kinds.push(mesh("mesh.stl, text", stl.into()));
    let corners = [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let triangle: Vec<u8> = corners.iter().flat_map(|c| c.to_le_bytes()).chain([0; 2]).collect();
    kinds.push(mesh("mesh.stl, binary", [&[b' '; 80][..], &1_u32.to_le_bytes(), &triangle].concat()));
    let drawing = Kind::new("SVG", "svg", SVG.into(), |file| {
        std::fs::read_to_string(file).is_ok_and(|text| paintcopter::vector_drawing::draw_svg(&text).is_ok())
    });
    // A picture of 2048 by 2048 pixels for the drawing, and one for each transparent group within another.
    kinds.push(Kind { more: 9 * (16 << 20), ..drawing });
    let mission = MissionFile { fill: Some(2e-5), ..MissionFile::default() };
    let text = toml::to_string(&mission).unwrap();
    kinds.push(Kind::new("mission.toml", "toml", text.into(), |file| MissionFile::read(file).is_ok()));
    kinds
}

const OBJ: &str = "mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl a\n\
                   f 1/1/1 2/2/1 3/3/1\nf -4/1 -2/3 -1/4\n";

const SVG: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 20"><defs><linearGradient id="a"><stop offset="0"/>
<stop offset="1" stop-color="#fff"/></linearGradient><clipPath id="c"><circle cx="9" cy="9" r="8"/></clipPath></defs>
<g opacity="0.5" transform="rotate(10 3 4)"><path d="M 2 5 H 8 C 9 9 12 12 20 10 Z" stroke="#000" stroke-width="2" fill="url(#a)"/></g>
<g clip-path="url(#c)"><rect x="1" y="2" width="30" height="9"/><use href="#d"/></g><ellipse id="d" cx="5" cy="5" rx="4" ry="2"/></svg>"##;

/// Takes the checksums out of the chunks of an MCAP file, or every change in one would end there.
fn drop_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 9) {
        let length = u64::from_le_bytes(head[1..9].try_into().unwrap()) as usize;
        if head[0] == 6 {
            // After the times of the first and the last message, and the uncompressed size.
            bytes[at + 9 + 24..at + 9 + 28].fill(0);
        }
        at += 9 + length;
    }
}

/// Takes away, replaces or moves values of a JSON document, in a GLB with the lengths that then fit.
fn mutate_json(bytes: &mut Vec<u8>, random: &mut impl FnMut(usize) -> usize) {
    let binary = bytes.starts_with(b"glTF");
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (from, to) = if binary { (20, 20 + length(12)) } else { (0, bytes.len()) };
    let mut document: Value = serde_json::from_slice(&bytes[from..to]).unwrap();
    let mut count = 0;
    each(&mut document, &mut |_| count += 1);
    for _ in 0..=random(2) {
        let (chosen, what) = (random(count), random(8));
        let number = [0_i64, -1, 1, 255, 5126, 1 << 31, i64::MAX][random(7)];
        let mut at = 0;
        each(&mut document, &mut |value| {
            if at == chosen {
                match (what, &mut *value) {
                    (0..3, Value::Object(fields)) if !fields.is_empty() => {
                        let key = fields.keys().nth(number.unsigned_abs() as usize % fields.len()).unwrap().clone();
                        fields.remove(&key);
                    }
                    (0..3, Value::Array(items)) => drop(items.pop()),
                    (3, Value::Array(items)) if !items.is_empty() => items.push(items[0].clone()),
                    (4, value) => *value = Value::Null,
                    (5, value) => *value = Value::String("data:,".into()),
                    (6, value) => *value = serde_json::json!(1e300),
                    (_, value) => *value = number.into(),
                }
            }
            at += 1;
        });
    }
    let mut text = document.to_string().into_bytes();
    if binary {
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = (20 + text.len() + bytes.len() - to) as u32;
        bytes[8..12].copy_from_slice(&total.to_le_bytes());
        bytes[12..16].copy_from_slice(&(text.len() as u32).to_le_bytes());
    }
    bytes.splice(from..to, text);
}

/// Visits every value of a document, those inside others before them.
fn each(value: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| each(item, visit)),
        Value::Object(fields) => fields.values_mut().for_each(|field| each(field, visit)),
        _ => {}
    }
    visit(value);
}

/// Makes the checksums of a PNG right again, or every change would end there.
fn mend_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) = at.checked_add(8 + length).filter(|end| end + 4 <= bytes.len()) else { return };
        let mut sum = flate2::Crc::new();
        sum.update(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.sum().to_be_bytes());
        at = end + 4;
    }
}

fn mutate(bytes: &mut Vec<u8>, random: &mut impl FnMut(usize) -> usize) {
    // Half of the files keep their length, so that more is read than the first lengths and offsets.
    let kinds = if random(2) == 0 { 3 } else { 6 };
    for _ in 0..=random(3) {
        let at = random(bytes.len());
        match random(kinds) {
            0 => bytes[at] = random(256) as u8,
            1 => bytes[at] ^= 1 << random(8),
            // Lengths and counts: eight bytes of ones, or some more digits.
            2 => bytes.iter_mut().skip(at).take(8).for_each(|byte| *byte = 0xff),
            3 => drop(bytes.splice(at..at, *b"99999999")),
            4 => drop(bytes.drain(at..(at + 1 + random(16)).min(bytes.len()))),
            _ => bytes.truncate(at.max(1)),
        }
        if bytes.is_empty() {
            return;
        }
    }
}

/// `MUTATIONS` is how many (3000); a million with
/// `MUTATIONS=1000000 cargo test --release -p paintcopter --all-features --test it mutated_files -- --nocapture`.
#[test]
fn mutated_files_are_read_or_refused() {
    let count: u64 = std::env::var("MUTATIONS").map_or(3000, |text| text.parse().unwrap());
    let s = Scratch::new("mutated");
    let kinds = kinds(&s);
    let mut generator = SplitMix64::seed_from_u64(7);
    let mut random = move |below: usize| (generator.next_u64() % below.max(1) as u64) as usize;
    for Kind { name, extension, bytes, read, .. } in &kinds {
        let sound = s.0.join("sound").with_extension(extension);
        std::fs::write(&sound, bytes).unwrap();
        assert!(read(&sound), "{name} is not read as it is");
    }
    let mut of_kind = vec![(0_u64, 0_u64, Duration::ZERO, 0_isize); kinds.len()];
    for k in 0..count {
        let which = k as usize % kinds.len();
        let Kind { name, extension, bytes, mutation, more, read } = &kinds[which];
        let mut bytes = bytes.clone();
        match mutation {
            Mutation::Json => mutate_json(&mut bytes, &mut random),
            Mutation::Bytes | Mutation::Png => mutate(&mut bytes, &mut random),
        }
        if *mutation == Mutation::Png && random(4) > 0 {
            mend_checksums(&mut bytes);
        }
        let file = &s.0.join("mutated").with_extension(extension);
        std::fs::write(file, &bytes).unwrap();
        let (before, began) = (HELD.get(), Instant::now());
        PEAK.set(before);
        let is_read = read(file);
        let (taken, elapsed) = (PEAK.get() - before, began.elapsed());
        // A hang, not a slow machine.
        assert!(elapsed < Duration::from_secs(20), "{name}, mutation {k}: {elapsed:?}");
        assert!(taken <= allowed(bytes.len()) + more, "{name}, mutation {k}: {taken} bytes for {}", bytes.len());
        let (tried, good, slowest, most) = &mut of_kind[which];
        *tried += 1;
        *good += u64::from(is_read);
        *slowest = (*slowest).max(elapsed);
        *most = (*most).max(taken);
    }
    for (Kind { name, .. }, (tried, good, slowest, most)) in kinds.iter().zip(&of_kind) {
        eprintln!("{name}: {good} of {tried} are read, the slowest in {slowest:?}, with at most {} KiB", most >> 10);
        // A thousand of each are enough for some of both.
        assert!(*tried < 500 || (0 < *good && good < tried), "{name}: {good} of {tried} are read");
    }
}

/// The allocator does count, and the bound does hold back: a reader that believes what a picture claims would be seen.
#[test]
fn what_a_reader_holds_is_counted() {
    let before = HELD.get();
    PEAK.set(before);
    drop(vec![1_u8; 64 << 20]);
    assert!(PEAK.get() - before >= 64 << 20 && HELD.get() - before < 1 << 20);
    assert!(PEAK.get() - before > allowed(1 << 20));
    // 30000 x 30000 pixels in a file of some hundred bytes.
    let s = Scratch::new("claims");
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(8, 8).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut bytes = png.into_inner();
    bytes[16..20].copy_from_slice(&30_000_u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&30_000_u32.to_be_bytes());
    mend_checksums(&mut bytes);
    std::fs::write(s.0.join("huge.png"), &bytes).unwrap();
    PEAK.set(HELD.get());
    let before = HELD.get();
    assert!(paintcopter::vio::GreyImage::read(&s.0.join("huge.png")).is_err());
    assert!(PEAK.get() - before <= allowed(bytes.len()), "{} bytes", PEAK.get() - before);
}
