//! The mapping run: every frame once, in order.

use std::path::Path;

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::{ColourView, DepthView, IncrementalMesher, KeyframeIndex};
use vio_ekf::{Alignment, Stamp, Trajectory, ate};

use super::checkpoint::{Checkpoints, Progress};
use super::correction::{Correction, Loops};
use super::decode::Images;
use super::error::ScanError;
use super::live::Live;
use super::map_store::MapStore;
use super::mapped::{Scan, ScanMetrics};
use super::pose_source::{CameraTracker, PoseSource};
use super::ray_cast_check::ray_cast_check;
use super::reintegration::Reintegration;
use super::sequence::{FrameFiles, Sequence};
use super::settings::ScanSettings;
use super::start::Start;
use crate::progress::Stage;

/// Frames that follow a correction with each new one (ours): a loop of a minute is in the map after a few seconds.
const REINTEGRATED: usize = 4;

impl Scan {
    /// Maps a sequence. Frames that cannot be used are counted and left out.
    pub fn run(folder: &Path, sequence: &Sequence, settings: &ScanSettings) -> Result<Self, ScanError> {
        let stage = Stage::start("fuse");
        let start = Start::open(folder, settings)?;
        let mut run = Run::new(sequence, settings, start)?;
        let mut checkpoints = Checkpoints::new(settings.checkpoint.clone());
        for index in run.resumed..sequence.frames.len() {
            stage.share(index as f64 / sequence.frames.len() as f64);
            let located = run.locate(index);
            run.tell_tracking(index);
            match located {
                Ok(placed) => run.take_all(placed)?,
                Err(why) => run.skip(index, &why),
            }
            let is_due = run.store.map().is_some() && checkpoints.are_due();
            // A stored map must fit the poses that are stored with it.
            run.reintegrate(if is_due { usize::MAX } else { REINTEGRATED })?;
            if is_due {
                let stamp = sequence.frames[index].stamp;
                checkpoints.save(run.store.map(), folder, stamp, &run.trajectory, run.keyframes())?;
            }
        }
        run.reintegrate(usize::MAX)?;
        if run.fused.is_empty() && run.resumed == 0 {
            let first = run.skipped.first().map_or_else(String::new, |(_, why)| why.clone());
            let frames = sequence.frames.len();
            return Err(ScanError::NothingFused { folder: folder.display().to_string(), frames, first });
        }
        let blocks = run.store.dense().blocks();
        stage.done(&format!("{} frames, {} left out, {blocks} blocks", run.fused.len(), run.skipped.len()));
        run.finish()
    }
}

/// A frame and where it was taken.
struct Placed {
    index: usize,
    pose: Isometry3<f64>,
    /// Of the present frame; those of earlier ones are read again.
    images: Option<Images>,
}

/// A run under way.
struct Run<'a> {
    sequence: &'a Sequence,
    settings: &'a ScanSettings,
    store: MapStore,
    mesher: IncrementalMesher,
    tracker: Option<CameraTracker>,
    /// Without loops; with them, the loops keep them.
    keyframes: KeyframeIndex,
    loops: Option<Loops>,
    /// From the world of the recorded poses to that of the map.
    correction: Isometry3<f64>,
    size: Option<[usize; 2]>,
    /// What has left active memory is not seen by a ray: then each ray cast comes while its surroundings are still there.
    leaving: bool,
    resumed: usize,
    trajectory: Trajectory,
    fused: Vec<(usize, Isometry3<f64>)>,
    reintegration: Reintegration,
    skipped: Vec<(usize, String)>,
    /// Frames since the camera was lost.
    lost: Vec<usize>,
    metrics: ScanMetrics,
    live: Option<Live>,
}

