//! The B-spline against published digits and against differences of itself.

use crate::support::recorded;
use crate::support::rng::Rng;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::format::tum;
use vio_ekf::lie::so3;
use vio_ekf::trajectory::{Motion, Spline};
use vio_ekf::{Error, Stamp, Trajectory, nalgebra};

fn nanos(nanos: i64) -> Stamp {
    Stamp::from_nanos(nanos)
}

#[test]
fn reference_values() {
    // An independent program, checked there against finite differences. Steps of 50 ms, u = 0.4, g = 9.81.
    let positions = [[0.0, 0.0, 0.0], [0.05, 0.01, 0.0], [0.11, 0.03, 0.01], [0.16, 0.07, 0.03]];
    let turns = [[0.1, -0.05, 0.2], [0.12, 0.0, 0.15], [0.05, 0.08, 0.1]];
    let mut rotation = UnitQuaternion::identity();
    let mut knots = vec![Isometry3::identity()];
    for i in 0..3 {
        rotation *= so3::exp(&Vector3::from(turns[i]));
        knots.push(Isometry3::from_parts(Vector3::from(positions[i + 1]).into(), rotation));
    }
    let spline = Spline::new(nanos(1_000), 50_000_000, knots).unwrap();
    assert_eq!(spline.span(), (nanos(50_001_000), nanos(100_001_000)));
    let m = spline.sample(nanos(1_000 + 70_000_000)).unwrap();
    let check = |what: &str, ours: Vector3<f64>, [x, y, z]: [f64; 3]| {
        assert!((ours - Vector3::new(x, y, z)).amax() < 2e-9, "{what}: {ours:?}");
    };
    check("position", m.world_from_body.translation.vector, [0.074253333, 0.018573333, 0.004466667]);
    check("velocity", m.velocity_in_world, [1.148, 0.396, 0.18]);
    check("acceleration", m.acceleration_in_world, [0.8, 5.6, 4.0]);
    check("rotation", so3::log(&m.world_from_body.rotation), [0.14624891, -0.04555799, 0.258973411]);
    check("rate", m.rate_in_body, [2.202273948, -0.038326047, 3.110726171]);
    check("angular acceleration", m.angular_acceleration_in_body, [-6.393245934, 24.25403293, -20.027363758]);
    check("specific force", m.specific_force(9.81), [3.061765637, 7.055980476, 12.788855723]);
}

/// Largest misfit between the derivatives of the samples and what they claim, relative to their size.
fn check_derivatives(spline: &Spline, at: Stamp) {
    let h = 100_000;
    let seconds = 2.0 * h as f64 / 1e9;
    let [before, now, after]: [Motion; 3] = [-h, 0, h].map(|d| spline.sample(nanos(at.nanos() + d)).unwrap());
    let difference = |a: Vector3<f64>, b: Vector3<f64>| (b - a) / seconds;
    let position = |m: &Motion| m.world_from_body.translation.vector;
    let turn = so3::log(&(before.world_from_body.rotation.inverse() * after.world_from_body.rotation)) / seconds;
    for (what, measured, claimed) in [
        ("velocity", difference(position(&before), position(&after)), now.velocity_in_world),
        ("acceleration", difference(before.velocity_in_world, after.velocity_in_world), now.acceleration_in_world),
        ("rate", turn, now.rate_in_body),
        ("angular", difference(before.rate_in_body, after.rate_in_body), now.angular_acceleration_in_body),
    ] {
        assert!((measured - claimed).norm() < 1e-4 * (1.0 + claimed.norm()), "{what} at {at}: {measured} {claimed}");
    }
}

#[test]
fn derivatives_are_derivatives_also_across_knots() {
    let mut rng = Rng::new(3);
    let knots: Vec<_> = (0..20)
        .map(|_| Isometry3::from_parts(Translation3::from(rng.vector()), so3::exp(&(rng.vector() * 0.5))))
        .collect();
    // Nothing here is of order one over a knot interval, so a step of 0.1 ms is small.
    let spline = Spline::new(nanos(0), 1_000_000_000, knots).unwrap();
    for i in 0..300 {
        check_derivatives(&spline, nanos(1_001_000_000 + i * 50_000_000));
    }
    // The second derivatives are continuous: a knot seen from both sides.
    for knot in 2..18 {
        let (a, b) = (
            spline.sample(nanos(knot * 1_000_000_000 - 1)).unwrap(),
            spline.sample(nanos(knot * 1_000_000_000)).unwrap(),
        );
        assert!((a.acceleration_in_world - b.acceleration_in_world).amax() < 1e-7);
        assert!((a.angular_acceleration_in_body - b.angular_acceleration_in_body).amax() < 1e-7);
    }
}

