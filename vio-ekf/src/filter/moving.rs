//! What some images and the inertial samples between them tell about the motion when nothing is known before.

mod closed;
mod refine;
mod turn;

use nalgebra::{SMatrix, SVector, Unit, UnitQuaternion, Vector3};

use super::bearing::Bearing;
use super::interval::Interval;
use super::state::at;
use crate::so3;

/// Unknowns besides the points: velocity and gravity at the first image, biases of gyroscope and accelerometer.
pub(super) const GLOBAL: usize = 12;
const VELOCITY: usize = 0;
const GRAVITY: usize = 3;
const BIASES: usize = 6;
/// A point whose misfit is this many times that of the others is another one in each image.
const STRAY: f64 = 2.5;
/// The window is solved again if the gyroscope's bias is found so far from what it was made with, rad/s.
const FAR_OFF: f64 = 3e-3;
/// Fewer points than this prove nothing.
pub(crate) const ENOUGH: usize = 10;

/// When a start in motion is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MovingSettings {
    /// Whether a start in motion is tried at all; yes.
    pub enabled: bool,
    /// Least time that is looked at, s; ours.
    pub least_s: f64,
    /// Longest time that is looked back while the scale is not known, s; ours.
    pub outlook_s: f64,
    /// Standard deviation of a tracked place, pixels; ours. What the points themselves show may raise it.
    pub pixel_sigma: f64,
    /// Largest root mean square misfit, pixels; ours.
    pub misfit: f64,
    /// Largest relative standard deviation of the scale; ours.
    pub scale_sigma: f64,
    /// Standard deviation of the gyroscope's bias before anything is known, rad/s; ours.
    pub gyro_bias_sigma: f64,
    /// The same of the accelerometer's, m/s²; ours.
    pub accel_bias_sigma: f64,
    /// Time after a start in which contradictions make it try again instead of giving up, s; ours.
    pub doubt_s: f64,
}

impl Default for MovingSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            least_s: 0.5,
            outlook_s: 3.0,
            pixel_sigma: 0.3,
            misfit: 1.0,
            scale_sigma: 0.05,
            gyro_bias_sigma: 0.05,
            accel_bias_sigma: 0.1,
            doubt_s: 3.0,
        }
    }
}

/// A point as one of the images of the window sees it: which image, and the direction in camera axes.
pub(crate) type Sighting = (usize, Vector3<f64>);

/// What some images see.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    /// Sightings of each point, in the order of the images, two at least.
    pub(crate) points: &'a [Vec<Sighting>],
    /// Position and attitude of the camera on the body.
    pub(crate) camera: (Vector3<f64>, UnitQuaternion<f64>),
    /// Pixels per radian.
    pub(crate) focal_length: f64,
    /// Magnitude of gravity.
    pub(crate) gravity: f64,
}

/// A scene and the motion between its images.
struct Window<'a> {
    scene: &'a Scene<'a>,
    /// From the first image to each.
    intervals: Vec<Interval>,
    /// Bias of the gyroscope that the intervals were made with; that of the accelerometer was zero.
    gyro_bias: Vector3<f64>,
}

/// What the window tells about its end. Errors of the core and of the distances are those of the window's unknowns, times
/// their derivatives.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    /// Velocity in body axes.
    pub(crate) velocity: Vector3<f64>,
    /// Attitude of the body in a world whose z axis points up; the yaw is arbitrary.
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) accel_bias: Vector3<f64>,
    /// Covariance of the window's unknowns.
    pub(crate) covariance: SMatrix<f64, GLOBAL, GLOBAL>,
    /// Errors of the core by theirs.
    pub(crate) core: SMatrix<f64, { at::CORE }, GLOBAL>,
    /// The points that the last image sees.
    pub(crate) landmarks: Vec<Depth>,
    /// Relative standard deviation of the scale.
    pub(crate) scale_sigma: f64,
    /// Length of the window, s.
    pub(crate) duration: f64,
}

/// Inverse distance of a point at the last image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Depth {
    /// Which of the window's points, and its name.
    pub(crate) point: usize,
    pub(crate) id: u64,
    pub(crate) inverse_distance: f64,
    /// Variance of its own, independent of all else.
    pub(crate) variance: f64,
    /// Derivative by the window's unknowns: what it has in common with all else.
    pub(crate) gradient: SVector<f64, GLOBAL>,
}

/// What is asked of a window.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Verdict {
    /// The motion is known.
    Known(Box<Motion>),
    /// Nothing contradicts, but the scale is not known well enough yet: in hover and in straight flight at constant speed no
    /// camera can know it.
    Open,
    /// The points contradict each other or the samples.
    Contradiction,
}

/// Motion over some images from the inertial sensor's part in between and the directions of points.
///
/// The bias of the gyroscope follows from the directions alone (Kneip and Lynen 2013), velocity, gravity and distances
/// from a closed form (Martinelli 2014), and all of them together with the accelerometer's bias from a descent on the
/// directions. Points that do not fit are left out. `integrate` gives the samples' part from the first image to each, with a
/// bias of the gyroscope that is not far from the true one: what is summed up depends on it in more than first order.
pub(crate) fn solve(
    integrate: impl Fn(&Vector3<f64>) -> Vec<Interval>,
    scene: &Scene,
    settings: &MovingSettings,
) -> Verdict {
    let mut window = Window { scene, intervals: integrate(&Vector3::zeros()), gyro_bias: Vector3::zeros() };
    for _ in 0..2 {
        let gyro_bias = turn::gyro_bias(&window, settings);
        window = Window { scene, intervals: integrate(&gyro_bias), gyro_bias };
    }
    let verdict = with_bias(&window, settings);
    match verdict {
        Verdict::Known(motion) if (motion.gyro_bias - window.gyro_bias).norm() > FAR_OFF => {
            let gyro_bias = motion.gyro_bias;
            with_bias(&Window { scene, intervals: integrate(&gyro_bias), gyro_bias }, settings)
        }
        verdict => verdict,
    }
}

