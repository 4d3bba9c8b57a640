//! A recording of one's own as the source of frames: those of a loop are read again when it is closed.

use std::cell::Cell;

use nalgebra::Isometry3;
use tsdf_hash::loop_closure::LoopSettings;
use tsdf_hash::slam::{BoxedError, FrameImages, FrameSource, PoseSource, Slam, SlamSettings, SlamState};
use tsdf_hash::{Error, Map, Settings};

use crate::loops::drifting_tour;
use crate::noisy_room::seen;
use crate::random::Random;
use crate::scene::{Shot, room};

struct Recording<'a> {
    shots: &'a [Shot],
    reads: &'a Cell<usize>,
    /// Frames from this one on are missing.
    end: usize,
}

impl FrameSource for Recording<'_> {
    fn read(&mut self, frame: usize) -> Result<FrameImages, BoxedError> {
        let shot = self.shots[..self.end].get(frame).ok_or("the recording has no such frame")?;
        self.reads.set(self.reads.get() + 1);
        Ok(FrameImages::of(&shot.view(), shot.colour().as_ref()))
    }
}

#[test]
fn the_map_follows_a_loop_by_frames_that_a_recording_gives_again() {
    let settings = SlamSettings {
        map: Settings { voxel_size: 0.02, ..Settings::default() },
        poses: PoseSource::Given,
        loops: Some(LoopSettings::default()),
        ..SlamSettings::default()
    };
    let tour: Vec<(Isometry3<f64>, Isometry3<f64>)> = drifting_tour(72, 2)[..90].to_vec();
    let mut random = Random::new(23);
    let lit = |shot: Shot| shot.painted(|p| room::colour(p, 0.0));
    let shots: Vec<Shot> = tour.iter().map(|(truth, _)| lit(seen(*truth, &mut random))).collect();
    let run = |end: usize, reads: &Cell<usize>| {
        let state = SlamState::new(Map::new(settings.map)?);
        let mut slam = Slam::with_source(settings.clone(), state, Recording { shots: &shots, reads, end })?;
        for (k, (shot, (_, believed))) in shots.iter().zip(&tour).enumerate() {
            slam.frame(k as f64 / 30.0, &shot.view(), shot.colour().as_ref(), Some(believed))?;
        }
        slam.reintegrate(usize::MAX)?;
        Ok::<_, Error>((*slam.statistics(), slam.frames().collect::<Vec<_>>(), slam.finish()?))
    };
    let reads = Cell::new(0);
    let (statistics, frames, state) = run(shots.len(), &reads).unwrap();
    assert!(statistics.loops > 0 && statistics.reintegrated > 0, "{statistics:?}");
    assert_eq!(reads.get(), statistics.reintegrated);
    // The map is that of its frames at their corrected poses, to the bit.
    let mut anew = Map::new(settings.map).unwrap();
    for (frame, pose) in frames {
        let shot = &shots[frame];
        anew.integrate(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
    }
    assert_eq!(anew.hash(), state.map.hash());
    // A frame that cannot be read is named.
    assert!(matches!(run(0, &reads).err(), Some(Error::FrameSource { .. })));
}
