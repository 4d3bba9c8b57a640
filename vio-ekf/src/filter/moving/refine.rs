//! Descent on the directions: all unknowns together, and how well they are known.

use nalgebra::{Matrix2x3, Matrix3, SMatrix, SVector, Unit, UnitQuaternion, Vector2, Vector3};

use super::{BIASES, Depth, GLOBAL, GRAVITY, MovingSettings, VELOCITY, Window};
use crate::filter::bearing::Bearing;

const ITERATIONS: usize = 40;
/// Misfits beyond this many standard deviations count less (Huber).
const ROBUST: f64 = 2.0;
/// Gravity is known to this, m/s²: what is more is the accelerometer's bias.
const GRAVITY_SIGMA: f64 = 0.01;
/// Inverse distances that a point may have, 1/m.
const NEAR_AND_FAR: (f64, f64) = (1e-3, 20.0);

type Global = SVector<f64, GLOBAL>;
type Information = SMatrix<f64, GLOBAL, GLOBAL>;

/// A point: where the first image of it sees it, and its inverse distance there.
#[derive(Debug, Clone, Copy)]
struct Point {
    bearing: Bearing,
    rho: f64,
}

/// Where the descent ends.
pub(super) struct Solution {
    pub(super) global: Global,
    pub(super) covariance: Information,
    /// Root mean square, pixels, each sighting counted as its robust weight says.
    pub(super) misfit: f64,
    /// Of each point.
    pub(super) misfits: Vec<f64>,
    points: Vec<Point>,
    /// Of the points' own errors, and what they inherit.
    eliminated: Vec<Eliminated>,
    sigma: f64,
}

/// A point's three unknowns for given global ones: `step − link · global`, with `matrix` the information on them.
#[derive(Debug, Clone, Copy)]
struct Eliminated {
    step: Vector3<f64>,
    link: SMatrix<f64, 3, GLOBAL>,
    matrix: Matrix3<f64>,
}

