//! Nonlinear least squares (Levenberg and Marquardt) on the directions: all unknowns together, with their covariance.

use nalgebra::{Matrix2x3, Matrix3, SMatrix, SVector, Unit, UnitQuaternion, Vector2, Vector3};

use super::result::InitialDistance;
use super::window::{BIASES, CHANGES, ERRORS, GLOBAL, GRAVITY, InitializationWindow, NOISE, VELOCITY};
use crate::filter::settings::DynamicInitializationSettings;
use crate::filter::state::bearing::Bearing;
use crate::inertial::preintegration::ImuPreintegration;

const ITERATIONS: usize = 40;
/// Residuals beyond this many standard deviations count less (Huber).
const HUBER_DEVIATIONS: f64 = 2.0;
/// Gravity is known to this, m/s²: what is more is the accelerometer's bias.
const GRAVITY_SIGMA: f64 = 0.01;
/// Least and largest inverse distance of a point, 1/m.
const INVERSE_DISTANCES: (f64, f64) = (1e-3, 20.0);

type Global = SVector<f64, GLOBAL>;
type Information = SMatrix<f64, GLOBAL, GLOBAL>;

/// A point: where the first image of it sees it, and its inverse distance there.
#[derive(Debug, Clone, Copy)]
struct Point {
    bearing: Bearing,
    rho: f64,
}

/// The minimum, or where the way to it ended.
pub(super) struct Solution {
    /// Whether it is one: a point that was mistaken for another, at the end of its range, holds up all of them.
    pub(super) converged: bool,
    pub(super) global: Global,
    pub(super) covariance: Information,
    /// Root mean square, pixels, each observation with its huber weight.
    pub(super) reprojection_error: f64,
    /// Of each point.
    pub(super) point_errors: Vec<f64>,
    points: Vec<Point>,
    /// The eliminated unknowns of the points.
    eliminated: Vec<EliminatedPoint>,
    sigma: f64,
    /// Of a minimum: errors of the global unknowns by changes of velocity that the samples do not show...
    pub(super) by_changes: SMatrix<f64, GLOBAL, NOISE>,
    /// ... and of each point, those of the global ones apart.
    points_by_changes: Vec<SMatrix<f64, 3, NOISE>>,
}

/// A point's three unknowns for given global ones: `step − link · global`, with `matrix` the information on them.
#[derive(Debug, Clone, Copy)]
struct EliminatedPoint {
    step: Vector3<f64>,
    link: SMatrix<f64, 3, GLOBAL>,
    matrix: Matrix3<f64>,
}

/// Levenberg and Marquardt from the closed form's solution. `None` if the numbers do not allow it.
pub(super) fn refine(
    window: &InitializationWindow,
    kept: &[usize],
    (mut global, rhos): (Global, Vec<f64>),
    settings: &DynamicInitializationSettings,
) -> Option<Solution> {
    let first = |(&k, rho): (&usize, f64)| Point {
        bearing: Bearing::new(&Unit::new_unchecked(window.input.points[k][0].1)),
        rho: rho.clamp(INVERSE_DISTANCES.0, INVERSE_DISTANCES.1),
    };
    let mut points: Vec<Point> = kept.iter().zip(rhos).map(first).collect();
    let sigma = settings.pixel_sigma / window.input.focal_length;
    let weight = sigma.powi(-2);
    let huber = HUBER_DEVIATIONS * sigma;
    let prior = |global: &Global| prior(global, window.input.gravity, settings);

    let mut equations = equations(window, kept, &global, &points, huber)?;
    let (mut damping, mut converged) = (1e-4, false);
    for _ in 0..ITERATIONS {
        let (matrix, vector, cost) = prior(&global);
        let cost = cost + equations.cost * weight;
        let mut matrix = matrix + equations.matrix * weight;
        let descent = vector + equations.vector * weight;
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
        let moved = |(point, own): (&Point, &EliminatedPoint)| {
            let own = own.step - own.link * step;
            Point { bearing: point.bearing.boxplus(&own.xy()), rho: corrected(point.rho, own.z) }
        };
        let next_points: Vec<Point> = points.iter().zip(&equations.eliminated).map(moved).collect();
        match self::equations(window, kept, &next, &next_points, huber) {
            Some(better) if prior(&next).2 + better.cost * weight < cost => {
                (global, points, equations) = (next, next_points, better);
                damping = (damping * 0.1_f64).max(1e-9);
            }
            _ => damping *= 10.0,
        }
    }
    // The points themselves show how well they were seen; the claim is never better than that.
    let reprojection_error = (equations.square / (equations.count - (3 * points.len() + GLOBAL) as f64).max(1.0))
        .sqrt()
        * window.input.focal_length;
    let sigma = settings.pixel_sigma.max(reprojection_error) / window.input.focal_length;
    let information = prior(&global).0 + equations.matrix * sigma.powi(-2);
    let point_errors = equations.point_errors.iter().map(|m| m * window.input.focal_length).collect();
    let covariance = information.cholesky()?.inverse();
    let (pull, points_by_changes) = if converged {
        pull_of_changes(window, kept, &global, &points, (&equations.eliminated, huber))?
    } else {
        Default::default()
    };
    Some(Solution {
        by_changes: covariance * pull * sigma.powi(-2),
        points_by_changes,
        converged,
        global,
        covariance,
        reprojection_error,
        point_errors,
        points,
        eliminated: equations.eliminated,
        sigma,
    })
}

