//! After a correction the map follows the trajectory frame by frame, a few with each new one: it can be queried all the time, and no new frame
//! waits for a long loop. When none is left the map equals, to the bit, one that was made at the corrected poses.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::slam::frame_source::{FrameSource, read_again};

/// Fused frames that the map does not have at their poses yet.
#[derive(Default)]
pub(crate) struct Reintegration {
    /// Where the map has them; `None` of one that it does not have, because it could be taken out but not fused again.
    in_map: BTreeMap<usize, Option<Isometry3<f64>>>,
    /// Blocks that were full when the map took a frame, of the few frames that met some.
    full: BTreeMap<usize, Vec<[i32; 3]>>,
}

impl Reintegration {
    /// A fused frame belongs elsewhere now; until now it was at this pose.
    pub(crate) fn moved(&mut self, frame: usize, from: Isometry3<f64>) {
        // Moved again before its turn came, it is still where it was fused.
        self.in_map.entry(frame).or_insert(Some(from));
    }

    /// These blocks were full when the map took a frame.
    pub(crate) fn met_full(&mut self, frame: usize, blocks: Vec<[i32; 3]>) {
        if !blocks.is_empty() {
            self.full.insert(frame, blocks);
        }
    }

    /// De-integrates at most so many frames where the map has them and integrates them where they belong, in the order of the recording, which
    /// is then read through once. `fused`: number and pose of frame `k`. Returns how many there were. After an error the frame is still to be moved.
    pub(crate) fn work(
        &mut self,
        map: &mut dyn DenseMap,
        source: &mut impl FrameSource,
        fused: impl Fn(usize) -> (usize, Isometry3<f64>),
        most: usize,
    ) -> Result<usize, Error> {
        for done in 0..most {
            let Some(mut next) = self.in_map.first_entry() else { return Ok(done) };
            let frame = *next.key();
            let (number, to) = fused(frame);
            let images = read_again(source, number)?;
            let (depth, colour) = (images.depth(), images.colour());
            if let Some(from) = next.get() {
                let full = self.full.get(&frame).map_or(&[][..], Vec::as_slice);
                map.deintegrate_except(&depth, colour.as_ref(), from, full)?;
                self.full.remove(&frame);
                next.insert(None);
            }
            let mut full = Vec::new();
            map.integrate_where_room(&depth, colour.as_ref(), &to, &mut full)?;
            next.remove();
            self.met_full(frame, full);
        }
        Ok(most)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::images::Intrinsics;
    use crate::map::Map;
    use crate::settings::Settings;
    use crate::slam::frame_source::{ColourImage, ColourPixels, DepthPixels, FrameImages};

    const FRAMES: usize = 6;

    /// Pictures of a wavy wall.
    fn images(k: usize) -> FrameImages {
        let wall = |at: usize| (1500.0 + 40.0 * ((at % 80 + at / 80 * k) as f64).sin()) as u16;
        let depth = DepthPixels::U16 { data: (0..80 * 60).map(wall).collect(), scale: 1000.0 };
        let intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };
        FrameImages { width: 80, height: 60, depth, intrinsics, colour: None }
    }

    fn grey() -> ColourImage {
        let intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };
        ColourImage { width: 80, height: 60, pixels: ColourPixels::Rgb8(vec![128; 3 * 80 * 60]), intrinsics }
    }

    fn poses(off: f64) -> Vec<Isometry3<f64>> {
        let pose = |k: usize| Isometry3::new(Vector3::new(0.02 * k as f64 + off, off, 0.0), Vector3::y() * off);
        (0..FRAMES).map(pose).collect()
    }

    fn fused(poses: &[Isometry3<f64>]) -> Map {
        let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
        for (k, pose) in poses.iter().enumerate() {
            map.integrate(&images(k).depth(), None, pose).unwrap();
        }
        map
    }

    /// Corrected twice, the second time halfway through the first: the map is the one of the last poses, to the bit. A source that fails once costs nothing.
    #[test]
    fn the_map_follows_frame_by_frame() {
        let (first, second, third) = (poses(0.0), poses(0.03), poses(-0.05));
        let mut map = fused(&first);
        let mut source = |k: usize| Ok(images(k));
        let mut reintegration = Reintegration::default();
        (0..FRAMES).for_each(|k| reintegration.moved(k, first[k]));
        assert_eq!(reintegration.work(&mut map, &mut source, |k| (k, second[k]), 2).unwrap(), 2);
        // Two of six have followed, and the map is whole.
        let halfway: Vec<_> = second[..2].iter().chain(&first[2..]).copied().collect();
        assert_eq!(map.hash(), fused(&halfway).hash());
        (0..FRAMES).for_each(|k| reintegration.moved(k, second[k]));
        let mut broken = |k: usize| if k == 3 { Err("the disk is gone".into()) } else { Ok(images(k)) };
        let failed = reintegration.work(&mut map, &mut broken, |k| (k, third[k]), usize::MAX);
        assert!(matches!(failed, Err(Error::FrameSource { frame: 3, .. })));
        assert_eq!(reintegration.work(&mut map, &mut source, |k| (k, third[k]), usize::MAX).unwrap(), 3);
        assert_eq!(map.hash(), fused(&third).hash());
        assert_eq!(reintegration.work(&mut map, &mut source, |k| (k, third[k]), 9).unwrap(), 0);
    }

    /// A camera that stays for long: what its voxels have no room for is passed over, at the corrected poses as before.
    #[test]
    fn the_map_follows_where_it_is_full() {
        let (stay, shot) = (1045, FrameImages { colour: Some(grey()), ..images(0) });
        let (depth, colour) = (shot.depth(), shot.colour());
        let [here, there] = [0.0, 0.03].map(|off| poses(off)[0]);
        let taken = |pose: &Isometry3<f64>, reintegration: &mut Reintegration| {
            let mut map = Map::new(Settings { voxel_size: 0.04, ..Settings::default() }).unwrap();
            for k in 0..stay {
                let mut full = Vec::new();
                map.integrate_where_room(&depth, colour.as_ref(), pose, &mut full).unwrap();
                assert_eq!(k >= 1040, !full.is_empty(), "{k}");
                reintegration.met_full(k, full);
            }
            map
        };
        let mut reintegration = Reintegration::default();
        let mut map = taken(&here, &mut reintegration);
        (0..stay).for_each(|k| reintegration.moved(k, here));
        let mut source = |_| Ok(shot.clone());
        assert_eq!(reintegration.work(&mut map, &mut source, |k| (k, there), usize::MAX).unwrap(), stay);
        assert_eq!(map.hash(), taken(&there, &mut Reintegration::default()).hash());
        assert_eq!(reintegration.full.len(), stay - 1040);
    }
}
