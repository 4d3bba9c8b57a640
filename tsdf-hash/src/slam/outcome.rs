//! What became of a frame, as values.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::report::FrameReport;
use crate::slam::camera_check::CameraDoubt;
use crate::slam::correction::Correction;
use crate::tracking::drift::Drift;
use crate::tracking::outcome::TrackingOutcome;

/// What became of a frame.
#[derive(Debug)]
pub struct FrameOutcome {
    /// Its number: frames are counted from 0, those that were left out or skipped included.
    pub frame: usize,
    /// Where it was taken, in the world of the map as it is now; `None` if it was left out.
    pub world_from_camera: Option<Isometry3<f64>>,
    /// What the tracker says of it; `None` for a given pose, for the first frame, and where the search for a lost camera has found nothing.
    pub tracking: Option<TrackingOutcome>,
    /// What happened, in this order.
    pub events: Vec<Event>,
    /// Time of tracking, relocalisation included, by [`Slam::set_clock`](crate::slam::Slam::set_clock).
    pub tracking_seconds: Option<f64>,
}

/// Something that happened with a frame.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// From this frame on the camera is lost.
    Lost,
    /// A lost camera is found again.
    Found,
    /// It was found by keyframes; that many frames of the time when it was lost have their poses now, too.
    Relocalised {
        /// Frames before this one, each [`Placed`](Self::Placed) or [`LeftOut`](Self::LeftOut) next.
        earlier: usize,
    },
    /// The frame does not fix all six directions of its pose. Odometry leads on along the others; without, the frame is
    /// [`LeftOut`](Self::LeftOut), and the next one is looked for where the motion before leads.
    Degenerate {
        /// Directions that are not fixed.
        directions: usize,
    },
    /// A frame has its pose, and is in the map if frames are fused: this one, or one from when the camera was lost.
    Placed(PlacedFrame),
    /// A frame is not in the map.
    LeftOut {
        /// Its number.
        frame: usize,
        /// Why.
        why: LeftOut,
    },
    /// Depth agrees with the map at the given poses to less than [`Quality::LEAST_AGREEMENT`](crate::slam::Quality::LEAST_AGREEMENT): camera, depth scale or poses are wrong.
    /// Said once.
    LowAgreement {
        /// Median of the shares of the pixels that agree.
        agreement: f64,
    },
    /// The frames fit each other clearly better with another camera: the map is bent. Said once.
    CameraDoubted(CameraDoubt),
    /// Less than [`Quality::LEAST_FUSED_SHARE`](crate::slam::Quality::LEAST_FUSED_SHARE) of the valid pixels were fused: neighbouring depths differ by more than the noise of the
    /// camera. Said once.
    LowFusedShare {
        /// The frame.
        frame: usize,
        /// Share of its valid pixels.
        share: f64,
    },
    /// The camera is back where a keyframe was taken.
    LoopClosed {
        /// The frame.
        frame: usize,
        /// The keyframe.
        keyframe: usize,
        /// The drift since then.
        drift: Box<Drift>,
        /// Its size at the camera, metres.
        distance: f64,
    },
    /// After a loop, keyframes agreed less by bundle adjustment than before: the poses are those of the pose graph.
    AdjustmentRefused {
        /// The frame.
        frame: usize,
    },
    /// The trajectory was corrected; the map follows with the next frames.
    Corrected(Correction),
    /// So many frames followed an earlier correction.
    Reintegrated {
        /// Frames that were taken out and fused anew.
        frames: usize,
    },
    /// A frame is in the map, but was not taken for a keyframe or compared with older ones.
    KeyframeRefused {
        /// Its number.
        frame: usize,
        /// Why.
        why: Error,
    },
}

/// A frame that has its pose.
#[derive(Debug, Clone)]
pub struct PlacedFrame {
    /// Its number.
    pub frame: usize,
    /// Seconds.
    pub stamp: f64,
    /// Where it was taken, before any later [`Event::Corrected`].
    pub world_from_camera: Isometry3<f64>,
    /// What it did to the map; `None` if frames are not fused.
    pub report: Option<FrameReport>,
    /// Time of its fusion, by [`Slam::set_clock`](crate::slam::Slam::set_clock).
    pub fusion_seconds: Option<f64>,
}

/// Why a frame is not in the map.
#[derive(Debug)]
#[non_exhaustive]
pub enum LeftOut {
    /// Poses are given, but none was.
    NoPose,
    /// The camera is lost.
    Lost {
        /// Places of the map that agree with the frames since: more frames tell them apart, or confirm the only one.
        places: usize,
    },
    /// Nothing fixes some directions of its pose: fused along a guess, it would bend the map.
    Degenerate {
        /// Directions that are not fixed.
        directions: usize,
    },
    /// It cannot be used.
    Refused(Error),
}

impl From<Error> for LeftOut {
    fn from(error: Error) -> Self {
        Self::Refused(error)
    }
}

/// What was counted over all frames of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SlamStatistics {
    /// Times that the camera was lost.
    pub losses: usize,
    /// Times that it was found by keyframes.
    pub relocalisations: usize,
    /// Frames that did not fix all six directions.
    pub degenerate_frames: usize,
    /// Those of them that were left out, because no odometry knew more.
    pub degenerate_left_out: usize,
    /// Loops that were found.
    pub loops: usize,
    /// Corrections of the trajectory.
    pub corrections: usize,
    /// Corrections whose bundle adjustment was not taken: it made keyframes agree less.
    pub adjustments_refused: usize,
    /// Frames that were taken out and fused anew, over all corrections.
    pub reintegrated: usize,
    /// Largest drift that was measured, metres.
    pub largest_drift: f64,
    /// Most bytes in active memory after a frame.
    pub active_bytes_peak: usize,
    /// Most bytes of evicted blocks in RAM after a frame.
    pub host_bytes_peak: usize,
}

impl SlamStatistics {
    pub(crate) fn count(&mut self, event: &Event) {
        match event {
            Event::Lost => self.losses += 1,
            Event::Relocalised { .. } => self.relocalisations += 1,
            Event::Degenerate { .. } => self.degenerate_frames += 1,
            Event::LeftOut { why: LeftOut::Degenerate { .. }, .. } => self.degenerate_left_out += 1,
            Event::LoopClosed { distance, .. } => {
                self.loops += 1;
                self.largest_drift = self.largest_drift.max(*distance);
            }
            Event::AdjustmentRefused { .. } => self.adjustments_refused += 1,
            Event::Corrected(_) => self.corrections += 1,
            _ => {}
        }
    }
}