fn with_bias(window: &Window, settings: &MovingSettings) -> Verdict {
    let points = window.scene.points.len();
    let mut kept: Vec<usize> = (0..points).collect();
    for _ in 0..3 {
        let Some(first) = closed::closed_form(window, &kept) else { return Verdict::Open };
        let Some(found) = refine::refine(window, &kept, first, settings) else { return Verdict::Contradiction };
        let typical = median(found.misfits.clone()).max(settings.pixel_sigma);
        let before = kept.len();
        kept = kept.into_iter().zip(&found.misfits).filter(|(_, m)| **m <= STRAY * typical).map(|(k, _)| k).collect();
        if kept.len() < ENOUGH.max(points / 2) {
            return Verdict::Contradiction;
        }
        if kept.len() == before {
            return judge(window, &kept, &found, settings);
        }
    }
    Verdict::Contradiction
}

fn judge(window: &Window, kept: &[usize], found: &refine::Solution, settings: &MovingSettings) -> Verdict {
    let biased = found.global.fixed_rows::<3>(BIASES + 3).amax() > 4.0 * settings.accel_bias_sigma;
    if found.misfit.is_nan() || found.misfit > settings.misfit || biased {
        return Verdict::Contradiction;
    }
    let motion = at_the_end(window, kept, found);
    if motion.scale_sigma > settings.scale_sigma || motion.landmarks.len() < ENOUGH / 2 {
        return Verdict::Open;
    }
    Verdict::Known(Box::new(motion))
}

/// The solution moved to the last image.
fn at_the_end(window: &Window, kept: &[usize], found: &refine::Solution) -> Motion {
    let global = &found.global;
    let last = &window.intervals[window.intervals.len() - 1];
    let biases = global.fixed_rows::<6>(BIASES).into_owned();
    let (rotation, moved, _) = last.with_biases(&window.change(&biases));
    let time = last.duration;
    let down = global.fixed_rows::<3>(GRAVITY).into_owned();
    let end_from_first = rotation.inverse().to_rotation_matrix().into_inner();
    let velocity = end_from_first * (global.fixed_rows::<3>(VELOCITY) + down * time + moved);
    let down = end_from_first * down;
    let attitude = Bearing::new(&Unit::new_normalize(-down)).level();

    // Errors of the core by errors of the unknowns. Turning the end by φ (in the axes of the first image) turns what is
    // expressed in its axes the other way.
    let mut core = SMatrix::<f64, { at::CORE }, GLOBAL>::zeros();
    let turn = end_from_first * last.by_biases(0);
    core.fixed_view_mut::<3, 3>(at::VELOCITY, VELOCITY).copy_from(&end_from_first);
    core.fixed_view_mut::<3, 3>(at::VELOCITY, GRAVITY).copy_from(&(end_from_first * time));
    let by_biases = end_from_first * last.by_biases(3) + velocity.cross_matrix() * turn;
    core.fixed_view_mut::<3, 6>(at::VELOCITY, BIASES).copy_from(&by_biases);
    // δ(down) = Rᵀ hat(g) δθ, inverted for the two components that it determines.
    let level = attitude.to_rotation_matrix().into_inner() / window.scene.gravity;
    let mut tilt = SMatrix::<f64, 3, GLOBAL>::zeros();
    tilt.fixed_view_mut::<3, 3>(0, GRAVITY).copy_from(&(level * end_from_first));
    tilt.fixed_view_mut::<3, 6>(0, BIASES).copy_from(&(level * down.cross_matrix() * turn));
    core.fixed_rows_mut::<1>(at::ATTITUDE).copy_from(&-tilt.row(1));
    core.fixed_rows_mut::<1>(at::ATTITUDE + 1).copy_from(&tilt.row(0));
    core.fixed_view_mut::<6, 6>(at::GYRO_BIAS, BIASES).fill_with_identity();

    let landmarks = found.depths(window, kept);
    let scale = |landmark: &Depth| {
        landmark.gradient.dot(&(found.covariance * landmark.gradient)).sqrt() / landmark.inverse_distance
    };
    let scales: Vec<f64> = landmarks.iter().map(scale).collect();
    Motion {
        velocity,
        attitude,
        gyro_bias: biases.fixed_rows::<3>(0).into_owned(),
        accel_bias: biases.fixed_rows::<3>(3).into_owned(),
        covariance: found.covariance,
        core,
        scale_sigma: if scales.is_empty() { f64::INFINITY } else { median(scales) },
        landmarks,
        duration: time,
    }
}

impl Window<'_> {
    /// What other biases are in addition to those that the intervals were made with.
    fn change(&self, biases: &SVector<f64, 6>) -> SVector<f64, 6> {
        let mut change = *biases;
        let mut gyro = change.fixed_rows_mut::<3>(0);
        gyro -= self.gyro_bias;
        change
    }
}

impl Interval {
    /// Rotation, velocity and position parts with biases that differ from those it was made with.
    fn with_biases(&self, change: &SVector<f64, 6>) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
        let part = |row: usize| self.by_biases(row) * change;
        (so3::exp(&part(0)) * self.rotation, self.velocity + part(3), self.position + part(6))
    }

    /// Derivatives by the biases: of the rotation (0), the velocity (3) or the position (6).
    fn by_biases(&self, row: usize) -> SMatrix<f64, 3, 6> {
        self.bias_jacobian.fixed_view::<3, 6>(row, 0).into_owned()
    }
}

/// The value in the middle; there must be one.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
