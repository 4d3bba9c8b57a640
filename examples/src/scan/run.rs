//! The mapping run: every frame once, in order.

use std::path::Path;

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::slam::BoxedError;
use tsdf_hash::slam::{
    Device, Event, FrameImages, FrameOutcome, FrameSource, PlacedFrame, PoseSource, Slam, SlamSettings,
};
use vio_ekf::eval::{Alignment, ate};
use vio_ekf::{Stamp, Trajectory};

use super::checkpoint::Checkpoints;
use super::decode::Images;
use super::error::ScanError;
use super::live::Live;
use super::mapped::{Scan, ScanMetrics};
use super::messages::{fault, line};
use super::ray_cast_check::ray_cast_check;
use super::sequence::Sequence;
use super::settings::ScanSettings;
use super::start;
use crate::interruption;
use crate::progress::Stage;
use crate::say;

impl Scan {
    /// Maps a sequence. Frames that cannot be used are counted and left out.
    pub fn run(folder: &Path, sequence: &Sequence, settings: &ScanSettings) -> Result<Self, ScanError> {
        let stage = Stage::start("fuse");
        let mut run = Run::new(folder, sequence, settings)?;
        let mut checkpoints = Checkpoints::new(settings.checkpoint.clone());
        for index in run.resumed..sequence.frames.len() {
            stage.share(index as f64 / sequence.frames.len() as f64);
            if interruption::is_requested() {
                say!("interrupted before frame {index}: --resume goes on from the map");
                break;
            }
            run.take(index)?;
            checkpoints.save(&mut run.slam, folder)?;
        }
        run.slam.reintegrate(usize::MAX)?;
        let fused = run.slam.frames().len();
        if fused == 0 && run.resumed == 0 {
            let first = run.skipped.first().map_or_else(String::new, |(_, why)| why.clone());
            let frames = sequence.frames.len();
            return Err(ScanError::NothingFused { folder: folder.display().to_string(), frames, first });
        }
        let blocks = run.slam.map().dense().blocks();
        stage.done(&format!("{fused} frames, {} left out, {blocks} blocks", run.skipped.len()));
        run.finish()
    }
}

/// The frames of a sequence, to be read again: their numbers are their indices.
struct Recording<'a>(&'a Sequence);

impl FrameSource for Recording<'_> {
    fn read(&mut self, frame: usize) -> Result<FrameImages, BoxedError> {
        Ok(self.0.images(frame)?.into_frame(self.0.intrinsics, self.0.depth_scale))
    }
}

/// A run under way.
struct Run<'a> {
    sequence: &'a Sequence,
    settings: &'a ScanSettings,
    slam: Slam<Recording<'a>>,
    size: Option<[usize; 2]>,
    /// What has left active memory is not seen by a ray: then each ray cast comes while its surroundings are still there.
    leaving: bool,
    resumed: usize,
    skipped: Vec<(usize, String)>,
    metrics: ScanMetrics,
    live: Option<Live>,
}

impl<'a> Run<'a> {
    fn new(folder: &Path, sequence: &'a Sequence, settings: &'a ScanSettings) -> Result<Self, ScanError> {
        let state = start::open(folder, sequence, settings)?;
        if settings.slam.device == Device::Gpu && !cfg!(feature = "gpu") {
            return Err(ScanError::NoGpu);
        }
        let resumed = state.next_frame;
        let slam_settings = SlamSettings {
            frame_interval: sequence.interval(),
            relocalise_first: settings.relocalise.is_some(),
            check_every: (settings.ray_cast_every / 2).max(1),
            ..settings.slam.clone()
        };
        let mut slam = Slam::with_source(slam_settings, state, Recording(sequence))?;
        slam.set_clock(|| ProcessTime::now().as_duration().as_secs_f64());
        if let Some(why) = slam.device_fallback() {
            say!("mapping on the processor: {why}");
        }
        for (stamp, rate) in &sequence.angular_rates {
            slam.angular_rate(*stamp, *rate)?;
        }
        let live = Live::open(&settings.live)?;
        if live.is_some() && slam.map().cpu().is_none() {
            eprintln!("warning: the mesh of a map on a GPU is not shown while it grows: use --device cpu");
        }
        Ok(Self {
            sequence,
            settings,
            slam,
            size: sequence.image_size,
            leaving: settings.slam.map.memory.host_bytes > 0,
            resumed,
            skipped: Vec::new(),
            metrics: ScanMetrics { loops: settings.slam.loops.is_some(), ..ScanMetrics::default() },
            live,
        })
    }

    fn due(&self, index: usize) -> bool {
        index.is_multiple_of(self.settings.ray_cast_every.max(1))
    }

