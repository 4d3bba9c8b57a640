//! The motions along which the odometry is evaluated, and the cameras that go along.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use nalgebra::{Isometry3, Translation3, Vector3};
use vio_ekf::format::{asl, euroc, tum};
use vio_ekf::sim::{camera_ahead, camera_ahead_right, painting_flight};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Imu, Stamp, Trajectory};

/// Four recorded flights, and two along a wall that is to be painted.
pub const SEQUENCES: [&str; 6] = ["MH_01", "MH_03", "MH_04", "V1_02", "paint_1", "paint_2"];

/// Recorded flights together with the readings of the inertial sensor that was on board.
pub const REAL_IMU: [&str; 3] = ["V1_01_imu", "V1_02_imu", "MH_04_imu"];

/// Recorded flights and walks that are slower, faster or turn more than [`SEQUENCES`]: of the TUM VI, UZH-FPV (drone races), KAIST VIO and TUM
/// RGB-D data sets.
pub const OTHER_FLIGHTS: [&str; 11] = [
    "room1",
    "room4",
    "indoor_3",
    "indoor_5",
    "outdoor_5",
    "circle",
    "infinite",
    "rotation",
    "square",
    "fr1_xyz",
    "fr2_desk",
];

/// Left and right camera of a sequence.
pub fn cameras(name: &str) -> [Camera; 2] {
    if name.starts_with("paint") {
        [camera_ahead(), camera_ahead_right()]
    } else {
        [Camera::euroc(), Camera::euroc_right()]
    }
}

/// The motion of a sequence, cut to some seconds; recordings are looked for in the folder `data`.
///
/// # Errors
/// If there is no such sequence, or its recording cannot be read.
pub fn motion(data: &Path, name: &str, seconds: Option<f64>) -> Result<Spline, Box<dyn Error>> {
    // A cubic B-spline shrinks what is fast, by a sixth of its knots' interval squared times the acceleration: along real samples
    // the camera would swing less than the sensor says.
    let (file, knots) = match name {
        "MH_01" => ("trajectories/euroc/MH_01_easy.txt.gz", 50_000_000),
        "MH_03" => ("trajectories/euroc/MH_03_medium.txt.gz", 50_000_000),
        "MH_04" => ("vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz", 50_000_000),
        "V1_02" => ("vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz", 50_000_000),
        "MH_04_imu" => ("vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz", 5_000_000),
        "V1_02_imu" => ("vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz", 5_000_000),
        "V1_01_imu" => ("vio/euroc_V1_01_micro/mav0/state_groundtruth_estimate0/V1_01_easy.txt.gz", 50_000_000),
        "room1" => ("trajectories/tum_vi/dataset-room1_512_16.txt.gz", 50_000_000),
        "room4" => ("trajectories/tum_vi/dataset-room4_512_16.txt.gz", 50_000_000),
        "indoor_3" => ("trajectories/uzhfpv/indoor_forward_3_snapdragon_with_gt.txt.gz", 50_000_000),
        "indoor_5" => ("trajectories/uzhfpv/indoor_forward_5_snapdragon_with_gt.txt.gz", 50_000_000),
        "outdoor_5" => ("trajectories/uzhfpv/outdoor_forward_5_snapdragon_with_gt.txt.gz", 50_000_000),
        "circle" => ("trajectories/kaist_vio/circle_fast.txt.gz", 50_000_000),
        "infinite" => ("trajectories/kaist_vio/infinite_fast.txt.gz", 50_000_000),
        "rotation" => ("trajectories/kaist_vio/rotation.txt.gz", 50_000_000),
        "square" => ("trajectories/kaist_vio/square_head.txt.gz", 50_000_000),
        "fr1_xyz" => ("trajectories/evo/freiburg1_xyz-groundtruth.txt.gz", 50_000_000),
        "fr2_desk" => ("trajectories/evo/fr2_desk_groundtruth.txt.gz", 50_000_000),
        "paint_1" => return Ok(painting_flight(1, seconds.unwrap_or(60.0))?),
        "paint_2" => return Ok(painting_flight(2, seconds.unwrap_or(60.0))?),
        _ => {
            let names = [&SEQUENCES[..], &OTHER_FLIGHTS[..], &REAL_IMU[..]].concat().join(", ");
            return Err(format!("`{name}` is no sequence: they are {names}").into());
        }
    };
    let text = unpacked(data, file)?;
    let whole = match file.ends_with("csv.gz") {
        true if REAL_IMU.contains(&name) => without_jumps(&euroc::read(&text)?)?,
        true => euroc::read(&text)?.trajectory,
        false => tum::read(&text)?,
    };
    let mut cut = Trajectory::default();
    let first = whole.stamps().first().copied().unwrap_or_default().plus_secs(on_ground(name));
    let flown = whole.iter().filter(|(stamp, _)| *stamp >= first);
    for (stamp, pose) in flown.take_while(|(s, _)| seconds.is_none_or(|most| s.secs_since(first) <= most)) {
        cut.push(stamp, *pose)?;
    }
    // Poses as far apart as the knots must be met, not approached.
    let spline = if name == "V1_01_imu" { Spline::through_trajectory } else { Spline::from_trajectory };
    Ok(spline(&cut, knots)?)
}

