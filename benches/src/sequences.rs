//! The motions along which the odometry is evaluated, and the cameras that go along.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use vio_ekf::sim::{camera_ahead, camera_ahead_right, painting_flight};
use vio_ekf::{Camera, Spline, Trajectory, euroc, tum};

/// Four recorded flights, and two along a wall that is to be painted.
pub const SEQUENCES: [&str; 6] = ["MH_01", "MH_03", "MH_04", "V1_02", "paint_1", "paint_2"];

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
    let file = match name {
        "MH_01" => "trajectories/euroc/MH_01_easy.txt.gz",
        "MH_03" => "trajectories/euroc/MH_03_medium.txt.gz",
        "MH_04" => "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
        "V1_02" => "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        "paint_1" => return Ok(painting_flight(1, seconds.unwrap_or(60.0))?),
        "paint_2" => return Ok(painting_flight(2, seconds.unwrap_or(60.0))?),
        _ => return Err(format!("`{name}` is no sequence: they are {}", SEQUENCES.join(", ")).into()),
    };
    let path = data.join(file);
    let output = Command::new("gzip").arg("-dc").arg(&path).output()?;
    if !output.status.success() {
        return Err(
            format!("cannot read {}: set PAINTCOPTER_DATA to the folder with the recordings", path.display()).into()
        );
    }
    let text = String::from_utf8(output.stdout)?;
    let whole = if file.ends_with("csv.gz") { euroc::read(&text)?.trajectory } else { tum::read(&text)? };
    let mut cut = Trajectory::default();
    let first = whole.stamps().first().copied().unwrap_or_default();
    for (stamp, pose) in whole.iter().take_while(|(s, _)| seconds.is_none_or(|most| s.secs_since(first) <= most)) {
        cut.push(stamp, *pose)?;
    }
    Ok(Spline::from_trajectory(&cut, 50_000_000)?)
}
