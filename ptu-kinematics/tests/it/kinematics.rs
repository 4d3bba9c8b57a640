//! Reference values, round trips and brute force for the kinematic chain.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use ptu_kinematics::{Error, Hover, Joints, Observation, Ptu, PtuSettings, Range, calibrate, wrap};

/// The offsets of the published reference values: a, b, c.
fn reference() -> PtuSettings {
    PtuSettings {
        body_from_pan_axis: Vector3::new(0.35, 0.0, 0.05),
        pan_from_tilt_axis: Vector3::new(0.03, 0.0, 0.04),
        tilt_from_tip: Vector3::new(0.12, 0.0, 0.02),
        ..PtuSettings::default()
    }
}

/// splitmix64: uniform numbers in [low, high) from a seed.
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, half: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform(-half, half))
    }

    /// Random offsets and gun pitch.
    fn settings(&mut self) -> PtuSettings {
        PtuSettings {
            body_from_pan_axis: self.vector(0.5),
            pan_from_tilt_axis: self.vector(0.05),
            tilt_from_tip: Vector3::new(self.uniform(0.05, 0.2), self.uniform(-0.02, 0.02), self.uniform(-0.03, 0.03)),
            gun_pitch: self.uniform(-0.3, 0.3),
            ..PtuSettings::default()
        }
    }

    fn hover(&mut self) -> Hover {
        Hover {
            position: Point3::from(self.vector(5.0)),
            heading: self.uniform(-PI, PI),
            joints: Joints { pan: self.uniform(-FRAC_PI_2, FRAC_PI_2), tilt: self.uniform(-FRAC_PI_4, FRAC_PI_4) },
        }
    }
}

fn close(a: impl AsRef<[f64]>, b: impl AsRef<[f64]>, tolerance: f64) {
    for (x, y) in a.as_ref().iter().zip(b.as_ref()) {
        assert!((x - y).abs() <= tolerance, "{x} is not {y} within {tolerance}");
    }
}

#[test]
fn forward_matches_the_worked_example() {
    let ptu = Ptu::new(reference()).unwrap();
    let hover = Hover { position: Point3::new(1.0, 2.0, 3.0), heading: 0.3, joints: Joints { pan: 0.4, tilt: -0.2 } };
    let nozzle = ptu.forward(&hover.world_from_body(), hover.joints);
    close(nozzle.tip.coords.as_slice(), [1.4503036023324, 2.2010834757787, 3.0857610118614], 1e-12);
    close(nozzle.direction.as_slice(), [0.7495962650805, 0.6313762241158, -0.1986693307951], 1e-12);
    // The inverse of the same nozzle at another heading.
    let other = ptu.inverse(&nozzle.tip, &nozzle.direction, -0.1).unwrap();
    close(other.position.coords.as_slice(), [0.98611631, 2.13837377, 3.0], 1e-8);
    close([other.joints.pan, other.joints.tilt], [0.8, -0.2], 1e-12);
}

#[test]
fn forward_is_the_product_of_rotation_matrices() {
    let mut random = Random(1);
    for _ in 0..1000 {
        let s = random.settings();
        let joints = random.hover().joints;
        let pose = Isometry3::new(random.vector(3.0), random.vector(1.0));
        let nozzle = Ptu::new(s).unwrap().forward(&pose, joints);
        let pan = Rotation3::from_axis_angle(&Vector3::z_axis(), joints.pan);
        let tilt = Rotation3::from_axis_angle(&Vector3::y_axis(), -joints.tilt);
        let tip = pose * Point3::from(s.body_from_pan_axis + pan * (s.pan_from_tilt_axis + tilt * s.tilt_from_tip));
        let gun = Rotation3::from_axis_angle(&Vector3::y_axis(), -s.gun_pitch);
        let direction = pose.rotation * (pan * tilt * gun * Vector3::x());
        close(nozzle.tip.coords.as_slice(), tip.coords.as_slice(), 1e-14);
        close(nozzle.direction.as_slice(), direction.as_slice(), 1e-14);
        let frame = Ptu::new(s).unwrap().world_from_nozzle(&pose, joints);
        close((frame.rotation * Vector3::x()).as_slice(), direction.as_slice(), 1e-14);
        close(frame.translation.vector.as_slice(), tip.coords.as_slice(), 1e-14);
    }
}