    fn take(&mut self, index: usize) -> Result<(), ScanError> {
        let frame = &self.sequence.frames[index];
        match self.images(index) {
            Ok(images) => {
                let (intrinsics, scale) = (self.sequence.intrinsics, self.sequence.depth_scale);
                let (depth, colour) = (images.depth(intrinsics, scale), images.colour(intrinsics));
                let pose = frame.world_from_camera.as_ref();
                let outcome = self.slam.frame(frame.stamp, &depth, colour.as_ref(), pose)?;
                self.follow(outcome, &images)
            }
            Err(why) => {
                self.slam.reintegrate(self.settings.slam.reintegrated_per_frame)?;
                self.slam.skip(frame.stamp);
                self.skip(index, &why);
                Ok(())
            }
        }
    }

    /// The images of a frame, colour where the depth camera sees it.
    fn images(&mut self, index: usize) -> Result<Images, ScanError> {
        let frame = &self.sequence.frames[index];
        // Before the images are read: what has no pose costs no time.
        if self.settings.slam.poses == PoseSource::Given && frame.world_from_camera.is_none() {
            return Err(ScanError::NoPose(if frame.lost {
                "its recorded pose is not finite: the recorder had lost the camera"
            } else {
                "no pose was recorded for it; --poses tracked finds the poses itself"
            }));
        }
        // In the trajectory it must have one.
        Stamp::from_secs(frame.stamp).map_err(vio_ekf::Error::from)?;
        let mut images = self.sequence.images(index)?;
        let found = [images.width(), images.height()];
        let expected = *self.size.get_or_insert(found);
        if found != expected {
            let [found, expected] = [found, expected].map(|[width, height]| format!("{width} x {height}"));
            return Err(ScanError::OtherSize { found, expected });
        }
        if let Some(why) = images.colour_fault.take() {
            self.metrics.without_colour += 1;
            say!("without colour: {}: {why}", frame.depth);
        }
        Ok(images)
    }

