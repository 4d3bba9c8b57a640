//! Pose graphs against closed forms, a dense solver, the chi-squared statistic and what was put in.

mod worlds;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use tsdf_hash::Error;
use tsdf_hash::pose_graph::{BetweenFactor, PoseGraph, PoseGraphSettings, PriorFactor, RobustKernel};

use crate::random::Random;
use worlds::{Noise, World, sphere, torus};

const NOISE: Noise = Noise { turn: 0.02, shift: 0.05 };

fn between(first: usize, second: usize, first_from_second: Isometry3<f64>, weight: f64) -> BetweenFactor {
    let information = Matrix6::identity() * weight;
    BetweenFactor { first, second, first_from_second, information, kernel: RobustKernel::Squared }
}

fn optimised(mut graph: PoseGraph) -> (PoseGraph, f64) {
    let report = graph.optimise(&PoseGraphSettings::default()).unwrap();
    assert!(report.converged, "{report:?}");
    assert!((graph.cost().unwrap() - report.cost).abs() < 1e-9 * (1.0 + report.cost));
    (graph, report.cost)
}

/// Root mean square distance between positions.
fn error(graph: &PoseGraph, truth: &[Isometry3<f64>]) -> f64 {
    let squares =
        graph.poses.iter().zip(truth).map(|(a, b)| (a.translation.vector - b.translation.vector).norm_squared());
    (squares.sum::<f64>() / truth.len() as f64).sqrt()
}

/// Steps of a metre on a line, and one measurement from end to end: all steps share what is missing.
#[test]
fn a_loop_on_a_line_is_shared_by_its_steps() {
    let (steps, weight, loop_weight, missing) = (7, 2.0, 5.0, 0.4);
    let x = |length: f64| Isometry3::translation(length, 0.0, 0.0);
    let mut graph = PoseGraph { poses: (0..=steps).map(|k| x(f64::from(k))).collect(), ..PoseGraph::default() };
    graph.betweens = (0..steps as usize).map(|k| between(k, k + 1, x(1.0), weight)).collect();
    graph.betweens.push(between(0, steps as usize, x(f64::from(steps) - missing), loop_weight));
    let (graph, cost) = optimised(graph);
    // Of n w δ² + W (n δ + missing)².
    let n = f64::from(steps);
    let delta = -missing * loop_weight / (weight + n * loop_weight);
    for (k, pose) in graph.poses.iter().enumerate() {
        assert!((pose.translation.x - k as f64 * (1.0 + delta)).abs() < 1e-9, "{k}");
    }
    let expected = 0.5 * (n * weight * delta * delta + loop_weight * (n * delta + missing).powi(2));
    assert!((cost - expected).abs() < 1e-12, "{cost} {expected}");
}

/// Turns about one axis in one place, around once: the same for angles, across the half turn.
#[test]
fn a_loop_of_turns_is_shared_by_its_turns() {
    let turn = |angle: f64| Isometry3::rotation(Vector3::new(0.48, 0.6, 0.64) * angle);
    let mut graph = PoseGraph { poses: (0..6).map(|k| turn(f64::from(k) * 1.1)).collect(), ..PoseGraph::default() };
    graph.betweens = (0..6).map(|k| between(k, (k + 1) % 6, turn(1.0), 3.0)).collect();
    let (graph, _) = optimised(graph);
    for k in 0..6 {
        let step = (graph.poses[k].inverse() * graph.poses[(k + 1) % 6]).rotation;
        assert!((step.angle() - std::f64::consts::TAU / 6.0).abs() < 1e-9, "{k}: {}", step.angle());
    }
}

#[test]
fn two_priors_meet_at_their_weighted_mean() {
    let turn = |angle: f64| Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * angle);
    let prior = |angle, weight| PriorFactor {
        pose: 0,
        world_from_body: turn(angle),
        information: Matrix6::identity() * weight,
    };
    let mut graph = PoseGraph::default();
    graph.poses.push(turn(2.0));
    graph.priors = vec![prior(0.1, 1.0), prior(0.5, 3.0)];
    let (graph, _) = optimised(graph);
    assert!((turn(0.4).inverse() * graph.poses[0]).rotation.angle() < 1e-9);
}