impl<'a> Run<'a> {
    fn new(sequence: &'a Sequence, settings: &'a ScanSettings, start: Start) -> Result<Self, ScanError> {
        let Start { map, progress, keyframes } = start;
        let store = MapStore::open(map, settings.device)?;
        let tracker = |odometry| {
            let loops = settings.loops && settings.fuse;
            let gyroscope = sequence.gyroscope.clone();
            CameraTracker::new(
                store.settings(),
                odometry,
                gyroscope,
                settings.relocalise.is_some(),
                !settings.fuse,
                loops,
                sequence.interval(),
            )
        };
        let mut tracker = match settings.poses {
            PoseSource::Given => None,
            PoseSource::Tracked => Some(tracker(None)?),
            PoseSource::Odometry(error) => Some(tracker(Some(error))?),
        };
        let progress =
            progress.unwrap_or(Progress { last_stamp: f64::NEG_INFINITY, trajectory: Trajectory::default() });
        if let (Some(tracker), Some(last)) = (&mut tracker, progress.trajectory.poses().last()) {
            tracker.start(*last);
        }
        let live = Live::open(&settings.live)?;
        if live.is_some() && store.map().is_none() {
            eprintln!("warning: the mesh of a map on a GPU is not shown while it grows: use --device cpu");
        }
        let loops = if settings.loops { Some(Loops::new(store.settings())?) } else { None };
        Ok(Self {
            sequence,
            settings,
            store,
            mesher: IncrementalMesher::new(),
            tracker,
            keyframes,
            loops,
            correction: Isometry3::identity(),
            size: sequence.image_size,
            leaving: settings.map.memory.host_bytes > 0,
            resumed: sequence.frames.partition_point(|frame| frame.stamp <= progress.last_stamp),
            trajectory: progress.trajectory,
            fused: Vec::new(),
            reintegration: Reintegration::default(),
            skipped: Vec::new(),
            lost: Vec::new(),
            metrics: ScanMetrics::default(),
            live,
        })
    }

    fn keyframes(&self) -> &KeyframeIndex {
        self.loops.as_ref().map_or(&self.keyframes, Loops::keyframes)
    }

    fn due(&self, index: usize) -> bool {
        index.is_multiple_of(self.settings.ray_cast_every.max(1))
    }

    /// Reads and places a frame, and those before it that have their poses only now; the latest last.
    fn locate(&mut self, index: usize) -> Result<Vec<Placed>, ScanError> {
        let frame = &self.sequence.frames[index];
        // Before the images are read: what has no pose costs no time.
        let given = if self.tracker.is_none() { Some(self.correction * given_pose(frame)?) } else { None };
        let images = self.images(frame)?;
        let (intrinsics, scale) = (self.sequence.intrinsics, self.sequence.depth_scale);
        let (depth, colour) = (images.depth(intrinsics, scale), images.colour(intrinsics));
        let mut placed = Vec::new();
        let pose = match (&mut self.tracker, given) {
            (Some(tracker), _) => {
                let keyframes = self.loops.as_ref().map_or(&self.keyframes, Loops::keyframes);
                let found = tracker.locate(&mut self.store, keyframes, frame, &depth, colour.as_ref());
                if matches!(found, Err(ScanError::Lost(_))) {
                    self.lost.push(index);
                }
                let found = found?;
                let lost = std::mem::take(&mut self.lost);
                let known = &lost[lost.len().saturating_sub(found.earlier.len())..];
                placed.extend(known.iter().zip(found.earlier).map(|(&index, pose)| Placed {
                    index,
                    pose,
                    images: None,
                }));
                found.world_from_camera
            }
            (None, Some(pose)) => pose,
            (None, None) => given_pose(frame)?,
        };
        // Twice as often as the map is cast: what is wrong is to be said early.
        let looked_at = index.is_multiple_of((self.settings.ray_cast_every / 2).max(1));
        if given.is_some() && looked_at && self.store.dense().blocks() > 0 {
            self.metrics.quality.check(&frame.depth.to_string(), &mut self.store, &depth, &pose)?;
        }
        placed.push(Placed { index, pose, images: Some(images) });
        Ok(placed)
    }

    /// Takes frames one after the other, and corrects the map where one closes a loop. What fails halfway in a correction ends the run.
    fn take_all(&mut self, placed: Vec<Placed>) -> Result<(), ScanError> {
        let mut moved = Isometry3::identity();
        for mut frame in placed {
            let index = frame.index;
            frame.pose = moved * frame.pose;
            self.skipped.retain(|(skipped, _)| *skipped != index);
            match self.take(frame) {
                Ok(None) => {}
                Ok(Some(correction)) => {
                    self.correct(&correction)?;
                    moved = correction.present * moved;
                }
                Err(why) => self.skip(index, &why),
            }
        }
        Ok(())
    }

