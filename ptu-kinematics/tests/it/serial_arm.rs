//! A five-joint arm and the pan-tilt unit behind one trait.

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use ptu_kinematics::{Error, Hover, KinematicChain, Ptu, Range, SerialArm, SerialJoint};

/// Shoulder yaw and pitch, elbow, wrist pitch and yaw on an arm before the body; the links lie along x at zero angles.
const FIVE_JOINTS: &str = r#"
<robot name="arm">
  <joint name="mount" type="fixed"><parent link="base"/><child link="m"/><origin xyz="0.3 0 0.05"/></joint>
  <joint name="yaw" type="revolute"><parent link="m"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-1.5" upper="1.5"/></joint>
  <joint name="shoulder" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.02 0 0.03"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.2 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-1.2" upper="1.2"/></joint>
  <joint name="wrist" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0.15 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="hand" type="continuous"><parent link="d"/><child link="e"/><origin xyz="0.05 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="gun" type="fixed"><parent link="e"/><child link="nozzle"/><origin xyz="0.1 0 0.02" rpy="0 -0.1 0"/></joint>
</robot>"#;

const PAN_TILT: &str = r#"
<robot name="unit">
  <joint name="pan" type="revolute"><parent link="base"/><child link="p"/><origin xyz="0.45 0 0.05"/><axis xyz="0 0 1"/>
    <limit lower="-1.4" upper="1.4"/></joint>
  <joint name="tilt" type="revolute"><parent link="p"/><child link="t"/><origin xyz="0.03 0 0.04"/><axis xyz="0 -1 0"/>
    <limit lower="-0.7" upper="0.7"/></joint>
  <joint name="gun" type="fixed"><parent link="t"/><child link="nozzle"/><origin xyz="0.12 0 0.02" rpy="0 -0.1 0"/></joint>
</robot>"#;

fn arm() -> SerialArm {
    SerialArm::from_urdf(FIVE_JOINTS, "nozzle").unwrap()
}

fn direction(azimuth: f64, elevation: f64) -> UnitVector3<f64> {
    let (sin, cos) = elevation.sin_cos();
    UnitVector3::new_normalize(Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin))
}

/// The inverse puts tip and spray where they were asked to be, and the Jacobian is the derivative of the forward
/// kinematics: for any chain.
fn keeps_its_promises<C: KinematicChain>(chain: &C, moved: impl Fn(&C::Joints, usize, f64) -> C::Joints) {
    let count = chain.limits().len();
    for k in 0..200 {
        let t = f64::from(k);
        let (heading, azimuth, elevation) = (3.0 * (0.7 * t).sin(), 1.2 * (1.3 * t).sin(), 0.6 * (2.1 * t).cos());
        let tip = Point3::new((0.3 * t).cos(), t.sin(), 2.0 + 0.01 * t);
        let wanted = direction(heading + azimuth, elevation);
        let hover = chain.inverse(&tip, &wanted, heading).unwrap();
        let nozzle = chain.forward(&hover.world_from_body(), &hover.joints);
        assert!((nozzle.tip - tip).norm() < 1e-9, "{k}: tip {}", nozzle.tip);
        assert!(nozzle.direction.cross(&wanted).norm() < 1e-8 && nozzle.direction.dot(&wanted) > 0.0, "{k}");
        // The angles of the spray are the ones that were asked for, and lead back to the same joints.
        let angles = chain.spray_angles(&hover.joints);
        assert!((angles[0] - azimuth).abs() < 1e-8 && (angles[1] - elevation).abs() < 1e-8, "{angles:?}");
        let again = chain.forward(&hover.world_from_body(), &chain.point(angles[0], angles[1]));
        assert!((again.tip - tip).norm() < 1e-7);

        let jacobian = chain.jacobian(&hover);
        assert_eq!(jacobian.ncols(), 4 + count);
        let at = |column: usize, step: f64| {
            let mut h = Hover { position: hover.position, heading: hover.heading, joints: hover.joints.clone() };
            match column {
                0..=2 => h.position[column] += step,
                3 => h.heading += step,
                _ => h.joints = moved(&hover.joints, column - 4, step),
            }
            let n = chain.forward(&h.world_from_body(), &h.joints);
            [n.tip.x, n.tip.y, n.tip.z, n.direction.x, n.direction.y, n.direction.z]
        };
        for column in 0..4 + count {
            let (plus, minus) = (at(column, 1e-6), at(column, -1e-6));
            for row in 0..6 {
                let numeric = (plus[row] - minus[row]) / 2e-6;
                assert!((numeric - jacobian[(row, column)]).abs() < 1e-8, "row {row} column {column}");
            }
        }
    }
}