#[test]
fn inverse_undoes_forward() {
    let mut random = Random(2);
    for _ in 0..20_000 {
        let mut s = random.settings();
        s.tilt_limits = Range::symmetric(FRAC_PI_2);
        let ptu = Ptu::new(s).unwrap();
        let hover = random.hover();
        let nozzle = ptu.forward(&hover.world_from_body(), hover.joints);
        let back = ptu.inverse(&nozzle.tip, &nozzle.direction, hover.heading).unwrap();
        close(back.position.coords.as_slice(), hover.position.coords.as_slice(), 1e-13);
        close([back.joints.pan, back.joints.tilt], [hover.joints.pan, hover.joints.tilt], 1e-13);
    }
}

#[test]
fn jacobian_matches_central_differences() {
    let mut random = Random(3);
    let step = 1e-6;
    for _ in 0..300 {
        let ptu = Ptu::new(random.settings()).unwrap();
        let hover = random.hover();
        let analytic = ptu.jacobian(&hover);
        let nozzle = |k: usize, d: f64| {
            let mut h = hover;
            match k {
                0..=2 => h.position[k] += d,
                3 => h.heading += d,
                4 => h.joints.pan += d,
                _ => h.joints.tilt += d,
            }
            let n = ptu.forward(&h.world_from_body(), h.joints);
            [n.tip.x, n.tip.y, n.tip.z, n.direction.x, n.direction.y, n.direction.z]
        };
        for k in 0..6 {
            let (plus, minus) = (nozzle(k, step), nozzle(k, -step));
            for row in 0..6 {
                let numeric = (plus[row] - minus[row]) / (2.0 * step);
                assert!((numeric - analytic[(row, k)]).abs() < 5e-9, "row {row} column {k}");
            }
        }
    }
}

#[test]
fn aim_matches_the_worked_examples() {
    // The targets are given in body-aligned axes from the pan axis point b.
    let from_pan_axis = |s: &PtuSettings, p: [f64; 3]| Point3::from(Vector3::from(p) + s.body_from_pan_axis);
    let s = reference();
    let identity = Isometry3::identity();
    let aim = Ptu::new(s).unwrap().aim(&identity, &from_pan_axis(&s, [0.2233407, 0.11461859, -0.01410592])).unwrap();
    close([aim.joints.pan, aim.joints.tilt, aim.distance], [0.474152257, -0.328066241, 0.106680065], 1e-8);

    let mut lateral = s;
    lateral.tilt_from_tip.y = 0.01;
    let aim = Ptu::new(lateral).unwrap().aim(&identity, &from_pan_axis(&lateral, [0.3, 0.2, 0.1])).unwrap();
    close([aim.joints.pan, aim.joints.tilt, aim.distance], [0.56026403673, 0.12004068478, 0.21522382739], 1e-10);
}

#[test]
fn the_spray_axis_goes_through_the_target_from_any_attitude() {
    let mut random = Random(4);
    let mut clamped = 0;
    for _ in 0..20_000 {
        let ptu = Ptu::new(random.settings()).unwrap();
        let attitude = UnitQuaternion::from_euler_angles(
            random.uniform(-0.5, 0.5),
            random.uniform(-0.5, 0.5),
            random.uniform(-PI, PI),
        );
        let pose = Isometry3::from_parts(Translation3::from(random.vector(4.0)), attitude);
        let target = pose * Point3::from(ptu.settings().body_from_pan_axis + random.vector(1.0) + Vector3::x() * 0.5);
        let Ok(aim) = ptu.aim(&pose, &target) else { continue };
        let nozzle = ptu.forward(&pose, aim.joints);
        let line = target - nozzle.tip;
        if aim.clamped {
            clamped += 1;
            assert!((nozzle.direction.angle(&line) - aim.pointing_error).abs() < 1e-7);
            assert!((line.norm() - aim.distance).abs() < 1e-12, "{} m, said {}", line.norm(), aim.distance);
            assert!(ptu.check_limits(aim.joints).is_ok());
        } else {
            let hit = nozzle.tip + nozzle.direction.into_inner() * aim.distance;
            assert!((hit - target).norm() < 1e-13, "missed by {}", (hit - target).norm());
        }
    }
    assert!(clamped > 100, "the sample must contain clamped cases");
}

