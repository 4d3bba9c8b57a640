//! Volumes that the vehicle keeps out of, and the side on which its tether hangs.

use std::f64::consts::PI;

use crate::walls::{Arm, Wall};
use paint_planner::constraints::{KeepOutVolume, Tether, WithKeepOut};
use paint_planner::mission::reachable_targets;
use paint_planner::nalgebra::{Point3, Vector3};
use paint_planner::plan::NotServed;
use paint_planner::{NozzleState, Plan, Settings, Target, Tool, VehicleState, plan};

/// Least distance between the tool and some volumes along a whole trajectory, every 10 ms.
fn least_gap(plan: &Plan, volumes: &[KeepOutVolume]) -> f64 {
    let (mut spheres, mut least) = (Vec::new(), f64::INFINITY);
    for k in 0..=(plan.trajectory.duration() / 0.01) as usize {
        let t = 0.01 * k as f64;
        let (sample, setpoint) = (plan.trajectory.sample(t), plan.setpoint(t));
        let state =
            VehicleState { position: sample.position, heading: sample.heading, pan: setpoint.pan, tilt: setpoint.tilt };
        spheres.clear();
        Arm::default().spheres(&state, &mut spheres);
        for (centre, radius) in &spheres {
            least = volumes.iter().fold(least, |least, volume| least.min(volume.distance(centre) - radius));
        }
    }
    least
}

#[test]
fn what_lies_in_a_keep_out_volume_stays_bare_and_flights_go_around_it() {
    let (wall, arm, settings) = (Wall::flat(), Arm::default(), Settings::default());
    let volumes = [
        // A mast before the middle of the wall: too near it to pass between, so high that the way is before it.
        KeepOutVolume::Box { min: Point3::new(-0.9, 1.9, -10.0), max: Point3::new(-0.3, 2.1, 30.0) },
        KeepOutVolume::Sphere { centre: Point3::new(-0.7, 3.9, 1.5), radius: 0.2 },
        KeepOutVolume::HalfSpace { point: Point3::new(0.0, -0.1, 0.0), normal: Vector3::y() },
    ];
    let targets = wall.rows(4.0, 1, 0.2);
    for (k, volume) in volumes.iter().enumerate() {
        let volumes = std::slice::from_ref(volume);
        let limited = WithKeepOut { surface: &wall, volumes };
        let (free, kept) =
            (plan(&targets, &wall, &arm, &settings).unwrap(), plan(&targets, &limited, &arm, &settings).unwrap());
        assert!(
            free.reachable.iter().all(|reached| *reached) && least_gap(&free, volumes) < 0.0,
            "volume {k} is not in the way"
        );
        let gap = least_gap(&kept, volumes);
        assert!(gap > 0.0, "volume {k}: {gap} m");
        let reached = reachable_targets(&targets, &limited, &arm, &settings).unwrap();
        assert!(kept.reachable.iter().zip(&reached).all(|(served, reached)| !served || *reached));
        if k == 0 {
            // Both ends are served, the middle is not, and the way between them goes around.
            assert!(kept.reachable[20] && kept.reachable[140]);
            assert_eq!(kept.not_served[80], Some(NotServed::NoHeading));
            assert!(kept.waypoints.iter().any(|w| w.state.position.x < -1.4));
        }
    }
}

/// The arm on a tether.
struct Tethered(Tether);

impl Tool for Tethered {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        Arm::default().vehicle(nozzle, heading)
    }
    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        Arm::default().spheres(vehicle, out);
    }
    fn permits(&self, vehicle: &VehicleState) -> bool {
        self.0.permits(vehicle)
    }
}

#[test]
fn the_tether_stays_on_its_side() {
    let (wall, settings) = (Wall::flat(), Settings::default());
    // The anchor is far to the right: a vehicle that turns freely shows it its side.
    let targets: Vec<Target> = wall.rows(2.0, 2, 0.2);
    let tether = Tether { anchor: Point3::new(-1.5, -4.0, 0.0), half_angle: 35_f64.to_radians() };
    let largest = |plan: &Plan| {
        let samples =
            (0..=(plan.trajectory.duration() / 0.01) as usize).map(|k| plan.trajectory.sample(0.01 * k as f64));
        let angle = |s: paint_planner::trajectory::Sample| {
            tether.angle(&VehicleState { position: s.position, heading: s.heading, pan: 0.0, tilt: 0.0 }).abs()
        };
        samples.map(angle).fold(0.0, f64::max)
    };
    let free = plan(&targets, &wall, &Arm::default(), &settings).unwrap();
    let kept = plan(&targets, &wall, &Tethered(tether), &settings).unwrap();
    assert!(largest(&free) > 50_f64.to_radians(), "{}", largest(&free));
    // Between two targets the curve may leave what its waypoints keep, by as much as it leaves them.
    assert!(largest(&kept) < tether.half_angle + 0.01, "{}", largest(&kept));
    assert!(kept.reachable.iter().all(|reached| *reached));
    // An anchor behind the wall has no side: everything stays bare, and reach says so before.
    let behind = Tethered(Tether { anchor: Point3::new(6.0, 1.0, 0.0), half_angle: 0.2 });
    let reached = reachable_targets(&targets, &wall, &behind, &settings).unwrap();
    assert!(reached.iter().all(|reached| !reached));
    assert!(plan(&targets, &wall, &behind, &settings).is_err());
    assert!(Tether { half_angle: 0.0, ..tether }.check().is_err() && tether.check().is_ok());
    assert!(Tether { half_angle: PI + 0.1, ..tether }.check().is_err());
}

#[test]
fn volumes_that_are_none_are_refused() {
    let origin = Point3::origin();
    for sound in [
        KeepOutVolume::Box { min: origin, max: Point3::new(1.0, 0.0, 2.0) },
        KeepOutVolume::Sphere { centre: origin, radius: 0.2 },
        KeepOutVolume::HalfSpace { point: origin, normal: Vector3::y() * 3.0 },
    ] {
        sound.check().unwrap();
    }
    for wrong in [
        KeepOutVolume::Box { min: origin, max: Point3::new(1.0, -0.1, 2.0) },
        KeepOutVolume::Box { min: origin, max: Point3::new(1.0, f64::INFINITY, 2.0) },
        KeepOutVolume::Sphere { centre: origin, radius: 0.0 },
        KeepOutVolume::Sphere { centre: Point3::new(f64::NAN, 0.0, 0.0), radius: 0.2 },
        KeepOutVolume::HalfSpace { point: origin, normal: Vector3::zeros() },
    ] {
        assert!(wrong.check().is_err(), "{wrong:?}");
    }
}