/// Levenberg and Marquardt from the closed form's solution. `None` if it does not end.
pub(super) fn refine(
    window: &Window,
    kept: &[usize],
    (mut global, rhos): (Global, Vec<f64>),
    settings: &MovingSettings,
) -> Option<Solution> {
    let first = |(&k, rho): (&usize, f64)| Point {
        bearing: Bearing::new(&Unit::new_unchecked(window.scene.points[k][0].1)),
        rho: rho.clamp(NEAR_AND_FAR.0, NEAR_AND_FAR.1),
    };
    let mut points: Vec<Point> = kept.iter().zip(rhos).map(first).collect();
    let sigma = settings.pixel_sigma / window.scene.focal_length;
    let weight = sigma.powi(-2);
    let robust = ROBUST * sigma;
    let prior = |global: &Global| prior(global, window.scene.gravity, settings);

    let mut sums = sums(window, kept, &global, &points, robust)?;
    let (mut damping, mut converged) = (1e-4, false);
    for _ in 0..ITERATIONS {
        let (matrix, vector, cost) = prior(&global);
        let cost = cost + sums.cost * weight;
        let mut matrix = matrix + sums.matrix * weight;
        let descent = vector + sums.vector * weight;
        // Damping holds back along the valley of the scale long before it does across: the end is judged without it.
        converged = descent.dot(&matrix.cholesky()?.solve(&descent)) < 1e-2;
        if converged || damping > 1e6 {
            break;
        }
        for k in 0..GLOBAL {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let step = matrix.cholesky()?.solve(&descent);
        let next = global + step;
        let moved = |(point, own): (&Point, &Eliminated)| {
            let own = own.step - own.link * step;
            let rho = (point.rho + own.z).clamp(NEAR_AND_FAR.0, NEAR_AND_FAR.1);
            Point { bearing: point.bearing.boxplus(&own.xy()), rho }
        };
        let next_points: Vec<Point> = points.iter().zip(&sums.eliminated).map(moved).collect();
        match self::sums(window, kept, &next, &next_points, robust) {
            Some(better) if prior(&next).2 + better.cost * weight < cost => {
                (global, points, sums) = (next, next_points, better);
                damping = (damping * 0.1_f64).max(1e-9);
            }
            _ => damping *= 10.0,
        }
    }
    if !converged {
        return None;
    }
    // The points themselves show how well they were seen; the claim is never better than that.
    let misfit =
        (sums.square / (sums.count - (3 * points.len() + GLOBAL) as f64).max(1.0)).sqrt() * window.scene.focal_length;
    let sigma = settings.pixel_sigma.max(misfit) / window.scene.focal_length;
    let information = prior(&global).0 + sums.matrix * sigma.powi(-2);
    let misfits = sums.misfits.iter().map(|m| m * window.scene.focal_length).collect();
    let covariance = information.cholesky()?.inverse();
    Some(Solution { global, covariance, misfit, misfits, points, eliminated: sums.eliminated, sigma })
}

/// Gravity has a known length; the biases are small. Information, descent and cost.
fn prior(global: &Global, gravity: f64, settings: &MovingSettings) -> (Information, Global, f64) {
    let down = global.fixed_rows::<3>(GRAVITY).into_owned();
    let (along, long) = (down.normalize(), down.norm() - gravity);
    let stiff = GRAVITY_SIGMA.powi(-2);
    let (mut matrix, mut vector) = (Information::zeros(), Global::zeros());
    matrix.fixed_view_mut::<3, 3>(GRAVITY, GRAVITY).copy_from(&(along * along.transpose() * stiff));
    vector.fixed_rows_mut::<3>(GRAVITY).copy_from(&(along * (-long * stiff)));
    let mut cost = long * long * stiff;
    for (row, sigma) in [(BIASES, settings.gyro_bias_sigma), (BIASES + 3, settings.accel_bias_sigma)] {
        for k in row..row + 3 {
            matrix[(k, k)] = sigma.powi(-2);
            vector[k] = -global[k] * sigma.powi(-2);
            cost += (global[k] / sigma).powi(2);
        }
    }
    (matrix, vector, cost)
}

/// Sums of the linearised directions, the points eliminated.
struct Sums {
    matrix: Information,
    vector: Global,
    eliminated: Vec<Eliminated>,
    /// Root mean squares of the points' misfits.
    misfits: Vec<f64>,
    /// Robust cost; weighted sum of squares and of weights.
    cost: f64,
    square: f64,
    count: f64,
}

fn sums(window: &Window, kept: &[usize], global: &Global, points: &[Point], robust: f64) -> Option<Sums> {
    let places = places(window, global);
    let mut sums = Sums {
        matrix: Information::zeros(),
        vector: Global::zeros(),
        eliminated: Vec::with_capacity(kept.len()),
        misfits: Vec::with_capacity(kept.len()),
        cost: 0.0,
        square: 0.0,
        count: 0.0,
    };
    for (&k, point) in kept.iter().zip(points) {
        let sightings = &window.scene.points[k];
        let anchor = &places[sightings[0].0];
        // A little stiffness keeps points without parallax in place.
        let (mut own, mut link, mut right) = (Matrix3::zeros(), SMatrix::<f64, 3, GLOBAL>::zeros(), Vector3::zeros());
        own[(2, 2)] = 1e-9;
        let mut square = 0.0;
        for (image, seen) in sightings {
            let view = see(&window.scene.camera, anchor, &places[*image], point)?;
            let (direction, length) = Unit::try_new_and_get(view.scaled, 1e-3)?;
            // Chord between the predicted and the seen direction, in the tangent plane of the latter.
            let flat = Bearing::new(&Unit::new_unchecked(*seen)).differential().transpose();
            let residual: Vector2<f64> = -(flat * direction.into_inner());
            let flat = flat * (Matrix3::identity() - direction.into_inner() * direction.transpose()) / length;
            let (by_point, by_global): (Matrix2x3<f64>, SMatrix<f64, 2, GLOBAL>) =
                (flat * view.by_point, flat * view.by_global);
            let off = residual.norm();
            let weight = if off > robust { robust / off } else { 1.0 };
            own += by_point.transpose() * by_point * weight;
            link += by_point.transpose() * by_global * weight;
            right += by_point.transpose() * residual * weight;
            sums.matrix += by_global.transpose() * by_global * weight;
            sums.vector += by_global.transpose() * residual * weight;
            sums.cost += if off > robust { robust * (2.0 * off - robust) } else { off * off };
            sums.square += weight * off * off;
            sums.count += 2.0 * weight;
            square += off * off;
        }
        let factor = own.cholesky()?;
        let (step, link_by_own) = (factor.solve(&right), factor.solve(&link));
        sums.matrix -= link.transpose() * link_by_own;
        sums.vector -= link.transpose() * step;
        sums.eliminated.push(Eliminated { step, link: link_by_own, matrix: own });
        sums.misfits.push((square / (2 * sightings.len() - 3).max(1) as f64).sqrt());
    }
    Some(sums)
}

/// The body at one image, in the axes of the first, and how its errors depend on the unknowns.
struct Place {
    moved: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    matrix: Matrix3<f64>,
    time: f64,
    turn_by_biases: SMatrix<f64, 3, 6>,
    moved_by_biases: SMatrix<f64, 3, 6>,
}

fn places(window: &Window, global: &Global) -> Vec<Place> {
    let change = window.change(&global.fixed_rows::<6>(BIASES).into_owned());
    let place = |interval: &super::Interval| {
        let (rotation, _, position) = interval.with_biases(&change);
        let time = interval.duration;
        let (velocity, down) = (global.fixed_rows::<3>(VELOCITY), global.fixed_rows::<3>(GRAVITY));
        Place {
            moved: velocity * time + down * (0.5 * time * time) + position,
            rotation,
            matrix: rotation.to_rotation_matrix().into_inner(),
            time,
            turn_by_biases: interval.by_biases(0),
            moved_by_biases: interval.by_biases(6),
        }
    };
    window.intervals.iter().map(place).collect()
}

/// A point as an image sees it: `d⁻¹`-scaled place in camera axes, and its derivatives.
struct Seen {
    scaled: Vector3<f64>,
    /// By the tangent coordinates and the inverse distance in the first image of it.
    by_point: Matrix3<f64>,
    by_global: SMatrix<f64, 3, GLOBAL>,
}

/// `q = C⁻¹ (R_j⁻¹ w − ρ t)` with `w = ρ (p_a − p_j) + R_a (ρ t + C μ)`.
fn see((lever, camera): &(Vector3<f64>, UnitQuaternion<f64>), a: &Place, j: &Place, point: &Point) -> Option<Seen> {
    let rho = point.rho;
    let camera_from_body = camera.inverse().to_rotation_matrix().into_inner();
    let camera_from_first = camera_from_body * j.matrix.transpose();
    let ray = lever * rho + camera * point.bearing.direction();
    let from_anchor = a.matrix * ray;
    let w = (a.moved - j.moved) * rho + from_anchor;
    let scaled = camera_from_first * w - camera_from_body * (lever * rho);
    let mut by_point = Matrix3::zeros();
    let axes = (a.rotation * camera).to_rotation_matrix().into_inner();
    by_point.fixed_columns_mut::<2>(0).copy_from(&(camera_from_first * axes * point.bearing.differential()));
    let by_rho = camera_from_first * (a.moved - j.moved + a.matrix * lever) - camera_from_body * lever;
    by_point.set_column(2, &by_rho);
    let mut by_global = SMatrix::<f64, 3, GLOBAL>::zeros();
    by_global.fixed_columns_mut::<3>(VELOCITY).copy_from(&(camera_from_first * (rho * (a.time - j.time))));
    let squares = 0.5 * rho * (a.time * a.time - j.time * j.time);
    by_global.fixed_columns_mut::<3>(GRAVITY).copy_from(&(camera_from_first * squares));
    let by_biases = (a.moved_by_biases - j.moved_by_biases) * rho - from_anchor.cross_matrix() * a.turn_by_biases
        + w.cross_matrix() * j.turn_by_biases;
    by_global.fixed_columns_mut::<6>(BIASES).copy_from(&(camera_from_first * by_biases));
    scaled.iter().all(|v| v.is_finite()).then_some(Seen { scaled, by_point, by_global })
}

impl Solution {
    /// Inverse distances at the last image of the points that it sees.
    pub(super) fn depths(&self, window: &Window, kept: &[usize]) -> Vec<Depth> {
        let places = places(window, &self.global);
        let last = window.intervals.len() - 1;
        let depth = |((&k, point), own): ((&usize, &Point), &Eliminated)| {
            let sightings = &window.scene.points[k];
            if sightings.last()?.0 != last {
                return None;
            }
            let view = see(&window.scene.camera, &places[sightings[0].0], &places[last], point)?;
            let length = view.scaled.norm();
            // ρ' = ρ / |q|
            let radial = view.scaled.transpose() * (-point.rho / length.powi(3));
            let mut by_point = (radial * view.by_point).transpose();
            by_point.z += 1.0 / length;
            let gradient = (radial * view.by_global).transpose() - own.link.transpose() * by_point;
            let spread = own.matrix.cholesky()?.solve(&by_point) * (self.sigma * self.sigma);
            let variance = by_point.dot(&spread);
            Some(Depth { point: k, id: 0, inverse_distance: point.rho / length, variance, gradient })
        };
        kept.iter().zip(&self.points).zip(&self.eliminated).filter_map(depth).collect()
    }
}
