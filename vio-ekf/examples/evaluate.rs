//! How good a trajectory is: pairing in time, alignment, absolute and relative errors.
//! `cargo run --release -p vio-ekf --example evaluate [TRUTH.tum ESTIMATE.tum]`

use vio_ekf::eval::{Evaluation, EvaluationSettings, evaluate};
use vio_ekf::format::tum;
use vio_ekf::nalgebra::{Isometry3, Vector3};
use vio_ekf::sim::painting_flight;
use vio_ekf::{Stamp, Trajectory};

/// A flight, and an estimate of it from a frame that is shifted and turned about the vertical, with a scale that is 1 % off.
pub fn flight() -> Result<[Trajectory; 2], vio_ekf::Error> {
    let spline = painting_flight(1, 60.0)?;
    let frame = Isometry3::new(Vector3::new(5.0, -2.0, 1.0), Vector3::z() * 0.7);
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    for stamp in (0..1200).map(|k| Stamp::from_nanos(spline.span().0.nanos() + k * 50_000_000)) {
        let pose = spline.sample(stamp)?.world_from_body;
        truth.push(stamp, pose)?;
        let scaled = Isometry3::from_parts((pose.translation.vector * 1.01).into(), pose.rotation);
        estimate.push(stamp, frame * scaled)?;
    }
    Ok([truth, estimate])
}

/// Absolute and relative errors of an estimate.
pub fn judge(truth: &Trajectory, estimate: &Trajectory) -> Result<Evaluation, vio_ekf::Error> {
    // Position and heading are aligned: what an estimator with gravity and scale cannot know.
    evaluate(truth, estimate, &EvaluationSettings::default())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [truth, estimate] = match &arguments[..] {
        [truth, estimate] => {
            [tum::read(&std::fs::read_to_string(truth)?)?, tum::read(&std::fs::read_to_string(estimate)?)?]
        }
        _ => flight()?,
    };
    let evaluation = judge(&truth, &estimate)?;
    println!("{} poses, {:.0} % of the time", evaluation.pairs, 100.0 * evaluation.coverage);
    println!("absolute error {:.4} m", evaluation.ate.position.rmse);
    for segment in &evaluation.segments {
        if let Some(rpe) = &segment.rpe {
            println!("drift over {} m: {:.4} m (median)", segment.length_m, rpe.translation.median);
        }
    }
    Ok(())
}
