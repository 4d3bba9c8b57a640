//! Exponentials, logarithms and Jacobians against published digits, `scipy.linalg.expm` 1.17.1 and their definitions.

use crate::support::rng::Rng;
use nalgebra::{Matrix3, Vector3, Vector6};
use vio_ekf::lie::{se3, so3};
use vio_ekf::nalgebra;

#[test]
fn rotation_reference_values() {
    let x = Vector3::new(0.3, -0.4, 0.5);
    // scipy.linalg.expm(hat(x)); the right Jacobian by its series.
    let exp = Matrix3::new(
        0.80340057,
        -0.51690398,
        -0.29556353,
        0.40182139,
        0.83696633,
        -0.37151977,
        0.43941677,
        0.17971545,
        0.8801223,
    );
    let right = Matrix3::new(
        0.9333548,
        0.22024949,
        0.21618671,
        -0.25926131,
        0.94473325,
        0.11134339,
        -0.16742193,
        -0.17636309,
        0.95936268,
    );
    assert!((so3::exp(&x).to_rotation_matrix().matrix() - exp).amax() < 6e-9);
    assert!((so3::right_jacobian(&x) - right).amax() < 6e-9);
}

#[test]
fn rigid_motion_reference_values() {
    // scipy.linalg.expm of the 4x4 twist, and of [ad I; 0 0], whose upper right block is the left Jacobian.
    let xi = Vector6::new(1.0, -2.0, 0.5, 0.3, -0.4, 0.5);
    let translation = Vector3::new(1.3681664649534497, -1.7573985582292644, 0.47318127444451896);
    assert!((se3::exp(&xi).translation.vector - translation).amax() < 1e-14);
    let q = Matrix3::new(
        -0.3323458152862729,
        -0.34526835683380985,
        -0.8131401262021837,
        0.025442596068770293,
        -0.17133444328444336,
        -0.6375359958102886,
        1.0178632148358473,
        0.2562057041194947,
        -0.35211591449495033,
    );
    assert!((se3::left_jacobian(&xi).fixed_view::<3, 3>(0, 3) - q).amax() < 1e-14);
    // Rotation part 3.54 rad: the closed forms instead of the series.
    let xi = Vector6::new(1.0, -2.0, 0.5, 1.5, -2.0, 2.5);
    let q = Matrix3::new(
        -0.3102605265055024,
        0.22339104405148374,
        0.20292435161837208,
        -0.7467690489150934,
        0.027152013458355814,
        -0.045879006849757514,
        -0.08081243654933862,
        -0.412553874914775,
        -0.5969183958589456,
    );
    assert!((se3::left_jacobian(&xi).fixed_view::<3, 3>(0, 3) - q).amax() < 1e-14);
}

#[test]
fn logarithm_inverts_exponential_from_tiny_angles_to_half_a_turn() {
    let mut rng = Rng::new(1);
    for exponent in -180..=0 {
        let angle = std::f64::consts::PI * 0.9999999 * 10_f64.powf(f64::from(exponent) / 10.0);
        let v = rng.vector().normalize() * angle;
        let q = so3::exp(&v);
        assert!((q.coords.norm() - 1.0).abs() < 1e-15);
        // A quaternion's w tells nothing of angles within 1e-8 of half a turn, its vector part does.
        assert!((so3::log(&q) - v).norm() < 4e-15 * angle.max(1.0), "angle {angle}");
        assert!((so3::log(&q) - v).norm() < 1e-14 * angle, "angle {angle}");
        let rho = rng.vector();
        let xi = Vector6::new(rho.x, rho.y, rho.z, v.x, v.y, v.z);
        assert!((se3::log(&se3::exp(&xi)) - xi).norm() < 1e-13);
    }
    assert_eq!(so3::log(&so3::exp(&Vector3::zeros())), Vector3::zeros());
}

#[test]
fn jacobians_are_the_derivatives_they_claim_to_be() {
    let mut rng = Rng::new(2);
    let step = 1e-5;
    for _ in 0..200 {
        let (rho, phi) = (rng.vector() * 2.0, rng.vector() * 1.7);
        let xi = Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z);
        let (left, right) = (se3::left_jacobian(&xi), se3::right_jacobian(&xi));
        for axis in 0..6 {
            let mut d = Vector6::zeros();
            d[axis] = step;
            let (plus, minus) = (se3::exp(&(xi + d)), se3::exp(&(xi - d)));
            let by_left = se3::log(&(plus * minus.inverse())) / (2.0 * step);
            let by_right = se3::log(&(minus.inverse() * plus)) / (2.0 * step);
            // Central differences: step² times a third derivative of order ten.
            assert!((by_left - left.column(axis)).amax() < 1e-8, "left, {xi:?}");
            assert!((by_right - right.column(axis)).amax() < 1e-8, "right, {xi:?}");
        }
        let one = nalgebra::Matrix6::identity();
        assert!((left * se3::left_jacobian_inverse(&xi) - one).amax() < 1e-12);
        assert!((right * se3::right_jacobian_inverse(&xi) - one).amax() < 1e-12);
        assert!((so3::right_jacobian(&phi) * so3::right_jacobian_inverse(&phi) - Matrix3::identity()).amax() < 1e-13);
        // J_l(φ) = Exp(φ) J_r(φ).
        let turned = so3::exp(&phi).to_rotation_matrix() * so3::right_jacobian(&phi);
        assert!((turned - so3::left_jacobian(&phi)).amax() < 1e-14);
    }
}
