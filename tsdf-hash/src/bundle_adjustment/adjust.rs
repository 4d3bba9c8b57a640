//! Gauss-Newton over the poses of all keyframes.

use nalgebra::Isometry3;

use crate::bundle_adjustment::point_terms::add_point;
use crate::bundle_adjustment::posed_frame::{Observation, PosedFrame};
use crate::bundle_adjustment::residual_stats::{ResidualStats, Scales};
use crate::bundle_adjustment::settings::BundleAdjustmentSettings;
use crate::bundle_adjustment::surface_points::{SurfacePoint, surface_points};
use crate::error::Error;
use crate::keyframes::index::KeyframeIndex;
use crate::parallel::in_chunks;
use crate::pose_graph::graph::PoseGraph;
use crate::pose_graph::normal_equations::NormalEquations;
use crate::pose_graph::se3::exp;
use crate::trace::span;
use crate::tracking::image_level::ImageLevel;

/// Before the first median is taken.
const FIRST_SCALES: Scales = Scales { depth: 1.0, intensity: 8.0 };
/// Of more keyframes that see a point, so many are heard, others at each point (ours): the work grows with their square.
const MOST_OBSERVERS: usize = 24;
/// The spread of the distances may grow by this factor, by chance; what makes it grow more is not taken (ours).
const MOST_GROWTH: f64 = 1.02;

/// What a dense bundle adjustment found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BundleAdjustmentReport {
    /// Points of the surface that two keyframes or more see.
    pub points: usize,
    /// Distances and intensities compared.
    pub terms: usize,
    /// Gauss-Newton steps.
    pub iterations: usize,
    /// Spread of the keyframes' distances from the surface that they have in common, as a multiple of the noise model's: before and after.
    pub spread: [f64; 2],
    /// Largest shift of a keyframe, metres.
    pub largest_shift: f64,
    /// Whether the new poses were taken: not if they make the spread larger.
    pub taken: bool,
}

/// Dense bundle adjustment: moves the poses of a graph so that what its keyframes saw of the same surface agrees, in depth and, where there is
/// colour, in intensity, all at once (thesis Paper I, outlook; here point-to-plane distances as in Eq. (5.2) and intensities as in Eq. (5.3), with the
/// surface itself eliminated point by point). Pose `k` of the graph is that of keyframe `k`. The factors of the graph hold what the
/// images do not fix; those that were made from the same images would count twice. Starts from poses that are right to about [`max_distance`](BundleAdjustmentSettings::max_distance).
///
/// # Errors
/// Settings that make no sense; those of [`PoseGraph::optimise`]; [`Error::UnconstrainedPose`] where keyframes and poses are not equally many; those of
/// [`Map::integrate`](crate::Map::integrate) where the map of the keyframes grows too large. The poses are then as they were.
pub fn bundle_adjust(
    keyframes: &KeyframeIndex,
    graph: &mut PoseGraph,
    settings: &BundleAdjustmentSettings,
) -> Result<BundleAdjustmentReport, Error> {
    span!("bundle_adjust");
    settings.check()?;
    let fixed = graph.anchors()?;
    if keyframes.len() != graph.poses.len() {
        let pose = keyframes.len().min(graph.poses.len());
        return Err(Error::UnconstrainedPose { pose, why: "a bundle adjustment needs one keyframe for each pose" });
    }
    let levels = keyframes.levels();
    let mut points = surface_points(keyframes, &graph.poses, settings)?;
    let mut poses = graph.poses.clone();
    let mut brightness = vec![0.0; poses.len()];
    let mut report = BundleAdjustmentReport::default();
    let mut scales = FIRST_SCALES;
    let mut is_done = false;
    loop {
        let frames = posed(&levels, &poses);
        let seen = observations(&frames, &points, settings);
        let mut equations = NormalEquations::new(&fixed, &graph.betweens, &covisible(&seen, poses.len()))?;
        equations.assemble(&poses, &graph.betweens, &graph.priors);
        let mut stats = ResidualStats::new(poses.len(), scales);
        for (point, seen) in points.iter_mut().zip(&seen).filter(|(_, seen)| seen.len() > 1) {
            let way = add_point(point, seen, &frames, &brightness, &mut equations, &mut stats);
            point.position += way * point.normal;
        }
        scales = stats.spread();
        report.spread[1] = scales.depth;
        if report.iterations == 0 {
            report.points = seen.iter().filter(|seen| seen.len() > 1).count();
            report.terms = stats.terms;
            report.spread[0] = scales.depth;
        }
        if is_done || equations.b.is_empty() || stats.terms == 0 || report.iterations == settings.max_iterations {
            break;
        }
        brightness.iter_mut().zip(stats.brighter()).for_each(|(own, more)| *own += more);
        let mut step = -&equations.b;
        equations.h.factorise()?;
        equations.h.solve(step.as_mut_slice());
        report.iterations += 1;
        for (pose, block) in poses.iter_mut().zip(&equations.blocks) {
            if let Some(block) = block {
                *pose *= exp(&step.fixed_rows::<6>(6 * block).into_owned());
                pose.rotation.renormalize();
            }
        }
        is_done = step.amax() < settings.least_step;
    }
    let shift = |(a, b): (&Isometry3<f64>, &Isometry3<f64>)| (a.translation.vector - b.translation.vector).norm();
    report.largest_shift = graph.poses.iter().zip(&poses).map(shift).fold(0.0, f64::max);
    report.taken = report.spread[1] <= MOST_GROWTH * report.spread[0] && poses.iter().all(is_finite);
    if report.taken {
        graph.poses = poses;
    }
    Ok(report)
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite())
}

