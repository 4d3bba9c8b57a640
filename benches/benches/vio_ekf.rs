//! Judging a trajectory of ten thousand poses.

use paintcopter_benches::{criterion, motion};
use vio_ekf::Error;
use vio_ekf::eval::{Alignment, EvaluationSettings, RpeSettings, ate, evaluate, rpe};
use vio_ekf::format::tum;
use vio_ekf::trajectory::Spline;

/// Poses of either trajectory.
const POSES: usize = 10_000;
/// Time between the knots of the spline, nanoseconds.
const KNOT_INTERVAL: i64 = 50_000_000;

fn main() -> Result<(), Error> {
    let (truth, estimate) = motion::pair(POSES)?;
    let settings = EvaluationSettings::default();
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("vio-ekf");

    for mode in [Alignment::Se3, Alignment::PosYaw] {
        ate(truth.poses(), estimate.poses(), mode)?;
        group.bench_function(format!("ATE, {mode:?}"), |b| b.iter(|| ate(truth.poses(), estimate.poses(), mode)));
    }
    rpe(truth.poses(), estimate.poses(), &RpeSettings::default())?;
    group.bench_function("RPE from pose to pose", |b| {
        b.iter(|| rpe(truth.poses(), estimate.poses(), &RpeSettings::default()));
    });
    evaluate(&truth, &estimate, &settings)?;
    group.bench_function("pair up, align, ATE and five drift lengths", |b| {
        b.iter(|| evaluate(&truth, &estimate, &settings));
    });
    let text = tum::write(&truth);
    tum::read(&text)?;
    group.bench_function("read TUM text", |b| b.iter(|| tum::read(&text)));
    group.bench_function("write TUM text", |b| b.iter(|| tum::write(&truth)));

    let spline = Spline::from_trajectory(&truth, KNOT_INTERVAL)?;
    let (first, last) = spline.span();
    let stamps: Vec<_> = truth.stamps().iter().copied().filter(|s| (first..=last).contains(s)).collect();
    group.bench_function(format!("spline, {} samples with derivatives", stamps.len()), |b| {
        b.iter(|| stamps.iter().filter(|s| spline.sample(**s).is_ok()).count());
    });
    group.finish();
    criterion.final_summary();
    Ok(())
}
