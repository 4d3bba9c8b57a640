//! Closed-form models of wide lenses: unified omnidirectional (Mei and Rives 2007), double sphere (Usenko, Demmel and Cremers 2018)
//! and enhanced unified (Khomutenko, Garcia and Martinet 2016). Equation numbers are those of Usenko et al.
//!
//! All divide by a depth that depends on the distance as well: `m = (x, y) / depth(p)`.

use nalgebra::{Matrix2x3, Vector2, Vector3};

/// Depth of a point, with its derivative; `None` outside the range in which a model is one to one.
type Depth = Option<(f64, Vector3<f64>)>;

/// `m` and its derivative.
fn divided(p: &Vector3<f64>, (depth, by_point): (f64, Vector3<f64>)) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let m = p.xy() / depth;
    let jacobian = (Matrix2x3::identity() - m * by_point.transpose()) / depth;
    (depth > 0.0 && m.x.is_finite() && m.y.is_finite()).then_some((m, jacobian))
}

/// How far behind the plane of the lens a point may be, as a share of its distance: Eqs. (15) and (34).
fn behind(alpha: f64) -> f64 {
    if alpha > 0.5 { (1.0 - alpha) / alpha } else { alpha / (1.0 - alpha) }
}

/// `ξ`, the unified model: a unit sphere seen from a pinhole `ξ` behind its centre.
pub(super) mod omni {
    use super::{Depth, Matrix2x3, Vector2, Vector3, divided};

    fn depth(xi: f64, p: &Vector3<f64>) -> Depth {
        let d = p.norm();
        let limit = if xi > 1.0 { 1.0 / xi } else { xi };
        (p.z > -limit * d).then(|| (xi * d + p.z, p * (xi / d) + Vector3::z()))
    }

    pub(in crate::camera) fn project(xi: f64, p: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        divided(p, depth(xi, p)?)
    }

    /// Eq. (18).
    pub(in crate::camera) fn direction(xi: f64, m: &Vector2<f64>) -> Option<Vector3<f64>> {
        let square = m.norm_squared();
        let root = (1.0 + (1.0 - xi * xi) * square).sqrt();
        let factor = (xi + root) / (1.0 + square);
        let direction = (m * factor).push(factor - xi);
        (root >= 0.0).then_some(direction)
    }
}

/// `ξ, α`: two unit spheres `ξ` apart, and a pinhole `α / (1 − α)` behind the second one.
pub(super) mod double_sphere {
    use super::{Depth, Matrix2x3, Vector2, Vector3, behind, divided};

    /// Eqs. (40) to (45).
    fn depth([xi, alpha]: [f64; 2], p: &Vector3<f64>) -> Depth {
        let first = p.norm();
        let limit = behind(alpha) + xi;
        let limit = limit / (2.0 * behind(alpha) * xi + xi * xi + 1.0).sqrt();
        // A NaN is in no range.
        let (true, true) = (p.z > -limit * first, first > 0.0) else { return None };
        let shifted = xi * first + p.z;
        let by_shifted = p * (xi / first) + Vector3::z();
        let second = (p.x * p.x + p.y * p.y + shifted * shifted).sqrt();
        let by_second = (Vector3::new(p.x, p.y, 0.0) + by_shifted * shifted) / second;
        Some((alpha * second + (1.0 - alpha) * shifted, by_second * alpha + by_shifted * (1.0 - alpha)))
    }

    pub(in crate::camera) fn project(k: [f64; 2], p: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        divided(p, depth(k, p)?)
    }

    /// Eqs. (46) to (51).
    pub(in crate::camera) fn direction([xi, alpha]: [f64; 2], m: &Vector2<f64>) -> Option<Vector3<f64>> {
        let square = m.norm_squared();
        let root = (1.0 - (2.0 * alpha - 1.0) * square).sqrt();
        let z = (1.0 - alpha * alpha * square) / (alpha * root + 1.0 - alpha);
        let factor = (z * xi + (z * z + (1.0 - xi * xi) * square).sqrt()) / (z * z + square);
        let direction = (m * factor).push(z * factor - xi);
        (root >= 0.0 && factor >= 0.0).then_some(direction)
    }
}

/// `α, β`: an ellipsoid in place of the sphere.
pub(super) mod eucm {
    use super::{Depth, Matrix2x3, Vector2, Vector3, behind, divided};

    /// Eqs. (30) to (35).
    fn depth([alpha, beta]: [f64; 2], p: &Vector3<f64>) -> Depth {
        let d = (beta * (p.x * p.x + p.y * p.y) + p.z * p.z).sqrt();
        let by_d = Vector3::new(beta * p.x, beta * p.y, p.z) / d;
        (p.z > -behind(alpha) * d)
            .then(|| (alpha * d + (1.0 - alpha) * p.z, by_d * alpha + Vector3::z() * (1.0 - alpha)))
    }

    pub(in crate::camera) fn project(k: [f64; 2], p: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        divided(p, depth(k, p)?)
    }

    /// Eqs. (36) to (39).
    pub(in crate::camera) fn direction([alpha, beta]: [f64; 2], m: &Vector2<f64>) -> Option<Vector3<f64>> {
        let square = beta * m.norm_squared();
        let root = (1.0 - (2.0 * alpha - 1.0) * square).sqrt();
        let z = (1.0 - alpha * alpha * square) / (alpha * root + 1.0 - alpha);
        (root >= 0.0).then_some(m.push(z))
    }
}