#[test]
fn targets_inside_the_gun_are_refused() {
    let s = reference();
    let ptu = Ptu::new(s).unwrap();
    let at = |v: [f64; 3]| ptu.aim(&Isometry3::identity(), &Point3::from(s.body_from_pan_axis + Vector3::from(v)));
    assert!(matches!(at([0.03, 0.0, 0.05]), Err(Error::TooClose { axis: "tilt", .. })));
    assert!(matches!(at([0.08, 0.0, 0.04]), Err(Error::TooClose { axis: "nozzle", .. })));
    let nan = ptu.aim(&Isometry3::identity(), &Point3::new(f64::NAN, 0.0, 0.0));
    assert!(matches!(nan, Err(Error::NonFinite { .. })));
}

#[test]
fn a_vertical_spray_keeps_pan_at_zero() {
    let ptu = Ptu::new(PtuSettings { tilt_limits: Range::symmetric(FRAC_PI_2), ..reference() }).unwrap();
    let hover = ptu.inverse(&Point3::origin(), &Vector3::z_axis(), 0.7).unwrap();
    assert_eq!(hover.joints.pan, 0.0);
    let nozzle = ptu.forward(&hover.world_from_body(), hover.joints);
    close(nozzle.tip.coords.as_slice(), [0.0; 3], 1e-15);
    close(nozzle.direction.as_slice(), [0.0, 0.0, 1.0], 1e-15);
}

#[test]
fn limits_and_settings_are_checked() {
    let ptu = Ptu::new(reference()).unwrap();
    let steep = UnitVector3::new_normalize(Vector3::new(1.0, 0.0, 1.1));
    let refused = ptu.inverse(&Point3::origin(), &steep, 0.0);
    assert!(matches!(refused, Err(Error::OutOfLimits { joint: "tilt", .. })));
    let backwards = ptu.inverse(&Point3::origin(), &-Vector3::x_axis(), 0.0);
    assert!(matches!(backwards, Err(Error::OutOfLimits { joint: "pan", .. })));
    let crossed = PtuSettings { pan_limits: Range { min: 1.0, max: -1.0 }, ..reference() };
    assert!(matches!(Ptu::new(crossed), Err(Error::InvalidSetting { name: "pan_limits", .. })));
    let over = PtuSettings { tilt_limits: Range::symmetric(2.0), ..reference() };
    assert!(matches!(Ptu::new(over), Err(Error::InvalidSetting { name: "tilt_limits", .. })));
}

#[test]
fn calibration_recovers_the_offsets() {
    let mut random = Random(5);
    for _ in 0..20 {
        let truth = random.settings();
        let ptu = Ptu::new(truth).unwrap();
        let observations: Vec<Observation> = (0..30)
            .map(|_| {
                let joints = random.hover().joints;
                let nozzle = ptu.forward(&Isometry3::identity(), joints);
                Observation { joints, tip_in_body: nozzle.tip, direction_in_body: nozzle.direction }
            })
            .collect();
        let found = calibrate(&PtuSettings::default(), &observations).unwrap();
        assert!(found.tip_rms < 1e-12 && found.direction_rms < 1e-7);
        // Identifiable combinations; the splits a_z/b_z and a_y/c_y stay with the prior.
        let (s, t) = (found.settings, truth);
        close([s.gun_pitch], [t.gun_pitch], 1e-12);
        close(
            [s.body_from_pan_axis.x, s.body_from_pan_axis.y],
            [t.body_from_pan_axis.x, t.body_from_pan_axis.y],
            1e-10,
        );
        close([s.tilt_from_tip.x, s.tilt_from_tip.z], [t.tilt_from_tip.x, t.tilt_from_tip.z], 1e-10);
        close([s.pan_from_tilt_axis.x], [t.pan_from_tilt_axis.x], 1e-10);
        let height = |p: &PtuSettings| p.body_from_pan_axis.z + p.pan_from_tilt_axis.z;
        let side = |p: &PtuSettings| p.pan_from_tilt_axis.y + p.tilt_from_tip.y;
        close([height(&s), side(&s)], [height(&t), side(&t)], 1e-10);
    }
    assert!(matches!(calibrate(&reference(), &[]), Err(Error::Calibration { .. })));
}