    /// Says and counts what became of a frame.
    fn follow(&mut self, mut outcome: FrameOutcome, images: &Images) -> Result<(), ScanError> {
        let stamp = self.sequence.frames[outcome.frame].stamp;
        if let (Some(live), Some(tracking)) = (&mut self.live, &outcome.tracking) {
            live.tracking(stamp, tracking);
        }
        self.metrics.tracking_s.extend(outcome.tracking_seconds);
        let name = |frame: usize| self.sequence.frames[frame].depth.to_string();
        for event in std::mem::take(&mut outcome.events) {
            // Directions that are not seen are told once.
            let told = matches!(event, Event::Degenerate { .. }) && self.slam.statistics().degenerate_frames > 1;
            if let Some(line) = line(&event, &outcome, name).filter(|_| !told) {
                say!("{line}");
            }
            match event {
                Event::Placed(placed) => self.placed(&placed, outcome.frame, images)?,
                Event::LeftOut { frame, why } => {
                    self.skipped.retain(|(skipped, _)| *skipped != frame);
                    self.skip(frame, &fault(why, outcome.tracking.as_ref()));
                }
                Event::KeyframeRefused { frame, why } => self.skip(frame, &why.into()),
                Event::Corrected(correction) => {
                    let poses = self.slam.trajectory().iter().map(|(_, pose)| *pose).collect::<Vec<_>>();
                    if let Some(live) = &mut self.live {
                        live.corrected(stamp, &poses, &correction.deformation, self.slam.mesher());
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A frame has its pose: the one that was just read, or one of before that is read again where it is shown.
    fn placed(&mut self, placed: &PlacedFrame, present: usize, images: &Images) -> Result<(), ScanError> {
        let &PlacedFrame { frame, stamp, world_from_camera: pose, .. } = placed;
        self.skipped.retain(|(skipped, _)| *skipped != frame);
        self.metrics.integrate_s.extend(placed.fusion_seconds);
        if placed.report.is_some() && self.slam.map().cpu().is_some() {
            let start = ProcessTime::now();
            self.slam.update_mesh()?;
            self.metrics.mesh_update_s.push(start.elapsed().as_secs_f64());
        }
        let casts = self.leaving && self.due(frame);
        let again =
            (frame != present && (casts || self.live.is_some())).then(|| self.sequence.images(frame)).transpose()?;
        let images = again.as_ref().unwrap_or(images);
        if let Some(live) = &mut self.live {
            live.frame(stamp, &pose, images.colour(self.sequence.intrinsics).as_ref(), self.slam.mesher());
        }
        if casts {
            let map = self.slam.map_mut().dense_mut();
            self.metrics.ray_casts.extend(ray_cast_check(map, self.sequence, images, &pose)?);
        }
        Ok(())
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

    fn finish(mut self) -> Result<Scan, ScanError> {
        let fused: Vec<(usize, Isometry3<f64>)> = self.slam.frames().collect();
        if !self.leaving {
            let stage = Stage::start("ray cast");
            let due: Vec<_> = fused.iter().copied().filter(|(index, _)| self.due(*index)).collect();
            for (index, pose) in due {
                stage.share(index as f64 / self.sequence.frames.len() as f64);
                let images = Images::read(&self.sequence.frames[index])?;
                let map = self.slam.map_mut().dense_mut();
                self.metrics.ray_casts.extend(ray_cast_check(map, self.sequence, &images, &pose)?);
            }
            stage.done(&format!("{} ray casts", self.metrics.ray_casts.len()));
        }
        if let (Some(live), Some((index, _)), Some(_)) = (&self.live, fused.last(), self.slam.map().cpu()) {
            live.finished(self.sequence.frames[*index].stamp, self.slam.update_mesh()?);
        }
        self.live.take().map_or(Ok(()), Live::close)?;
        let stage = Stage::start("mesh");
        let start = ProcessTime::now();
        let mut mesh = self.slam.map().dense().mesh()?;
        if self.settings.least_triangles > 0 {
            mesh = mesh.without_small_components(self.settings.least_triangles);
        }
        self.metrics.mesh_s = start.elapsed().as_secs_f64();
        stage.done(&format!("{} vertices, {} triangles", mesh.positions.len(), mesh.faces.len()));
        let Self { sequence, settings, slam, resumed, skipped, mut metrics, .. } = self;
        let poses = settings.slam.poses;
        // Odometry is no truth to measure against.
        if poses == PoseSource::Tracked
            && let Some((error, ratio)) = tracked_error(sequence, &fused)
        {
            metrics.ate_se3_rmse = Some(error);
            metrics.fitting_depth_scale = ratio.map(|ratio| sequence.depth_scale / ratio);
        }
        metrics.quality = slam.quality().clone();
        metrics.camera_doubt = slam.camera_doubt();
        metrics.statistics = *slam.statistics();
        let device = slam.map().device().to_string();
        let state = slam.finish()?;
        let mut trajectory = Trajectory::default();
        for (stamp, pose) in &state.trajectory {
            trajectory.push(Stamp::from_secs(*stamp).map_err(vio_ekf::Error::from)?, *pose)?;
        }
        Ok(Scan { state, mesh, trajectory, fused, skipped, resumed, poses, device, metrics })
    }
}

/// The path grows or shrinks by so much, or the depth scale is not doubted (ours).
const LEAST_RATIO: f64 = 1.1;
/// And the tracked poses are off by more than recorded ones often are themselves, metres (ours).
const LEAST_ERROR: f64 = 0.02;

/// Of the frames that have a recorded pose, the error after rigid alignment, and what the recorded path is longer by if that explains most of
/// it; `None` where these do not fix an alignment: below three, or on one line.
fn tracked_error(sequence: &Sequence, fused: &[(usize, Isometry3<f64>)]) -> Option<(f64, Option<f64>)> {
    let recorded = |(index, pose): &(usize, Isometry3<f64>)| Some((sequence.frames[*index].world_from_camera?, *pose));
    let (given, tracked): (Vec<_>, Vec<_>) = fused.iter().filter_map(recorded).unzip();
    let [rigid, scaled] = [Alignment::Se3, Alignment::Sim3].map(|mode| ate(&given, &tracked, mode).ok());
    let (rigid, scaled) = (rigid?.position.rmse, scaled?);
    let ratio = scaled.reference_from_estimate.scaling();
    Some((rigid, is_wrong_scale(rigid, scaled.position.rmse, ratio).then_some(ratio)))
}

/// Whether another scale explains the error of the tracked poses: root mean squares as they are and with the scale, metres.
fn is_wrong_scale(rigid: f64, scaled: f64, ratio: f64) -> bool {
    rigid > LEAST_ERROR && 2.0 * scaled < rigid && ratio.max(1.0 / ratio) > LEAST_RATIO
}

#[cfg(test)]
mod tests {
    use super::is_wrong_scale;

    #[test]
    fn recorded_poses_that_are_a_centimetre_off_say_nothing_of_the_scale() {
        // A handful of frames with the right scale, and the same camera for seconds with a wrong one.
        assert!(!is_wrong_scale(0.009, 0.004, 0.79));
        assert!(is_wrong_scale(0.153, 0.008, 4.7) && is_wrong_scale(0.03, 0.008, 0.88));
        // Other errors.
        assert!(!is_wrong_scale(0.153, 0.1, 1.3) && !is_wrong_scale(0.03, 0.01, 1.05));
    }
}
