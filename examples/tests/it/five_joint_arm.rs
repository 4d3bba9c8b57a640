//! The planner with another arm: strokes planned and checked with five joints instead of the pan-tilt unit.

use nalgebra::{Point3, Vector3};
use paint_planner::{Settings, Target, Tool, plan};
use paint_sim::TriangleSurface;
use paintcopter::adapters::{MeshSurface, Robot};
use ptu_kinematics::{KinematicChain, Ptu, PtuSettings, SerialArm};

const ARM: &str = r#"
<robot name="arm">
  <joint name="yaw" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0.4 0 0.05"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5"/></joint>
  <joint name="shoulder" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.02 0 0.03"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.15 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-1.2" upper="1.2"/></joint>
  <joint name="wrist" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0.1 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="hand" type="revolute"><parent link="d"/><child link="e"/><origin xyz="0.05 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="gun" type="fixed"><parent link="e"/><child link="nozzle"/><origin xyz="0.08 0 0.02"/></joint>
</robot>"#;

/// A wall in the plane x = 0, painted from smaller x.
fn wall() -> TriangleSurface {
    let corners = [[0.0, -5.0, -5.0], [0.0, 5.0, -5.0], [0.0, 5.0, 5.0], [0.0, -5.0, 5.0]];
    TriangleSurface::new(&corners, &[[0, 2, 1], [0, 3, 2]]).unwrap()
}

/// A wave over the wall, its normals tilted as those of a rough rock are.
fn targets() -> Vec<Target> {
    (0..60)
        .map(|i| {
            let s = 0.025 * f64::from(i);
            let normal = Vector3::new(-1.0, 0.3 * (3.0 * s).sin(), 0.4 * (2.0 * s).cos());
            let point = Point3::new(0.0, s, 2.0 + 0.2 * (2.0 * s).sin());
            Target {
                point,
                normal: nalgebra::UnitVector3::new_normalize(normal),
                dose: 1e-6,
                time: None,
                stand_off: None,
            }
        })
        .collect()
}

/// Plans with a chain and checks what every plan must keep; returns the mean normal deviation.
fn planned_with<C: KinematicChain>(chain: C) -> f64 {
    let (wall, targets, settings) = (wall(), targets(), Settings::default());
    let robot = Robot::new(chain);
    let plan = plan(&targets, &MeshSurface(&wall), &robot, &settings).unwrap();
    assert_eq!(plan.report.served, targets.len());
    assert!(plan.report.clearance > 0.0 && plan.report.extrema.speed <= settings.timing.max_speed);
    for (state, nozzle) in plan.vehicle.iter().zip(&plan.nozzle) {
        // The planned state puts the chain's own nozzle where the plan says.
        let joints = robot.chain.point(state.pan, state.tilt);
        let limits = robot.chain.limits();
        let hover = ptu_kinematics::Hover { position: state.position, heading: state.heading, joints };
        let held = robot.chain.forward(&hover.world_from_body(), &hover.joints);
        assert!((held.tip - nozzle.position).norm() < 1e-6);
        assert!(held.direction.angle(&nozzle.direction) < 1e-6);
        assert!(!limits.is_empty());
        let (mut spheres, mut again) = (Vec::new(), Vec::new());
        robot.spheres(state, &mut spheres);
        robot.body.spheres(&robot.chain, &hover.world_from_body(), &hover.joints, &mut again);
        assert_eq!(spheres, again);
    }
    plan.report.normal_deviation_mean
}

#[test]
fn strokes_are_planned_with_the_pan_tilt_unit_and_with_five_joints() {
    let unit = planned_with(Ptu::new(PtuSettings::default()).unwrap());
    let arm = planned_with(SerialArm::from_urdf(ARM, "nozzle").unwrap());
    assert!(unit < 0.01 && arm < 0.01, "{unit} {arm}");
    // Stage 1 does not know the arm: the nozzle states are the same.
    assert!((unit - arm).abs() < 1e-12);
}
