//! Where the pose of a frame comes from: the recording, or the tracker.

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::{
    ColourView, DepthView, KeyframeIndex, PosePrior, Tracker, TrackingOutcome, TrackingSettings, TrackingStatus,
};

use super::error::ScanError;
use super::map_store::MapStore;
use super::sequence::FrameFiles;

/// Which poses a run believes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseSource {
    /// Those recorded with the sequence.
    Given,
    /// Those that the tracker finds, from the first one that was recorded, or from the origin.
    Tracked,
}

/// What became of tracking.
#[derive(Debug, Clone, Default)]
pub struct TrackingMetrics {
    /// Processor time per tracked frame, ray cast of the model included, seconds.
    pub seconds: Vec<f64>,
    /// Frames that did not fix all six directions.
    pub degenerate: usize,
    /// Times that the camera was lost.
    pub losses: usize,
    /// Times that it was found by keyframes.
    pub relocalisations: usize,
}

/// Poses from the tracker: each frame against the map, from where the last two poses lead.
pub(super) struct Odometry {
    tracker: Tracker,
    last: Option<Isometry3<f64>>,
    before: Option<Isometry3<f64>>,
    lost: bool,
    /// Where the camera is at first is looked for, too.
    found_first: bool,
    pub(super) metrics: TrackingMetrics,
}

impl Odometry {
    pub(super) fn new(map: &tsdf_hash::Settings, found_first: bool) -> Result<Self, ScanError> {
        let settings = TrackingSettings { noise: map.noise, threads: map.threads, ..TrackingSettings::default() };
        let tracker = Tracker::new(settings)?;
        Ok(Self { tracker, last: None, before: None, lost: false, found_first, metrics: TrackingMetrics::default() })
    }

    /// Goes on from a pose.
    pub(super) fn start(&mut self, pose: Isometry3<f64>) {
        (self.last, self.before) = (Some(pose), None);
    }

    /// The map and all in it have moved.
    pub(super) fn move_by(&mut self, correction: &Isometry3<f64>) {
        for pose in [&mut self.last, &mut self.before].into_iter().flatten() {
            *pose = correction * *pose;
        }
    }

    /// The pose of a frame.
    pub(super) fn locate(
        &mut self,
        store: &mut MapStore,
        keyframes: &KeyframeIndex,
        frame: &FrameFiles,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Isometry3<f64>, ScanError> {
        if self.last.is_none() && !self.found_first {
            let first = frame.world_from_camera.unwrap_or_else(Isometry3::identity);
            self.start(first);
            return Ok(first);
        }
        let start = ProcessTime::now();
        let mut outcome = None;
        if let Some(last) = self.last {
            let onwards = self.before.map_or(last, |before| last * (before.inverse() * last));
            let mut tracked = self.track(store, depth, colour, onwards)?;
            if !tracked.is_tracked() && self.before.is_some() {
                // The camera may have stopped.
                tracked = self.track(store, depth, colour, last)?;
            }
            outcome = Some(tracked);
        }
        if outcome.as_ref().is_none_or(|outcome| !outcome.is_tracked())
            && let Some(found) = self.tracker.relocalise(store.dense(), depth, colour, keyframes)?
        {
            self.metrics.relocalisations += 1;
            outcome = Some(found);
            self.before = None;
            self.last = None;
        }
        self.metrics.seconds.push(start.elapsed().as_secs_f64());
        let Some(outcome) = outcome else {
            self.metrics.losses += usize::from(!std::mem::replace(&mut self.lost, true));
            return Err(ScanError::Lost("no keyframe of the map agrees with what it sees".into()));
        };
        self.note(frame, &outcome);
        if !outcome.is_tracked() {
            self.before = None;
            return Err(ScanError::Lost(reason(&outcome)));
        }
        // After a jump the last two poses are no motion.
        (self.before, self.last) = (self.last, Some(outcome.world_from_camera));
        Ok(outcome.world_from_camera)
    }

    fn track(
        &mut self,
        store: &mut MapStore,
        depth: &DepthView,
        colour: Option<&ColourView>,
        guess: Isometry3<f64>,
    ) -> Result<TrackingOutcome, ScanError> {
        let prior = PosePrior { world_from_camera: guess, covariance: None };
        Ok(self.tracker.track(store.dense(), depth, colour, &prior)?)
    }

    /// Counts, and says what changed.
    fn note(&mut self, frame: &FrameFiles, outcome: &TrackingOutcome) {
        let name = &frame.depth;
        if outcome.is_tracked() && !outcome.degenerate.is_empty() {
            self.metrics.degenerate += 1;
            if self.metrics.degenerate == 1 {
                let count = outcome.degenerate.len();
                eprintln!(
                    "warning: {name}: {count} of 6 directions are not seen; the motion before goes on along them"
                );
            }
        }
        match (self.lost, outcome.is_tracked()) {
            (false, false) => {
                self.metrics.losses += 1;
                eprintln!("warning: {name}: the camera is lost: {}", reason(outcome));
            }
            (true, true) => eprintln!("{name}: the camera is found again"),
            _ => {}
        }
        self.lost = !outcome.is_tracked();
    }
}

fn reason(outcome: &TrackingOutcome) -> String {
    let (overlap, agreement) = (100.0 * outcome.overlap, 100.0 * outcome.agreement);
    match outcome.status {
        TrackingStatus::NoOverlap => format!("only {overlap:.0} % of the map in view were measured"),
        TrackingStatus::Disagreement => format!("only {agreement:.0} % of the pixels agree with the map"),
        TrackingStatus::Rejected => "the motion is not plausible".into(),
        TrackingStatus::Tracked => "it is not".into(),
    }
}
