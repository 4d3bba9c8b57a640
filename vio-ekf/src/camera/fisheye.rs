//! The equidistant model: distance from the image centre is a polynomial of the angle off the axis,
//! `d(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`.

use nalgebra::{Matrix2x3, Vector2, Vector3};

const MAX_STEPS: usize = 50;

/// Below this angle the direction across the axis has no digits left, and the model is a pinhole to all of them.
const ON_AXIS: f64 = 1e-8;

fn radius([k1, k2, k3, k4]: &[f64; 4], angle: f64) -> f64 {
    let s = angle * angle;
    angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
}

fn slope([k1, k2, k3, k4]: &[f64; 4], angle: f64) -> f64 {
    let s = angle * angle;
    1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)))
}

/// Whether the radius grows all the way from the axis to this angle, tested at sixteen places: the polynomial is of
/// ninth degree and cannot hide a fold of any use between them.
fn one_to_one(k: &[f64; 4], angle: f64) -> bool {
    (1..=16).all(|i| slope(k, angle * f64::from(i) / 16.0) > 0.0)
}

/// Angle off the axis and distance from it.
fn polar(point: &Vector3<f64>) -> Option<(f64, f64)> {
    let across = point.x.hypot(point.y);
    let angle = across.atan2(point.z);
    // On the negative axis, and at the origin, every pixel of the rim is as good as another.
    let usable = angle < std::f64::consts::PI - ON_AXIS && point.norm() > 0.0 && point.norm().is_finite();
    usable.then_some((angle, across))
}

pub(super) fn project(k: &[f64; 4], point: &Vector3<f64>) -> Option<Vector2<f64>> {
    let (angle, across) = polar(point)?;
    if angle < ON_AXIS {
        return Some(point.xy() / point.z);
    }
    one_to_one(k, angle).then(|| point.xy() / across * radius(k, angle))
}

pub(super) fn project_with_jacobian(k: &[f64; 4], point: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let (angle, across) = polar(point)?;
    if angle < ON_AXIS {
        let m = point.xy() / point.z;
        return Some((m, Matrix2x3::new(1.0, 0.0, -m.x, 0.0, 1.0, -m.y) / point.z));
    }
    if !one_to_one(k, angle) {
        return None;
    }
    let e = point.xy() / across;
    let (radius, slope) = (radius(k, angle), slope(k, angle));
    let square = point.norm_squared();
    // Along e the angle moves, across it only the direction does.
    let along = slope * point.z / square;
    let sideways = radius / across;
    let difference = along - sideways;
    let forward = -slope * across / square;
    let jacobian = Matrix2x3::new(
        sideways + difference * e.x * e.x,
        difference * e.x * e.y,
        forward * e.x,
        difference * e.x * e.y,
        sideways + difference * e.y * e.y,
        forward * e.y,
    );
    Some((e * radius, jacobian))
}

/// The direction whose image this is, not normalised.
pub(super) fn direction(k: &[f64; 4], distorted: &Vector2<f64>) -> Option<Vector3<f64>> {
    let wanted = distorted.norm();
    if wanted < ON_AXIS {
        return Some(distorted.push(1.0));
    }
    let mut angle = wanted.min(std::f64::consts::FRAC_PI_2);
    for _ in 0..MAX_STEPS {
        let growth = slope(k, angle);
        if growth <= 0.0 {
            return None;
        }
        let step = (radius(k, angle) - wanted) / growth;
        angle -= step;
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            return None;
        }
        if step.abs() <= 1e-14 * angle {
            let found = one_to_one(k, angle) && (radius(k, angle) - wanted).abs() < 1e-12;
            return found.then(|| (distorted * (angle.sin() / wanted)).push(angle.cos()));
        }
    }
    None
}
