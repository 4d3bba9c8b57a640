use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Unit, UnitQuaternion, Vector2, Vector3, Vector6};

use super::bearing::Bearing;
use super::interval::Interval;
use crate::so3;

/// Unknowns besides the distances: velocity, gravity, gyroscope's bias.
const GLOBAL: usize = 9;
const ITERATIONS: usize = 50;

/// When a start in motion is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MovingSettings {
    /// Whether a start in motion is tried at all; yes.
    pub enabled: bool,
    /// Longest time that is looked back, s; ours.
    pub window_s: f64,
    /// Standard deviation of a tracked place, pixels; ours.
    pub pixel_sigma: f64,
    /// Largest root mean square misfit, pixels; ours.
    pub misfit: f64,
    /// Largest standard deviation of the velocity relative to the speed: the scale must be known this well; ours.
    pub scale_sigma: f64,
    /// Largest difference between gravity as found and as it is, m/s²; ours.
    pub gravity_tolerance: f64,
    /// Standard deviation of the gyroscope's bias before anything is known, rad/s; ours.
    pub gyro_bias_sigma: f64,
    /// The same of the accelerometer's, m/s²; ours.
    pub accel_bias_sigma: f64,
}

impl Default for MovingSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            window_s: 1.0,
            pixel_sigma: 0.3,
            misfit: 0.6,
            scale_sigma: 0.05,
            gravity_tolerance: 0.5,
            gyro_bias_sigma: 0.05,
            accel_bias_sigma: 0.1,
        }
    }
}

/// A point as one of the images of the window sees it: which image, and the direction in camera axes.
pub(crate) type Sighting = (usize, Vector3<f64>);

/// What the window tells about its end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    /// Velocity in body axes.
    pub(crate) velocity: Vector3<f64>,
    /// Gravity, pointing down, in body axes.
    pub(crate) gravity: Vector3<f64>,
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) velocity_sigma: f64,
    pub(crate) tilt_sigma: f64,
    pub(crate) gyro_bias_sigma: f64,
    /// Median over the points, 1/m.
    pub(crate) inverse_distance: f64,
}

/// Motion over some images from the inertial sensor's part in between and the directions of points.
///
/// The closed form of Martinelli 2014 gives velocity, gravity and distances; a descent on the directions then refines
/// them together with the gyroscope's bias, with the known magnitude of gravity. `None` if the points contradict each
/// other, if gravity comes out wrong, or if the scale is not known: in hover and in straight flight at constant speed no
/// camera can know it.
pub(crate) fn solve(
    intervals: &[Interval],
    points: &[Vec<Sighting>],
    camera: &(Vector3<f64>, UnitQuaternion<f64>),
    focal_length: f64,
    gravity: f64,
    settings: &MovingSettings,
) -> Option<Motion> {
    let (mut global, mut inverse_distances) = closed_form(intervals, points, camera)?;
    let off = (global.fixed_rows::<3>(3).norm() - gravity).abs();
    if off.is_nan() || off > 0.5 * gravity {
        return None;
    }
    let weight = (focal_length / settings.pixel_sigma).powi(2);
    let prior = |global: &SVector<f64, GLOBAL>| {
        // Gravity has a known length, up to the accelerometer's bias; the gyroscope's bias is small.
        let down = global.fixed_rows::<3>(3).into_owned();
        let bias = global.fixed_rows::<3>(6).into_owned();
        let (long, biased) = (settings.accel_bias_sigma.powi(-2), settings.gyro_bias_sigma.powi(-2));
        let (mut matrix, mut vector) = (SMatrix::<f64, GLOBAL, GLOBAL>::zeros(), SVector::<f64, GLOBAL>::zeros());
        let along = down.normalize();
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&(along * along.transpose() * long));
        vector.fixed_rows_mut::<3>(3).copy_from(&(along * ((gravity - down.norm()) * long)));
        matrix.fixed_view_mut::<3, 3>(6, 6).fill_diagonal(biased);
        vector.fixed_rows_mut::<3>(6).copy_from(&(bias * -biased));
        (matrix, vector, (gravity - down.norm()).powi(2) * long + bias.norm_squared() * biased)
    };
    // Levenberg-Marquardt: the closed form is off where the gyroscope's bias is not small.
    let mut sums = normal_equations(intervals, points, camera, &global, &inverse_distances)?;
    let (mut damping, mut converged) = (1e-6, false);
    for _ in 0..ITERATIONS {
        let (matrix, vector, cost) = prior(&global);
        let mut matrix = matrix + sums.matrix * weight;
        let descent = vector + sums.vector * weight;
        // Damping holds back along the valley of the scale long before it does across: the end is judged without it.
        converged = descent.dot(&matrix.cholesky()?.solve(&descent)) < 1e-3;
        if converged {
            break;
        }
        for k in 0..GLOBAL {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let step = matrix.cholesky()?.solve(&descent);
        let next = global + step;
        let distances: Vec<f64> = inverse_distances
            .iter()
            .zip(&sums.back)
            .map(|(distance, (a, b))| (distance + a - b.dot(&step)).clamp(1e-3, 20.0))
            .collect();
        let cost = cost + sums.square * weight;
        let moved = normal_equations(intervals, points, camera, &next, &distances)
            .map(|moved| (prior(&next).2 + moved.square * weight, moved));
        match moved {
            Some((lower, moved)) if lower < cost => {
                (global, inverse_distances, sums) = (next, distances, moved);
                damping *= 0.1;
            }
            _ => damping *= 10.0,
        }
        if damping > 1e3 {
            break;
        }
    }
    if !converged {
        return None;
    }
    let information = prior(&global).0 + sums.matrix * weight;
    let misfit = (sums.square / sums.count).sqrt() * focal_length;
    if misfit.is_nan() || misfit > settings.misfit {
        return None;
    }
    report(intervals, &global, &inverse_distances, &information, gravity, settings)
}