/// Gauss-Newton with a dense matrix and numerical derivatives of the residuals as they are documented.
fn dense_minimum(graph: &PoseGraph) -> f64 {
    let mut poses = graph.poses.clone();
    let residuals = |poses: &[Isometry3<f64>]| {
        let mut all = Vec::new();
        for f in &graph.betweens {
            let e = f.first_from_second.inverse() * poses[f.first].inverse() * poses[f.second];
            // The logarithm by way of 4 x 4 matrices would be the same; here by the half turn that all of them are below.
            let (w, t) = (e.rotation.scaled_axis(), e.translation.vector);
            let (angle, k) = (w.norm(), w.cross_matrix());
            let c = if angle < 1e-6 {
                1.0 / 12.0
            } else {
                1.0 / angle.powi(2) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
            };
            let v = t - 0.5 * k * t + c * k * k * t;
            let whitened =
                f.information.cholesky().unwrap().l().transpose() * Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z);
            all.extend(whitened.iter().copied());
        }
        DVector::from_vec(all)
    };
    let moved = |poses: &[Isometry3<f64>], k: usize, step: &[f64]| {
        let mut poses = poses.to_vec();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
        poses[k] *= Isometry3::from_parts(Vector3::new(step[3], step[4], step[5]).into(), turn);
        poses
    };
    let (free, h) = (poses.len() - 1, 1e-6);
    for _ in 0..30 {
        let here = residuals(&poses);
        let mut jacobian = DMatrix::zeros(here.len(), 6 * free);
        for column in 0..6 * free {
            let mut step = [0.0; 6];
            step[column % 6] = h;
            let ahead = residuals(&moved(&poses, column / 6 + 1, &step));
            step[column % 6] = -h;
            let behind = residuals(&moved(&poses, column / 6 + 1, &step));
            jacobian.set_column(column, &((ahead - behind) / (2.0 * h)));
        }
        let normal = jacobian.transpose() * &jacobian;
        let delta = normal.cholesky().unwrap().solve(&-(jacobian.transpose() * here));
        for k in 0..free {
            poses = moved(&poses, k + 1, delta.rows(6 * k, 6).as_slice());
        }
    }
    0.5 * residuals(&poses).norm_squared()
}

#[test]
fn the_minimum_is_that_of_a_dense_solver() {
    let mut random = Random::new(11);
    let World { mut graph, .. } = sphere(3, 5, Noise { turn: 0.05, shift: 0.1 }, &mut || random.uniform());
    // Informations that couple turns and shifts.
    for f in &mut graph.betweens {
        let mix = Matrix6::from_fn(|_, _| random.uniform() - 0.5);
        f.information += 100.0 * mix * mix.transpose();
    }
    let expected = dense_minimum(&graph);
    let (_, cost) = optimised(graph);
    assert!((cost - expected).abs() < 1e-6 * expected, "{cost} {expected}");
}

/// With noise drawn from the covariances that are stated, twice the cost at the minimum is chi-squared distributed, with six degrees of
/// freedom for each factor that is not needed.
#[test]
fn the_cost_of_a_noisy_sphere_and_torus_is_what_the_noise_makes() {
    let mut random = Random::new(5);
    let worlds = [sphere(20, 30, NOISE, &mut || random.uniform()), torus(24, 20, NOISE, &mut || random.uniform())];
    for World { graph, truth } in worlds {
        let before = error(&graph, &truth);
        let freedom = 6.0 * (graph.betweens.len() + 1 - graph.poses.len()) as f64;
        let mut from_measurements = graph.clone();
        // Poses that say nothing: all in one place.
        from_measurements.poses[1..].fill(truth[0]);
        from_measurements.initialise().unwrap();
        let relaxed = error(&from_measurements, &truth);
        assert!(relaxed < 0.5 * before, "{relaxed} of {before}");
        let (graph, cost) = optimised(graph);
        let off = (2.0 * cost - freedom) / (2.0 * freedom).sqrt();
        assert!(off.abs() < 4.0, "{off} standard deviations: {cost}");
        assert!(error(&graph, &truth) < 0.2 * before, "{} of {before}", error(&graph, &truth));
        let (_, again) = optimised(from_measurements);
        assert!((again - cost).abs() < 1e-5 * cost, "{again} {cost}");
    }
}

/// Loops that are wrong by metres are let go by their kernel; without it they bend the whole graph.
#[test]
fn false_loops_let_go() {
    let mut random = Random::new(7);
    let World { mut graph, truth } = sphere(8, 20, Noise { turn: 0.002, shift: 0.01 }, &mut || random.uniform());
    let (clean, _) = optimised(graph.clone());
    let honest = error(&clean, &truth);
    for (first, second) in [(3, 120), (40, 150), (66, 110)] {
        graph.betweens.push(between(first, second, Isometry3::identity(), 1e4));
    }
    let (bent, _) = optimised(graph.clone());
    assert!(error(&bent, &truth) > 10.0 * honest, "{} {honest}", error(&bent, &truth));
    let odometry = clean.betweens.len();
    for kernel in [RobustKernel::DynamicCovarianceScaling(5.0), RobustKernel::Cauchy(1.0)] {
        graph.betweens[odometry..].iter_mut().for_each(|f| f.kernel = kernel);
        let (kept, _) = optimised(graph.clone());
        assert!(error(&kept, &truth) < 1.5 * honest, "{kernel:?}: {} {honest}", error(&kept, &truth));
    }
}

