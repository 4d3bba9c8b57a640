//! Why a run failed: the inertial sensor is read with other axes, and a reading with which the images can be followed is named.

use vio_ekf::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::{Matrix3, Vector3};
use vio_ekf::{Imu, ImuNoise, Stamp, Status, Vio};

use super::camera_frames::{CameraFrame, camera_frames};
use super::grey_image::GreyImage;
use super::recording::Recording;
use super::run::RunSettings;

/// Length of the part of the recording that is looked at, s: the one with the most rotation.
const WINDOW_S: f64 = 8.0;
/// A reading is right if it follows this share of the window's images...
const FOLLOWED: f64 = 0.5;
/// ... and the one given is wrong if it follows less than this share of what the right one does.
const CLEARLY_LESS: f64 = 0.5;
/// Share of an image's landmarks that must agree with the prediction for it to be followed.
const AGREEING: f64 = 0.7;
/// With the right reading the filter starts within this time in motion, s; waiting longer for wrong ones takes minutes.
const START_S: f64 = 1.5;
/// Landmarks that an image must follow at least.
const MIN_LANDMARKS: usize = 8;

/// A way to read the inertial sensor.
struct Reading {
    name: String,
    gyro: Matrix3<f64>,
    accel: Matrix3<f64>,
}

/// Another reading of the inertial sensor with which the images can be followed where they cannot be as it is; `None` if there is
/// none, or if nothing is wrong there. Negated, mirrored, swapped and cycled axes of either sensor, or of both against the camera.
pub fn diagnose(recording: &Recording, settings: &RunSettings) -> Option<String> {
    let (from, until) = busiest_window(&recording.samples, WINDOW_S)?;
    let frames: Vec<(Stamp, GreyImage)> = camera_frames(recording)
        .skip_while(|frame| frame.stamp < from)
        .take_while(|frame| frame.stamp <= until)
        .filter_map(|CameraFrame { stamp, picture, .. }| Some((stamp, picture.ok()?)))
        .collect();
    let samples: Vec<Imu> =
        recording.samples.iter().filter(|sample| (from..=until).contains(&sample.stamp)).copied().collect();
    let share = |reading: &Reading| followed_share(recording, settings, (&samples, &frames), reading);
    let given = share(&Reading { name: String::new(), gyro: Matrix3::identity(), accel: Matrix3::identity() });
    let readings = readings();
    let shares = in_parallel(&readings, settings.threads, &share);
    let best = shares.iter().zip(&readings).max_by(|a, b| a.0.total_cmp(b.0))?;
    let (&most, reading) = best;
    (most >= FOLLOWED && given < CLEARLY_LESS * most).then(|| {
        let [given, most] = [given, most].map(|share| 100.0 * share);
        format!("{}: {most:.0} % of the images of a part can be followed then, {given:.0} % as it is", reading.name)
    })
}

/// The part of a recording that turns most; `None` if there are no samples.
pub(super) fn busiest_window(samples: &[Imu], length_s: f64) -> Option<(Stamp, Stamp)> {
    let (first, last) = (samples.first()?.stamp, samples.last()?.stamp);
    let starts = (0..).map(|k| first.plus_secs(f64::from(k))).take_while(|start| start.plus_secs(length_s) <= last);
    let turning = |start: Stamp| {
        let end = start.plus_secs(length_s);
        let inside = samples.iter().filter(|sample| (start..=end).contains(&sample.stamp));
        inside.map(|sample| sample.gyro.norm_squared()).sum::<f64>()
    };
    let best = starts.map(|start| (turning(start), start)).max_by(|a, b| a.0.total_cmp(&b.0));
    let start = best.map_or(first, |(_, start)| start);
    Some((start, start.plus_secs(length_s).min(last)))
}

