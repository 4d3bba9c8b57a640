//! The figures of a run, and the report that shows them.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use vio_ekf::format::tum;
use vio_ekf::imu_check::ImuValidation;
use vio_ekf::lie::so3;
use vio_ekf::run::{Loss, Run, RunEvaluation};
use vio_ekf::{Stamp, Trajectory};

use super::error::write_file;
use super::run::TimedRun;
use super::states::states_csv;
use super::{Recording, VioError, plots};
use crate::report::save_figures;

/// What `report.json` of a run holds. Flat, SI units in the names; every number is finite. What needs the truth is absent
/// where that is unknown.
#[derive(Debug, Clone, Serialize)]
pub struct VioReport {
    /// Version of the program.
    pub version: &'static str,
    /// Images that the filter took.
    pub frames: usize,
    /// Those among them that came with one of the second camera.
    pub stereo_pairs: usize,
    /// Images that were left out.
    pub frames_skipped: usize,
    /// Images that have a pose.
    pub poses: usize,
    /// Share of the recording's images that have a pose.
    pub tracked_share: f64,
    /// Poses that were taken back: of starts that turned out to be wrong, and those just before a divergence.
    pub poses_withdrawn: usize,
    /// Poses without a landmark: from inertial samples alone.
    pub poses_dead_reckoned: usize,
    /// Segments, each in a world of its own.
    pub segments: usize,
    /// Time of the first pose of each segment.
    pub segment_first_s: Vec<f64>,
    /// Time of the last pose of each segment.
    pub segment_last_s: Vec<f64>,
    /// Inertial samples that it took.
    pub imu_samples: usize,
    /// Gaps in the inertial samples; absent, as the next, if the samples failed their test and were taken all the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu_gaps: Option<usize>,
    /// What is unusual about the inertial samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu_doubts: Option<Vec<String>>,
    /// Time from the first to the last pose, summed over segments.
    pub duration_s: f64,
    /// Length of the estimated path, summed over segments.
    pub path_length_m: f64,
    /// Root mean square position error after rigid alignment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_se3_rmse_m: Option<f64>,
    /// The same after alignment of position and yaw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_yaw_rmse_m: Option<f64>,
    /// Median translation error over 10 m of path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rpe_10m_median_m: Option<f64>,
    /// Mean normalised squared error of the position: 3 is consistent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nees_position_mean: Option<f64>,
    /// The same of the attitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nees_attitude_mean: Option<f64>,
    /// The same of the velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nees_velocity_mean: Option<f64>,
    /// Share of the time with truth and images for which there is an estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<f64>,
    /// Processor time of an image, median.
    pub frame_cpu_ms_median: f64,
    /// The same, 99th percentile.
    pub frame_cpu_ms_p99: f64,
    /// Processor time of an inertial sample with output and covariance, median.
    pub imu_cpu_us_median: f64,
    /// Whether the filter diverged at any time.
    pub diverged: bool,
    /// How often the filter was reset.
    pub resets: usize,
    /// Time from the first image to the first pose.
    pub initialization_time_s: f64,
    /// Angle between the camera's attitude as estimated and as in the calibration.
    pub extrinsics_error_rad: f64,
    /// Estimated time to add to the camera's stamps to get the inertial sensor's.
    pub time_offset_s: f64,
    /// Matrix of the accelerometer at the end, row by row: force by reading, without the bias. Absent where the sensor was found to be
    /// calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_matrix: Option<Vec<f64>>,
    /// Worker threads.
    pub threads: usize,
}