fn posed<'a>(levels: &'a [Option<ImageLevel>], poses: &[Isometry3<f64>]) -> Vec<Option<PosedFrame<'a>>> {
    let frame = |(level, pose): (&'a Option<ImageLevel>, &Isometry3<f64>)| Some(PosedFrame::new(level.as_ref()?, pose));
    levels.iter().zip(poses).map(frame).collect()
}

/// For each point how the keyframes see it, in their order.
fn observations(
    frames: &[Option<PosedFrame>],
    points: &[SurfacePoint],
    settings: &BundleAdjustmentSettings,
) -> Vec<Vec<Observation>> {
    let mut numbered: Vec<(usize, &SurfacePoint)> = points.iter().enumerate().collect();
    let seen = in_chunks(&mut numbered, settings.threads, |points| {
        let of = |&(number, point): &(usize, &SurfacePoint)| {
            let observed =
                frames.iter().enumerate().filter_map(|(k, frame)| frame.as_ref()?.observe(k, point, settings));
            fewer(observed.collect(), number)
        };
        points.iter().map(of).collect::<Vec<_>>()
    });
    seen.into_iter().flatten().collect()
}

/// At most [`MOST_OBSERVERS`], evenly spread, others for each point.
fn fewer(seen: Vec<Observation>, number: usize) -> Vec<Observation> {
    let count = seen.len();
    if count <= MOST_OBSERVERS {
        return seen;
    }
    // The k-th of them lies in the k-th of equal parts.
    let place = |k: usize| (k * count + number % count) / MOST_OBSERVERS;
    (0..MOST_OBSERVERS).map(|k| seen[place(k)]).collect()
}

/// Pairs of keyframes that see a point in common.
fn covisible(seen: &[Vec<Observation>], count: usize) -> Vec<[usize; 2]> {
    let mut together = vec![false; count * count];
    for seen in seen {
        for (k, a) in seen.iter().enumerate() {
            seen[k + 1..].iter().for_each(|b| together[a.frame * count + b.frame] = true);
        }
    }
    let pair = |(at, together): (usize, &bool)| together.then_some([at / count, at % count]);
    together.iter().enumerate().filter_map(pair).collect()
}
