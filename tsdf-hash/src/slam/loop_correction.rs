//! Loops found keyframe by keyframe, and what each frame of the run moves by when one is closed.

use nalgebra::{Isometry3, Point3};

use crate::error::Error;
use crate::images::{ColourView, DepthData, DepthView};
use crate::keyframes::index::KeyframeIndex;
use crate::loop_closure::closer::LoopCloser;
use crate::loop_closure::report::LoopReport;
use crate::loop_closure::settings::LoopSettings;
use crate::mesh::deformation::EmbeddedDeformation;
use crate::slam::correction::Correction;
use crate::slam::outcome::Event;

/// What is farther away is no depth, metres: 16 bits say so where nothing was measured.
const FARTHEST: f64 = 30.0;

/// Looks for loops while the map grows.
pub(crate) struct LoopCorrection {
    closer: LoopCloser,
    /// For each fused frame of the run: the keyframe that it belongs to, and where it is from there.
    owners: Vec<(usize, Isometry3<f64>)>,
    /// What each keyframe looks at, from there.
    sights: Vec<Point3<f64>>,
}

impl LoopCorrection {
    pub(crate) fn new(settings: LoopSettings) -> Result<Self, Error> {
        Ok(Self { closer: LoopCloser::new(settings)?, owners: Vec::new(), sights: Vec::new() })
    }

    pub(crate) fn keyframes(&self) -> &KeyframeIndex {
        self.closer.keyframes()
    }

    /// Takes a frame that was fused at a pose, the next of the run. If the trajectory was corrected: the new pose of each fused frame.
    pub(crate) fn add(
        &mut self,
        frame: usize,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        events: &mut Vec<Event>,
    ) -> Result<Option<Correction>, Error> {
        let report = match self.closer.add(depth, colour, pose) {
            Ok(report) => report,
            Err(why) => {
                // It belongs to the keyframe before, or moves with the first one.
                let owner = self.closer.poses().len().saturating_sub(1);
                let keyframe = self.closer.poses().get(owner).copied().unwrap_or(*pose);
                self.owners.push((owner, keyframe.inverse() * pose));
                return Err(why);
            }
        };
        let (poses, owner) = (self.closer.poses(), self.closer.poses().len().saturating_sub(1));
        self.sights.resize(poses.len(), sight(depth));
        tell(frame, pose, &report, events);
        let then = report.corrected_from.as_deref().unwrap_or(poses);
        self.owners.push((owner, then[owner].inverse() * pose));
        let Some(before) = &report.corrected_from else { return Ok(None) };
        let frames = self.owners.iter().map(|(owner, from_there)| {
            let mut pose = poses[*owner] * from_there;
            pose.rotation.renormalize();
            pose
        });
        let places = self.sights.iter().zip(before).zip(poses);
        let places = places.map(|((sight, before), after)| (before * sight, after * before.inverse()));
        Ok(Some(Correction {
            frames: frames.collect(),
            present: poses[owner] * before[owner].inverse(),
            deformation: EmbeddedDeformation::new(places.collect()),
        }))
    }
}

fn tell(frame: usize, pose: &Isometry3<f64>, report: &LoopReport, events: &mut Vec<Event>) {
    if report.adjustment.is_some_and(|adjustment| !adjustment.taken) {
        events.push(Event::AdjustmentRefused { frame });
    }
    events.extend(report.loops.iter().map(|found| Event::LoopClosed {
        frame,
        keyframe: found.old,
        drift: Box::new(found.drift.clone()),
        distance: found.drift.distance(pose),
    }));
}

/// The point in the middle of the picture, as deep as what is seen is in the mean.
fn sight(depth: &DepthView) -> Point3<f64> {
    let metres: Vec<f64> = match depth.data {
        DepthData::U16 { data, scale } => data.iter().map(|d| f64::from(*d) / scale).collect(),
        DepthData::F32 { data } => data.iter().map(|d| f64::from(*d)).collect(),
    };
    let seen = || metres.iter().filter(|z| z.is_finite() && **z > 0.0 && **z < FARTHEST);
    Point3::new(0.0, 0.0, seen().sum::<f64>() / seen().count().max(1) as f64)
}
