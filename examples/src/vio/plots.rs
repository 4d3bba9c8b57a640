//! The pictures of an odometry run.

use std::path::Path;

use vio_ekf::Trajectory;
use vio_ekf::lie::so3;
use vio_ekf::nalgebra::Vector3;
use vio_ekf::run::{AlignedPair, Estimate, PoseError, Run, RunEvaluation};

use super::VioError;
use crate::pictures::{Panel, PathPanel, save_curves, save_paths};

/// Points of a curve at most: more cannot be seen.
const POINTS: usize = 3000;

/// `trajectory.png`, `state.png` and, with a truth, `error.png` and `sigma.png`.
pub(super) fn save(
    trajectories: &[Trajectory],
    run: &Run,
    evaluation: Option<&RunEvaluation>,
    folder: &Path,
) -> Result<(), VioError> {
    save_path(trajectories, evaluation, &folder.join("trajectory.png"))?;
    save_state(run, &folder.join("state.png"))?;
    if let Some(evaluation) = evaluation {
        save_errors(evaluation, &folder.join("error.png"))?;
        save_sigmas(evaluation, &folder.join("sigma.png"))?;
    }
    Ok(())
}

type Curve = Vec<(f64, f64)>;

fn save_path(trajectories: &[Trajectory], evaluation: Option<&RunEvaluation>, path: &Path) -> Result<(), VioError> {
    let (estimate, truth): (Vec<Vector3<f64>>, Vec<Vector3<f64>>) = if let Some(j) = evaluation {
        j.aligned.iter().map(|(_, g, e)| (e.translation.vector, g.translation.vector)).unzip()
    } else {
        let poses = trajectories.iter().flat_map(Trajectory::poses);
        (poses.map(|pose| pose.translation.vector).collect(), Vec::new())
    };
    let panel = |label: [&'static str; 2], axes: [usize; 2]| {
        let curve = |points: &[Vector3<f64>]| -> Curve { points.iter().map(|p| (p[axes[0]], p[axes[1]])).collect() };
        let mut curves = vec![("estimate", curve(&estimate))];
        if !truth.is_empty() {
            curves.push(("truth", curve(&truth)));
        }
        PathPanel { horizontal: label[0], vertical: label[1], curves }
    };
    let panels = [panel(["x [m]", "y [m]"], [0, 1]), panel(["x [m]", "z [m]"], [0, 2])];
    Ok(save_paths(path, "From above, and from the side", &panels)?)
}

fn save_state(run: &Run, path: &Path) -> Result<(), VioError> {
    let all = || run.segments.iter().flat_map(|segment| &segment.estimates);
    let Some(first) = all().next().map(|first| first.odometry.stamp) else { return Ok(()) };
    let curve = |value: &dyn Fn(&vio_ekf::Odometry, usize) -> f64| -> Curve {
        thinned(all().map(|Estimate { odometry: o, used, .. }| (o.stamp.secs_since(first), value(o, *used))).collect())
    };
    let bias = |pick: fn(&vio_ekf::Odometry) -> Vector3<f64>| {
        let axis = |k: usize| curve(&|o, _| pick(o)[k]);
        vec![("x", axis(0)), ("y", axis(1)), ("z", axis(2))]
    };
    let panels = [
        Panel { label: "speed [m/s]", curves: vec![("speed", curve(&|o, _| o.velocity_in_body.norm()))] },
        Panel { label: "landmarks used", curves: vec![("landmarks", curve(&|_, used| used as f64))] },
        Panel { label: "gyroscope bias [rad/s]", curves: bias(|o| o.gyro_bias) },
        Panel { label: "accelerometer bias [m/s²]", curves: bias(|o| o.accel_bias) },
    ];
    Ok(save_curves(path, "What the filter thinks", "time [s]", &panels)?)
}

fn save_errors(evaluation: &RunEvaluation, path: &Path) -> Result<(), VioError> {
    let Some(&(first, ..)) = evaluation.aligned.first() else { return Ok(()) };
    let curve = |value: &dyn Fn(&AlignedPair) -> f64| {
        thinned(evaluation.aligned.iter().map(|at| (at.0.secs_since(first), value(at))).collect())
    };
    let position = curve(&|(_, g, e)| 100.0 * (g.translation.vector - e.translation.vector).norm());
    let attitude = curve(&|(_, g, e)| so3::angle_between(&g.rotation, &e.rotation).to_degrees());
    let panels = [
        Panel { label: "position [cm]", curves: vec![("position", position)] },
        Panel { label: "attitude [deg]", curves: vec![("attitude", attitude)] },
    ];
    Ok(save_curves(path, "Errors after alignment of position and yaw", "time [s]", &panels)?)
}

fn save_sigmas(evaluation: &RunEvaluation, path: &Path) -> Result<(), VioError> {
    let Some(first) = evaluation.errors.first().map(|error| error.stamp) else { return Ok(()) };
    let panel = |label, factor: f64, pick: &dyn Fn(&PoseError) -> (f64, f64)| {
        let curve = |value: &dyn Fn(f64, f64) -> f64| -> Curve {
            let at = |error: &PoseError| {
                let (error_value, sigma) = pick(error);
                (error.stamp.secs_since(first), factor * value(error_value, sigma))
            };
            thinned(evaluation.errors.iter().map(at).collect())
        };
        let curves = vec![
            ("error", curve(&|e, _| e)),
            ("+3 sigma", curve(&|_, s| 3.0 * s)),
            ("-3 sigma", curve(&|_, s| -3.0 * s)),
        ];
        Panel { label, curves }
    };
    let degrees = 1f64.to_degrees();
    let panels = [
        panel("x [cm]", 100.0, &|e| (e.position.x, e.position_sigma.x)),
        panel("y [cm]", 100.0, &|e| (e.position.y, e.position_sigma.y)),
        panel("z [cm]", 100.0, &|e| (e.position.z, e.position_sigma.z)),
        panel("about x [deg]", degrees, &|e| (e.attitude.x, e.attitude_sigma.x)),
        panel("about y [deg]", degrees, &|e| (e.attitude.y, e.attitude_sigma.y)),
        panel("about z [deg]", degrees, &|e| (e.attitude.z, e.attitude_sigma.z)),
    ];
    Ok(save_curves(path, "Errors from the start on, and what the filter claims", "time [s]", &panels)?)
}

fn thinned(curve: Curve) -> Curve {
    let step = curve.len().div_ceil(POINTS).max(1);
    curve.into_iter().step_by(step).collect()
}