#[test]
fn reproduces_constant_velocity_and_constant_rate() {
    let (velocity, rate) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.2, 0.4, -0.7));
    let pose = |t: f64| Isometry3::from_parts((velocity * t).into(), so3::exp(&(rate * t)));
    let spline = Spline::new(nanos(0), 100_000_000, (0..10).map(|i| pose(f64::from(i) * 0.1)).collect()).unwrap();
    for i in 0..=70 {
        let m = spline.sample(nanos(100_000_000 + i * 10_000_000)).unwrap();
        let truth = pose(0.1 + i as f64 * 0.01);
        assert!((m.world_from_body.translation.vector - truth.translation.vector).norm() < 1e-14);
        assert!(so3::angle_between(&m.world_from_body.rotation, &truth.rotation) < 1e-14);
        assert!((m.rate_in_body - rate).norm() < 1e-12 && m.acceleration_in_world.norm() < 1e-11);
        assert!((m.velocity_in_world - velocity).norm() < 1e-12 && m.angular_acceleration_in_body.norm() < 1e-10);
    }
}

#[test]
fn follows_a_recorded_flight() {
    let Some(text) = recorded::text("trajectories/euroc/MH_03_medium.txt.gz") else { return };
    let truth = tum::read(&text).unwrap();
    let spline = Spline::from_trajectory(&truth, 50_000_000).unwrap();
    let (first, last) = spline.span();
    let middle = first.nanos() / 2 + last.nanos() / 2;
    for i in -40..40 {
        let stamp = nanos(middle + i * 777_777_777);
        let m = spline.sample(stamp).unwrap();
        let pose = truth.pose_at(stamp).unwrap();
        // A B-spline cuts corners by about a·Δt²/6: 4 mm at 1 g.
        assert!((m.world_from_body.translation.vector - pose.translation.vector).norm() < 0.01);
        assert!(m.velocity_in_world.norm() < 5.0 && (m.specific_force(9.81).norm() - 9.81).abs() < 12.0);
    }
}

#[test]
fn a_curve_through_its_poses_keeps_the_size_of_fast_motion() {
    // 2 cm and 3 degrees to and fro at 3 Hz, 20 poses a second.
    let wave = |t: f64| (std::f64::consts::TAU * 3.0 * t).sin();
    let poses = (0..100).map(|k| {
        let t = 0.05 * f64::from(k);
        Isometry3::new(Vector3::new(0.02 * wave(t), t, 0.0), Vector3::new(0.0, 0.05 * wave(t), 0.3 * t))
    });
    let stamps = (0..100).map(|k| nanos(50_000_000 * k)).collect();
    let trajectory = Trajectory::new(stamps, poses.collect()).unwrap();
    let apart = |spline: &Spline| {
        let inner = trajectory.iter().skip(10).take(80);
        let errors = inner.map(|(stamp, pose)| {
            let at = spline.sample(stamp).unwrap().world_from_body;
            (at.translation.vector - pose.translation.vector).norm() + at.rotation.angle_to(&pose.rotation)
        });
        errors.fold(0.0, f64::max)
    };
    let near = apart(&Spline::from_trajectory(&trajectory, 50_000_000).unwrap());
    let through = apart(&Spline::through_trajectory(&trajectory, 50_000_000).unwrap());
    assert!(near > 5e-3 && through < 1e-6, "{near} {through}");
}

#[test]
fn refuses_what_it_cannot_sample() {
    let knots = vec![Isometry3::identity(); 4];
    assert!(matches!(Spline::new(nanos(0), 0, knots.clone()), Err(Error::InvalidSetting { .. })));
    assert!(matches!(Spline::new(nanos(0), 1, knots[..3].to_vec()), Err(Error::TooFew { got: 3, need: 4, .. })));
    assert!(matches!(Spline::new(nanos(i64::MAX - 2), 1, knots.clone()), Err(Error::InvalidStamp(_))));
    assert!(matches!(Spline::new(nanos(-5), i64::MAX / 2, knots.clone()), Err(Error::InvalidStamp(_))));
    let second = [Stamp::from_nanos(0), Stamp::from_nanos(1_000_000_000)];
    let trajectory = Trajectory::new(second.to_vec(), knots[..2].to_vec()).unwrap();
    assert!(matches!(Spline::from_trajectory(&trajectory, 1), Err(Error::InvalidSetting { .. })));
    assert!(matches!(Spline::from_trajectory(&trajectory, 500_000_000), Err(Error::TooFew { got: 3, .. })));
    let spline = Spline::new(nanos(0), 10, knots.clone()).unwrap();
    assert!(matches!(spline.sample(nanos(9)), Err(Error::OutOfRange { .. })));
    assert!(matches!(spline.sample(nanos(21)), Err(Error::OutOfRange { .. })));
    assert!(spline.sample(nanos(20)).is_ok());
    let mut bad = knots;
    bad[2].translation.x = f64::NAN;
    assert!(matches!(Spline::new(nanos(0), 10, bad), Err(Error::NonFinite { index: 2, .. })));
}
