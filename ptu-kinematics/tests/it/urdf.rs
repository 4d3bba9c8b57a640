//! URDF reading: the same chain written in different ways gives the same kinematics.

use nalgebra::{Isometry3, Vector3};
use ptu_kinematics::{Error, Joints, Ptu, PtuSettings, Range};

const PLAIN: &str = r#"
<robot name="painter">
  <link name="base_link"/><link name="pan"/><link name="tilt"/><link name="nozzle"/>
  <joint name="pan_joint" type="revolute">
    <parent link="base_link"/><child link="pan"/><origin xyz="0.35 0 0.05"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.2" effort="1" velocity="6"/>
  </joint>
  <joint name="tilt_joint" type="revolute">
    <parent link="pan"/><child link="tilt"/><origin xyz="0.03 0 0.04"/><axis xyz="0 -1 0"/>
    <limit lower="-0.7" upper="0.6" effort="1" velocity="6"/>
  </joint>
  <joint name="gun" type="fixed">
    <parent link="tilt"/><child link="nozzle"/><origin xyz="0.12 0 0.02" rpy="0 -0.1 0"/>
  </joint>
</robot>"#;

#[test]
fn reads_offsets_limits_and_gun_pitch() {
    let (ptu, signs) = Ptu::from_urdf(PLAIN, "nozzle").unwrap();
    let expected = PtuSettings {
        body_from_pan_axis: Vector3::new(0.35, 0.0, 0.05),
        pan_from_tilt_axis: Vector3::new(0.03, 0.0, 0.04),
        tilt_from_tip: Vector3::new(0.12, 0.0, 0.02),
        gun_pitch: ptu.settings().gun_pitch,
        pan_limits: Range { min: -1.5, max: 1.2 },
        tilt_limits: Range { min: -0.7, max: 0.6 },
    };
    assert_eq!(ptu.settings(), &expected);
    // rpy pitch -0.1 lifts the x axis by 0.1.
    assert!((ptu.settings().gun_pitch - 0.1).abs() < 1e-12);
    assert_eq!((signs.pan, signs.tilt), (1.0, 1.0));
}

#[test]
fn rotated_frames_and_reversed_axes_are_the_same_robot() {
    // The pan frame is turned by 90 degrees about z, tilt counts downwards, an extra fixed link holds the arm.
    let turned = r#"
    <robot name="painter">
      <joint name="arm" type="fixed"><parent link="base"/><child link="arm"/><origin xyz="0.3 0 0.05"/></joint>
      <joint name="pan" type="revolute"><parent link="arm"/><child link="p"/>
        <origin xyz="0.05 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 -1"/><limit lower="-1.2" upper="1.5"/></joint>
      <joint name="tilt" type="revolute"><parent link="p"/><child link="t"/>
        <origin xyz="0 -0.03 0.04" rpy="0 0 -1.5707963267948966"/><axis xyz="0 1 0"/><limit lower="-0.6" upper="0.7"/></joint>
      <joint name="gun" type="fixed"><parent link="t"/><child link="nozzle"/><origin xyz="0.12 0 0.02" rpy="0 -0.1 0"/></joint>
    </robot>"#;
    let (a, _) = Ptu::from_urdf(PLAIN, "nozzle").unwrap();
    let (b, signs) = Ptu::from_urdf(turned, "nozzle").unwrap();
    assert_eq!((signs.pan, signs.tilt), (-1.0, -1.0));
    let joints = Joints { pan: 0.4, tilt: -0.3 };
    let (na, nb) = (a.forward(&Isometry3::identity(), joints), b.forward(&Isometry3::identity(), joints));
    assert!((na.tip - nb.tip).norm() < 1e-12);
    assert!(na.direction.angle(&nb.direction) < 1e-7);
    assert!((a.settings().pan_limits.min - b.settings().pan_limits.min).abs() < 1e-12);
    assert!((a.settings().tilt_limits.max - b.settings().tilt_limits.max).abs() < 1e-12);
}

#[test]
fn says_what_is_wrong() {
    let message = |text: &str, tip: &str| match Ptu::from_urdf(text, tip) {
        Err(Error::Urdf { place, what }) => format!("{place}: {what}"),
        other => panic!("expected a URDF error, got {other:?}"),
    };
    assert!(message("<robot", "nozzle").starts_with("document"));
    assert!(message(PLAIN, "gripper").starts_with("gripper: no joint"));
    assert!(message(PLAIN, "pan").contains("1 moving joints"));
    assert!(message(&PLAIN.replace("0 0 1\"", "0 1 0\""), "nozzle").contains("pan must turn"));
    assert!(message(&PLAIN.replace("0 -1 0", "1 0 0"), "nozzle").contains("tilt must turn"));
    assert!(message(&PLAIN.replace("0.35 0 0.05", "0.35 zero 0.05"), "nozzle").contains("three finite numbers"));
    assert!(message(&PLAIN.replace("type=\"fixed\"", "type=\"floating\""), "nozzle").contains("floating"));
    assert!(message(&PLAIN.replace("lower=\"-1.5\"", ""), "nozzle").contains("lower"));
    assert!(message(&PLAIN.replace("rpy=\"0 -0.1 0\"", "rpy=\"0 0 0.4\""), "nozzle").contains("xz plane"));
    let cycle = PLAIN.replace("<parent link=\"base_link\"/>", "<parent link=\"nozzle\"/>");
    assert!(message(&cycle, "nozzle").contains("loop"));
}

/// Written, read by the reader of robots of others, it is the same robot.
#[test]
fn what_is_written_is_the_same_robot() {
    let settings = PtuSettings {
        body_from_pan_axis: Vector3::new(0.41, -0.02, 0.07),
        pan_from_tilt_axis: Vector3::new(0.03, 0.01, 0.04),
        tilt_from_tip: Vector3::new(0.12, 0.015, -0.02),
        gun_pitch: 0.15,
        pan_limits: Range { min: -1.1, max: 1.4 },
        tilt_limits: Range { min: -0.5, max: 0.8 },
    };
    let written = Ptu::new(settings).unwrap().to_urdf("R2 & \"friends\" <3", 6.0);
    let (read, signs) = Ptu::from_urdf(&written, "nozzle").unwrap();
    assert_eq!((signs.pan, signs.tilt), (1.0, 1.0));
    assert!((read.settings().gun_pitch - 0.15).abs() < 1e-12);
    assert_eq!(read.settings(), &PtuSettings { gun_pitch: read.settings().gun_pitch, ..settings });
}