/// Seconds that a recording of KAIST VIO stands on the ground; there its truth turns by half a turn now and then, which nothing does.
fn on_ground(name: &str) -> f64 {
    match name {
        "circle" => 64.0,
        "infinite" => 60.0,
        "rotation" => 76.0,
        "square" => 12.0,
        _ => 0.0,
    }
}

/// What the inertial sensor on board read along the motion of one of [`REAL_IMU`].
///
/// # Errors
/// If there is no such sequence, or its recording cannot be read.
pub fn real_samples(data: &Path, name: &str, motion: &Spline) -> Result<Vec<Imu>, Box<dyn Error>> {
    let file = match name {
        "V1_01_imu" => "vio/euroc_V1_01_micro/mav0/imu0/data.csv.gz",
        "V1_02_imu" => "vio/euroc_imu_gt/V1_02_medium/imu_V102.txt.gz",
        "MH_04_imu" => "vio/euroc_imu_gt/MH_04_difficult/imu_MH04.txt.gz",
        _ => return Err(format!("there are no readings of `{name}`: they are of {}", REAL_IMU.join(", ")).into()),
    };
    let (first, last) = motion.span();
    let mut samples = asl::read_imu(&unpacked(data, file)?)?;
    samples.retain(|sample| (first..=last).contains(&sample.stamp));
    Ok(samples)
}

/// A recorded truth moves by more than its own velocity where its maker's position fixes pulled at it. From this on, m, nothing flies
/// so: in `MH_04` there are 39 such places, the largest of 13 cm.
const JUMP: f64 = 1e-3;

/// Poses without the jumps: what comes after one is shifted back by it. Along the rest the samples are what they were.
fn without_jumps(states: &euroc::States) -> Result<Trajectory, Box<dyn Error>> {
    let mut joined = Trajectory::default();
    let (mut shift, mut last) = (Vector3::zeros(), None::<(Stamp, Vector3<f64>, Vector3<f64>)>);
    for ((stamp, pose), &velocity) in states.trajectory.iter().zip(&states.velocities_in_world) {
        let position = pose.translation.vector;
        if let Some((before, from, began)) = last {
            let jump = position - from - (began + velocity) * (0.5 * stamp.secs_since(before));
            if jump.norm() > JUMP {
                shift -= jump;
            }
        }
        last = Some((stamp, position, velocity));
        joined.push(stamp, Isometry3::from_parts(Translation3::from(position + shift), pose.rotation))?;
    }
    Ok(joined)
}

/// Text of a gzipped file.
fn unpacked(data: &Path, file: &str) -> Result<String, Box<dyn Error>> {
    let path = data.join(file);
    let output = Command::new("gzip").arg("-dc").arg(&path).output()?;
    if !output.status.success() {
        return Err(
            format!("cannot read {}: set PAINTCOPTER_DATA to the folder with the recordings", path.display()).into()
        );
    }
    Ok(String::from_utf8(output.stdout)?)
}