    fn tell_tracking(&mut self, index: usize) {
        let outcome = self.tracker.as_mut().and_then(|tracker| tracker.outcome.take());
        if let (Some(live), Some(outcome)) = (&mut self.live, outcome) {
            live.tracking(self.sequence.frames[index].stamp, &outcome);
        }
    }

    fn skip(&mut self, index: usize, why: &ScanError) {
        // What cannot be read names its file itself.
        let name = match why {
            ScanError::Sequence(_) => String::new(),
            _ => format!("{}: ", self.sequence.frames[index].depth),
        };
        let why = format!("{name}{why}");
        if let Some(live) = &self.live {
            live.say(self.sequence.frames[index].stamp, &format!("left out: {why}"));
        }
        self.skipped.push((index, why));
    }

    /// Fuses a frame, keeps its pose, and looks for loops; returns how the frames have to move, if one was found.
    fn take(&mut self, Placed { index, pose, images }: Placed) -> Result<Option<Correction>, ScanError> {
        let frame = &self.sequence.frames[index];
        let images = images.map_or_else(|| self.images(frame), Ok)?;
        let (intrinsics, scale) = (self.sequence.intrinsics, self.sequence.depth_scale);
        let (depth, colour) = (images.depth(intrinsics, scale), images.colour(intrinsics));
        let name = frame.depth.to_string();
        if self.settings.fuse {
            self.fuse(&name, &depth, colour.as_ref(), &pose)?;
            if let Some(tracker) = &mut self.tracker {
                let keyframes = self.loops.as_ref().map_or(0, |loops| loops.keyframes().len());
                tracker.fused(&depth, colour.as_ref(), &pose, keyframes)?;
            }
        }
        if let Some(live) = &mut self.live {
            live.frame(frame.stamp, &pose, colour.as_ref(), &mut self.mesher);
        }
        self.fused.push((index, pose));
        self.trajectory.push(Stamp::from_secs(frame.stamp).map_err(vio_ekf::Error::from)?, pose)?;
        if self.leaving && self.due(index) {
            self.metrics.ray_casts.extend(ray_cast_check(&mut self.store, self.sequence, &images, &pose)?);
        }
        match &mut self.loops {
            Some(loops) => loops.add(&name, &depth, colour.as_ref(), &pose),
            None if self.settings.fuse => {
                self.keyframes.add(&depth, colour.as_ref(), &pose)?;
                Ok(None)
            }
            None => Ok(None),
        }
    }

