//! How long planned flights take against a bound, against their previews, and what they keep to on the way: on walls that bend, fold
//! and lean.

use nalgebra::Point3;
use paint_planner::{Plan, Tool, VehicleState};
use paint_sim::{Surface, TriangleSurface};
use paintcopter::adapters::Robot;
use paintcopter::design::Design;
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mission::{MissionSettings, PaintingTask, PlannedMission, preview, save_plan};
use paintcopter::region::Scene;
use paintcopter::report::TimeFigures;
use ptu_kinematics::Ptu;

use crate::scratch::Scratch;

/// Size of a wall, m, and its lower edge above the ground.
const WIDTH: f64 = 1.2;
const HEIGHT: f64 = 0.9;
const ABOVE: f64 = 1.5;
/// Spacing of its vertices, m.
const STEP: f64 = 0.02;
/// Greatest heading rate on the walls that fold, rad/s: a vehicle that may turn at 1 rad/s takes a fold in its stride.
const SLOW_TURN: f64 = 0.15;
/// Time between two looks at a plan, s.
const LOOK: f64 = 0.004;

/// A wall seen from above is a curve whose heading, rad, is given along it, m from its middle; what stands out of it is given over the
/// length along the curve and the height, m.
struct Wall {
    name: &'static str,
    heading: fn(f64) -> f64,
    relief: fn(f64, f64) -> f64,
}

/// Turns from `-angle/2` to `angle/2` on a few centimetres: one spot where the vehicle has to turn.
fn fold(s: f64, angle: f64) -> f64 {
    0.5 * angle * (s / 0.03).tanh()
}

fn walls() -> [Wall; 12] {
    let flat = |_: f64| 0.0;
    let plain = |_: f64, _: f64| 0.0;
    [
        Wall { name: "flat", heading: flat, relief: plain },
        Wall { name: "column", heading: |s| 1.4 * s, relief: plain },
        Wall { name: "niche", heading: |s| -0.7 * s, relief: plain },
        Wall { name: "fold of 60 degrees", heading: |s| fold(s, 1.05), relief: plain },
        Wall { name: "fold of 80 degrees", heading: |s| fold(s - 0.2, 1.4), relief: plain },
        Wall { name: "fold on a column", heading: |s| 0.6 * s + fold(s + 0.15, 1.0), relief: plain },
        Wall { name: "bumps", heading: flat, relief: |s, z| 0.03 * (9.0 * s).sin() * (8.0 * z).cos() },
        Wall { name: "furrows", heading: flat, relief: |s, _| 0.02 * (20.0 * s).sin() },
        Wall { name: "steps", heading: flat, relief: |_, z| 0.04 * (20.0 * z).sin() },
        Wall { name: "leaning", heading: |s| 0.5 * s, relief: |_, z| 0.3 * z },
        Wall { name: "dome", heading: flat, relief: |s, z| 0.5 * (1.0 - s * s - z * z).sqrt() },
        Wall { name: "waves", heading: |s| 0.8 * (5.0 * s).sin(), relief: |_, z| 0.02 * (12.0 * z).sin() },
    ]
}

