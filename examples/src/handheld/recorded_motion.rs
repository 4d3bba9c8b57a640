//! A recorded motion of the robot: placed before the object, smooth between its poses, lost where none were recorded.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Stamp, Trajectory};

use super::arguments::MotionAxes;
use super::error::HandheldError;
use super::motion_file::RecordedPoses;

/// Longest time between two poses over which the robot counts as tracked, s.
const LONGEST_GAP: f64 = 0.1;
/// Largest step between two poses that is no jump of the tracking, m, and fastest speed of a hand, m/s.
const LONGEST_STEP: f64 = 0.05;
const FASTEST: f64 = 5.0;
/// Shortest and longest distance of the spline's knots, s.
const KNOTS: [f64; 2] = [0.01, 0.05];

/// What a recording has to be turned into: metres, axes of the robot, and the object's place.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionFrame {
    /// Metres per unit of the recording.
    pub(super) scale: f64,
    /// Axes of what was recorded.
    pub(super) axes: MotionAxes,
    /// Where the middle of the motion shall be; `None` leaves it where it was recorded.
    pub(super) middle: Option<Isometry3<f64>>,
}

/// A motion with its gaps.
#[derive(Debug)]
pub(super) struct RecordedMotion {
    /// Its duration, s.
    pub(super) duration: f64,
    /// What was assumed and left out, in words.
    pub(super) remarks: Vec<String>,
    spline: Spline,
    /// From and to, s after the start, ascending.
    gaps: Vec<[f64; 2]>,
}

impl RecordedMotion {
    /// From the poses of the file `path`.
    ///
    /// # Errors
    /// [`HandheldError::Motion`]: too short, too fast, or more gap than motion.
    pub(super) fn new(recorded: RecordedPoses, path: &Path, frame: &MotionFrame) -> Result<Self, HandheldError> {
        let refuse = |why: String| HandheldError::Motion { path: path.into(), why };
        let RecordedPoses { source, poses, left_out } = recorded;
        let poses = in_frame(&poses, frame).map_err(|e| refuse(e.to_string()))?;
        let mut steps: Vec<f64> = poses.stamps().windows(2).map(|pair| pair[1].secs_since(pair[0])).collect();
        steps.sort_by(f64::total_cmp);
        let Some(usual) = steps.get(steps.len() / 2).copied() else {
            return Err(refuse("fewer than two poses".into()));
        };
        let speed = median_speed(&poses);
        if speed > FASTEST {
            let why = format!(
                "moves at {speed:.0} m/s, which no hand does: if its unit is not the metre, give --motion-scale (0.001 for millimetres)"
            );
            return Err(refuse(why));
        }
        let interval = usual.clamp(KNOTS[0], KNOTS[1]);
        let nanos = (interval * 1e9) as i64;
        let spline = Spline::through_trajectory(&poses, nanos).map_err(|e| refuse(e.to_string()))?;
        let (start, end) = spline.span();
        let duration = end.secs_since(start);
        let gaps = gaps(&poses, start);
        let lost: f64 = gaps.iter().map(|[from, to]| to.min(duration) - from.max(0.0)).sum();
        if lost > 0.5 * duration {
            let why = format!(
                "{lost:.1} of its {duration:.1} s lie in gaps of more than {LONGEST_GAP} s: record it at 10 Hz or faster"
            );
            return Err(refuse(why));
        }
        let mut remarks =
            vec![format!("motion from {source}: {} poses in {duration:.1} s, {:.0} Hz", poses.len(), 1.0 / usual)];
        if left_out > 0 {
            remarks.push(format!("{left_out} poses left out: their stamps repeat others or go back"));
        }
        if !gaps.is_empty() {
            remarks.push(format!("{} gaps and jumps, {lost:.1} s: the valve stays shut there", gaps.len()));
        }
        Ok(Self { duration, remarks, spline, gaps })
    }

    /// The robot at a time after the start, s; before and after the motion at its ends.
    pub(super) fn at(&self, time: f64) -> Isometry3<f64> {
        let (start, end) = self.spline.span();
        let nanos = (time.clamp(0.0, self.duration) * 1e9) as i64;
        let stamp = Stamp::from_nanos((start.nanos() + nanos).min(end.nanos()));
        // Inside of the span there is a pose at any time.
        self.spline.sample(stamp).map_or_else(|_| Isometry3::identity(), |motion| motion.world_from_body)
    }

    /// Whether the robot is tracked at a time, s.
    pub(super) fn tracked(&self, time: f64) -> bool {
        let next = self.gaps.partition_point(|[_, to]| *to <= time);
        self.gaps.get(next).is_none_or(|[from, _]| time < *from)
    }
}

/// In metres, with the robot's axes, where the object is.
fn in_frame(poses: &Trajectory, frame: &MotionFrame) -> Result<Trajectory, vio_ekf::Error> {
    let recorded_from_robot = match frame.axes {
        MotionAxes::Robot => UnitQuaternion::identity(),
        // A camera looks along z, its y axis points down.
        MotionAxes::Camera => UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::new(
            0.0, -1.0, 0.0, //
            0.0, 0.0, -1.0, //
            1.0, 0.0, 0.0,
        ))),
    };
    let metric = |pose: &Isometry3<f64>| {
        let place = Translation3::from(pose.translation.vector * frame.scale);
        Isometry3::from_parts(place, pose.rotation * recorded_from_robot)
    };
    let poses_in_metres: Vec<_> = poses.poses().iter().map(metric).collect();
    let place = frame.middle.map_or_else(Isometry3::identity, |middle| middle * mean(&poses_in_metres).inverse());
    Trajectory::new(poses.stamps().to_vec(), poses_in_metres.iter().map(|pose| place * pose).collect())
}

