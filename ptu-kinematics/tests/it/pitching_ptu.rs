//! A vehicle that can pitch: the pan-tilt unit where the level vehicle has no reach.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use ptu_kinematics::{Error, Hover, Joints, KinematicChain, PitchingJoints, PitchingPtu, Ptu, PtuSettings, Range};

fn vehicle() -> PitchingPtu {
    let unit = Ptu::new(PtuSettings { gun_pitch: 0.05, ..PtuSettings::default() }).unwrap();
    PitchingPtu::new(unit, Range::symmetric(0.9)).unwrap()
}

fn direction(azimuth: f64, elevation: f64) -> UnitVector3<f64> {
    let (sin, cos) = elevation.sin_cos();
    UnitVector3::new_normalize(Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin))
}

#[test]
fn the_inverse_undoes_the_forward_and_the_jacobian_is_its_derivative() {
    let vehicle = vehicle();
    for k in 0..400 {
        let t = f64::from(k);
        let (heading, azimuth, elevation) = (3.0 * (0.7 * t).sin(), 0.9 * (1.3 * t).sin(), 1.5 * (2.1 * t).cos());
        let tip = Point3::new((0.3 * t).cos(), t.sin(), 2.0 + 0.01 * t);
        let wanted = direction(heading + azimuth, elevation);
        let hover = vehicle.inverse(&tip, &wanted, heading).unwrap();
        let nozzle = vehicle.forward(&hover.world_from_body(), &hover.joints);
        assert!(
            (nozzle.tip - tip).norm() < 1e-12 && (nozzle.direction.into_inner() - wanted.into_inner()).norm() < 1e-12
        );
        let joints = [hover.joints.pitch, hover.joints.pan, hover.joints.tilt];
        assert!(joints.iter().zip(vehicle.limits()).all(|(joint, limits)| limits.contains(*joint)), "{joints:?}");
        let angles = vehicle.spray_angles(&hover.joints);
        assert!((angles[0] - azimuth).abs() < 1e-9 && (angles[1] - elevation).abs() < 1e-12, "{angles:?}");
        let again = vehicle.point(angles[0], angles[1]);
        assert!((vehicle.forward(&hover.world_from_body(), &again).tip - tip).norm() < 1e-8);
        let at = |column: usize, step: f64| {
            let mut h: Hover<_> = hover;
            match column {
                0..=2 => h.position[column] += step,
                3 => h.heading += step,
                4 => h.joints.pitch += step,
                5 => h.joints.pan += step,
                _ => h.joints.tilt += step,
            }
            let n = vehicle.forward(&h.world_from_body(), &h.joints);
            [n.tip.x, n.tip.y, n.tip.z, n.direction.x, n.direction.y, n.direction.z]
        };
        let jacobian = vehicle.jacobian(&hover);
        for column in 0..7 {
            let (plus, minus) = (at(column, 1e-6), at(column, -1e-6));
            for row in 0..6 {
                let numeric = (plus[row] - minus[row]) / 2e-6;
                assert!((numeric - jacobian[(row, column)]).abs() < 1e-8, "row {row} column {column}");
            }
        }
    }
}

#[test]
fn it_stays_level_where_the_tilt_joint_reaches_and_takes_the_least_pitch_beyond() {
    let vehicle = vehicle();
    let unit = Ptu::new(PtuSettings { gun_pitch: 0.05, ..PtuSettings::default() }).unwrap();
    let limits = unit.settings().tilt_limits;
    for k in 0..=300 {
        let elevation = std::f64::consts::FRAC_PI_2 * (f64::from(k) / 150.0 - 1.0) * 0.999;
        for azimuth in [-0.8, 0.0, 0.5] {
            let wanted = direction(azimuth, elevation);
            let level = unit.inverse(&Point3::origin(), &wanted, 0.0);
            let joints = vehicle.inverse(&Point3::origin(), &wanted, 0.0).unwrap().joints;
            match level {
                Ok(level) => assert_eq!(joints.pitch, 0.0, "{level:?}"),
                Err(Error::OutOfLimits { joint: "tilt", .. }) => {
                    // By brute force: no smaller pitch brings the direction within the joint.
                    let reached = |pitch: f64| {
                        let body = Isometry3::rotation(-Vector3::y() * pitch);
                        let seen = body.inverse_transform_vector(&wanted);
                        limits.contains(seen.z.asin() - 0.05)
                    };
                    assert!(reached(joints.pitch));
                    let smaller = (0..200).map(|k| joints.pitch.abs() * (f64::from(k) / 200.0));
                    assert!(smaller.flat_map(|p| [p, -p]).all(|pitch| !reached(pitch)), "{elevation} {azimuth}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
    // Straight up, which a unit of 45 degrees never sprays: the nose rises by the other 45, less the angle of the gun.
    let up = vehicle.inverse(&Point3::origin(), &Vector3::z_axis(), 1.0).unwrap();
    let expected = std::f64::consts::FRAC_PI_4 - 0.05;
    assert!((up.joints.pitch - expected).abs() < 1e-8 && up.joints.pan.abs() < 1e-12, "{:?}", up.joints);
    let stiff = PitchingPtu::new(unit.clone(), Range::symmetric(0.3)).unwrap();
    assert!(matches!(stiff.inverse(&Point3::origin(), &Vector3::z_axis(), 0.0), Err(Error::OutOfLimits { .. })));
    assert!(PitchingPtu::new(unit.clone(), Range { min: 0.1, max: 0.5 }).is_err());
    assert!(PitchingPtu::new(unit.clone(), Range::symmetric(2.0)).is_err());
    // A level body is the unit itself.
    let joints = Joints { pan: 0.3, tilt: -0.2 };
    let same = ptu_kinematics::PitchingJoints { pitch: 0.0, pan: 0.3, tilt: -0.2 };
    let body = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, -0.2, 0.3));
    let (a, b) = (unit.forward(&body, joints), vehicle.forward(&body, &same));
    assert!((a.tip - b.tip).norm() < 1e-12 && (a.direction.into_inner() - b.direction.into_inner()).norm() < 1e-12);
}

#[test]
fn its_arm_goes_from_the_pan_axis_of_the_pitched_body_to_the_tip() {
    let (vehicle, pitch) = (vehicle(), 0.4_f64);
    let pose = Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::zeros());
    let joints = PitchingJoints { pitch, pan: 0.3, tilt: -0.2 };
    let members = vehicle.members(&pose, &joints);
    let [x, y, z]: [f64; 3] = PtuSettings::default().body_from_pan_axis.into();
    // A positive pitch lifts the nose.
    let axis = Point3::new(1.0 + pitch.cos() * x - pitch.sin() * z, -2.0 + y, 3.0 + pitch.sin() * x + pitch.cos() * z);
    assert!((members[0] - axis).norm() < 1e-12, "{members:?}");
    assert_eq!(members[1..], [vehicle.forward(&pose, &joints).tip]);
}