impl VioReport {
    /// The figures of a run.
    ///
    /// # Errors
    /// [`VioError::Library`] if the filter gave poses that are not finite.
    pub fn new(
        recording: &Recording,
        findings: Option<&ImuValidation>,
        TimedRun { run, frame_s, imu_s }: &TimedRun,
        evaluation: Option<&RunEvaluation>,
        threads: usize,
    ) -> Result<Self, VioError> {
        let trajectories = run.trajectories()?;
        let end = |last: fn(&Trajectory) -> Option<&Stamp>| {
            trajectories.iter().filter_map(last).map(|stamp| stamp.nanos() as f64 * 1e-9).collect()
        };
        let attitude = recording.camera.camera.body_from_camera.rotation;
        Ok(Self {
            version: env!("CARGO_PKG_VERSION"),
            frames: run.frames,
            stereo_pairs: run.pairs,
            frames_skipped: run.skipped.len(),
            poses: run.poses(),
            tracked_share: run.poses() as f64 / recording.images.count().max(1) as f64,
            poses_withdrawn: run.withdrawn,
            poses_dead_reckoned: run.dead_reckoned(),
            segments: trajectories.len(),
            segment_first_s: end(|trajectory| trajectory.stamps().first()),
            segment_last_s: end(|trajectory| trajectory.stamps().last()),
            imu_samples: run.imu_samples,
            imu_gaps: findings.map(|findings| findings.gaps),
            imu_doubts: findings.map(|findings| findings.warnings.iter().map(ToString::to_string).collect()),
            duration_s: trajectories.iter().map(Trajectory::duration_s).sum(),
            path_length_m: trajectories.iter().map(Trajectory::path_length).sum(),
            ate_se3_rmse_m: evaluation.map(|j| j.ate_se3),
            ate_yaw_rmse_m: evaluation.map(|j| j.ate_yaw),
            rpe_10m_median_m: evaluation.and_then(|j| j.rpe_10m_median),
            nees_position_mean: evaluation.map(|j| j.nees_position),
            nees_attitude_mean: evaluation.map(|j| j.nees_attitude),
            nees_velocity_mean: evaluation.and_then(|j| j.nees_velocity),
            coverage: evaluation.map(|j| j.coverage),
            frame_cpu_ms_median: 1e3 * quantile(frame_s, 0.5),
            frame_cpu_ms_p99: 1e3 * quantile(frame_s, 0.99),
            imu_cpu_us_median: 1e6 * quantile(imu_s, 0.5),
            diverged: !run.lost.is_empty(),
            resets: run.lost.len(),
            initialization_time_s: run.initialization_time_s,
            extrinsics_error_rad: so3::angle_between(&attitude, &run.calibration.body_from_camera.rotation),
            time_offset_s: run.calibration.time_offset_s,
            accel_matrix: run.accel_matrix().map(|matrix| matrix.transpose().iter().copied().collect()),
            threads,
        })
    }

