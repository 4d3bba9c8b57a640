//! A vehicle with a tool of one's own: inverse kinematics, a collision body, and what it may not do.

use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::plan::{NotServed, Setpoint};
use paint_planner::{NozzleState, Settings, Surface, Target, Tool, VehicleState, plan};

use crate::walls::{Arm, Wall};

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
        target.normal = UnitVector3::new_normalize(Vector3::new(-0.3_f64.cos(), 0.0, -0.3_f64.sin()));
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

/// An arm that can tell where it sprays.
struct Sighted(Arm);

impl Tool for Sighted {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        self.0.vehicle(nozzle, heading)
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        self.0.spheres(vehicle, out);
    }

    fn nozzle(&self, vehicle: &VehicleState) -> Option<NozzleState> {
        let azimuth = vehicle.heading + vehicle.pan;
        let level = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * vehicle.tilt.cos();
        let direction = UnitVector3::new_normalize(level + Vector3::z() * vehicle.tilt.sin());
        // The nozzle before a body at the origin, by the inverse.
        let at_origin = self.0.vehicle(&NozzleState { position: Point3::origin(), direction }, vehicle.heading)?;
        Some(NozzleState { position: vehicle.position - at_origin.position.coords, direction })
    }
}

#[test]
fn the_valve_is_open_only_where_the_planned_spray_meets_its_aim() {
    // Targets far apart on a bumpy wall: between them the arm swings past the chord.
    let (wall, tool) = (Wall { bumps: 0.15, wavelength: 0.6, turn: 0.0 }, Sighted(Arm::default()));
    let targets: Vec<Target> = (0..30).map(|k| wall.target(0.09 * f64::from(k), 1.5, 1e-6)).collect();
    for (max_joint_rate, served) in [(6.1, true), (0.4, false)] {
        let mut settings = Settings { valve_tolerance: 0.02, ..Settings::default() };
        settings.timing.max_joint_rate = max_joint_rate;
        let plan = plan(&targets, &wall, &tool, &settings).unwrap();
        let (mut open, mut uneven, mut shut) = (0, 0, 0);
        for k in 0..targets.len() - 1 {
            let (from, to) = (plan.target_time[k], plan.target_time[k + 1]);
            let ends = [plan.setpoint(from), plan.setpoint(to)];
            // By the joints of the plan, and by joints even in time.
            let miss = |share: f64, even: bool| {
                let setpoint = plan.setpoint(from + (to - from) * share);
                let mixed = |of: fn(&Setpoint) -> f64| of(&ends[0]) + (of(&ends[1]) - of(&ends[0])) * share;
                let [pan, tilt] =
                    if even { [mixed(|s| s.pan), mixed(|s| s.tilt)] } else { [setpoint.pan, setpoint.tilt] };
                let (position, heading) = (setpoint.sample.position, setpoint.sample.heading);
                let nozzle = tool.nozzle(&VehicleState { position, heading, pan, tilt }).unwrap();
                let hit = wall.cast(&nozzle.position, &nozzle.direction, 1.0);
                hit.map_or(f64::INFINITY, |hit| (hit.point - setpoint.aim).norm())
            };
            let worst = |even: bool| (0..=500).map(|n| miss(f64::from(n) / 500.0, even)).fold(0.0, f64::max);
            assert!(plan.flow[k] == 0.0 || worst(false) <= settings.valve_tolerance, "{k}: {}", worst(false));
            let missed = plan.reachable[k] && plan.reachable[k + 1] && plan.flow[k] == 0.0;
            assert!(!missed || plan.not_served[k] == Some(NotServed::Missed), "{k}");
            open += usize::from(plan.flow[k] > 0.0);
            uneven += usize::from(plan.flow[k] > 0.0 && worst(true) > settings.valve_tolerance);
            shut += usize::from(missed);
        }
        println!("{max_joint_rate}: {open} {uneven} {shut}");
        assert!(if served { uneven > 3 && shut == 0 } else { open > 3 && shut > 3 }, "{open} {uneven} {shut}");
    }
}
