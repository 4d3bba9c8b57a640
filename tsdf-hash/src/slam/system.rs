//! The system: locate a frame, fuse it, look for loops, and let the map follow what they correct.

mod results;

use std::collections::VecDeque;

use nalgebra::{Isometry3, Vector3};

use crate::device_map::DeviceMap;
use crate::error::Error;
use crate::global_registration::GlobalRegistration;
use crate::images::{ColourView, DepthView, check_pose};
use crate::map::Map;
use crate::mesh::incremental::IncrementalMesher;
use crate::report::FrameReport;
use crate::slam::backend::Backend;
use crate::slam::camera_check::CameraCheck;
use crate::slam::correction::Correction;
use crate::slam::frame_memory::FrameMemory;
use crate::slam::frame_source::{FrameSource, read_again};
use crate::slam::frontend::{Frontend, Located};
use crate::slam::motion_model::StampedPose;
use crate::slam::outcome::{Event, FrameOutcome, LeftOut, PlacedFrame, SlamStatistics};
use crate::slam::quality::Quality;
use crate::slam::reintegration::Reintegration;
use crate::slam::settings::{PoseSource, SlamSettings};
use crate::slam::state::SlamState;
use crate::tracking::outcome::TrackingStatus;

/// Localises a depth camera, maps what it sees, and corrects both where it comes back.
///
/// Frame by frame, without files or threads of its own; what happens is told by values. Frames that may be looked at again, after a loop
/// was closed or a lost camera is found, come from a [`FrameSource`]: unless another one is given, they are kept in memory.
///
/// ```
/// use nalgebra::Isometry3;
/// use tsdf_hash::slam::{PoseSource, Slam, SlamSettings};
/// use tsdf_hash::{DepthData, DepthView, Intrinsics};
///
/// let depth = vec![1.5_f32; 160 * 120];
/// let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
/// let view = DepthView { width: 160, height: 120, data: DepthData::F32 { data: &depth }, intrinsics };
/// let mut slam = Slam::new(SlamSettings { poses: PoseSource::Given, ..SlamSettings::default() })?;
/// for k in 0..3 {
///     let pose = Isometry3::translation(0.02 * f64::from(k), 0.0, 0.0);
///     let outcome = slam.frame(f64::from(k) / 30.0, &view, None, Some(&pose))?;
///     assert_eq!(outcome.world_from_camera, Some(pose));
/// }
/// let state = slam.finish()?;
/// assert_eq!((state.trajectory.len(), state.map.mesh().faces.is_empty()), (3, false));
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
pub struct Slam<S = FrameMemory> {
    settings: SlamSettings,
    map: DeviceMap,
    fallback: Option<Error>,
    mesher: IncrementalMesher,
    /// `None` where poses are given.
    frontend: Option<Frontend>,
    backend: Backend,
    /// From the world of the given poses to that of the map.
    correction: Isometry3<f64>,
    source: S,
    next_frame: usize,
    last_stamp: f64,
    trajectory: Vec<(f64, Isometry3<f64>)>,
    /// Numbers of the frames of this run that have a pose, which are the last of the trajectory.
    frames: Vec<usize>,
    reintegration: Reintegration,
    /// Numbers and stamps of the frames since the camera was lost.
    lost: VecDeque<(usize, f64)>,
    quality: Quality,
    camera_check: CameraCheck,
    statistics: SlamStatistics,
    clock: Option<fn() -> f64>,
}

impl Slam {
    /// An empty map; frames that may be read again are kept in memory.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], and those of [`DeviceMap::open`].
    pub fn new(settings: SlamSettings) -> Result<Self, Error> {
        let map = Map::new(settings.map)?;
        Self::with_source(settings, SlamState::new(map), FrameMemory::new())
    }
}

