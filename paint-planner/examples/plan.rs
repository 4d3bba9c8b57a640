//! One stroke down a leaning wall: nozzle, vehicle and valve every second, and the certificates of the plan.

use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{Error, Hit, NozzleState, Settings, Surface, Target, Tool, VehicleState, plan};

/// A plane through the origin.
struct Wall {
    normal: UnitVector3<f64>,
}

impl Surface for Wall {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let distance = -self.normal.dot(&origin.coords) / self.normal.dot(direction);
        let point = origin + direction.into_inner() * distance;
        (0.0..max).contains(&distance).then_some(Hit { point, normal: self.normal, distance })
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.normal.dot(&point.coords).abs().min(max)
    }
}

/// A nozzle in the centre of a sphere.
struct Gimbal;

impl Tool for Gimbal {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let pan = (nozzle.direction.y.atan2(nozzle.direction.x) - heading).sin().asin();
        Some(VehicleState { position: nozzle.position, heading, pan, tilt: nozzle.direction.z.asin() })
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        out.push((vehicle.position, 0.02));
    }
}

fn main() -> Result<(), Error> {
    let wall = Wall { normal: UnitVector3::new_normalize(Vector3::new(-1.0, 0.0, -0.4)) };
    let down = UnitVector3::new_normalize(Vector3::new(0.4, 0.0, -1.0));
    let point =
        |k: usize| Point3::from(down.into_inner() * (0.025 * k as f64)) + Vector3::y() * (0.1 * k as f64).sin() * 0.1;
    let target = |k| Target { point: point(k), normal: wall.normal, dose: 2e-6, time: None, stand_off: None };
    let plan = plan(&(0..60).map(target).collect::<Vec<_>>(), &wall, &Gimbal, &Settings::default())?;
    println!("time, s   nozzle, m                tilt, degrees   flow, ml/s");
    for (time, s) in plan.setpoints(1.0) {
        let p = s.nozzle.position;
        println!(
            "{time:7.1}   {:6.3} {:6.3} {:6.3}   {:14.1}   {:10.2}",
            p.x,
            p.y,
            p.z,
            s.tilt.to_degrees(),
            1e6 * s.flow
        );
    }
    let report = &plan.report;
    println!(
        "at most {:.2} m/s, {:.2} m/s2, {:.1} mm off the normals",
        report.extrema.speed,
        report.extrema.acceleration,
        1e3 * report.normal_deviation_max
    );
    Ok(())
}