#[test]
fn the_pan_tilt_unit_and_a_five_joint_arm_are_kinematic_chains() {
    let (unit, _) = Ptu::from_urdf(PAN_TILT, "nozzle").unwrap();
    keeps_its_promises(&unit, |joints, k, step| {
        let mut joints = *joints;
        *[&mut joints.pan, &mut joints.tilt][k] += step;
        joints
    });
    keeps_its_promises(&arm(), |joints, k, step| {
        let mut joints = joints.clone();
        joints[k] += step;
        joints
    });
}

#[test]
fn a_pan_tilt_unit_read_as_a_serial_arm_gives_the_closed_form() {
    let (unit, _) = Ptu::from_urdf(PAN_TILT, "nozzle").unwrap();
    let serial = SerialArm::from_urdf(PAN_TILT, "nozzle").unwrap();
    assert_eq!(KinematicChain::limits(&unit), serial.limits());
    for k in 0..100 {
        let t = f64::from(k);
        let (heading, tip) = (0.1 * t, Point3::new(t.sin(), t.cos(), 1.0));
        let wanted = direction(heading + 1.3 * (0.9 * t).sin(), 0.55 * (1.7 * t).cos());
        let (a, b) = (unit.inverse(&tip, &wanted, heading).unwrap(), serial.inverse(&tip, &wanted, heading).unwrap());
        assert!((a.position - b.position).norm() < 1e-9);
        assert!((a.joints.pan - b.joints[0]).abs() < 1e-9 && (a.joints.tilt - b.joints[1]).abs() < 1e-9);
        let (p, q) = (KinematicChain::jacobian(&unit, &a), serial.jacobian(&b));
        assert!((p - q).amax() < 1e-9);
        let body = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, -0.2, 0.3));
        let (members, joints) = (serial.members(&body, &b.joints), KinematicChain::members(&unit, &body, &a.joints));
        assert!((members[0] - joints[0]).norm() < 1e-12 && (members[2] - joints[1]).norm() < 1e-9);
    }
}

/// A quarter turn to the left, 10 cm on, 20 cm up, then the joint: what is fixed lies along the turned axes, from the root on.
#[test]
fn fixed_joints_follow_each_other_from_the_root() {
    let text = r#"
<robot name="bracket">
  <joint name="turn" type="fixed"><parent link="base"/><child link="a"/><origin rpy="0 0 1.5707963267948966"/></joint>
  <joint name="bar" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0.2"/></joint>
  <joint name="pan" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/><limit lower="-2" upper="2"/></joint>
  <joint name="dip" type="fixed"><parent link="c"/><child link="d"/><origin rpy="0 1.5707963267948966 0"/></joint>
  <joint name="gun" type="fixed"><parent link="d"/><child link="nozzle"/><origin xyz="0.3 0 0"/></joint>
</robot>"#;
    let arm = SerialArm::from_urdf(text, "nozzle").unwrap();
    assert!((arm.joints()[0].parent_from_joint * Point3::origin() - Point3::new(0.0, 0.1, 0.2)).norm() < 1e-12);
    for pan in [0.0, 0.7, -1.9] {
        let nozzle = arm.forward(&Isometry3::identity(), &vec![pan]);
        assert!((nozzle.tip - Point3::new(0.0, 0.1, -0.1)).norm() < 1e-12, "{}", nozzle.tip);
        assert!((nozzle.direction.into_inner() + Vector3::z()).norm() < 1e-12);
    }
}

