//! After a correction the map follows the trajectory frame by frame, a few with each new one: it can be queried all the time, and no new frame
//! waits for a long loop. When none is left the map equals, to the bit, one that was made at the corrected poses.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use super::decode::Images;
use super::error::ScanError;
use super::map_store::MapStore;
use super::sequence::Sequence;

/// Fused frames that the map does not have at their poses yet.
#[derive(Default)]
pub(super) struct Reintegration {
    /// Where the map has them.
    in_map: BTreeMap<usize, Isometry3<f64>>,
}

impl Reintegration {
    /// A fused frame belongs elsewhere now; until now it was at this pose.
    pub(super) fn moved(&mut self, frame: usize, from: Isometry3<f64>) {
        // Moved again before its turn came, it is still where it was fused.
        self.in_map.entry(frame).or_insert(from);
    }

    /// De-integrates at most so many frames where the map has them and integrates them where they belong, in the order of the recording, which
    /// is then read through once. `fused`: the frames of the sequence and their poses. Returns how many there were.
    pub(super) fn work(
        &mut self,
        store: &mut MapStore,
        sequence: &Sequence,
        fused: &[(usize, Isometry3<f64>)],
        most: usize,
    ) -> Result<usize, ScanError> {
        for done in 0..most {
            let Some((k, from)) = self.in_map.pop_first() else { return Ok(done) };
            let (index, to) = fused[k];
            let mut images = Images::read(&sequence.frames[index])?;
            if let Some(camera) = &sequence.colour_camera {
                images.register_colour(camera, sequence.intrinsics, sequence.depth_scale);
            }
            let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
            let colour = images.colour(sequence.intrinsics);
            store.dense().deintegrate(&depth, colour.as_ref(), &from)?;
            store.dense().integrate(&depth, colour.as_ref(), &to)?;
        }
        Ok(most)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use image::{ImageBuffer, Luma};
    use nalgebra::Vector3;
    use tsdf_hash::{Intrinsics, Map, Settings};

    use super::*;
    use crate::scan::image_source::ImageSource;
    use crate::scan::map_store::Device;
    use crate::scan::sequence::FrameFiles;

    const FRAMES: usize = 6;

    /// Pictures of a wavy wall.
    fn sequence(folder: &Path) -> Sequence {
        let frame = |k: usize| {
            let path = folder.join(format!("{k}.png"));
            let wall = |u: u32, v: u32| Luma([(1500.0 + 40.0 * f64::from(u + v * k as u32).sin()) as u16]);
            ImageBuffer::from_fn(80, 60, wall).save(&path).unwrap();
            let depth = ImageSource::File(path);
            FrameFiles { stamp: k as f64, depth, colour: None, world_from_camera: None, lost: false }
        };
        Sequence {
            layout: "TUM",
            intrinsics: Intrinsics { fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 },
            camera_origin: String::new(),
            image_size: None,
            depth_scale: 1000.0,
            scale_origin: String::new(),
            colour_camera: None,
            gyroscope: None,
            frames: (0..FRAMES).map(frame).collect(),
        }
    }

    fn poses(off: f64) -> Vec<(usize, Isometry3<f64>)> {
        let pose = |k: usize| Isometry3::new(Vector3::new(0.02 * k as f64 + off, off, 0.0), Vector3::y() * off);
        (0..FRAMES).map(|k| (k, pose(k))).collect()
    }

    fn fused(sequence: &Sequence, poses: &[(usize, Isometry3<f64>)]) -> MapStore {
        let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
        for (index, pose) in poses {
            let images = Images::read(&sequence.frames[*index]).unwrap();
            map.integrate(&images.depth(sequence.intrinsics, sequence.depth_scale), None, pose).unwrap();
        }
        MapStore::open(map, Device::Cpu).unwrap()
    }

    fn hash(store: &MapStore) -> u64 {
        store.map().unwrap().hash()
    }

    /// Corrected twice, the second time halfway through the first: the map is the one of the last poses, to the bit.
    #[test]
    fn the_map_follows_frame_by_frame() {
        let folder = std::env::temp_dir().join(format!("reintegration-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let sequence = sequence(&folder);
        let (first, second, third) = (poses(0.0), poses(0.03), poses(-0.05));
        let mut store = fused(&sequence, &first);
        let mut reintegration = Reintegration::default();
        (0..FRAMES).for_each(|k| reintegration.moved(k, first[k].1));
        assert_eq!(reintegration.work(&mut store, &sequence, &second, 2).unwrap(), 2);
        // Two of six have followed, and the map is whole.
        let halfway: Vec<_> = second[..2].iter().chain(&first[2..]).copied().collect();
        assert_eq!(hash(&store), hash(&fused(&sequence, &halfway)));
        (0..FRAMES).for_each(|k| reintegration.moved(k, second[k].1));
        assert_eq!(reintegration.work(&mut store, &sequence, &third, usize::MAX).unwrap(), FRAMES);
        assert_eq!(hash(&store), hash(&fused(&sequence, &third)));
        assert_eq!(reintegration.work(&mut store, &sequence, &third, 9).unwrap(), 0);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
