//! Loops: the camera is back, the drift is measured, and the poses since then are corrected (thesis Paper I, sections 4.5 and 4.6).

use nalgebra::{Isometry3, Matrix3, Matrix6};

use crate::error::Error;
use crate::images::{ColourView, DepthView, check_pose};
use crate::keyframes::index::{KeyframeIndex, is_near};
use crate::pose_graph::factors::BetweenFactor;
use crate::pose_graph::graph::PoseGraph;
use crate::pose_graph::levenberg_marquardt::PoseGraphSettings;
use crate::pose_graph::robust_kernel::RobustKernel;
use crate::settings::{NoiseModel, Settings};
use crate::tracking::drift::Drift;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::Tracker;

/// How loops are looked for, and how far the poses are believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopSettings {
    /// Bytes of keyframes (64 MiB).
    pub max_bytes: usize,
    /// Keyframes before the present one that are no old visit (10).
    pub recent: usize,
    /// Keyframes that look alike that are tried for each new one (3), and as many of those that were taken from near by.
    pub candidates: usize,
    /// Least correlation of the small images of those that look alike (0.5).
    pub min_correlation: f64,
    /// Keyframes on either side of a candidate that make the map of its visit (3).
    pub window: usize,
    /// Edge of the voxels of that map, metres (0.02).
    pub voxel_size: f64,
    /// Error of the motion between two keyframes as a share of it (0.01), beside 2 mm and 1 mrad.
    pub odometry_error: f64,
    /// Noise of the depth camera.
    pub noise: NoiseModel,
    /// Threads used inside one call; results do not depend on it.
    pub threads: usize,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            max_bytes: 64 << 20,
            recent: 10,
            candidates: 3,
            min_correlation: 0.5,
            window: 3,
            voxel_size: 0.02,
            odometry_error: 0.01,
            noise: NoiseModel::default(),
            threads: 1,
        }
    }
}

/// Standard deviations that every measured motion has at least, radians and metres.
const ODOMETRY_FLOOR: [f64; 2] = [1e-3, 2e-3];
const LOOP_FLOOR: [f64; 2] = [5e-4, 1e-3];
/// Of the kernel of loops: chi-squared of six degrees of freedom, 99 %.
const LOOP_KERNEL: f64 = 16.81;
/// Of the kernel of motions measured between neighbours, in standard deviations.
const STEP_KERNEL: f64 = 3.0;
/// How much narrower the kernels become from step to step.
const NARROWING: f64 = 4.0;
/// Keyframes of old visits within this distance, metres, are tried without being alike.
const NEARBY: f64 = 0.5;
/// And within this angle, radians.
const ALIKE_ANGLE: f64 = 0.6;
/// Errors of odometry add up in one direction in the worst case: that many deviations of each step are believed (ours).
const WORST: f64 = 2.0;
/// Least overlap of a frame with the map of an old visit: with less, little is compared.
const LEAST_OVERLAP: f64 = 0.4;

/// A loop that was found.
#[derive(Clone, Debug)]
pub struct LoopClosure {
    /// The keyframe of the old visit.
    pub old: usize,
    /// The present keyframe.
    pub present: usize,
    /// What was measured between them, before anything was corrected.
    pub drift: Drift,
}

/// What became of a frame.
#[derive(Clone, Debug, Default)]
pub struct LoopReport {
    /// Its number, if it became a keyframe.
    pub keyframe: Option<usize>,
    /// Old keyframes that the present one was compared with.
    pub compared: usize,
    /// Loops that were found.
    pub loops: Vec<LoopClosure>,
    /// Where the keyframes were before the correction, if there was one; where they are now says [`LoopCloser::poses`].
    pub corrected_from: Option<Vec<Isometry3<f64>>>,
}

/// Follows a trajectory, keyframe by keyframe; finds where it comes back, and corrects it.
///
/// ```
/// # use nalgebra::Isometry3;
/// # use tsdf_hash::{DepthView, Error, LoopCloser};
/// # fn follow(closer: &mut LoopCloser, depth: &DepthView, pose: Isometry3<f64>) -> Result<(), Error> {
/// let report = closer.add(depth, None, &pose)?;
/// if let Some(before) = &report.corrected_from {
///     // A frame that belongs to keyframe k is now at after[k] · before[k]⁻¹ · pose: de-integrate it there, integrate it here.
///     println!("{} keyframes have moved to {:?}", before.len(), closer.poses());
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct LoopCloser {
    settings: LoopSettings,
    keyframes: KeyframeIndex,
    graph: PoseGraph,
    tracker: Tracker,
}

