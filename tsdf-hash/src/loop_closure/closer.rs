//! Follows keyframes, finds loops among them, and corrects their poses.

use std::ops::Range;

use nalgebra::Isometry3;

use crate::bundle_adjustment::adjust::{BundleAdjustmentReport, bundle_adjust};
use crate::bundle_adjustment::settings::BundleAdjustmentSettings;
use crate::error::Error;
use crate::images::{ColourView, DepthView, check_pose};
use crate::keyframes::index::{KeyframeIndex, is_near};
use crate::loop_closure::error_growth::{WORST, deviations, largest_error};
use crate::loop_closure::factors::{LOOP_KERNEL, odometry, registered};
use crate::loop_closure::report::{LoopClosure, LoopReport};
use crate::loop_closure::settings::LoopSettings;
use crate::pose_graph::factors::BetweenFactor;
use crate::pose_graph::graph::PoseGraph;
use crate::pose_graph::levenberg_marquardt::PoseGraphSettings;
use crate::pose_graph::robust_kernel::RobustKernel;
use crate::settings::Settings;
use crate::tracking::drift::Drift;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::Tracker;

/// How much narrower the kernels become from step to step.
const NARROWING: f64 = 4.0;
/// Keyframes of old visits within this distance, metres, are tried without being alike.
const NEARBY: f64 = 0.5;
/// And within this angle, radians.
const ALIKE_ANGLE: f64 = 0.6;
/// Least overlap of a frame with the map of an old visit: with less, little is compared.
const LEAST_OVERLAP: f64 = 0.4;
/// The map of all keyframes has voxels of this edge at most, metres.
const MOST_VOXEL: f64 = 0.2;
/// A keyframe is registered against the ones so many before it, too: an error then spans several steps, not one (ours).
const BASELINES: [usize; 6] = [1, 2, 3, 4, 5, 6];

/// Follows a trajectory, keyframe by keyframe; finds where it comes back, and corrects it.
///
/// ```
/// # use nalgebra::Isometry3;
/// # use tsdf_hash::loop_closure::LoopCloser;
/// # use tsdf_hash::{DepthView, Error};
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
    /// The poses as the registrations so far have them, without a correction: what is near each other is exact.
    registered: Vec<Isometry3<f64>>,
    tracker: Tracker,
}