#[test]
fn the_inverse_stays_within_the_limits_and_says_when_it_cannot() {
    let arm = arm();
    for k in 0..300 {
        let t = f64::from(k);
        let wanted = direction(3.0 * (0.37 * t).sin(), 1.5 * (0.53 * t).sin());
        match arm.inverse(&Point3::origin(), &wanted, 0.0) {
            Ok(hover) => {
                for (angle, limits) in hover.joints.iter().zip(arm.limits()) {
                    assert!(limits.contains(*angle), "{angle} outside {limits:?}");
                }
            }
            Err(error) => panic!("five joints reach every one of these: {error}"),
        }
    }
    // With the hand and the yaw held near zero, nothing sprays backwards.
    let narrow = Range::symmetric(0.1);
    let joints: Vec<SerialJoint> =
        arm.joints().iter().map(|joint| SerialJoint { limits: narrow, ..joint.clone() }).collect();
    let stiff = SerialArm::new(joints, Isometry3::identity()).unwrap();
    let refused = stiff.inverse(&Point3::origin(), &direction(3.0, 0.0), 0.0);
    assert!(matches!(refused, Err(Error::Unreachable { left }) if left > 2.0), "{refused:?}");
    let nearest = stiff.point(3.0, 0.0);
    assert!(nearest.iter().all(|angle| narrow.contains(*angle)));
}

#[test]
fn redundant_joints_stay_near_the_rest_posture() {
    // The rest posture folds the elbow: a small change of direction moves every joint by little.
    let rest = [0.0, 0.5, -0.9, 0.3, 0.0];
    let folded = arm().with_rest(&rest).unwrap();
    let [azimuth, elevation] = folded.spray_angles(&rest.to_vec());
    let same = folded.point(azimuth, elevation);
    assert!(same.iter().zip(rest).all(|(a, b)| (a - b).abs() < 1e-9), "{same:?}");
    let near = folded.point(azimuth + 0.1, elevation - 0.1);
    assert!(near.iter().zip(rest).all(|(a, b)| (a - b).abs() < 0.11), "{near:?}");
}

#[test]
fn arms_that_are_none_are_refused() {
    assert!(matches!(SerialArm::new(vec![], Isometry3::identity()), Err(Error::InvalidSetting { name: "joints", .. })));
    assert!(matches!(arm().with_rest(&[0.0]), Err(Error::InvalidSetting { name: "rest", .. })));
    assert!(matches!(arm().with_rest(&[f64::NAN; 5]), Err(Error::NonFinite { .. })));
    let nan = arm().inverse(&Point3::new(f64::NAN, 0.0, 0.0), &Vector3::x_axis(), 0.0);
    assert!(matches!(nan, Err(Error::NonFinite { .. })));
    let crossed = SerialJoint {
        name: "crossed".into(),
        parent_from_joint: Isometry3::from_parts(nalgebra::Translation3::identity(), UnitQuaternion::identity()),
        axis: Vector3::z_axis(),
        limits: Range { min: 1.0, max: -1.0 },
    };
    assert!(SerialArm::new(vec![crossed], Isometry3::identity()).is_err());
    assert!(matches!(SerialArm::from_urdf(FIVE_JOINTS, "gripper"), Err(Error::Urdf { .. })));
}

/// One joint that turns half a radian to either side, told to rest beyond.
#[test]
fn a_rest_beyond_the_limits_is_the_limit() {
    let (axis, limits) = (Vector3::z_axis(), Range::symmetric(0.5));
    let joint = SerialJoint { name: "pan".into(), parent_from_joint: Isometry3::identity(), axis, limits };
    let arm = SerialArm::new(vec![joint], Isometry3::translation(0.1, 0.0, 0.0)).unwrap().with_rest(&[1.0]).unwrap();
    // The rest itself, what is within reach, and what is not.
    for (azimuth, expected) in [(1.0, 0.5), (0.2, 0.2), (-1.0, -0.5)] {
        let found = arm.point(azimuth, 0.0);
        assert!((found[0] - expected).abs() < 1e-9, "{azimuth}: {found:?}");
    }
}
