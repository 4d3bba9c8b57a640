//! Why a run failed: the inertial sensor is read with other axes, and a reading with which the images can be followed is named.

use std::fmt;

use nalgebra::{Matrix3, Vector3};

use crate::filter::report::Status;
use crate::filter::vio::Vio;
use crate::imu_check::signed_axes::axis_names;
use crate::imu_check::window::busiest_window;
use crate::run::frames::{Picture, RecordedFrame};
use crate::samples::Imu;
use crate::stamp::Stamp;

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

/// Which sensors are read otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MisreadSensor {
    /// The gyroscope alone.
    Gyroscope,
    /// The accelerometer alone.
    Accelerometer,
    /// Both alike: they sit on the robot in another way.
    Both,
}

/// Another reading of the inertial sensor with which the odometry goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesDiagnosis {
    /// Which sensors are read otherwise.
    pub sensor: MisreadSensor,
    /// What is right, from what is given: a signed permutation of the axes.
    pub axes: Matrix3<f64>,
    /// Share of the images of the part that turns most that can be followed then.
    pub followed: f64,
    /// The same as the samples are given.
    pub followed_as_given: f64,
}

impl fmt::Display for AxesDiagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.sensor {
            MisreadSensor::Gyroscope => "the gyroscope's (x, y, z) are ",
            MisreadSensor::Accelerometer => "the accelerometer's (x, y, z) are ",
            MisreadSensor::Both => "the (x, y, z) of both sensors are ",
        })?;
        let [given, most] = [self.followed_as_given, self.followed].map(|share| 100.0 * share);
        let axes = axis_names(&self.axes);
        write!(f, "{axes}: {most:.0} % of the images of a part can be followed then, {given:.0} % as it is")
    }
}

/// A way to read the inertial sensor.
#[derive(Debug, Clone, Copy)]
struct Reading {
    sensor: MisreadSensor,
    axes: Matrix3<f64>,
}

impl Reading {
    fn read(&self, sample: &Imu) -> Imu {
        let gyro = if self.sensor == MisreadSensor::Accelerometer { sample.gyro } else { self.axes * sample.gyro };
        let accel = if self.sensor == MisreadSensor::Gyroscope { sample.accel } else { self.axes * sample.accel };
        Imu { gyro, accel, ..*sample }
    }
}

/// Another reading of the inertial sensor with which the images can be followed where they cannot be as it is; `None` if there is
/// none, or if nothing is wrong there. Negated, mirrored, swapped and cycled axes of either sensor, or of both against the camera.
///
/// `vio` is the filter as it was before the run; each reading gets a copy of it. With more than one thread the readings are shared
/// among as many; the result does not depend on it.
pub fn diagnose_axes<P: Picture + Sync>(
    vio: &Vio,
    samples: &[Imu],
    frames: impl IntoIterator<Item = RecordedFrame<P>>,
    threads: usize,
) -> Option<AxesDiagnosis> {
    let (from, until) = busiest_window(samples, WINDOW_S)?;
    let frames: Vec<(Stamp, P)> = frames
        .into_iter()
        .skip_while(|frame| frame.stamp < from)
        .take_while(|frame| frame.stamp <= until)
        .filter_map(|RecordedFrame { stamp, picture, .. }| Some((stamp, picture.ok()?)))
        .collect();
    let samples: Vec<Imu> = samples.iter().filter(|sample| (from..=until).contains(&sample.stamp)).copied().collect();
    let share = |reading: &Reading| followed_share(vio.clone(), &samples, &frames, reading);
    let followed_as_given = share(&Reading { sensor: MisreadSensor::Both, axes: Matrix3::identity() });
    let readings = readings();
    let shares = in_parallel(&readings, threads, &share);
    let (&followed, reading) = shares.iter().zip(&readings).max_by(|a, b| a.0.total_cmp(b.0))?;
    let Reading { sensor, axes } = *reading;
    let found = followed >= FOLLOWED && followed_as_given < CLEARLY_LESS * followed;
    found.then_some(AxesDiagnosis { sensor, axes, followed, followed_as_given })
}

/// Share of the images that the filter follows, from a start in motion, with the samples read in a given way.
fn followed_share(mut vio: Vio, samples: &[Imu], frames: &[(Stamp, impl Picture)], reading: &Reading) -> f64 {
    let (mut next, mut followed, mut started) = (samples.iter(), 0, false);
    let Some((first, _)) = frames.first() else { return 0.0 };
    let time_offset_s = vio.time_offset_s();
    for (stamp, picture) in frames {
        let time = stamp.plus_secs(time_offset_s);
        for sample in next.by_ref() {
            if vio.imu(&reading.read(sample)).is_err() || sample.stamp >= time {
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

/// The results do not depend on the number of threads; one spawns none.
fn in_parallel(readings: &[Reading], threads: usize, share: &(dyn Fn(&Reading) -> f64 + Sync)) -> Vec<f64> {
    if threads < 2 {
        return readings.iter().map(share).collect();
    }
    let part = readings.len().div_ceil(threads);
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
    let read = |sensor| move |axes| Reading { sensor, axes };
    let gyro = of_one.clone().map(read(MisreadSensor::Gyroscope));
    let accel = of_one.map(read(MisreadSensor::Accelerometer));
    gyro.chain(accel).chain(of_both.map(read(MisreadSensor::Both))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_signed_permutations_and_differ() {
        let readings = readings();
        for (k, Reading { sensor, axes }) in readings.iter().enumerate() {
            assert!((axes * axes.transpose() - Matrix3::identity()).norm() < 1e-12, "{axes}");
            assert!(readings[..k].iter().all(|other| (other.sensor, &other.axes) != (*sensor, axes)));
            // What is done to both is a rotation: a mirror image of a robot does not fly.
            assert!(*sensor != MisreadSensor::Both || axes.determinant() > 0.0, "{axes}");
        }
        assert_eq!(axis_names(&Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)), "(-y, x, z)");
    }

    #[test]
    fn threads_change_neither_shares_nor_their_order() {
        let all = readings();
        // What a reading makes of a vector that no two of them make the same of.
        let share = |reading: &Reading| {
            let read = reading.axes * Vector3::new(1.0, 10.0, 100.0);
            read.x + 7.0 * read.y + 49.0 * read.z + 1e6 * f64::from(reading.sensor as u8)
        };
        let expected: Vec<f64> = all.iter().map(share).collect();
        for threads in [0, 1, 2, 3, 7, 1000] {
            assert_eq!(in_parallel(&all, threads, &share), expected, "{threads} threads");
        }
    }
}
