//! Where the pose of a frame comes from: the recording, or the tracker.

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::{
    ColourView, DepthView, KeyframeIndex, PosePrior, Relocaliser, Tracker, TrackingOutcome, TrackingSettings,
    TrackingStatus,
};

use super::error::ScanError;
use super::gyroscope::Gyroscope;
use super::map_store::MapStore;
use super::prediction::{OdometryError, Prediction};
use super::recent_map::RecentMap;
use super::sequence::FrameFiles;

/// Least share of a frame that a map must account for where it does not grow (ours).
const LEAST_COVERAGE: f64 = 0.4;

/// Which poses a run believes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseSource {
    /// Those recorded with the sequence.
    Given,
    /// Those that the tracker finds, from the first one that was recorded, or from the origin.
    Tracked,
    /// Those that the tracker finds, led from frame to frame by the motion between those recorded.
    Odometry(OdometryError),
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

/// Where a frame was taken.
pub(super) struct Located {
    pub(super) world_from_camera: Isometry3<f64>,
    /// Where the lost frames before it were taken, the latest last: as many as are sure now.
    pub(super) earlier: Vec<Isometry3<f64>>,
}

/// Least agreement of a frame with a map that stays as it is (ours): of real recordings, frames that were placed within seven
/// centimetres agreed by 83 % or more, those that were off by more by 77 % or less.
const FIXED_MAP_AGREEMENT: f64 = 0.8;

/// Poses from the tracker: each frame against the map, from where the poses before lead.
pub(super) struct CameraTracker {
    tracker: Tracker,
    relocaliser: Relocaliser,
    /// Tracked against instead of the whole map, where loops are looked for.
    recent: Option<RecentMap>,
    prediction: Prediction,
    lost: bool,
    /// Where the camera is at first is looked for, too.
    found_first: bool,
    /// Nothing is fused.
    fixed_map: bool,
    /// Of the present frame; `None` before the first one that was tracked.
    pub(super) outcome: Option<TrackingOutcome>,
    pub(super) metrics: TrackingMetrics,
}

impl CameraTracker {
    pub(super) fn new(
        map: &tsdf_hash::Settings,
        odometry: Option<OdometryError>,
        gyroscope: Option<Gyroscope>,
        found_first: bool,
        fixed_map: bool,
        loops: bool,
        interval: f64,
    ) -> Result<Self, ScanError> {
        let settings = TrackingSettings { noise: map.noise, threads: map.threads, ..TrackingSettings::default() };
        // What is not fused does not grow the map: a camera that leaves it agrees less and less, and is led astray by what is left.
        let min_agreement = if fixed_map { FIXED_MAP_AGREEMENT } else { settings.min_agreement };
        Ok(Self {
            tracker: Tracker::new(TrackingSettings { min_agreement, ..settings })?,
            relocaliser: Relocaliser::new(settings)?,
            recent: loops.then(|| RecentMap::new(map)),
            prediction: Prediction::new(odometry, gyroscope, interval),
            lost: false,
            found_first,
            fixed_map,
            outcome: None,
            metrics: TrackingMetrics::default(),
        })
    }

    /// Goes on from a pose.
    pub(super) fn start(&mut self, pose: Isometry3<f64>) {
        self.prediction.start(pose, None);
    }

    /// A frame was fused, when the run had so many keyframes.
    pub(super) fn fused(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        keyframes: usize,
    ) -> Result<(), ScanError> {
        let Some(recent) = &mut self.recent else { return Ok(()) };
        Ok(recent.fuse(depth, colour, pose, keyframes)?)
    }

    /// The map and all in it have moved.
    pub(super) fn move_by(&mut self, correction: &Isometry3<f64>) {
        if let Some(recent) = &mut self.recent {
            recent.move_by(correction);
        }
        self.prediction.move_by(correction);
    }