/// Share of the images that the filter follows, from a start in motion, with the samples read in a given way.
fn followed_share(
    recording: &Recording,
    settings: &RunSettings,
    (samples, frames): (&[Imu], &[(Stamp, GreyImage)]),
    reading: &Reading,
) -> f64 {
    let camera: CameraCalibration = recording.camera;
    let noise: ImuNoise = settings.noise.unwrap_or(recording.imu.noise);
    let imu = ImuCalibration { noise, ..recording.imu };
    let Ok(mut vio) = Vio::from_calibration(&[camera], &imu, settings.filter) else { return 0.0 };
    if recording.mask.as_ref().is_some_and(|mask| vio.set_mask(&mask.view()).is_err()) {
        return 0.0;
    }
    let (mut next, mut followed, mut started) = (samples.iter(), 0, false);
    let Some((first, _)) = frames.first() else { return 0.0 };
    for (stamp, picture) in frames {
        let time = stamp.plus_secs(camera.time_offset_s);
        for sample in next.by_ref() {
            let read = Imu { gyro: reading.gyro * sample.gyro, accel: reading.accel * sample.accel, ..*sample };
            if vio.imu(&read).is_err() || sample.stamp >= time {
                break;
            }
        }
        let Ok(report) = vio.image(*stamp, &picture.view()) else { continue };
        let agree = report.used as f64 >= AGREEING * (report.used + report.rejected) as f64;
        followed += usize::from(report.status == Status::Tracking && agree && report.used >= MIN_LANDMARKS);
        let running = report.status.has_estimate();
        let too_late = !started && stamp.secs_since(*first) > START_S;
        if (started && !running) || too_late || matches!(report.status, Status::Diverged(_)) {
            break;
        }
        started |= running;
    }
    followed as f64 / frames.len() as f64
}

/// The results do not depend on the number of threads.
fn in_parallel(readings: &[Reading], threads: usize, share: &(dyn Fn(&Reading) -> f64 + Sync)) -> Vec<f64> {
    let part = readings.len().div_ceil(threads.max(1));
    std::thread::scope(|scope| {
        let workers: Vec<_> = readings
            .chunks(part)
            .map(|part| scope.spawn(move || part.iter().map(share).collect::<Vec<f64>>()))
            .collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(join).collect()
    })
}

/// The mistakes that people make, undone.
fn readings() -> Vec<Reading> {
    let rows = |order: [usize; 3], signs: [f64; 3]| Matrix3::from_fn(|r, c| if order[r] == c { signs[r] } else { 0.0 });
    let flips = [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]].map(|signs| rows([0, 1, 2], signs));
    let orders = [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]].map(|order| rows(order, [1.0; 3]));
    let identity = Matrix3::identity();
    let of_one = flips.into_iter().chain(orders).chain([-identity]);
    // Turned together they are another place of the sensor on the robot: by half turns, and by quarters.
    let half_turns = flips.map(|flip| -flip);
    let quarters = (0..3).flat_map(|axis| {
        [1.0, -1.0].map(|sign| {
            let mut unit = Vector3::zeros();
            unit[axis] = 1.0;
            (unit * unit.transpose()) + unit.cross_matrix() * sign
        })
    });
    let of_both = half_turns.into_iter().chain(orders[3..].iter().copied()).chain(quarters);
    let gyro = of_one.clone().map(|axes| (format!("the gyroscope's (x, y, z) are {}", names(&axes)), axes, identity));
    let accel = of_one.map(|axes| (format!("the accelerometer's (x, y, z) are {}", names(&axes)), identity, axes));
    let both = of_both.map(|axes| (format!("the (x, y, z) of both sensors are {}", names(&axes)), axes, axes));
    gyro.chain(accel).chain(both).map(|(name, gyro, accel)| Reading { name, gyro, accel }).collect()
}

/// The rows of a signed permutation in terms of what is read.
fn names(axes: &Matrix3<f64>) -> String {
    let row = |r: usize| {
        let column = (0..3).find(|&c| axes[(r, c)].abs() > 0.5).unwrap_or(r);
        format!("{}{}", if axes[(r, column)] < 0.0 { "-" } else { "" }, ["x", "y", "z"][column])
    };
    format!("({}, {}, {})", row(0), row(1), row(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_signed_permutations_and_differ() {
        let readings = readings();
        for (k, reading) in readings.iter().enumerate() {
            for axes in [reading.gyro, reading.accel] {
                assert!((axes * axes.transpose() - Matrix3::identity()).norm() < 1e-12, "{}", reading.name);
            }
            assert!(readings[..k].iter().all(|other| (other.gyro, other.accel) != (reading.gyro, reading.accel)));
            // What is done to both is a rotation: a mirror image of a robot does not fly.
            assert!(!reading.name.contains("both") || reading.gyro.determinant() > 0.0, "{}", reading.name);
        }
        assert_eq!(names(&Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)), "(-y, x, z)");
    }
}
