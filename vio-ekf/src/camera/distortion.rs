//! The radial-tangential polynomial on the plane at unit depth, coefficients `k1, k2, p1, p2`.

use nalgebra::{Matrix2, Vector2};

/// Newton steps before a point is given up; four settle inside any usual lens.
const MAX_STEPS: usize = 30;

/// The distorted point, `None` where the radial polynomial has turned round.
pub(super) fn distort(k: &[f64; 4], m: &Vector2<f64>) -> Option<Vector2<f64>> {
    // A NaN is not below any limit, and is refused with the rest.
    (m.norm_squared() < largest_square(k)).then(|| evaluate(k, m))
}

fn evaluate([k1, k2, p1, p2]: &[f64; 4], m: &Vector2<f64>) -> Vector2<f64> {
    let s = m.norm_squared();
    let radial = 1.0 + k1 * s + k2 * s * s;
    let xy = m.x * m.y;
    let tangential =
        Vector2::new(2.0 * p1 * xy + p2 * (s + 2.0 * m.x * m.x), p1 * (s + 2.0 * m.y * m.y) + 2.0 * p2 * xy);
    m * radial + tangential
}

/// Derivative of the distorted by the undistorted point.
pub(super) fn jacobian([k1, k2, p1, p2]: &[f64; 4], m: &Vector2<f64>) -> Matrix2<f64> {
    let (x, y, s) = (m.x, m.y, m.norm_squared());
    let radial = 1.0 + k1 * s + k2 * s * s;
    let slope = 2.0 * k1 + 4.0 * k2 * s;
    let cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
    Matrix2::new(
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        cross,
        cross,
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )
}

/// The inverse by Newton's method, `None` where there is none on the branch through the centre.
pub(super) fn undistort(k: &[f64; 4], distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
    let limit = largest_square(k);
    let mut m = *distorted;
    // A start beyond the turning point would walk to the wrong branch.
    if m.norm_squared() >= limit {
        m *= 0.9 * (limit / m.norm_squared()).sqrt();
    }
    for _ in 0..MAX_STEPS {
        let error = evaluate(k, &m) - distorted;
        let step = jacobian(k, &m).try_inverse()? * error;
        m -= step;
        if step.norm() <= 1e-14 * (1.0 + m.norm()) {
            let found = m.norm_squared() < limit && (evaluate(k, &m) - distorted).norm() < 1e-12 * (1.0 + m.norm());
            return found.then_some(m);
        }
    }
    None
}

/// Square of the radius at which `r (1 + k1 r² + k2 r⁴)` stops growing: the smaller positive root of
/// `1 + 3 k1 s + 5 k2 s²`.
fn largest_square([k1, k2, ..]: &[f64; 4]) -> f64 {
    let (b, a) = (3.0 * k1, 5.0 * k2);
    let discriminant = b * b - 4.0 * a;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // 2 / (−b + √…) is the root nearest above zero, whatever the sign of a, and has no cancellation at a = 0.
    let denominator = -b + discriminant.sqrt();
    if denominator > 0.0 { 2.0 / denominator } else { f64::INFINITY }
}