impl Wall {
    fn mesh(&self) -> TriangleMesh {
        let (columns, rows) = ((WIDTH / STEP) as u32, (HEIGHT / STEP) as u32);
        // From the robot's left to its right, facing -x.
        let (mut x, mut y) = (0.0, 0.5 * WIDTH);
        let mut mesh = TriangleMesh::default();
        for column in 0..=columns {
            let s = STEP * f64::from(column) - 0.5 * WIDTH;
            let heading = (self.heading)(s);
            for row in 0..=rows {
                let z = STEP * f64::from(row) - 0.5 * HEIGHT;
                let out = (self.relief)(s, z);
                let place = [x - out * heading.cos(), y - out * heading.sin(), ABOVE + 0.5 * HEIGHT + z];
                mesh.positions.push(place.map(|c| c as f32));
            }
            let next = (self.heading)(s + 0.5 * STEP);
            (x, y) = (x + STEP * next.sin(), y - STEP * next.cos());
        }
        for column in 0..columns {
            for row in 0..rows {
                let at = |c: u32, r: u32| c * (rows + 1) + r;
                let [a, b, c, d] = [at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)];
                mesh.faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        mesh
    }
}

/// Of the paint of a plan, m³, how much leaves while the spray misses its aim by more than `off`, m; and the least distance between
/// the robot and the wall.
fn astray(plan: &Plan, wall: &TriangleSurface, robot: &Robot, off: f64) -> (f64, f64) {
    let (mut volume, mut nearest) = (0.0, f64::INFINITY);
    let mut spheres = Vec::new();
    for (_, setpoint) in plan.setpoints(LOOK) {
        let (position, heading) = (setpoint.sample.position, setpoint.sample.heading);
        let vehicle = VehicleState { position, heading, pan: setpoint.pan, tilt: setpoint.tilt };
        spheres.clear();
        robot.spheres(&vehicle, &mut spheres);
        for (centre, radius) in &spheres {
            nearest = f64::min(nearest, wall.distance(centre, 1.0) - radius);
        }
        let nozzle = robot.nozzle(&vehicle).unwrap();
        let hit = wall.cast(&nozzle.position, &nozzle.direction, 1.0);
        let miss = hit.map_or(f64::INFINITY, |hit| {
            let place: Point3<f64> = nozzle.position + nozzle.direction.into_inner() * hit.distance;
            (place - setpoint.aim).norm()
        });
        if miss > off {
            volume += setpoint.flow * LOOK;
        }
    }
    (volume, nearest)
}

/// `cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture flights_without_waste`
#[test]
#[ignore = "minutes; reprints the table of the results"]
fn flights_without_waste() {
    println!(
        "| wall | minutes | over the bound | preview | mL off by > 25 mm | least distance, m | sprayed without a limit, s | heading binds, share |"
    );
    for wall in walls() {
        let mut settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let folds = wall.name.starts_with("fold");
        if folds {
            settings.planner.timing.max_heading_rate = SLOW_TURN;
        }
        let mesh = wall.mesh();
        let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let limits = settings.planner.clone();
        let task = || PaintingTask::new(wall.name, &Scene::whole(wall.mesh()), &Design::Stripes, settings.clone());
        let s = Scratch::new("flight-times");
        let promised = preview(&task().unwrap(), &s.0).unwrap();
        let mission = PlannedMission::new(task().unwrap()).unwrap();
        let figures = save_plan(&mission, &s.0).unwrap();
        let times = TimeFigures::of(mission.layers().map(|(_, layer)| &layer.plan), &limits.timing);
        let (volumes, distances): (Vec<f64>, Vec<f64>) =
            mission.layers().map(|(_, layer)| astray(&layer.plan, &surface, &robot, limits.valve_tolerance)).unzip();
        let volume: f64 = volumes.iter().sum();
        let nearest = distances.into_iter().fold(f64::INFINITY, f64::min);
        let flown = figures.flight_time_s;
        println!(
            "| {} | {:.1} | {:.3} | {:.3} | {:.4} | {nearest:.4} | {:.2} | {:.3} |",
            wall.name,
            flown / 60.0,
            flown / times.flight_time_bound_s,
            promised.flight_time_s / flown,
            1e6 * volume,
            times.longest_unlimited_spraying_s,
            times.limited_by_heading_rate_share,
        );
        assert!(flown >= times.flight_time_bound_s && flown <= 1.25 * times.flight_time_bound_s, "{}", wall.name);
        assert!((promised.flight_time_s / flown - 1.0).abs() <= 0.1, "{}", wall.name);
        assert_eq!(volume, 0.0, "{}", wall.name);
        assert!(!folds || times.limited_by_heading_rate_share > 0.0, "{}", wall.name);
        assert!(times.longest_unlimited_spraying_s <= 2.0, "{}", wall.name);
        assert!(nearest >= limits.clearance && figures.clearance_missing_m == 0.0, "{}", wall.name);
    }
}
