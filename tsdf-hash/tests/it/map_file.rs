//! A map goes into a file and comes back as it was, or not at all.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use tsdf_hash::storage::{MapFile, MemoryLimits};
use tsdf_hash::{Error, Map, Settings};

use crate::eviction::{FREE, add, contents, scratch, take_out};
use crate::scene::{Shot, room};

fn fused(settings: Settings, shots: &[Shot]) -> Map {
    let mut map = Map::new(settings).unwrap();
    for shot in shots {
        add(&mut map, shot).unwrap();
    }
    map
}

/// Removed when the test ends.
struct Path(std::path::PathBuf);

impl Drop for Path {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn path(name: &str) -> Path {
    Path(scratch(name))
}

const COLD: MemoryLimits =
    MemoryLimits { host_bytes: 4 << 20, disk_bytes: 0, max_age: 0.1, max_transfers: 100, merge_timeout: 0.0 };

#[test]
fn everything_comes_back() {
    let shots = room::tour(6, 4, &Isometry3::identity());
    // Half of the blocks are packed already.
    let map = fused(Settings { memory: COLD, max_bytes: 2 << 20, ..FREE }, &shots);
    assert!(map.memory().host_blocks > 100);
    let expected = contents(&map);
    let mesh = expected.2.clone();
    let metadata: BTreeMap<String, Vec<u8>> =
        [("place", b"kitchen".to_vec()), ("", vec![]), ("every byte", (0..=255).collect())]
            .map(|(key, value)| (key.to_string(), value))
            .into();
    let path = path("everything");
    map.save(&path.0, Some(&mesh), &metadata).unwrap();
    let file = MapFile::open(&path.0).unwrap();
    assert_eq!((file.settings(), file.blocks()), (map.settings(), map.blocks()));
    assert_eq!((file.mesh().unwrap(), file.metadata().unwrap()), (Some(mesh), metadata));
    // A tenth of a second is left of the clock.
    let opened = Map::open(&path.0).unwrap();
    assert!(contents(&opened) == expected);
    let memory = opened.memory();
    assert_eq!((memory.active_blocks, memory.file_blocks), (0, map.blocks()));
    // Without cold memory it is all read at once.
    let whole = file.into_map(FREE, None).unwrap();
    assert_eq!(whole.memory().active_blocks, map.blocks());
    assert_eq!((whole.hash(), whole.blocks(), whole.mesh()), expected);
    // Nothing but what was fused, nothing beside the file.
    map.save(&path.0, None, &BTreeMap::new()).unwrap();
    let bare = MapFile::open(&path.0).unwrap();
    assert!(bare.mesh().unwrap().is_none() && bare.metadata().unwrap().is_empty());
    let name = path.0.file_name().unwrap().to_str().unwrap().to_string();
    let beside = std::fs::read_dir(path.0.parent().unwrap()).unwrap().flatten();
    assert_eq!(beside.filter(|entry| entry.file_name().to_str().unwrap().starts_with(&name)).count(), 1);
}

#[test]
fn a_file_takes_less_than_a_third_of_the_voxels() {
    let map = fused(FREE, &room::tour(20, 2, &Isometry3::identity()));
    let path = path("small");
    map.save(&path.0, None, &BTreeMap::new()).unwrap();
    let (bytes, raw) = (std::fs::metadata(&path.0).unwrap().len(), 7168 * map.blocks() as u64);
    assert!(10 * bytes <= 3 * raw, "{bytes} of {raw}");
    assert!(MapFile::open(&path.0).unwrap().into_map(FREE, None).unwrap().hash() == map.hash());
}

#[test]
fn an_opened_map_goes_on() {
    let shots = room::tour(10, 4, &Isometry3::identity());
    let expected = contents(&fused(FREE, &shots));
    let path = path("continued");
    let early = fused(FREE, &shots[..6]);
    early.save(&path.0, None, &BTreeMap::new()).unwrap();
    let tight = MemoryLimits { host_bytes: 1 << 20, disk_bytes: 8 << 20, ..COLD };
    for (max_bytes, tiers) in [(1 << 30, FREE.memory), (1 << 30, COLD), (1 << 20, tight)] {
        let settings = Settings { max_bytes, memory: tiers, ..FREE };
        let swap = scratch("continued-swap");
        let file = MapFile::open(&path.0).unwrap();
        let mut map = file.into_map(settings, (tiers.disk_bytes > 0).then_some(&*swap)).unwrap();
        assert_eq!(map.hash(), early.hash());
        for shot in &shots[6..] {
            add(&mut map, shot).unwrap();
        }
        assert!(contents(&map) == expected);
        // Saved over the file that it still reads from, and frames from before taken out of it again.
        map.save(&path.0, None, &BTreeMap::new()).unwrap();
        assert!(contents(&map) == expected);
        for shot in &shots[..6] {
            take_out(&mut map, shot).unwrap();
        }
        assert!(contents(&map) == contents(&fused(FREE, &shots[6..])));
        assert!(contents(&MapFile::open(&path.0).unwrap().into_map(FREE, None).unwrap()) == expected);
        early.save(&path.0, None, &BTreeMap::new()).unwrap();
    }
}

#[test]
fn files_that_are_not_what_they_should_be_are_named() {
    let map = fused(FREE, &room::tour(12, 8, &Isometry3::identity())[..1]);
    let path = path("damaged");
    let metadata = [("a".to_string(), vec![1, 2, 3])].into();
    map.save(&path.0, Some(&map.mesh()), &metadata).unwrap();
    let good = std::fs::read(&path.0).unwrap();
    let open = |bytes: &[u8]| {
        std::fs::write(&path.0, bytes).unwrap();
        MapFile::open(&path.0)
    };
    let changed = |at: usize, value: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        open(&bytes)
    };
    assert!(open(&good).is_ok());
    assert!(matches!(changed(0, b"PLY"), Err(Error::NotAMapFile { offset: 0, .. })));
    for other in [1, 2, 4] {
        let error = changed(8, &[other]).err().unwrap();
        let refused = matches!(error, Error::UnsupportedVersion { found, known: 3 } if found == u32::from(other));
        assert!(refused && error.to_string().contains("scan anew"), "{error}");
    }
    assert!(matches!(changed(12, &[1, 2, 3, 4]), Err(Error::NotAMapFile { offset: 12, .. })));
    assert!(matches!(changed(16, &[7]), Err(Error::CorruptFile { offset: 0, .. })));
    let end = good.len() as u64;
    for length in [0, 7, 8, 100, 151, 152, good.len() / 2, good.len() - 1] {
        let error = open(&good[..length]).err().unwrap();
        match error {
            Error::NotAMapFile { .. } => assert!(length < 8),
            Error::Truncated { expected, found } => {
                assert!(found == length as u64 && expected == if length < 152 { 152 } else { end });
            }
            other => panic!("{other}"),
        }
    }
    assert!(matches!(open(&[&good[..], &[0]].concat()), Err(Error::CorruptFile { .. })));
    // The sections as the head tells them: settings, blocks, index, mesh, metadata.
    let sections: Vec<[usize; 2]> = (0..5)
        .map(|k| [0, 8].map(|at| u64::from_le_bytes(good[24 + 24 * k + at..][..8].try_into().unwrap()) as usize))
        .collect();
    for (k, [at, length]) in sections.into_iter().enumerate() {
        let middle = at + length / 2;
        let file = changed(middle, &[good[middle] ^ 0x10]);
        let found = match k {
            1 => {
                // Found when the block is read, whether now or later.
                let file = file.unwrap();
                let cold = Settings { memory: COLD, ..FREE };
                let lazy = file.into_map(cold, None).unwrap();
                assert!(matches!(lazy.consolidated(), Err(Error::CorruptBlock { .. })));
                let mut refused = 0;
                for shot in &room::tour(12, 8, &Isometry3::identity())[..1] {
                    let mut lazy = MapFile::open(&path.0).unwrap().into_map(cold, None).unwrap();
                    let before = lazy.hash();
                    refused += usize::from(matches!(take_out(&mut lazy, shot), Err(Error::CorruptBlock { .. })));
                    assert_eq!(lazy.hash(), before);
                }
                assert_eq!(refused, 1);
                for byte in (at..at + length).step_by(length / 200) {
                    let file = changed(byte, &[good[byte] ^ (1 << (byte % 8))]).unwrap();
                    assert!(matches!(file.into_map(FREE, None), Err(Error::CorruptBlock { .. })), "byte {byte}");
                }
                continue;
            }
            3 => file.unwrap().mesh().map(|_| ()),
            4 => file.unwrap().metadata().map(|_| ()),
            _ => file.map(|_| ()),
        };
        assert!(matches!(found, Err(Error::CorruptFile { offset, .. }) if offset == at as u64), "section {k}");
    }
    open(&good).unwrap();
    let file = MapFile::open(&path.0).unwrap();
    let other = Settings { voxel_size: 0.021, ..FREE };
    assert!(matches!(file.into_map(other, None), Err(Error::IncompatibleSettings)));
    assert!(matches!(Map::open(&scratch("no-such-file")), Err(Error::Io { .. })));
    assert!(matches!(map.save(&scratch("no-such-folder").join("map"), None, &metadata), Err(Error::Io { .. })));
}