/// An inverse distance after a step, which is taken in the distance: velocity and distances then grow in the same proportion, and a step
/// along the scale, which images hardly see, stays where it fits them. One that would halve the distance or more is taken as it is.
fn corrected(rho: f64, step: f64) -> f64 {
    let nearer = step / rho;
    let rho = if nearer < 0.5 { rho / (1.0 - nearer) } else { rho + step };
    rho.clamp(INVERSE_DISTANCES.0, INVERSE_DISTANCES.1)
}

/// Gravity has a known length; the biases are small. Information, descent and cost.
fn prior(global: &Global, gravity: f64, settings: &DynamicInitializationSettings) -> (Information, Global, f64) {
    let down = global.fixed_rows::<3>(GRAVITY).into_owned();
    let (along, long) = (down.normalize(), down.norm() - gravity);
    let information = GRAVITY_SIGMA.powi(-2);
    let (mut matrix, mut vector) = (Information::zeros(), Global::zeros());
    matrix.fixed_view_mut::<3, 3>(GRAVITY, GRAVITY).copy_from(&(along * along.transpose() * information));
    vector.fixed_rows_mut::<3>(GRAVITY).copy_from(&(along * (-long * information)));
    let mut cost = long * long * information;
    for (row, sigma) in [(BIASES, settings.gyro_bias_sigma), (BIASES + 3, settings.accel_bias_sigma)] {
        for k in row..row + 3 {
            matrix[(k, k)] = sigma.powi(-2);
            vector[k] = -global[k] * sigma.powi(-2);
            cost += (global[k] / sigma).powi(2);
        }
    }
    (matrix, vector, cost)
}

/// Normal equations of the linearised directions, the points eliminated (Schur complement).
struct NormalEquations {
    matrix: Information,
    vector: Global,
    eliminated: Vec<EliminatedPoint>,
    /// Root mean square error of each point.
    point_errors: Vec<f64>,
    /// Robust cost; weighted sum of squares and of weights.
    cost: f64,
    square: f64,
    count: f64,
}

fn equations(
    window: &InitializationWindow,
    kept: &[usize],
    global: &Global,
    points: &[Point],
    huber: f64,
) -> Option<NormalEquations> {
    let body_poses = body_poses(window, global);
    let mut equations = NormalEquations {
        matrix: Information::zeros(),
        vector: Global::zeros(),
        eliminated: Vec::with_capacity(kept.len()),
        point_errors: Vec::with_capacity(kept.len()),
        cost: 0.0,
        square: 0.0,
        count: 0.0,
    };
    for (&k, point) in kept.iter().zip(points) {
        let observations = &window.input.points[k];
        let anchor = &body_poses[observations[0].0];
        // A weak prior keeps points without parallax in place.
        let (mut own, mut link, mut right) = (Matrix3::zeros(), SMatrix::<f64, 3, GLOBAL>::zeros(), Vector3::zeros());
        own[(2, 2)] = 1e-9;
        let mut square = 0.0;
        for (image, seen) in observations {
            let observed = observe(&window.input.camera, (anchor, &body_poses[*image]), point, (seen, huber))?;
            let Observed { residual, by_point, by_global, weight, .. } = observed;
            let error = residual.norm();
            own += by_point.transpose() * by_point * weight;
            link += by_point.transpose() * by_global * weight;
            right += by_point.transpose() * residual * weight;
            equations.matrix += by_global.transpose() * by_global * weight;
            equations.vector += by_global.transpose() * residual * weight;
            equations.cost += if error > huber { huber * (2.0 * error - huber) } else { error * error };
            equations.square += weight * error * error;
            equations.count += 2.0 * weight;
            square += error * error;
        }
        let factor = own.cholesky()?;
        let (step, link_by_own) = (factor.solve(&right), factor.solve(&link));
        equations.matrix -= link.transpose() * link_by_own;
        equations.vector -= link.transpose() * step;
        equations.eliminated.push(EliminatedPoint { step, link: link_by_own, matrix: own });
        equations.point_errors.push((square / (2 * observations.len() - 3).max(1) as f64).sqrt());
    }
    Some(equations)
}