    fn markdown(&self, recording: &Recording, run: &Run, evaluated: bool) -> String {
        let mut text = format!(
            "# {}\n\n{} images ({} left out) and {} inertial samples; {:.1} m in {:.1} s. Version {}.\n\n",
            recording.name,
            self.frames,
            self.frames_skipped,
            self.imu_samples,
            self.path_length_m,
            self.duration_s,
            self.version
        );
        for Loss { stamp, reason: why } in &run.lost {
            let _ = writeln!(text, "**Diverged at {stamp} s**: {why}.\n");
        }
        if self.segments > 1 {
            let count = self.segments;
            let _ = writeln!(
                text,
                "**{count} segments, each in a world of its own**: place and heading begin anew with each.\n"
            );
        }
        if self.poses_withdrawn > 0 {
            let _ = writeln!(text, "{} poses were taken back.\n", self.poses_withdrawn);
        }
        let mut pictures =
            vec![("trajectory.png", "From above and from the side"), ("state.png", "State of the filter")];
        if evaluated {
            pictures.push(("error.png", "Errors after alignment of position and yaw"));
            pictures.push((
                "sigma.png",
                "Errors from the start on, and three standard deviations as the filter claims them",
            ));
        }
        for (file, caption) in pictures {
            let _ = writeln!(text, "**{caption}**\n\n![{caption}]({file})\n");
        }
        text.push_str("| figure | value |\n|---|---|\n");
        let mut row = |figure: &str, value: Option<String>| {
            let _ = writeln!(text, "| {figure} | {} |", value.unwrap_or_else(|| "-".into()));
        };
        let metres = |value: Option<f64>| value.map(|v| format!("{v:.4} m"));
        let plain = |value: Option<f64>| value.map(|v| format!("{v:.2}"));
        row("position error, rigid alignment, RMS", metres(self.ate_se3_rmse_m));
        row("position error, position and yaw aligned, RMS", metres(self.ate_yaw_rmse_m));
        row("error over 10 m of path, median", metres(self.rpe_10m_median_m));
        row("NEES of position (3 is consistent)", plain(self.nees_position_mean));
        row("NEES of attitude", plain(self.nees_attitude_mean));
        row("NEES of velocity", plain(self.nees_velocity_mean));
        row("share of the truth covered", self.coverage.map(|v| format!("{:.1} %", 100.0 * v)));
        row("initialization after", Some(format!("{:.2} s", self.initialization_time_s)));
        row("share of the images with a pose", Some(format!("{:.1} %", 100.0 * self.tracked_share)));
        row("poses from inertial samples alone", Some(self.poses_dead_reckoned.to_string()));
        row("resets", Some(self.resets.to_string()));
        let frame = format!("{:.2} / {:.2} ms", self.frame_cpu_ms_median, self.frame_cpu_ms_p99);
        row("processor time of an image, median / 99 %", Some(frame));
        row("processor time of an inertial sample with covariance", Some(format!("{:.1} us", self.imu_cpu_us_median)));
        let degrees = self.extrinsics_error_rad.to_degrees();
        row("camera's attitude, estimate against calibration", Some(format!("{degrees:.3} deg")));
        row("time offset, camera to IMU", Some(format!("{:.2} ms", 1e3 * self.time_offset_s)));
        text.push_str(
            "\nAll figures, in SI units, are in [report.json](report.json); poses in [trajectory.tum](trajectory.tum), \
                       velocities, biases and covariances in [states.csv](states.csv).\n",
        );
        if !run.skipped.is_empty() {
            let _ = writeln!(text, "\nImages left out; the first of them:\n");
            for why in run.skipped.iter().take(10) {
                let _ = writeln!(text, "- {why}");
            }
        }
        text
    }
}

/// Writes `trajectory.tum`, `states.csv`, the pictures, `report.md` and, last, `report.json` into a folder.
///
/// # Errors
/// [`VioError`] names the file that could not be written, or the figure that is not finite.
pub fn save(
    report: &VioReport,
    recording: &Recording,
    run: &Run,
    evaluation: Option<&RunEvaluation>,
    folder: &Path,
) -> Result<(), VioError> {
    let trajectories = run.trajectories()?;
    write_file(&folder.join("trajectory.tum"), segmented_text(&trajectories).as_bytes())?;
    write_file(&folder.join("states.csv"), states_csv(&run.segments).as_bytes())?;
    plots::save(&trajectories, run, evaluation, folder)?;
    write_file(&folder.join("report.md"), report.markdown(recording, run, evaluation.is_some()).as_bytes())?;
    // Last, so that its presence means the folder is complete.
    save_figures(report, folder)?;
    Ok(())
}

/// TUM text; where there is more than one segment, a comment marks each.
fn segmented_text(trajectories: &[Trajectory]) -> String {
    let count = trajectories.len();
    let segment = |(k, trajectory): (usize, &Trajectory)| match count {
        1 => tum::write(trajectory),
        _ => format!("# segment {} of {count}, in a world of its own\n{}", k + 1, tum::write(trajectory)),
    };
    trajectories.iter().enumerate().map(segment).collect()
}

/// The value below which a share of the values lies; 0 of none.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get((sorted.len().saturating_sub(1) as f64 * share).round() as usize).copied().unwrap_or(0.0)
}