/// Mean place, and the orientation whose axes are nearest to the mean ones.
fn mean(poses: &[Isometry3<f64>]) -> Isometry3<f64> {
    let share = 1.0 / poses.len().max(1) as f64;
    let sum = |of: &dyn Fn(&Isometry3<f64>) -> Vector3<f64>| poses.iter().map(of).sum::<Vector3<f64>>() * share;
    let x = sum(&|pose| pose.rotation * Vector3::x());
    let z = sum(&|pose| pose.rotation * Vector3::z());
    // A motion that turns all the way round has no mean; any will do.
    let rotation =
        UnitQuaternion::face_towards(&x, &z) * UnitQuaternion::face_towards(&Vector3::x(), &Vector3::z()).inverse();
    let place = sum(&|pose| pose.translation.vector);
    let finite = rotation.coords.iter().all(|c| c.is_finite());
    Isometry3::from_parts(Translation3::from(place), if finite { rotation } else { UnitQuaternion::identity() })
}

/// Median over all steps.
fn median_speed(poses: &Trajectory) -> f64 {
    let pairs = poses.stamps().windows(2).zip(poses.poses().windows(2));
    let speed = |(t, p): (&[Stamp], &[Isometry3<f64>])| length(p) / t[1].secs_since(t[0]);
    let mut speeds: Vec<f64> = pairs.map(speed).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.get(speeds.len() / 2).copied().unwrap_or(0.0)
}

fn length(pair: &[Isometry3<f64>]) -> f64 {
    (pair[1].translation.vector - pair[0].translation.vector).norm()
}

/// Where poses are missing, or jump farther and faster than a hand.
fn gaps(poses: &Trajectory, start: Stamp) -> Vec<[f64; 2]> {
    let pairs = poses.stamps().windows(2).zip(poses.poses().windows(2));
    pairs
        .filter(|(t, p)| {
            let (time, step) = (t[1].secs_since(t[0]), length(p));
            time > LONGEST_GAP || (step > LONGEST_STEP && step > FASTEST * time)
        })
        .map(|(t, _)| [t[0].secs_since(start), t[1].secs_since(start)])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trajectory(poses: &[(f64, [f64; 3])]) -> Trajectory {
        let stamps = poses.iter().map(|(time, _)| Stamp::from_secs(*time).unwrap()).collect();
        Trajectory::new(stamps, poses.iter().map(|(_, [x, y, z])| Isometry3::translation(*x, *y, *z)).collect())
            .unwrap()
    }

    #[test]
    fn gaps_are_silences_and_jumps() {
        let still = trajectory(&[
            (10.0, [0.0; 3]),
            (10.05, [0.04, 0.0, 0.0]),
            // A silence.
            (10.2, [0.05, 0.0, 0.0]),
            (10.25, [0.06, 0.0, 0.0]),
            // A jump: 0.3 m in 0.05 s.
            (10.3, [0.36, 0.0, 0.0]),
            // Far, but no faster than a hand.
            (10.38, [0.36, 0.3, 0.0]),
            // Fast, but not far.
            (10.385, [0.36, 0.34, 0.0]),
        ]);
        let gaps = gaps(&still, Stamp::from_secs(10.0).unwrap());
        let expected = [[0.05, 0.2], [0.25, 0.3]];
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        assert!(gaps.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9), "{gaps:?}");
        // Steps of 0.8, 0.067, 0.2, 6, 3.75 and 8 m/s.
        assert!((median_speed(&still) - 3.75).abs() < 1e-6);
    }

    #[test]
    fn a_recording_is_placed_turned_and_scaled() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        let pose = |x: f64| Isometry3::from_parts(Translation3::new(x, 100.0, 0.0), turn);
        let stamps = [0.0, 0.1, 0.2].map(|time| Stamp::from_secs(time).unwrap()).to_vec();
        let poses = Trajectory::new(stamps, [0.0, 200.0, 400.0].map(pose).to_vec()).unwrap();
        let middle = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * 0.5);
        let frame = MotionFrame { scale: 1e-3, axes: MotionAxes::Robot, middle: Some(middle) };
        let placed = in_frame(&poses, &frame).unwrap();
        // The one in the middle is where the middle shall be, the others 0.2 m before and after it along the recording's x.
        assert!((placed.poses()[1].inverse() * middle).translation.vector.norm() < 1e-9);
        assert!(placed.poses()[1].rotation.angle_to(&middle.rotation) < 1e-9);
        let way = placed.poses()[2].translation.vector - placed.poses()[1].translation.vector;
        let expected = middle.rotation * turn.inverse() * Vector3::x() * 0.2;
        assert!((way - expected).norm() < 1e-9, "{way}");
        // A camera looks along z with y down: the robot's x and -z.
        let frame = MotionFrame { scale: 1.0, axes: MotionAxes::Camera, middle: None };
        let turned = in_frame(&trajectory(&[(0.0, [0.0; 3]), (0.1, [0.0; 3])]), &frame).unwrap();
        assert!((turned.poses()[0] * Vector3::x() - Vector3::z()).norm() < 1e-12);
        assert!((turned.poses()[0] * Vector3::z() + Vector3::y()).norm() < 1e-12);
    }
}