/// The solution moved to the last image, if it is good enough.
fn report(
    intervals: &[Interval],
    global: &SVector<f64, GLOBAL>,
    inverse_distances: &[f64],
    information: &SMatrix<f64, GLOBAL, GLOBAL>,
    gravity: f64,
    settings: &MovingSettings,
) -> Option<Motion> {
    let covariance = information.cholesky()?.inverse();
    let deviation = |at: usize| (0..3).map(|k| covariance[(at + k, at + k)]).fold(0.0, f64::max).sqrt();
    let down = global.fixed_rows::<3>(3).into_owned();
    let bias = global.fixed_rows::<3>(6).into_owned();
    let last = intervals.last()?;
    let (rotation, velocity, _) = last.with_gyro_bias(&bias);
    let end = global.fixed_rows::<3>(0) + down * last.duration + velocity;
    // What the accelerometer's bias does to the velocity over the window.
    let drifted = settings.accel_bias_sigma * last.duration;
    let velocity_sigma = deviation(0).hypot(drifted);
    let wrong = (down.norm() - gravity).abs() > settings.gravity_tolerance;
    if wrong || deviation(0) > settings.scale_sigma * end.norm() {
        return None;
    }
    let mut sorted = inverse_distances.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    Some(Motion {
        velocity: rotation.inverse() * end,
        gravity: rotation.inverse() * down,
        gyro_bias: bias,
        velocity_sigma,
        tilt_sigma: (deviation(3) / gravity).hypot(settings.accel_bias_sigma / gravity),
        gyro_bias_sigma: deviation(6),
        inverse_distance: sorted[sorted.len() / 2],
    })
}

/// Position of the body at an image in the axes of the first, and its derivatives by the global unknowns.
fn place(
    interval: &Interval,
    global: &SVector<f64, GLOBAL>,
) -> (Vector3<f64>, UnitQuaternion<f64>, Matrix3<f64>, Matrix3<f64>) {
    let bias = global.fixed_rows::<3>(6).into_owned();
    let (rotation, _, position) = interval.with_gyro_bias(&bias);
    let time = interval.duration;
    let moved = global.fixed_rows::<3>(0) * time + global.fixed_rows::<3>(3) * (0.5 * time * time) + position;
    let (turn, shift) = interval.by_gyro_bias();
    (moved, rotation, turn, shift)
}

