//! World and body frames of MAVLink and ours, in one place.
//!
//! Ours: world x east, y north, z up (ENU); body x forward, y left, z up (FLU). MAVLink: north, east, down (NED); forward, right, down
//! (FRD). All four changes are turns by half a circle, so each is its own inverse.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A vector of the world: ENU to NED, or NED to ENU.
pub fn world(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// A vector of the body: FLU to FRD, or FRD to FLU.
pub fn body(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// An attitude: ENU from FLU to NED from FRD, or back.
pub fn attitude(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    // About the diagonal of x and y, and about x.
    let world = UnitQuaternion::new_unchecked(Quaternion::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0));
    let body = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    world * q * body
}

/// A heading: from east towards north to from north towards east, or back; in -pi..=pi.
pub fn heading(yaw: f64) -> f64 {
    let turned = FRAC_PI_2 - yaw;
    turned.sin().atan2(turned.cos())
}

/// A quaternion as MAVLink writes it: w, x, y, z, with w not negative.
pub fn quaternion(q: &UnitQuaternion<f64>) -> [f32; 4] {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.i, q.j, q.k].map(|v| (sign * v) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three poses by hand.
    #[test]
    fn attitudes_are_those_found_by_hand() {
        let level = |yaw: f64| UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
        let same = |a: UnitQuaternion<f64>, b: UnitQuaternion<f64>| assert!(a.angle_to(&b) < 1e-12, "{a} {b}");
        // Level and facing north is the identity there, a quarter turn from east here.
        same(attitude(&level(FRAC_PI_2)), UnitQuaternion::identity());
        // Turned from north by 90 degrees to the left it faces west: -90 degrees from north towards east.
        same(attitude(&level(2.0 * FRAC_PI_2)), level(-FRAC_PI_2));
        // Facing north, right side down by 30 degrees: a roll about the forward axis, positive in both.
        let roll = 30.0_f64.to_radians();
        let here = level(FRAC_PI_2) * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
        same(attitude(&here), UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll));
        // Nose down by 20 degrees: positive pitch here, negative there.
        let pitch = 20.0_f64.to_radians();
        let here = level(FRAC_PI_2) * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch);
        same(attitude(&here), UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -pitch));
        let [w, x, y, z] = quaternion(&attitude(&level(FRAC_PI_2)));
        assert!((w - 1.0).abs() + x.abs() + y.abs() + z.abs() < 1e-6);
    }

    #[test]
    fn vectors_and_headings_are_those_found_by_hand() {
        // One metre east, two north, three up.
        assert_eq!(world(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(2.0, 1.0, -3.0));
        assert_eq!(body(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(1.0, -2.0, -3.0));
        for (here, there) in [(0.0, FRAC_PI_2), (FRAC_PI_2, 0.0), (-FRAC_PI_2, std::f64::consts::PI)] {
            assert!((heading(here) - there).abs() < 1e-12, "{here}");
        }
    }

    #[test]
    fn a_vector_seen_from_the_body_is_the_same_both_ways() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.7, 2.1);
        let v = Vector3::new(0.4, -1.1, 0.6);
        assert!((attitude(&q) * body(&v) - world(&(q * v))).norm() < 1e-12);
        assert!(attitude(&attitude(&q)).angle_to(&q) < 1e-12);
    }
}