/// A direction that was seen, linearised: what it is off, and the derivatives of what is predicted.
struct Observed {
    residual: Vector2<f64>,
    by_point: Matrix2x3<f64>,
    by_global: SMatrix<f64, 2, GLOBAL>,
    /// By the way from this image back to the first one of the point.
    by_way: Matrix2x3<f64>,
    weight: f64,
}

fn observe(
    camera: &(Vector3<f64>, UnitQuaternion<f64>),
    (anchor, here): (&BodyPose, &BodyPose),
    point: &Point,
    (seen, huber): (&Vector3<f64>, f64),
) -> Option<Observed> {
    let view = project_point(camera, anchor, here, point)?;
    let (direction, length) = Unit::try_new_and_get(view.scaled, 1e-3)?;
    // Chord between the predicted and the seen direction, in the tangent plane of the latter.
    let flat = Bearing::new(&Unit::new_unchecked(*seen)).differential().transpose();
    let residual: Vector2<f64> = -(flat * direction.into_inner());
    let flat = flat * (Matrix3::identity() - direction.into_inner() * direction.transpose()) / length;
    let error = residual.norm();
    Some(Observed {
        residual,
        by_point: flat * view.by_point,
        by_global: flat * view.by_global,
        by_way: flat * view.by_way,
        weight: if error > huber { huber / error } else { 1.0 },
    })
}

/// Derivatives by the changes of velocity from those by a way that they add to.
fn by_changes<const R: usize>(by_way: &SMatrix<f64, R, 3>, moved: [[f64; CHANGES]; 2]) -> SMatrix<f64, R, NOISE> {
    let mut all = SMatrix::<f64, R, NOISE>::zeros();
    for (k, (from, to)) in moved[0].iter().zip(moved[1]).enumerate() {
        all.fixed_columns_mut::<3>(3 * k).copy_from(&(by_way * (from - to)));
    }
    all
}

/// What changes of velocity that the samples do not show add to the right side of the normal equations, per unit, and to each point.
fn pull_of_changes(
    window: &InitializationWindow,
    kept: &[usize],
    global: &Global,
    points: &[Point],
    (eliminated, huber): (&[EliminatedPoint], f64),
) -> Option<(SMatrix<f64, GLOBAL, NOISE>, Vec<SMatrix<f64, 3, NOISE>>)> {
    let body_poses = body_poses(window, global);
    let mut pull = SMatrix::<f64, GLOBAL, NOISE>::zeros();
    let of_point = |((&k, point), own): ((&usize, &Point), &EliminatedPoint)| {
        let observations = &window.input.points[k];
        let anchor = &body_poses[observations[0].0];
        let mut right = SMatrix::<f64, 3, NOISE>::zeros();
        for (image, seen) in observations {
            let here = &body_poses[*image];
            let observed = observe(&window.input.camera, (anchor, here), point, (seen, huber))?;
            let moved = [anchor, here].map(|pose| window.moved_by_changes(pose.time));
            let by_changes = by_changes(&observed.by_way, moved) * observed.weight;
            right += observed.by_point.transpose() * by_changes;
            pull += observed.by_global.transpose() * by_changes;
        }
        pull -= own.link.transpose() * right;
        Some(own.matrix.cholesky()?.solve(&right))
    };
    let points = kept.iter().zip(points).zip(eliminated).map(of_point).collect::<Option<Vec<_>>>()?;
    Some((pull, points))
}

