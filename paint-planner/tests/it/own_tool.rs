//! A vehicle with a tool of one's own: inverse kinematics, a collision body, and what it may not do.

use paint_planner::nalgebra::{Point3, Vector3};
use paint_planner::plan::NotServed;
use paint_planner::{NozzleState, Settings, Target, Tool, VehicleState, plan};

use crate::walls::Wall;

/// A nozzle a metre above the vehicle on a mast that turns, and tilts by `tilt` at most; it may not go below `floor`.
struct Mast {
    tilt: f64,
    floor: f64,
}

impl Tool for Mast {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let turn = nozzle.direction.y.atan2(nozzle.direction.x) - heading;
        let (pan, tilt) = (turn.sin().atan2(turn.cos()), nozzle.direction.z.asin());
        let position = nozzle.position - Vector3::z() - 0.5 * Vector3::new(heading.cos(), heading.sin(), 0.0);
        (tilt.abs() <= self.tilt).then_some(VehicleState { position, heading, pan, tilt })
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        out.push((vehicle.position, 0.3));
    }

    fn permits(&self, vehicle: &VehicleState) -> bool {
        vehicle.position.z >= self.floor
    }
}

#[test]
fn a_vehicle_is_where_its_tool_says() {
    let (wall, targets) = (Wall::flat(), Wall::flat().rows(1.0, 1, 0.2));
    let settings = Settings::default();
    let planned = plan(&targets, &wall, &Mast { tilt: 0.5, floor: 0.0 }, &settings).unwrap();
    assert_eq!(planned.report.served, targets.len());
    for (vehicle, nozzle) in planned.vehicle.iter().zip(&planned.nozzle) {
        let below = nozzle.position - vehicle.position;
        assert!((below.z - 1.0).abs() < 1e-12 && (below.xy().norm() - 0.5).abs() < 1e-12);
    }
    // Targets stand 1.5 m high.
    assert!(plan(&targets, &wall, &Mast { tilt: 0.5, floor: 0.6 }, &settings).is_err());
}

#[test]
fn what_the_joints_or_the_tool_forbid_has_no_heading() {
    let wall = Wall::flat();
    let mut targets = wall.rows(1.0, 1, 0.2);
    for target in &mut targets[20..] {
        // Normals that look down by 0.3 rad, and a tilt that ends at 0.1.
        target.normal =
            paint_planner::nalgebra::UnitVector3::new_normalize(Vector3::new(-0.3_f64.cos(), 0.0, -0.3_f64.sin()));
    }
    let mut settings = Settings::default();
    settings.nozzle.ca = 0.0;
    settings.nozzle.cb = 0.0;
    let planned = plan(&targets, &wall, &Mast { tilt: 0.1, floor: 0.0 }, &settings).unwrap();
    let reasons = |range: std::ops::Range<usize>| planned.not_served[range].to_vec();
    assert!(reasons(0..18).iter().all(Option::is_none) && reasons(23..41) == [Some(NotServed::NoHeading); 18]);
    let bare: Vec<&Target> =
        targets.iter().zip(&planned.reachable).filter(|(_, reached)| !**reached).map(|(t, _)| t).collect();
    assert!(bare.len() >= 18);
}