impl<S: FrameSource> Slam<S> {
    /// Goes on from a state, whose map's settings take the place of [`SlamSettings::map`], with a source of frames.
    ///
    /// # Errors
    /// As [`Slam::new`].
    pub fn with_source(settings: SlamSettings, state: SlamState, source: S) -> Result<Self, Error> {
        settings.check()?;
        let SlamState { map, keyframes, trajectory, last_stamp, next_frame, frontend: stored } = state;
        let map_settings = *map.settings();
        let mut frontend = match settings.poses {
            PoseSource::Given => None,
            PoseSource::Tracked | PoseSource::Odometry(_) => Some(Frontend::new(&settings, &map_settings)?),
        };
        match (&mut frontend, stored, trajectory.last()) {
            (Some(frontend), Some(stored), _) => frontend.restore(&stored),
            (Some(frontend), None, Some((_, last))) => frontend.start(*last),
            _ => {}
        }
        let (map, fallback) = DeviceMap::open(map, settings.device)?;
        let backend = match () {
            #[cfg(feature = "pose-graph")]
            () if settings.loops.is_some() => {
                use crate::loop_closure::settings::LoopSettings;
                use crate::slam::loop_correction::LoopCorrection;
                let (noise, threads) = (map_settings.noise, map_settings.threads);
                let loops = LoopSettings { noise, threads, ..settings.loops.unwrap_or_default() };
                Backend::Loops(Box::new(LoopCorrection::new(loops)?))
            }
            () => Backend::Keyframes(keyframes),
        };
        Ok(Self {
            settings,
            map,
            fallback,
            mesher: IncrementalMesher::new(),
            frontend,
            backend,
            correction: Isometry3::identity(),
            source,
            next_frame,
            last_stamp,
            trajectory,
            frames: Vec::new(),
            reintegration: Reintegration::default(),
            lost: VecDeque::new(),
            quality: Quality::default(),
            camera_check: CameraCheck::default(),
            statistics: SlamStatistics::default(),
            clock: None,
        })
    }

    /// Takes the next frame: the system's step.
    ///
    /// `stamp` is in seconds and increases; `colour` is registered to `depth`. `prior` is the camera's pose, with [`PoseSource::Odometry`] in
    /// a world of its own; with [`PoseSource::Tracked`] only that of the first frame counts, and the origin without one.
    ///
    /// A frame that cannot be used is left out, and the outcome says why.
    ///
    /// # Errors
    /// What keeps the map from following its trajectory: [`Error::FrameSource`], or a map that refuses a frame at its corrected pose. The
    /// frame is still to be moved then, and the next call tries again.
    pub fn frame(
        &mut self,
        stamp: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: Option<&Isometry3<f64>>,
    ) -> Result<FrameOutcome, Error> {
        let frames = self.reintegrate(self.settings.reintegrated_per_frame)?;
        let last = self.last_stamp;
        let frame = self.skip(stamp);
        let mut outcome =
            FrameOutcome { frame, world_from_camera: None, tracking: None, events: Vec::new(), tracking_seconds: None };
        if frames > 0 {
            outcome.events.push(Event::Reintegrated { frames });
        }
        let located = if stamp.is_finite() && stamp > last {
            self.locate(StampedPose { stamp, world_from_camera: prior.copied() }, depth, colour, &mut outcome)
        } else {
            Err(Error::InvalidTime { time: stamp, last }.into())
        };
        match located {
            Ok((pose, earlier)) => self.place_all(pose, &earlier, stamp, depth, colour, &mut outcome),
            Err(why) => outcome.events.push(Event::LeftOut { frame, why }),
        }
        outcome.events.iter().for_each(|event| self.statistics.count(event));
        Ok(outcome)
    }

    /// Counts a frame that cannot be read, so that numbers stay those of the recording. Returns its number.
    pub fn skip(&mut self, stamp: f64) -> usize {
        if stamp.is_finite() {
            self.last_stamp = self.last_stamp.max(stamp);
        }
        self.next_frame += 1;
        self.next_frame - 1
    }

