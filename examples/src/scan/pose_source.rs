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
}

/// Poses from the tracker: each frame against the map, from where the last two poses lead.
pub(super) struct Odometry {
    tracker: Tracker,
    last: Option<Isometry3<f64>>,
    before: Option<Isometry3<f64>>,
    lost: bool,
    keyframes: KeyframeIndex,
    pub(super) metrics: TrackingMetrics,
}

impl Odometry {
    pub(super) fn new(map: &tsdf_hash::Settings) -> Result<Self, ScanError> {
        let settings = TrackingSettings { noise: map.noise, threads: map.threads, ..TrackingSettings::default() };
        let tracker = Tracker::new(settings)?;
        Ok(Self {
            tracker,
            last: None,
            before: None,
            lost: false,
            keyframes: KeyframeIndex::new(),
            metrics: TrackingMetrics::default(),
        })
    }

    /// Goes on from a pose.
    pub(super) fn start(&mut self, pose: Isometry3<f64>) {
        (self.last, self.before) = (Some(pose), None);
    }

    /// The pose of a frame.
    pub(super) fn locate(
        &mut self,
        store: &mut MapStore,
        frame: &FrameFiles,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Isometry3<f64>, ScanError> {
        let Some(last) = self.last else {
            let first = frame.world_from_camera.unwrap_or_else(Isometry3::identity);
            self.start(first);
            self.keyframes.add(depth, colour, &first)?;
            return Ok(first);
        };
        let start = ProcessTime::now();
        let onwards = self.before.map_or(last, |before| last * (before.inverse() * last));
        let mut outcome = self.track(store, depth, colour, onwards)?;
        if !outcome.is_tracked() && self.before.is_some() {
            // The camera may have stopped.
            outcome = self.track(store, depth, colour, last)?;
        }
        if !outcome.is_tracked()
            && let Some(found) = self.tracker.relocalise(store.dense(), depth, colour, &mut self.keyframes)?
        {
            outcome = found;
            self.before = None;
            self.last = None;
        }
        self.metrics.seconds.push(start.elapsed().as_secs_f64());
        self.note(frame, &outcome);
        if !outcome.is_tracked() {
            self.before = None;
            return Err(ScanError::Lost(reason(&outcome)));
        }
        // After a jump the last two poses are no motion.
        (self.before, self.last) = (self.last, Some(outcome.world_from_camera));
        self.keyframes.add(depth, colour, &outcome.world_from_camera)?;
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
        let name = frame.depth.display();
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