    /// The pose of a frame.
    pub(super) fn locate(
        &mut self,
        store: &mut MapStore,
        keyframes: &KeyframeIndex,
        frame: &FrameFiles,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Located, ScanError> {
        if self.prediction.is_empty() && !self.found_first {
            let first = frame.world_from_camera.unwrap_or_else(Isometry3::identity);
            self.prediction.start(first, Some(frame));
            return Ok(Located { world_from_camera: first, earlier: Vec::new() });
        }
        let start = ProcessTime::now();
        let tracked = self.follow(store, frame, depth, colour)?;
        let (outcome, earlier) = match tracked {
            Some(outcome) if outcome.is_tracked() => {
                self.relocaliser.reset();
                (Some(outcome), Vec::new())
            }
            tracked => match self.relocaliser.add(store.dense(), depth, colour, keyframes)? {
                Some(found) => {
                    self.metrics.relocalisations += 1;
                    self.prediction.forget();
                    self.recent.iter_mut().for_each(RecentMap::forget);
                    (Some(found.outcome), found.earlier)
                }
                None => (tracked, Vec::new()),
            },
        };
        self.metrics.seconds.push(start.elapsed().as_secs_f64());
        let Some(outcome) = outcome else {
            self.metrics.losses += usize::from(!std::mem::replace(&mut self.lost, true));
            return Err(ScanError::Lost(self.search_state().into()));
        };
        let was_lost = self.lost;
        self.note(frame, &outcome);
        self.outcome = Some(outcome.clone());
        if !outcome.is_tracked() {
            self.prediction.lost(frame);
            return Err(ScanError::Lost(format!("{}; {}", reason(&outcome), self.search_state())));
        }
        // After a jump the last two poses are no motion, but what led to the place where it is found is one.
        self.prediction.found(&outcome, earlier.last().copied(), frame, was_lost);
        Ok(Located { world_from_camera: outcome.world_from_camera, earlier })
    }

    /// How far the search for a lost camera has come.
    fn search_state(&self) -> &'static str {
        match self.relocaliser.places() {
            0 => "no keyframe of the map agrees with what it sees",
            1 => "a place agrees; more frames, from other poses, must confirm it",
            _ => "several places agree; more frames must tell them apart",
        }
    }

    /// Tracks a frame from where the poses before lead; `None` before the first.
    fn follow(
        &mut self,
        store: &mut MapStore,
        frame: &FrameFiles,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Option<TrackingOutcome>, ScanError> {
        let mut tracked = None;
        // A lost camera has moved, nobody knows where, unless odometry does, and one that skipped frames: what would do from one frame to the
        // next is not enough.
        let is_guess = (self.lost && !self.prediction.is_led(frame)) || self.prediction.is_gap(frame);
        for prior in self.prediction.priors(frame) {
            let outcome = self.track(store, depth, colour, &prior, is_guess)?;
            let found = outcome.is_tracked();
            tracked = Some(outcome);
            if found {
                break;
            }
        }
        Ok(tracked)
    }

    fn track(
        &mut self,
        store: &mut MapStore,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: &PosePrior,
        is_guess: bool,
    ) -> Result<TrackingOutcome, ScanError> {
        let recent = self.recent.as_mut().and_then(RecentMap::older);
        let (map, world_from_map) = recent.unwrap_or_else(|| (store.dense(), Isometry3::identity()));
        let there = prior.seen_from(&world_from_map.inverse());
        let mut outcome = self.tracker.track(map, depth, colour, &there)?.seen_from(&world_from_map);
        // A map that does not grow is left sooner or later: what little of it is in view then leads anywhere.
        if self.fixed_map && (outcome.coverage < LEAST_COVERAGE || !outcome.degenerate.is_empty()) {
            outcome.status = TrackingStatus::NoOverlap;
        }
        if is_guess && outcome.agreement < self.tracker.settings().relocalise_agreement {
            outcome.status = TrackingStatus::Disagreement;
        }
        Ok(outcome)
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
        TrackingStatus::NoOverlap => {
            let coverage = 100.0 * outcome.coverage;
            format!(
                "{overlap:.0} % of the map in view were measured, {coverage:.0} % of the frame are in the map: too little"
            )
        }
        TrackingStatus::Disagreement => format!("only {agreement:.0} % of the pixels agree with the map"),
        TrackingStatus::Rejected => "the motion is not plausible".into(),
        TrackingStatus::Tracked => "it is not".into(),
    }
}
