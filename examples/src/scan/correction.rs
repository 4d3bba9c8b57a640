//! Loops of a run: found keyframe by keyframe, and the map that follows the corrected poses.

use nalgebra::{Isometry3, Point3};
use tsdf_hash::{ColourView, DepthData, DepthView, EmbeddedDeformation, LoopCloser, LoopReport, LoopSettings};

use super::error::ScanError;

/// Frames that move by less are not fused anew: a share of a voxel, and radians.
const LEAST_MOTION: [f64; 2] = [0.25, 8.7e-4];

/// What is farther away is no depth, metres: 16 bits say so where nothing was measured.
const FARTHEST: f64 = 30.0;

/// What became of the loops of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoopMetrics {
    /// Keyframes.
    pub keyframes: usize,
    /// Loops that were found.
    pub loops: usize,
    /// Corrections of the trajectory.
    pub corrections: usize,
    /// Corrections whose bundle adjustment was not taken: it made keyframes agree less.
    pub adjustments_refused: usize,
    /// Frames that were fused anew, over all corrections.
    pub refused: usize,
    /// Largest drift that was measured, metres.
    pub largest_drift: f64,
}

/// Looks for loops while the map grows.
pub(super) struct Loops {
    closer: LoopCloser,
    /// For each fused frame of the run: the keyframe that it belongs to, and where it is from there.
    owners: Vec<(usize, Isometry3<f64>)>,
    /// What each keyframe looks at, from there.
    sights: Vec<Point3<f64>>,
    pub(super) metrics: LoopMetrics,
}

impl Loops {
    pub(super) fn new(map: &tsdf_hash::Settings) -> Result<Self, ScanError> {
        let settings = LoopSettings { noise: map.noise, threads: map.threads, ..LoopSettings::default() };
        Ok(Self {
            closer: LoopCloser::new(settings)?,
            owners: Vec::new(),
            sights: Vec::new(),
            metrics: LoopMetrics::default(),
        })
    }

    pub(super) fn keyframes(&self) -> &tsdf_hash::KeyframeIndex {
        self.closer.keyframes()
    }

    /// Takes a frame that was fused at a pose. If the trajectory was corrected: the new pose of each fused frame, given their old ones.
    pub(super) fn add(
        &mut self,
        name: &str,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
    ) -> Result<Option<Correction>, ScanError> {
        let report = self.closer.add(depth, colour, pose)?;
        self.metrics.keyframes = self.closer.poses().len();
        self.sights.resize(self.metrics.keyframes, sight(depth));
        self.note(name, pose, &report);
        let (poses, owner) = (self.closer.poses(), self.closer.poses().len().saturating_sub(1));
        let then = report.corrected_from.as_deref().unwrap_or(poses);
        self.owners.push((owner, then[owner].inverse() * pose));
        let Some(before) = &report.corrected_from else { return Ok(None) };
        self.metrics.corrections += 1;
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

    fn note(&mut self, name: &str, pose: &Isometry3<f64>, report: &LoopReport) {
        if report.adjustment.is_some_and(|adjustment| !adjustment.taken) {
            self.metrics.adjustments_refused += 1;
            eprintln!(
                "{name}: the keyframes agree less after a bundle adjustment: the poses stay as the pose graph has them"
            );
        }
        for found in &report.loops {
            self.metrics.loops += 1;
            let drift = found.drift.distance(pose);
            self.metrics.largest_drift = self.metrics.largest_drift.max(drift);
            if found.drift.is_significant() {
                let degrees = found.drift.angle().to_degrees();
                eprintln!("{name}: back at keyframe {}: drift {:.1} mm, {degrees:.2} deg", found.old, 1e3 * drift);
            }
        }
    }
}

/// Where the frames of a run are after a correction.
pub(super) struct Correction {
    frames: Vec<Isometry3<f64>>,
    /// What the present moves by.
    pub(super) present: Isometry3<f64>,
    /// What the mesh does at once; the map follows frame by frame.
    pub(super) deformation: EmbeddedDeformation,
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

impl Correction {
    /// The new pose of a fused frame, if it differs by enough to fuse it anew.
    pub(super) fn moved(&self, frame: usize, pose: &Isometry3<f64>, voxel_size: f64) -> Option<Isometry3<f64>> {
        let moved = self.frames[frame];
        let apart = pose.inverse() * moved;
        let far =
            apart.translation.vector.norm() > LEAST_MOTION[0] * voxel_size || apart.rotation.angle() > LEAST_MOTION[1];
        far.then_some(moved)
    }
}