#[test]
fn graphs_survive_their_text() {
    let mut random = Random::new(3);
    let World { mut graph, .. } = torus(3, 4, NOISE, &mut || random.uniform());
    graph.betweens[2].information[(0, 4)] = 7.0;
    graph.betweens[2].information[(4, 0)] = 7.0;
    graph.fixed = vec![0, 5];
    let information = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0));
    graph.priors.push(PriorFactor { pose: 3, world_from_body: graph.poses[3], information });
    let again = PoseGraph::from_g2o(&graph.to_g2o()).unwrap();
    assert_eq!((graph.fixed.clone(), graph.betweens.len()), (again.fixed.clone(), again.betweens.len()));
    assert_eq!(graph.priors[0].information, again.priors[0].information);
    assert_eq!(graph.betweens[2].information, again.betweens[2].information);
    assert!((graph.cost().unwrap() - again.cost().unwrap()).abs() < 1e-6 * graph.cost().unwrap());
    // Numbers with gaps, edges first, comments; the first entry of an information is that of the shift along x.
    let text = "# by hand\nEDGE_SE3:QUAT 9 4 1 0 0 0 0 0 1  7 0 0 0 0 0  1 0 0 0 0  1 0 0 0  1 0 0  1 0  1\n\n\
                VERTEX_SE3:QUAT 9 1 0 0 0 0 0 1\nVERTEX_SE3:QUAT 4 0 0 0 0 0 0 2\nFIX 4\n";
    let graph = PoseGraph::from_g2o(text).unwrap();
    assert_eq!((graph.betweens[0].first, graph.betweens[0].second, &graph.fixed[..]), (1, 0, &[0][..]));
    assert_eq!((graph.betweens[0].information[(3, 3)], graph.poses[1].translation.x), (7.0, 1.0));
}

#[test]
fn what_is_wrong_is_named() {
    let vertex = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
    for (line, words) in [
        ("VERTEX_SE3:QUAT 1 0 0 0 0 0 0", "expected 9 words"),
        ("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1", "taken"),
        ("VERTEX_SE3:QUAT 1 nan 0 0 0 0 0 1", "finite"),
        ("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 0", "quaternion"),
        ("VERTEX_SE3:QUAT -1 0 0 0 0 0 0 1", "number of a vertex"),
        ("FIX 3", "no vertex 3"),
        ("VERTEX_SE2 1 0 0 0", "not known"),
        ("PARAMS_SE3OFFSET 0 1 0 0 0 0 0 1", "elsewhere"),
    ] {
        let said = PoseGraph::from_g2o(&format!("{vertex}{line}\n")).unwrap_err().to_string();
        assert!(said.contains(words) && said.contains("line 2"), "{line}: {said}");
    }
    let mut graph = PoseGraph { poses: vec![Isometry3::identity(); 3], ..PoseGraph::default() };
    graph.betweens.push(between(0, 1, Isometry3::identity(), 1.0));
    let before = graph.clone();
    let lonely = graph.optimise(&PoseGraphSettings::default());
    assert!(matches!(lonely, Err(Error::UnconstrainedPose { pose: 2, .. })), "{lonely:?}");
    assert_eq!(graph, before);
    graph.betweens.push(between(1, 2, Isometry3::identity(), 1.0));
    graph.betweens[1].information[(0, 1)] = 1.0;
    assert!(matches!(graph.cost(), Err(Error::InvalidFactor { index: 1, .. })));
    graph.betweens[1] = between(1, 7, Isometry3::identity(), 1.0);
    assert!(matches!(graph.cost(), Err(Error::InvalidFactor { index: 1, .. })));
    // Nothing is known about the turn of the third: no minimum.
    graph.betweens[1] = between(1, 2, Isometry3::identity(), 0.0);
    assert!(matches!(graph.optimise(&PoseGraphSettings::default()), Err(Error::SingularGraph)));
    graph.priors.push(PriorFactor {
        pose: 9,
        world_from_body: Isometry3::identity(),
        information: Matrix6::identity(),
    });
    assert!(graph.cost().is_err());
}