/// Pose of the body at one image, in the axes of the first, and its derivatives by the unknowns.
struct BodyPose {
    moved: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    matrix: Matrix3<f64>,
    time: f64,
    rotation_by_biases: SMatrix<f64, 3, 6>,
    moved_by_biases: SMatrix<f64, 3, 6>,
}

fn body_poses(window: &InitializationWindow, global: &Global) -> Vec<BodyPose> {
    let change = window.bias_change(&global.fixed_rows::<6>(BIASES).into_owned());
    let body_pose = |preintegration: &ImuPreintegration| {
        let (rotation, _, position) = preintegration.with_biases(&change);
        let time = preintegration.duration;
        let (velocity, down) = (global.fixed_rows::<3>(VELOCITY), global.fixed_rows::<3>(GRAVITY));
        BodyPose {
            moved: velocity * time + down * (0.5 * time * time) + position,
            rotation,
            matrix: rotation.to_rotation_matrix().into_inner(),
            time,
            rotation_by_biases: preintegration.by_biases(0),
            moved_by_biases: preintegration.by_biases(6),
        }
    };
    window.preintegrations.iter().map(body_pose).collect()
}

/// A point in one image: its `d⁻¹`-scaled position in camera axes, and its derivatives.
struct PointProjection {
    scaled: Vector3<f64>,
    /// By the tangent coordinates and the inverse distance in the first image of it.
    by_point: Matrix3<f64>,
    by_global: SMatrix<f64, 3, GLOBAL>,
    /// By `p_a - p_j`.
    by_way: Matrix3<f64>,
}

/// `q = C⁻¹ (R_j⁻¹ w − ρ t)` with `w = ρ (p_a − p_j) + R_a (ρ t + C μ)`.
fn project_point(
    (lever, camera): &(Vector3<f64>, UnitQuaternion<f64>),
    a: &BodyPose,
    j: &BodyPose,
    point: &Point,
) -> Option<PointProjection> {
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
    let by_biases = (a.moved_by_biases - j.moved_by_biases) * rho - from_anchor.cross_matrix() * a.rotation_by_biases
        + w.cross_matrix() * j.rotation_by_biases;
    by_global.fixed_columns_mut::<6>(BIASES).copy_from(&(camera_from_first * by_biases));
    let by_way = camera_from_first * rho;
    scaled.iter().all(|v| v.is_finite()).then_some(PointProjection { scaled, by_point, by_global, by_way })
}

impl Solution {
    /// Inverse distances at the last image of the points that it sees.
    pub(super) fn distances_at_last_image(
        &self,
        window: &InitializationWindow,
        kept: &[usize],
    ) -> Vec<InitialDistance> {
        let body_poses = body_poses(window, &self.global);
        let last = window.preintegrations.len() - 1;
        let distance =
            |(((&k, point), own), by_noise): (((&usize, &Point), &EliminatedPoint), &SMatrix<f64, 3, NOISE>)| {
                let observations = &window.input.points[k];
                if observations.last()?.0 != last {
                    return None;
                }
                let ends = [observations[0].0, last].map(|image| &body_poses[image]);
                let view = project_point(&window.input.camera, ends[0], ends[1], point)?;
                let length = view.scaled.norm();
                // ρ' = ρ / |q|
                let radial = view.scaled.transpose() * (-point.rho / length.powi(3));
                let mut by_point = (radial * view.by_point).transpose();
                by_point.z += 1.0 / length;
                let by_global = (radial * view.by_global).transpose() - own.link.transpose() * by_point;
                let moved = ends.map(|pose| window.moved_by_changes(pose.time));
                let itself = by_noise.transpose() * by_point - by_changes(&(radial * view.by_way), moved).transpose();
                let mut gradient = SVector::<f64, ERRORS>::zeros();
                gradient.fixed_rows_mut::<GLOBAL>(0).copy_from(&by_global);
                gradient.fixed_rows_mut::<NOISE>(GLOBAL).copy_from(&(self.by_changes.transpose() * by_global + itself));
                let spread = own.matrix.cholesky()?.solve(&by_point) * (self.sigma * self.sigma);
                let variance = by_point.dot(&spread);
                Some(InitialDistance { point: k, id: 0, inverse_distance: point.rho / length, variance, gradient })
            };
        kept.iter().zip(&self.points).zip(&self.eliminated).zip(&self.points_by_changes).filter_map(distance).collect()
    }
}