    /// The pose of a frame, and of those before it that have theirs only now.
    fn locate(
        &mut self,
        frame: StampedPose,
        depth: &DepthView,
        colour: Option<&ColourView>,
        outcome: &mut FrameOutcome,
    ) -> Result<(Isometry3<f64>, Vec<Isometry3<f64>>), LeftOut> {
        let Some(frontend) = &mut self.frontend else {
            let pose = self.correction * frame.world_from_camera.ok_or(LeftOut::NoPose)?;
            check_pose(&pose)?;
            let every = self.settings.check_every;
            if every > 0 && outcome.frame.is_multiple_of(every) && self.map.dense().blocks() > 0 {
                outcome.events.extend(self.quality.check(self.map.dense_mut(), depth, &pose)?);
            }
            return Ok((pose, Vec::new()));
        };
        let start = self.clock.map(|clock| clock());
        let located = frontend.locate(self.map.dense_mut(), self.backend.keyframes(), &frame, depth, colour)?;
        let Located { world_from_camera, earlier, tracking, events } = located;
        outcome.tracking_seconds = self.clock.zip(start).map(|(clock, start)| clock() - start);
        outcome.tracking = tracking;
        outcome.events.extend(events);
        if let Some(pose) = world_from_camera {
            return Ok((pose, earlier));
        }
        let (places, remembered) = (frontend.places(), frontend.remembered());
        if let Some(tracking) = outcome.tracking.as_ref().filter(|t| t.status == TrackingStatus::Degenerate) {
            let directions = tracking.degenerate.len();
            while !self.lost.is_empty() {
                self.forget_lost();
            }
            return Err(LeftOut::Degenerate { directions });
        }
        if self.settings.fuse {
            self.source.store(outcome.frame, depth, colour);
        }
        self.lost.push_back((outcome.frame, frame.stamp));
        while self.lost.len() > remembered {
            self.forget_lost();
        }
        Err(LeftOut::Lost { places })
    }

    fn forget_lost(&mut self) {
        if let Some((frame, _)) = self.lost.pop_front()
            && self.settings.fuse
        {
            self.source.discard(frame);
        }
    }

    /// Takes the frames that were lost and have their poses now, then the present one; where one closes a loop, the others move along.
    fn place_all(
        &mut self,
        pose: Isometry3<f64>,
        earlier: &[Isometry3<f64>],
        stamp: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        outcome: &mut FrameOutcome,
    ) {
        let mut moved = Isometry3::identity();
        while self.lost.len() > earlier.len() {
            self.forget_lost();
        }
        for ((frame, stamp), pose) in std::mem::take(&mut self.lost).into_iter().zip(earlier) {
            let events = &mut outcome.events;
            let placed = if self.settings.fuse {
                read_again(&mut self.source, frame).and_then(|images| {
                    let (depth, colour) = (images.depth(), images.colour());
                    self.place(frame, stamp, &depth, colour.as_ref(), &(moved * pose), events)
                })
            } else {
                self.place(frame, stamp, depth, colour, &(moved * pose), events)
            };
            match placed {
                Ok(present) => moved = present * moved,
                Err(why) => events.push(Event::LeftOut { frame, why: why.into() }),
            }
            if self.settings.fuse && !self.backend.closes_loops() {
                self.source.discard(frame);
            }
        }
        if self.backend.closes_loops() {
            self.source.store(outcome.frame, depth, colour);
        }
        let pose = moved * pose;
        match self.place(outcome.frame, stamp, depth, colour, &pose, &mut outcome.events) {
            Ok(present) => outcome.world_from_camera = Some(present * pose),
            Err(why) => outcome.events.push(Event::LeftOut { frame: outcome.frame, why: why.into() }),
        }
    }

    /// Fuses a frame, keeps its pose, and looks for loops; returns what the present moves by. A frame that is refused leaves no trace.
    fn place(
        &mut self,
        frame: usize,
        stamp: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        events: &mut Vec<Event>,
    ) -> Result<Isometry3<f64>, Error> {
        let mut full = Vec::new();
        let (report, fusion_seconds) =
            if self.settings.fuse { self.fuse(depth, colour, pose, &mut full)? } else { (None, None) };
        if let Some(report) = &report {
            events.extend(self.quality.count(frame, depth.width * depth.height, report));
            self.count_bytes();
            if self.camera_check.add(depth, pose) {
                events.extend(self.camera_doubt().map(Event::CameraDoubted));
            }
        }
        self.reintegration.met_full(self.frames.len(), full);
        self.frames.push(frame);
        self.trajectory.push((stamp, *pose));
        events.push(Event::Placed(PlacedFrame { frame, stamp, world_from_camera: *pose, report, fusion_seconds }));
        if !self.settings.fuse {
            return Ok(Isometry3::identity());
        }
        match self.backend.add(frame, depth, colour, pose, events) {
            Ok(None) => Ok(Isometry3::identity()),
            Ok(Some(correction)) => {
                self.correct(&correction);
                let present = correction.present;
                events.push(Event::Corrected(correction));
                Ok(present)
            }
            Err(why) => {
                events.push(Event::KeyframeRefused { frame, why });
                Ok(Isometry3::identity())
            }
        }
    }

