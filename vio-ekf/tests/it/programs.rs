//! The programs of `examples/`: what they print is right, and the recipe of the README is the first of them.

#[path = "../../examples/evaluate.rs"]
#[allow(dead_code, unreachable_pub, reason = "a program of its own, of which main is not called here")]
mod evaluate;
#[path = "../../examples/odometry.rs"]
#[allow(dead_code, unreachable_pub, reason = "a program of its own, of which main is not called here")]
mod odometry;
#[path = "../../examples/pose_fusion.rs"]
#[allow(dead_code, unreachable_pub, reason = "a program of its own, of which main is not called here")]
mod pose_fusion;

use vio_ekf::eval::{Alignment, ate};

#[test]
fn the_recipe_is_the_example_and_short() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/odometry.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/odometry.rs");
    let lines = example.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//"));
    assert!(lines.count() <= 40);
}

#[test]
fn odometry_follows_its_driver() {
    let driver = odometry::driver().unwrap();
    let run = odometry::track(&driver).unwrap();
    assert!(run.lost.is_empty() && run.skipped.len() <= 1 && run.tracking_at_end, "{:?}", run.skipped);
    assert!(run.poses() > 60 && run.segments.len() == 1, "{} poses", run.poses());
    let estimate = run.segments[0].trajectory().unwrap();
    let truth: Vec<_> = estimate.stamps().iter().map(|stamp| driver.motion(*stamp).unwrap().world_from_body).collect();
    let error = ate(&truth, estimate.poses(), Alignment::PosYaw).unwrap().position.rmse;
    assert!(error < 0.03, "{error} m");
}

#[test]
fn evaluation_finds_the_scale_that_is_off() {
    let [truth, estimate] = evaluate::flight().unwrap();
    let found = evaluate::judge(&truth, &estimate).unwrap();
    // A hundredth of the distance from the middle of the flight, and of each chord of the path.
    let middle = truth.poses().iter().map(|pose| pose.translation.vector).sum::<vio_ekf::nalgebra::Vector3<f64>>()
        / truth.poses().len() as f64;
    let spread = truth.poses().iter().map(|pose| (pose.translation.vector - middle).norm_squared()).sum::<f64>();
    let expected = 0.01 * (spread / truth.poses().len() as f64).sqrt();
    assert!((found.ate.position.rmse - expected).abs() < 1e-6, "{} against {expected}", found.ate.position.rmse);
    let drift = found.segments[0].rpe.as_ref().unwrap().translation.median;
    assert!(drift > 0.0 && drift < 0.08, "{drift} of 8 m");
}

#[test]
fn fusion_is_better_than_its_poses() {
    let error = pose_fusion::fuse().unwrap();
    assert!(error < 0.02 * 3.0_f64.sqrt() / 2.0, "{error} m");
}
