//! A mission on a surface type of one's own, a round column, by a robot of one's own.

use paint_planner::mission::{MarginRehearsal, MissionSettings, plan_mission};
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{Error, Hit, NozzleState, Surface, Target, Tool, VehicleState};

struct Column; // about the z axis, with a radius of one metre
impl Surface for Column {
    fn cast(&self, from: &Point3<f64>, along: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let (o, d) = (from.coords.xy(), along.xy());
        let half = o.dot(&d) / d.norm_squared();
        let distance = -half - (half * half - (o.norm_squared() - 1.0) / d.norm_squared()).sqrt();
        let point = from + along.into_inner() * distance;
        let normal = UnitVector3::try_new(Vector3::new(point.x, point.y, 0.0), 0.0)?;
        (0.0..max).contains(&distance).then_some(Hit { point, normal, distance })
    }
    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        (point.coords.xy().norm() - 1.0).abs().min(max)
    }
}

struct Boom; // a nozzle that pans and tilts about a point 60 cm ahead of the vehicle
impl Tool for Boom {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let (ahead, spray) = (Vector3::new(heading.cos(), heading.sin(), 0.0), nozzle.direction);
        let (pan, tilt) = (ahead.cross(&spray).z.atan2(ahead.dot(&spray)), spray.z.asin());
        (pan.abs() < 1.5).then(|| VehicleState { position: nozzle.position - 0.6 * ahead, heading, pan, tilt })
    }
    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        out.push((vehicle.position, 0.4));
    }
}

fn main() -> Result<(), Error> {
    let target = |turn: f64, z: f64| {
        let normal = UnitVector3::new_normalize(Vector3::new(turn.cos(), turn.sin(), 0.0));
        Target { point: Point3::new(normal.x, normal.y, z), normal, dose: 2e-6, time: None, stand_off: None }
    };
    let strokes = [1.0, 1.2, 1.4].map(|z| (0..60).map(|k| target(0.025 * f64::from(k), z)).collect());
    let rehearsal = MarginRehearsal { surface: &Column, tool: &Boom, margin: 0.1 };
    let mission = plan_mission(&strokes, &Column, &Boom, &rehearsal, MissionSettings::default())?;
    let seconds: f64 = mission.flights.iter().map(|flight| flight.plan.trajectory.duration()).sum();
    println!("{seconds:.0} s in the air; {}", mission.outcomes().summary());
    Ok(())
}