    /// Into the map, and into the local one; both or none. With the time of the former, and the blocks that it found full.
    fn fuse(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        full: &mut Vec<[i32; 3]>,
    ) -> Result<(Option<FrameReport>, Option<f64>), Error> {
        let start = self.clock.map(|clock| clock());
        let report = self.map.dense_mut().integrate_where_room(depth, colour, pose, full)?;
        let seconds = self.clock.zip(start).map(|(clock, start)| clock() - start);
        if let Some(frontend) = &mut self.frontend
            && let Err(refusal) = frontend.fused(depth, colour, pose, self.backend.keyframes().len())
        {
            self.map.dense_mut().deintegrate_except(depth, colour, pose, full)?;
            return Err(refusal);
        }
        Ok((Some(report), seconds))
    }

    fn count_bytes(&mut self) {
        let statistics = &mut self.statistics;
        let memory = self.map.memory();
        statistics.active_bytes_peak = statistics.active_bytes_peak.max(memory.active_bytes);
        statistics.host_bytes_peak = statistics.host_bytes_peak.max(memory.host_bytes);
    }

    /// Moves the frames to their corrected poses; the map follows with the next frames.
    fn correct(&mut self, correction: &Correction) {
        let voxel_size = self.map.dense().settings().voxel_size;
        let earlier = self.trajectory.len() - self.frames.len();
        for (k, (_, old)) in self.trajectory[earlier..].iter_mut().enumerate() {
            if let Some(pose) = correction.moved(k, old, voxel_size) {
                self.reintegration.moved(k, std::mem::replace(old, pose));
            }
        }
        self.correction = correction.present * self.correction;
        if let Some(frontend) = &mut self.frontend {
            frontend.move_by(&correction.present);
        }
    }

    /// Lets the map follow the last corrections by at most so many frames; returns how many there were. [`frame`](Self::frame) does it with
    /// [`SlamSettings::reintegrated_per_frame`].
    ///
    /// # Errors
    /// As [`frame`](Self::frame).
    pub fn reintegrate(&mut self, most: usize) -> Result<usize, Error> {
        let earlier = self.trajectory.len() - self.frames.len();
        let (frames, trajectory) = (&self.frames, &self.trajectory);
        let fused = |k: usize| (frames[k], trajectory[earlier + k].1);
        let done = self.reintegration.work(self.map.dense_mut(), &mut self.source, fused, most)?;
        self.statistics.reintegrated += done;
        Ok(done)
    }

    /// Takes a sample of a gyroscope on the camera: seconds, on the clock of the frames, and the angular rate along the camera's axes, rad/s.
    /// Samples come before the first frame that is not earlier. Between frames the camera is then taken to turn as they say. Where poses
    /// are given, samples are not needed.
    ///
    /// # Errors
    /// As [`Gyroscope::add`](crate::slam::Gyroscope::add).
    pub fn angular_rate(&mut self, stamp: f64, rate_in_camera: Vector3<f64>) -> Result<(), Error> {
        self.frontend.as_mut().map_or(Ok(()), |frontend| frontend.gyroscope().add(stamp, rate_in_camera))
    }

    /// Looks for a lost camera by the shape of the map, too, where keyframes do not show it; see [`Relocaliser::set_surface`]. Where poses are
    /// given, none is looked for.
    ///
    /// [`Relocaliser::set_surface`]: crate::tracking::Relocaliser::set_surface
    pub fn set_surface(&mut self, surface: GlobalRegistration) {
        if let Some(frontend) = &mut self.frontend {
            frontend.relocaliser().set_surface(surface);
        }
    }

    /// The vertical along the axes of the camera that takes the next frame, for that; of any length.
    pub fn set_vertical(&mut self, up_in_camera: Vector3<f64>) {
        if let Some(frontend) = &mut self.frontend {
            frontend.relocaliser().set_vertical(up_in_camera);
        }
    }

    /// Lets outcomes say how long tracking and fusion took, by a clock of the caller's: seconds since any moment.
    pub fn set_clock(&mut self, clock: fn() -> f64) {
        self.clock = Some(clock);
    }
}
