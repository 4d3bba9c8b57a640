//! `vio inertial`: dead reckoning, with no image at all.

use std::path::Path;

use serde::Serialize;
use vio_ekf::Imu;
use vio_ekf::format::{asl, euroc, tum};
use vio_ekf::inertial::{ImuSettings, InertialOdometry, InitialSigma, InitialState};
use vio_ekf::nalgebra::Vector3;
use vio_ekf::run::{Estimate, Segment};

use super::arguments::Inertial;
use super::error::{VioError, read_text, write_file};
use super::euroc_folder::{Overrides, imu, inside};
use super::states::states_csv;
use crate::report::save_figures;
use crate::say;

/// Longest pause of the samples that is integrated over, s.
const MAX_GAP: f64 = 0.5;

/// What is reported. Standard deviations are those of one axis, the largest.
#[derive(Debug, Clone, Serialize)]
pub(super) struct InertialReport {
    /// Always `dead reckoning`: nothing corrects these poses.
    mode: &'static str,
    samples: usize,
    duration_s: f64,
    path_length_m: f64,
    position_sigma_end_m: f64,
    velocity_sigma_end_m_per_s: f64,
    attitude_sigma_end_rad: f64,
    /// Against the recording's own truth, without any alignment: both begin in the same state.
    #[serde(skip_serializing_if = "Option::is_none")]
    position_error_end_m: Option<f64>,
    /// Squared error in units of the covariance: 3 is right in the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    position_nees_end: Option<f64>,
}

/// Integrates the samples of an EuRoC/ASL folder from a given state and writes `trajectory.tum`, `states.csv` and `report.json`.
pub(super) fn dead_reckon(arguments: &Inertial) -> Result<InertialReport, Box<dyn std::error::Error>> {
    let root = inside(&arguments.euroc);
    let table = root.join("imu0/data.csv");
    let samples = asl::read_imu(&read_text(&table)?).map_err(|error| VioError::malformed(&table, &error))?;
    let noise = imu(&root, &Overrides { imu: arguments.imu.clone(), ..Overrides::default() })?.noise;
    let truth = root.join("state_groundtruth_estimate0/data.csv");
    let given = arguments.start.as_deref().unwrap_or(&truth);
    let states = euroc::read(&read_text(given)?).map_err(|error| VioError::malformed(given, &error))?;
    let initial = initial_state(&states, &samples).map_err(|why| VioError::malformed(given, &why))?;

    // The last sample that is not after the start, and all after it.
    let first = samples.partition_point(|sample| sample.stamp <= initial.stamp) - 1;
    let settings = ImuSettings::default();
    let mut odometry = InertialOdometry::new(&initial, samples[first], noise, settings, arguments.gravity)?;
    let mut segment = Segment::default();
    for pair in samples[first..].windows(2) {
        let gap = pair[1].stamp.secs_since(pair[0].stamp);
        if gap > MAX_GAP {
            say!("ends at {} s: {gap:.2} s without inertial samples", pair[0].stamp);
            break;
        }
        if pair[1].stamp.secs_since(initial.stamp) > arguments.seconds {
            break;
        }
        odometry.imu(&pair[1])?;
        segment.estimates.push(Estimate { odometry: odometry.output(), used: 0, dead_reckoned: true });
    }
    let report = report(&segment, &truth)?;
    write_file(&arguments.out.join("trajectory.tum"), tum::write(&segment.trajectory()?).as_bytes())?;
    write_file(&arguments.out.join("states.csv"), states_csv(std::slice::from_ref(&segment)).as_bytes())?;
    save_figures(&report, &arguments.out)?;
    Ok(report)
}

/// The first state of a file that the samples cover.
fn initial_state(states: &euroc::States, samples: &[Imu]) -> Result<InitialState, String> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err("there are no inertial samples to start with".into());
    };
    let covered = |stamp| first.stamp <= stamp && stamp < last.stamp;
    let row = states.trajectory.stamps().iter().position(|&stamp| covered(stamp));
    let row = row.ok_or_else(|| {
        format!("has no state between the first and the last inertial sample, {} and {} s", first.stamp, last.stamp)
    })?;
    let velocity = states.velocities_in_world.get(row).ok_or("has no velocity: give 11 columns (t p q v) or 17")?;
    let pose = states.trajectory.poses()[row];
    let bias = |biases: &[Vector3<f64>]| biases.get(row).copied().unwrap_or_default();
    Ok(InitialState {
        stamp: states.trajectory.stamps()[row],
        world_from_body: pose,
        velocity_in_body: pose.rotation.inverse() * velocity,
        gyro_bias: bias(&states.gyro_biases),
        accel_bias: bias(&states.accel_biases),
        sigma: InitialSigma::default(),
    })
}

fn report(segment: &Segment, truth: &Path) -> Result<InertialReport, Box<dyn std::error::Error>> {
    let (Some(first), Some(end)) = (segment.estimates.first(), segment.estimates.last()) else {
        return Err("no inertial sample comes after the start".into());
    };
    let (first, end) = (&first.odometry, &end.odometry);
    let sigma = |row: usize| (row..row + 3).map(|k| end.covariance[(k, k)].max(0.0).sqrt()).fold(0.0, f64::max);
    // The truth may end before the samples do, and then there is nothing to compare with.
    let known = truth.is_file().then(|| read_text(truth)).transpose()?;
    let known = known.map(|text| euroc::read(&text)).transpose().map_err(|error| VioError::malformed(truth, &error))?;
    let there = known.and_then(|states| states.trajectory.pose_at(end.stamp).ok());
    let error = there.map(|pose| pose.translation.vector - end.world_from_body.translation.vector);
    let covariance = end.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    Ok(InertialReport {
        mode: "dead reckoning",
        samples: segment.estimates.len(),
        duration_s: end.stamp.secs_since(first.stamp),
        path_length_m: segment.trajectory()?.path_length(),
        position_sigma_end_m: sigma(0),
        velocity_sigma_end_m_per_s: sigma(3),
        attitude_sigma_end_rad: sigma(6),
        position_error_end_m: error.map(|error| error.norm()),
        position_nees_end: error.and_then(|e| Some(e.dot(&covariance.cholesky()?.solve(&e)))),
    })
}

impl InertialReport {
    /// What it is, in a line.
    pub(super) fn summary(&self) -> String {
        let error = self.position_error_end_m.map_or(String::new(), |error| format!("; {error:.2} m off the truth"));
        format!(
            "dead reckoning, inertial samples alone: after {:.1} s the position is known to {:.2} m (one deviation){error}",
            self.duration_s, self.position_sigma_end_m
        )
    }
}