#[test]
fn calibration_reports_root_mean_squares() {
    let truth = reference();
    let ptu = Ptu::new(truth).unwrap();
    let mut random = Random(6);
    let (slant, shift) = (0.01, 0.002);
    let observations: Vec<Observation> = (0..400)
        .map(|k| {
            let joints = random.hover().joints;
            let nozzle = ptu.forward(&Isometry3::identity(), joints);
            // Errors of one size and both signs: what is left after the fit is that size, for any number of observations.
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let lateral = Vector3::new(-joints.pan.sin(), joints.pan.cos(), 0.0);
            let turn = UnitQuaternion::from_scaled_axis(lateral * (sign * slant));
            let tip_in_body = nozzle.tip + lateral * (sign * shift);
            Observation { joints, tip_in_body, direction_in_body: turn * nozzle.direction }
        })
        .collect();
    let found = calibrate(&truth, &observations).unwrap();
    assert!((found.direction_rms / slant - 1.0).abs() < 0.01, "{}", found.direction_rms);
    assert!((found.tip_rms / shift - 1.0).abs() < 0.03, "{}", found.tip_rms);
    assert!((found.settings.gun_pitch - truth.gun_pitch).abs() < 1e-3);
}

#[test]
fn calibration_refuses_what_it_cannot_use() {
    let ptu = Ptu::new(reference()).unwrap();
    let mut random = Random(7);
    let mut good: Vec<Observation> = (0..3)
        .map(|_| {
            let joints = random.hover().joints;
            let nozzle = ptu.forward(&Isometry3::identity(), joints);
            Observation { joints, tip_in_body: nozzle.tip, direction_in_body: nozzle.direction }
        })
        .collect();
    assert!(calibrate(&reference(), &good).is_ok());
    assert!(matches!(calibrate(&reference(), &good[..2]), Err(Error::Calibration { .. })));
    let refused = |change: &dyn Fn(&mut Observation)| {
        let mut bad = good.clone();
        change(&mut bad[1]);
        calibrate(&reference(), &bad)
    };
    assert!(matches!(refused(&|o| o.joints.tilt = f64::NAN), Err(Error::NonFinite { what: "observation", .. })));
    assert!(matches!(refused(&|o| o.tip_in_body.y = f64::NAN), Err(Error::NonFinite { what: "observed tip", .. })));
    let nan = UnitVector3::new_unchecked(Vector3::repeat(f64::NAN));
    let refused = refused(&|o| o.direction_in_body = nan);
    assert!(matches!(refused, Err(Error::NonFinite { what: "observed direction", .. })));
    // Two of three directions sideways: the mean is too short to be an axis.
    for o in &mut good[..2] {
        o.direction_in_body = UnitVector3::new_normalize(Vector3::new(-o.joints.pan.sin(), o.joints.pan.cos(), 0.0));
    }
    assert!(matches!(calibrate(&reference(), &good), Err(Error::Calibration { .. })));
}

#[test]
fn wrapping_covers_the_circle_once() {
    for k in -50..=50 {
        let angle = 0.37 * f64::from(k);
        let w = wrap(angle);
        assert!(w > -PI && w <= PI);
        close([w.sin(), w.cos()], [angle.sin(), angle.cos()], 1e-13);
    }
    // Half a turn has one name, whichever way it was made.
    assert_eq!([PI, -PI, 3.0 * PI].map(wrap), [PI; 3]);
}