/// Velocity, gravity and a zero bias, and the inverse distances, by linear least squares on
/// `m × (d m₀ + t − r − Q t) = 0` with `r = v T + g T²/2 + α`, the bias taken as zero.
fn closed_form(
    intervals: &[Interval],
    points: &[Vec<Sighting>],
    (lever, camera): &(Vector3<f64>, UnitQuaternion<f64>),
) -> Option<(SVector<f64, GLOBAL>, Vec<f64>)> {
    let zero = SVector::<f64, GLOBAL>::zeros();
    let (mut matrix, mut vector) = (Matrix6::zeros(), Vector6::zeros());
    let mut back = Vec::with_capacity(points.len());
    for sightings in points {
        let first = camera * sightings[0].1;
        let (mut hh, mut hg, mut h) = (0.0, Vector6::<f64>::zeros(), 0.0);
        let (mut own, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for (image, direction) in &sightings[1..] {
            let (alpha, rotation, _, _) = place(&intervals[*image], &zero);
            let time = intervals[*image].duration;
            let cross = (rotation * (camera * direction)).cross_matrix();
            let known = cross * (alpha + rotation * lever - lever);
            let by_distance = cross * first;
            let mut by_global = SMatrix::<f64, 3, 6>::zeros();
            by_global.fixed_columns_mut::<3>(0).copy_from(&(cross * -time));
            by_global.fixed_columns_mut::<3>(3).copy_from(&(cross * (-0.5 * time * time)));
            hh += by_distance.norm_squared();
            hg += by_global.transpose() * by_distance;
            h += by_distance.dot(&known);
            own += by_global.transpose() * by_global;
            right += by_global.transpose() * known;
        }
        if hh < 1e-12 {
            return None;
        }
        matrix += own - hg * hg.transpose() / hh;
        vector += right - hg * (h / hh);
        back.push((h / hh, hg / hh));
    }
    let solution = matrix.cholesky()?.solve(&vector);
    let mut global = zero;
    global.fixed_rows_mut::<6>(0).copy_from(&solution);
    let distances = back.iter().map(|(a, b)| 1.0 / (a - b.dot(&solution)).clamp(0.1, 100.0));
    Some((global, distances.collect()))
}

/// Sums of the linearised directions, distances eliminated.
struct Sums {
    matrix: SMatrix<f64, GLOBAL, GLOBAL>,
    vector: SVector<f64, GLOBAL>,
    /// Per point: step of its inverse distance for a global step `s` is `a − b·s`.
    back: Vec<(f64, SVector<f64, GLOBAL>)>,
    square: f64,
    count: f64,
}

fn normal_equations(
    intervals: &[Interval],
    points: &[Vec<Sighting>],
    (lever, camera): &(Vector3<f64>, UnitQuaternion<f64>),
    global: &SVector<f64, GLOBAL>,
    inverse_distances: &[f64],
) -> Option<Sums> {
    let mut sums = Sums {
        matrix: SMatrix::zeros(),
        vector: SVector::zeros(),
        back: Vec::with_capacity(points.len()),
        square: 0.0,
        count: 0.0,
    };
    let places: Vec<_> = intervals.iter().map(|interval| place(interval, global)).collect();
    for (sightings, &rho) in points.iter().zip(inverse_distances) {
        let start = camera * sightings[0].1 + lever * rho;
        let (mut own, mut cross, mut right) = (0.0, SVector::<f64, GLOBAL>::zeros(), 0.0);
        for (image, seen) in &sightings[1..] {
            let (moved, rotation, turn, shift) = &places[*image];
            let time = intervals[*image].duration;
            let camera_from_first = (camera.inverse() * rotation.inverse()).to_rotation_matrix().into_inner();
            let from_body = start - moved * rho;
            let q = camera_from_first * from_body - camera.inverse() * lever * rho;
            let (direction, length) = Unit::try_new_and_get(q, 1e-3)?;
            let bearing = Bearing::new(&Unit::new_unchecked(*seen));
            // Chord between the predicted and the seen direction, in the tangent plane of the latter.
            let flat = bearing.differential().transpose();
            let residual: Vector2<f64> = -(flat * direction.into_inner());
            let by_point = flat * (Matrix3::identity() - direction.into_inner() * direction.transpose()) / length;
            let by_moved = by_point * camera_from_first * -rho;
            let by_rho = by_point * (camera_from_first * (lever - moved) - camera.inverse() * lever);
            let mut by_global = SMatrix::<f64, 2, GLOBAL>::zeros();
            by_global.fixed_columns_mut::<3>(0).copy_from(&(by_moved * time));
            by_global.fixed_columns_mut::<3>(3).copy_from(&(by_moved * (0.5 * time * time)));
            let by_bias = by_moved * shift + by_point * camera_from_first * from_body.cross_matrix() * turn;
            by_global.fixed_columns_mut::<3>(6).copy_from(&by_bias);
            own += by_rho.norm_squared();
            cross += by_global.transpose() * by_rho;
            right += by_rho.dot(&residual);
            sums.matrix += by_global.transpose() * by_global;
            sums.vector += by_global.transpose() * residual;
            sums.square += residual.norm_squared();
            sums.count += 2.0;
        }
        // A little stiffness keeps points without parallax in place.
        let own = own + 1e-9;
        sums.matrix -= cross * cross.transpose() / own;
        sums.vector -= cross * (right / own);
        sums.back.push((right / own, cross / own));
    }
    Some(sums)
}

impl Interval {
    /// Rotation, velocity and position parts with another bias of the gyroscope than the one they were made with.
    fn with_gyro_bias(&self, bias: &Vector3<f64>) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
        let change = |row: usize| self.bias_jacobian.fixed_view::<3, 3>(row, 0) * bias;
        (so3::exp(&change(0)) * self.rotation, self.velocity + change(3), self.position + change(6))
    }

    /// Derivatives of rotation and position by the gyroscope's bias.
    fn by_gyro_bias(&self) -> (Matrix3<f64>, Matrix3<f64>) {
        (
            self.bias_jacobian.fixed_view::<3, 3>(0, 0).into_owned(),
            self.bias_jacobian.fixed_view::<3, 3>(6, 0).into_owned(),
        )
    }
}
