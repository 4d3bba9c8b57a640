//! Keyframes whose poses bend slowly, as after a loop, are straightened by what they see in common.

use nalgebra::{Isometry3, Matrix6, Vector3};
use tsdf_hash::Error;
use tsdf_hash::loop_closure::{BundleAdjustmentReport, BundleAdjustmentSettings, bundle_adjust};
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::pose_graph::{BetweenFactor, PoseGraph, RobustKernel};

use crate::noisy_room::{alignment, apart, seen};
use crate::random::Random;
use crate::scene::room;

/// Keyframes once around the room, ten degrees each, with noise; the true poses.
fn tour() -> (KeyframeIndex, Vec<Isometry3<f64>>) {
    let (mut keyframes, mut random) = (KeyframeIndex::new(), Random::new(5));
    let truth: Vec<_> = (0..36).map(|k| room::pose(k, 36)).collect();
    for pose in &truth {
        let shot = seen(*pose, &mut random).painted(|p| room::colour(p, 0.0));
        keyframes.push(&shot.view(), shot.colour().as_ref(), pose).unwrap();
    }
    (keyframes, truth)
}

/// Poses that bend by up to 5 mm and a milliradian, slowly; the motions between them are hardly known.
fn bent(truth: &[Isometry3<f64>]) -> PoseGraph {
    let bend = |k: usize| {
        let size = 4e-3 * (k as f64 / 18.0 * std::f64::consts::PI).sin();
        Isometry3::new(Vector3::new(1.0, -0.5, 0.5) * size, Vector3::new(0.2, 0.2, -0.2) * size)
    };
    let poses: Vec<_> = truth.iter().enumerate().map(|(k, pose)| bend(k) * pose).collect();
    let between = |k: usize| BetweenFactor {
        first: k,
        second: k + 1,
        first_from_second: poses[k].inverse() * poses[k + 1],
        information: Matrix6::identity(),
        kernel: RobustKernel::Squared,
    };
    let betweens = (0..poses.len() - 1).map(between).collect();
    PoseGraph { poses, betweens, ..PoseGraph::default() }
}

/// Means over all poses, laid over the true ones: metres, radians.
fn error(graph: &PoseGraph, truth: &[Isometry3<f64>]) -> [f64; 2] {
    let best = alignment(&graph.poses, truth);
    let apart: Vec<_> = graph.poses.iter().zip(truth).map(|(pose, truth)| apart(&(best * pose), truth)).collect();
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| apart.iter().map(of).sum::<f64>() / apart.len() as f64;
    [mean(&|a| a.0), mean(&|a| a.1)]
}

fn adjusted(
    keyframes: &KeyframeIndex,
    truth: &[Isometry3<f64>],
    settings: BundleAdjustmentSettings,
) -> (PoseGraph, BundleAdjustmentReport) {
    let mut graph = bent(truth);
    let report = bundle_adjust(keyframes, &mut graph, &settings).unwrap();
    (graph, report)
}

#[test]
fn a_slow_bend_is_straightened() {
    let (keyframes, truth) = tour();
    let before = error(&bent(&truth), &truth);
    let (graph, report) = adjusted(&keyframes, &truth, BundleAdjustmentSettings::default());
    let after = error(&graph, &truth);
    eprintln!("{before:?} -> {after:?}, {report:?}");
    assert!(report.taken && report.spread[1] < report.spread[0] && report.points > 10_000, "{report:?}");
    assert!(before[0] > 2e-3 && after[0] < 0.2 * before[0] && after[1] < 0.4e-3, "{before:?} -> {after:?}");
    // Any number of threads, the same bits.
    let settings = BundleAdjustmentSettings { threads: 3, ..BundleAdjustmentSettings::default() };
    assert_eq!(adjusted(&keyframes, &truth, settings).0.poses, graph.poses);
    // From where it came to, it hardly moves any more.
    let mut again = graph.clone();
    let report = bundle_adjust(&keyframes, &mut again, &BundleAdjustmentSettings::default()).unwrap();
    assert!(report.largest_shift < 2e-3 && error(&again, &truth)[0] < 0.35 * before[0], "{report:?}");
}

/// Two keyframes, back to back: nothing in common, so the factor between them decides.
#[test]
fn what_sees_nothing_in_common_stays() {
    let (mut keyframes, mut random) = (KeyframeIndex::new(), Random::new(5));
    let poses: Vec<_> = [0, 18].map(|k| room::pose(k, 36)).into();
    for pose in &poses {
        keyframes.push(&seen(*pose, &mut random).view(), None, pose).unwrap();
    }
    let mut graph = bent(&poses);
    let before = graph.poses.clone();
    let report = bundle_adjust(&keyframes, &mut graph, &BundleAdjustmentSettings::default()).unwrap();
    assert!(report.terms == 0 && graph.poses == before, "{report:?}");
    // A pose more than there are keyframes.
    graph.poses.push(poses[0]);
    let more = BetweenFactor { first: 1, second: 2, ..graph.betweens[0].clone() };
    graph.betweens.push(more);
    let refused = bundle_adjust(&keyframes, &mut graph, &BundleAdjustmentSettings::default());
    assert!(matches!(refused, Err(Error::UnconstrainedPose { pose: 2, .. })), "{refused:?}");
    let settings = BundleAdjustmentSettings { max_distance: f64::NAN, ..BundleAdjustmentSettings::default() };
    graph.poses.pop();
    graph.betweens.pop();
    let refused = bundle_adjust(&keyframes, &mut graph, &settings);
    assert!(matches!(refused, Err(Error::InvalidSetting { .. })), "{refused:?}");
}