impl LoopCloser {
    /// Without keyframes.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: LoopSettings) -> Result<Self, Error> {
        let refuse = |name, value, requirement| Err(Error::InvalidSetting { name, value, requirement });
        if !(settings.odometry_error >= 0.0 && settings.odometry_error < 1.0) {
            return refuse("loops.odometry_error", settings.odometry_error, "0..1");
        }
        if !(-1.0..=1.0).contains(&settings.min_correlation) {
            return refuse("loops.min_correlation", settings.min_correlation, "-1..=1");
        }
        let tracking =
            TrackingSettings { noise: settings.noise, threads: settings.threads, ..TrackingSettings::default() };
        Ok(Self {
            settings,
            keyframes: KeyframeIndex::with_budget(settings.max_bytes),
            graph: PoseGraph::default(),
            tracker: Tracker::new(tracking)?,
        })
    }

    /// The keyframes, at their corrected poses.
    pub fn keyframes(&self) -> &KeyframeIndex {
        &self.keyframes
    }

    /// The corrected poses of the keyframes.
    pub fn poses(&self) -> &[Isometry3<f64>] {
        &self.graph.poses
    }

    /// The pose graph: motions between consecutive keyframes, and loops.
    pub fn graph(&self) -> &PoseGraph {
        &self.graph
    }

    /// Takes the next frame. `world_from_camera` is in the world of the corrected keyframes: after a correction it goes on from the last
    /// one's new pose.
    ///
    /// # Errors
    /// Views or pose that make no sense, and those of [`PoseGraph::optimise`].
    pub fn add(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<LoopReport, Error> {
        check_pose(world_from_camera)?;
        let mut report = LoopReport::default();
        if self.graph.poses.last().is_some_and(|last| is_near(last, world_from_camera)) {
            return Ok(report);
        }
        let present = self.keyframes.push(depth, colour, world_from_camera)?;
        self.graph.poses.push(*world_from_camera);
        report.keyframe = Some(present);
        let Some(before) = present.checked_sub(1) else { return Ok(report) };
        self.graph.betweens.push(self.odometry(before, present));
        if let Some(drift) =
            self.compare(depth, present, before.saturating_sub(self.settings.window)..present, world_from_camera)?
        {
            // Odometry again, as the depth has it.
            let again = LoopClosure { old: before, present, drift };
            let factor = BetweenFactor { kernel: RobustKernel::Huber(STEP_KERNEL), ..self.measured(&again) };
            self.graph.betweens.push(factor);
        }
        report.loops = self.loops(depth, colour, present, &mut report.compared)?;
        for found in &report.loops {
            self.graph.betweens.push(self.measured(found));
        }
        if report.loops.iter().any(|found| found.drift.is_significant()) {
            report.corrected_from = Some(self.graph.poses.clone());
            self.optimise()?;
            self.keyframes.set_poses(&self.graph.poses)?;
        }
        Ok(report)
    }

    /// Graduated non-convexity (Yang et al. 2020): the kernels of the loops start so wide that all are believed, and narrow step by step.
    /// With narrow ones at once, drift that is large would be taken for a false loop.
    fn optimise(&mut self) -> Result<(), Error> {
        let settings = PoseGraphSettings::default();
        let is_loop = |f: &BetweenFactor| f.second > f.first + 1;
        let set = |graph: &mut PoseGraph, kernel| {
            graph.betweens.iter_mut().filter(|f| is_loop(f)).for_each(|f| f.kernel = kernel);
        };
        set(&mut self.graph, RobustKernel::Squared);
        self.graph.optimise(&settings)?;
        let poses = &self.graph.poses;
        let chi_squared = |f: &BetweenFactor| {
            let residual = f.residual(&poses[f.first], &poses[f.second]);
            residual.dot(&(f.information * residual))
        };
        let mut width = self.graph.betweens.iter().filter(|f| is_loop(f)).map(chi_squared).fold(0.0, f64::max);
        while width > LOOP_KERNEL {
            width = (width / NARROWING).max(LOOP_KERNEL);
            set(&mut self.graph, RobustKernel::DynamicCovarianceScaling(width));
            self.graph.optimise(&settings)?;
        }
        set(&mut self.graph, RobustKernel::DynamicCovarianceScaling(LOOP_KERNEL));
        Ok(())
    }

    /// The motion since the last keyframe, as good as odometry is.
    fn odometry(&self, first: usize, second: usize) -> BetweenFactor {
        let first_from_second = self.graph.poses[first].inverse() * self.graph.poses[second];
        let information = diagonal(self.deviations(&first_from_second).map(|s| s.powi(-2)));
        BetweenFactor { first, second, first_from_second, information, kernel: RobustKernel::Squared }
    }

    fn measured(&self, found: &LoopClosure) -> BetweenFactor {
        let corrected = found.drift.outcome.world_from_camera;
        // From the axes of the world to those of the camera.
        let turn = corrected.rotation.inverse().to_rotation_matrix().into_inner();
        let mut axes = Matrix6::zeros();
        axes.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
        axes.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        let covariance =
            axes * found.drift.outcome.covariance * axes.transpose() + diagonal(LOOP_FLOOR.map(|s| s.powi(2)));
        let information = covariance.try_inverse().unwrap_or_else(Matrix6::zeros);
        BetweenFactor {
            first: found.old,
            second: found.present,
            first_from_second: self.graph.poses[found.old].inverse() * corrected,
            information: 0.5 * (information + information.transpose()),
            kernel: RobustKernel::DynamicCovarianceScaling(LOOP_KERNEL),
        }
    }

    /// Of old keyframes: those that look like the present one or were taken from near by, as far as the present agrees with what they saw.
    fn loops(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        present: usize,
        compared: &mut usize,
    ) -> Result<Vec<LoopClosure>, Error> {
        let LoopSettings { recent, candidates, min_correlation, .. } = self.settings;
        let Some(end) = present.checked_sub(recent) else { return Ok(Vec::new()) };
        let pose = self.graph.poses[present];
        let mut starts: Vec<(usize, Isometry3<f64>)> = Vec::new();
        for found in self.keyframes.candidates(depth, colour, candidates, |k| k < end)? {
            if found.correlation >= min_correlation {
                starts.push((found.keyframe, found.world_from_camera));
            }
        }
        let mut nearby: Vec<(f64, usize)> = (0..end)
            .filter_map(|k| {
                let apart = self.graph.poses[k].inverse() * pose;
                let distance = apart.translation.vector.norm();
                (distance < NEARBY && apart.rotation.angle() < ALIKE_ANGLE).then_some((distance, k))
            })
            .collect();
        nearby.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        starts.extend(nearby.into_iter().take(candidates).map(|(_, k)| (k, pose)));
        let mut found: Vec<LoopClosure> = Vec::new();
        for (old, start) in starts {
            if found.iter().any(|f| f.old.abs_diff(old) <= self.settings.window) {
                continue;
            }
            *compared += 1;
            let window = self.settings.window;
            let visit = old.saturating_sub(window)..(old + window + 1).min(end);
            if let Some(drift) = self.compare(depth, present, visit, &start)? {
                found.push(LoopClosure { old, present, drift });
            }
        }
        Ok(found)
    }

    fn compare(
        &mut self,
        depth: &DepthView,
        present: usize,
        visit: std::ops::Range<usize>,
        start: &Isometry3<f64>,
    ) -> Result<Option<Drift>, Error> {
        let LoopSettings { voxel_size, noise, threads, .. } = self.settings;
        let settings = Settings { voxel_size, threads, noise, ..Settings::default() };
        let last = visit.end.saturating_sub(1);
        let mut map = self.keyframes.map_of(visit, settings)?;
        let pose = self.graph.poses[present];
        let drift = self.tracker.drift(&mut map, depth, None, &pose, None, &[*start])?;
        let [turn, shift] = self.plausible(last, present);
        let plausible = |drift: &Drift| drift.angle() <= turn && drift.distance(&pose) <= shift;
        Ok(drift.filter(|drift| drift.outcome.overlap >= LEAST_OVERLAP && plausible(drift)))
    }

    /// The largest drift, radians and metres, that odometry can have gathered between two keyframes: places that look alike but are
    /// farther apart are others.
    fn plausible(&self, old: usize, present: usize) -> [f64; 2] {
        let poses = &self.graph.poses[old..=present];
        let [mut turn, mut shift] = LOOP_FLOOR.map(|s| 3.0 * s);
        for pair in poses.windows(2) {
            let step = pair[0].inverse() * pair[1];
            let deviations = self.deviations(&step);
            // A turn moves all that comes after it.
            let arm = (poses[poses.len() - 1].translation.vector - pair[1].translation.vector).norm();
            turn += WORST * deviations[0];
            shift += WORST * (deviations[1] + deviations[0] * arm);
        }
        [turn, shift]
    }

    /// Standard deviations of the turn and the shift of a measured motion.
    fn deviations(&self, step: &Isometry3<f64>) -> [f64; 2] {
        let size = [step.rotation.angle(), step.translation.vector.norm()];
        [0, 1].map(|k| ODOMETRY_FLOOR[k] + self.settings.odometry_error * size[k])
    }
}

/// Turn before shift.
fn diagonal([turn, shift]: [f64; 2]) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * turn));
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * shift));
    out
}