    fn fuse(
        &mut self,
        name: &str,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
    ) -> Result<(), ScanError> {
        let start = ProcessTime::now();
        let report = self.store.dense().integrate(depth, colour, pose)?;
        let metrics = &mut self.metrics;
        metrics.integrate_s.push(start.elapsed().as_secs_f64());
        metrics.quality.count(name, depth.width * depth.height, &report);
        metrics.active_bytes_peak = metrics.active_bytes_peak.max(self.store.dense().bytes());
        if let Some(map) = self.store.map() {
            metrics.host_bytes_peak = metrics.host_bytes_peak.max(map.memory().host_bytes);
            let start = ProcessTime::now();
            self.mesher.update(map)?;
            metrics.mesh_update_s.push(start.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// Moves the frames to their corrected poses; the map follows with the next frames.
    fn correct(&mut self, correction: &Correction) -> Result<(), ScanError> {
        let voxel_size = self.store.settings().voxel_size;
        for (k, (_, old)) in self.fused.iter_mut().enumerate() {
            if let Some(pose) = correction.moved(k, old, voxel_size) {
                self.reintegration.moved(k, std::mem::replace(old, pose));
            }
        }
        // Stamps do not change.
        let earlier = self.trajectory.poses().len() - self.fused.len();
        let mut poses = self.trajectory.poses()[..earlier].to_vec();
        poses.extend(self.fused.iter().map(|(_, pose)| *pose));
        let stamps = self.trajectory.stamps().to_vec();
        self.trajectory = Trajectory::default();
        for (stamp, pose) in stamps.into_iter().zip(poses) {
            self.trajectory.push(stamp, pose)?;
        }
        let present = correction.present;
        self.correction = present * self.correction;
        if let Some(tracker) = &mut self.tracker {
            tracker.move_by(&present);
        }
        if let (Some(live), Some((index, _))) = (&mut self.live, self.fused.last()) {
            let stamp = self.sequence.frames[*index].stamp;
            live.corrected(stamp, self.trajectory.poses(), &correction.deformation, &self.mesher);
        }
        Ok(())
    }

    /// Lets the map follow by at most so many frames.
    fn reintegrate(&mut self, most: usize) -> Result<(), ScanError> {
        let anew = self.reintegration.work(&mut self.store, self.sequence, &self.fused, most)?;
        if let Some(loops) = &mut self.loops {
            loops.metrics.refused += anew;
        }
        Ok(())
    }

    /// The images of a frame, colour where the depth camera sees it.
    fn images(&mut self, frame: &FrameFiles) -> Result<Images, ScanError> {
        let mut images = Images::read(frame)?;
        let found = [images.width(), images.height()];
        let expected = *self.size.get_or_insert(found);
        if found != expected {
            let [found, expected] = [found, expected].map(|[width, height]| format!("{width} x {height}"));
            return Err(ScanError::OtherSize { found, expected });
        }
        if let Some(why) = images.colour_fault.take() {
            self.metrics.quality.without_colour += 1;
            eprintln!("without colour: {}: {why}", frame.depth);
        }
        if let Some(camera) = &self.sequence.colour_camera {
            images.register_colour(camera, self.sequence.intrinsics, self.sequence.depth_scale);
        }
        Ok(images)
    }

    fn finish(mut self) -> Result<Scan, ScanError> {
        if !self.leaving {
            let stage = Stage::start("ray cast");
            let due: Vec<_> = self.fused.iter().copied().filter(|(index, _)| self.due(*index)).collect();
            for (index, pose) in due {
                stage.share(index as f64 / self.sequence.frames.len() as f64);
                let images = Images::read(&self.sequence.frames[index])?;
                self.metrics.ray_casts.extend(ray_cast_check(&mut self.store, self.sequence, &images, &pose)?);
            }
            stage.done(&format!("{} ray casts", self.metrics.ray_casts.len()));
        }
        if let (Some(live), Some((index, _)), Some(map)) = (&self.live, self.fused.last(), self.store.map()) {
            self.mesher.update(map)?;
            live.finished(self.sequence.frames[*index].stamp, &mut self.mesher);
        }
        let stage = Stage::start("mesh");
        let start = ProcessTime::now();
        let mesh = self.store.dense().mesh()?;
        self.metrics.mesh_s = start.elapsed().as_secs_f64();
        stage.done(&format!("{} vertices, {} triangles", mesh.positions.len(), mesh.faces.len()));
        if let Some(tracker) = &self.tracker {
            // Odometry is no truth to measure against.
            if self.settings.poses == PoseSource::Tracked {
                self.metrics.ate_se3_rmse = tracked_error(self.sequence, &self.fused);
            }
            self.metrics.tracking = Some(tracker.metrics.clone());
        }
        self.metrics.loops = self.loops.as_ref().map(|loops| loops.metrics);
        let keyframes = self.keyframes().clone();
        let (device, map) = (self.store.device(), self.store.into_map()?);
        let Self { settings, trajectory, fused, skipped, resumed, metrics, .. } = self;
        let poses = settings.poses;
        Ok(Scan { map, mesh, trajectory, keyframes, fused, skipped, resumed, poses, device, metrics })
    }
}

fn given_pose(frame: &FrameFiles) -> Result<Isometry3<f64>, ScanError> {
    frame.world_from_camera.ok_or(ScanError::NoPose(if frame.lost {
        "its recorded pose is not finite: the recorder had lost the camera"
    } else {
        "no pose was recorded for it; --poses tracked finds the poses itself"
    }))
}

/// Of the frames that have a recorded pose; `None` where these do not fix an alignment: below three, or on one line.
fn tracked_error(sequence: &Sequence, fused: &[(usize, Isometry3<f64>)]) -> Option<f64> {
    let recorded = |(index, pose): &(usize, Isometry3<f64>)| Some((sequence.frames[*index].world_from_camera?, *pose));
    let (given, tracked): (Vec<_>, Vec<_>) = fused.iter().filter_map(recorded).unzip();
    ate(&given, &tracked, Alignment::Se3).ok().map(|found| found.position.rmse)
}
