//! The keyframes of a run: collected to find a lost camera by, or watched for loops, too.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::images::{ColourView, DepthView};
use crate::keyframes::index::KeyframeIndex;
use crate::slam::correction::Correction;
#[cfg(feature = "pose-graph")]
use crate::slam::loop_correction::LoopCorrection;
use crate::slam::outcome::Event;

/// What becomes of the frames that were fused.
pub(crate) enum Backend {
    /// Keyframes alone.
    Keyframes(KeyframeIndex),
    /// Loops are looked for.
    #[cfg(feature = "pose-graph")]
    Loops(Box<LoopCorrection>),
}

impl Backend {
    pub(crate) fn keyframes(&self) -> &KeyframeIndex {
        match self {
            Self::Keyframes(keyframes) => keyframes,
            #[cfg(feature = "pose-graph")]
            Self::Loops(loops) => loops.keyframes(),
        }
    }

    pub(crate) fn closes_loops(&self) -> bool {
        !matches!(self, Self::Keyframes(_))
    }

    /// Takes a frame that was fused, the next of the run.
    #[cfg_attr(
        not(feature = "pose-graph"),
        expect(unused_variables, reason = "loops need the frame's number and events")
    )]
    pub(crate) fn add(
        &mut self,
        frame: usize,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        events: &mut Vec<Event>,
    ) -> Result<Option<Correction>, Error> {
        match self {
            Self::Keyframes(keyframes) => keyframes.add(depth, colour, pose).map(|_| None),
            #[cfg(feature = "pose-graph")]
            Self::Loops(loops) => loops.add(frame, depth, colour, pose, events),
        }
    }
}