impl LoopCloser {
    /// Without keyframes.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: LoopSettings) -> Result<Self, Error> {
        settings.check()?;
        let tracking =
            TrackingSettings { noise: settings.noise, threads: settings.threads, ..TrackingSettings::default() };
        Ok(Self {
            settings,
            keyframes: KeyframeIndex::with_budget(settings.max_bytes),
            graph: PoseGraph::default(),
            registered: Vec::new(),
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

    /// The pose graph: motions between keyframes, and loops.
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
        let frame = Frame { depth, colour, present };
        self.follow(&frame)?;
        report.loops = self.loops(&frame, &mut report.compared)?;
        for found in &report.loops {
            let pose = &self.graph.poses[found.old];
            self.graph.betweens.push(registered(pose, &found.drift.outcome, [found.old, present], true));
        }
        if report.loops.iter().any(|found| found.drift.is_significant()) {
            report.corrected_from = Some(self.graph.poses.clone());
            self.optimise()?;
            report.adjustment = self.adjust()?;
            self.keyframes.set_poses(&self.graph.poses)?;
            self.registered.clone_from(&self.graph.poses);
        }
        Ok(report)
    }

    /// The motion since the last keyframes, by odometry and again as depth and colour have it.
    fn follow(&mut self, frame: &Frame) -> Result<(), Error> {
        let (poses, present) = (&self.graph.poses, frame.present);
        let Some(last) = present.checked_sub(1) else {
            self.registered.push(poses[present]);
            return Ok(());
        };
        let motion = poses[last].inverse() * poses[present];
        self.registered.push(self.registered[last] * motion);
        self.graph.betweens.push(odometry(poses, self.settings.odometry_error, last));
        let allowed = deviations(self.settings.odometry_error, &motion).map(|deviation| WORST * deviation);
        for baseline in BASELINES {
            let Some(first) = present.checked_sub(baseline) else { break };
            let start = self.registered[present];
            let visit = first.saturating_sub(self.settings.window)..first + 1;
            let Some(drift) = self.compare(frame, visit, &start, &start)? else { continue };
            // Where both contradict each other, the registration was mistaken.
            if drift.angle() > allowed[0] || drift.distance(&start) > allowed[1] {
                continue;
            }
            self.graph.betweens.push(registered(&self.registered[first], &drift.outcome, [first, present], false));
            if baseline == 1 {
                self.registered[present] = drift.outcome.world_from_camera;
            }
        }
        Ok(())
    }

    fn is_loop(factor: &BetweenFactor) -> bool {
        matches!(factor.kernel, RobustKernel::DynamicCovarianceScaling(_))
    }

    /// Graduated non-convexity (Yang et al. 2020): the kernels of the loops start so wide that all are believed, and narrow step by step.
    /// With narrow ones at once, drift that is large would be taken for a false loop.
    fn optimise(&mut self) -> Result<(), Error> {
        let settings = PoseGraphSettings::default();
        let mut width = f64::MAX;
        loop {
            let kernel = RobustKernel::DynamicCovarianceScaling(width);
            self.graph.betweens.iter_mut().filter(|f| Self::is_loop(f)).for_each(|f| f.kernel = kernel);
            self.graph.optimise(&settings)?;
            if width <= LOOP_KERNEL {
                return Ok(());
            }
            if width == f64::MAX {
                let poses = &self.graph.poses;
                let chi_squared = |f: &BetweenFactor| {
                    let residual = f.residual(&poses[f.first], &poses[f.second]);
                    residual.dot(&(f.information * residual))
                };
                width = self.graph.betweens.iter().filter(|f| Self::is_loop(f)).map(chi_squared).fold(0.0, f64::max);
            }
            width = (width / NARROWING).max(LOOP_KERNEL);
        }
    }

    /// Of old keyframes: those that show what the present one shows, look like it, or were taken from near by, as far as the present agrees with what they saw.
    fn loops(&mut self, frame: &Frame, compared: &mut usize) -> Result<Vec<LoopClosure>, Error> {
        let LoopSettings { recent, window, .. } = self.settings;
        let Some(end) = frame.present.checked_sub(recent) else { return Ok(Vec::new()) };
        let present = self.graph.poses[frame.present];
        let mut found: Vec<LoopClosure> = Vec::new();
        for (old, start) in self.starts(frame, end)? {
            if found.iter().any(|f| f.old.abs_diff(old) <= window) {
                continue;
            }
            *compared += 1;
            let visit = old.saturating_sub(window)..(old + window + 1).min(end);
            // The registered poses near the old keyframe, moved to where that stands.
            let there = self.graph.poses[old] * self.registered[old].inverse();
            let back = there.inverse();
            if let Some(drift) = self.compare(frame, visit, &(back * present), &(back * start))? {
                found.push(LoopClosure { old, present: frame.present, drift: drift.seen_from(&there) });
            }
        }
        if !found.is_empty() {
            let mut refined = self.graph.clone();
            refined.optimise(&PoseGraphSettings::default())?;
            found.retain(|found| self.is_plausible(&refined.poses, found));
        }
        Ok(found)
    }

    /// What the registrations between two keyframes each leave open, from all keyframes at once. Only factors that are not made from the
    /// images take part, and those of keyframes whose images had to make room.
    fn adjust(&mut self) -> Result<Option<BundleAdjustmentReport>, Error> {
        let LoopSettings { bundle_adjust: true, noise, threads, .. } = self.settings else { return Ok(None) };
        let mut settings = BundleAdjustmentSettings { noise, threads, ..BundleAdjustmentSettings::default() };
        let mut graph = self.graph.clone();
        let seen = |k: usize| self.keyframes.has_frame(k);
        graph.betweens.retain(|f| f.kernel == RobustKernel::Squared || !seen(f.first) || !seen(f.second));
        let report = loop {
            match bundle_adjust(&self.keyframes, &mut graph, &settings) {
                // A large map: its surface is needed, not its details.
                Err(Error::OutOfBudget { .. }) if settings.voxel_size < MOST_VOXEL => settings.voxel_size *= 2.0,
                other => break other?,
            }
        };
        self.graph.poses = graph.poses;
        Ok(Some(report))
    }

    /// Old keyframes before `end` that the present one may have come back to, and where it is if it has: those that share features first.
    fn starts(&self, frame: &Frame, end: usize) -> Result<Vec<(usize, Isometry3<f64>)>, Error> {
        let LoopSettings { candidates, min_correlation, .. } = self.settings;
        let pose = self.graph.poses[frame.present];
        let alike = self.keyframes.candidates(frame.depth, frame.colour, candidates, |k| k < end)?;
        let alike = alike.into_iter().filter(|found| found.correlation >= min_correlation);
        let recognised = self.keyframes.recognise(frame.depth, frame.colour, candidates, |k| k < end)?;
        let mut nearby: Vec<(f64, usize)> = (0..end)
            .filter_map(|k| {
                let apart = self.graph.poses[k].inverse() * pose;
                let distance = apart.translation.vector.norm();
                (distance < NEARBY && apart.rotation.angle() < ALIKE_ANGLE).then_some((distance, k))
            })
            .collect();
        nearby.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let nearby = nearby.into_iter().take(candidates).map(|(_, k)| (k, pose));
        let recognised = recognised.into_iter().map(|found| (found.keyframe, found.world_from_camera));
        Ok(recognised.chain(alike.map(|found| (found.keyframe, found.world_from_camera))).chain(nearby).collect())
    }

    /// Registers a frame that is believed to be at `present` against what some keyframes saw, both in the world of the registered poses.
    fn compare(
        &mut self,
        frame: &Frame,
        visit: Range<usize>,
        present: &Isometry3<f64>,
        start: &Isometry3<f64>,
    ) -> Result<Option<Drift>, Error> {
        let LoopSettings { voxel_size, noise, threads, .. } = self.settings;
        let settings = Settings { voxel_size, threads, noise, ..Settings::default() };
        let mut map = self.keyframes.map_of(visit, &self.registered, settings)?;
        let drift = self.tracker.drift(&mut map, frame.depth, frame.colour, present, None, &[*start])?;
        Ok(drift.filter(|drift| drift.outcome.overlap >= LEAST_OVERLAP))
    }

    /// Whether a registration is where the motions measured so far allow it to be: places that look alike but are farther apart are others.
    fn is_plausible(&self, refined: &[Isometry3<f64>], found: &LoopClosure) -> bool {
        let measured = self.graph.poses[found.old].inverse() * found.drift.outcome.world_from_camera;
        let off = (refined[found.old].inverse() * refined[found.present]).inverse() * measured;
        let share = self.settings.odometry_error;
        let [turn, shift] = largest_error(refined, &self.graph.betweens, share, [found.old, found.present]);
        off.rotation.angle() <= turn && off.translation.vector.norm() <= shift
    }
}

/// The present keyframe.
struct Frame<'a> {
    depth: &'a DepthView<'a>,
    colour: Option<&'a ColourView<'a>>,
    present: usize,
}
