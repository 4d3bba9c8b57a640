//! A robot that knows of its place only what its own sensors tell: it finds itself in the map of its scan, flies and paints by it.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};
use paint_sim::flight::{
    CascadedController, ControllerSettings, FlightLog, FlightSettings, IdealPanTilt, Interlock, Reference,
    ReferenceState, Valve, fly_localised,
};
use paint_sim::{Error, Surface, TriangleSurface};
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::onboard::{Approach, LocalisationFigures, LocalisedFlight};
use paintcopter::scan_flight::{MAP_FILE, ScanFlight, save};
use paintcopter::simulated_sensors::{FaultInterval, SensorFault, SimulatedCamera};
use paintcopter::world::{CENTRE, rock_wall};

/// Deviation of a spot, m.
const SPOT: f64 = 0.025;
/// The stroke begins so many milliseconds after the robot hovers.
const BEFORE: i64 = 1000 + 4500;

/// 1.6 m by 0.8 m, as high above the ground as the whole wall.
fn wall(seed: u64) -> TriangleMesh {
    let mut mesh = rock_wall(seed);
    for [x, y, z] in &mut mesh.positions {
        (*x, *y, *z) = (0.35 * *x, 0.35 * *y, (CENTRE + 0.35 * (f64::from(*z) - CENTRE)) as f32);
    }
    mesh
}

/// The file of the first wall's map.
fn map() -> &'static Path {
    static MAP: OnceLock<PathBuf> = OnceLock::new();
    MAP.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("paintcopter-onboard-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        save(&ScanFlight::fly(&wall(1), 1, 2).unwrap(), &folder).unwrap();
        folder.join(MAP_FILE)
    })
}

/// A stroke of 60 cm over the wall, painted all the way.
struct Stroke<'a>(&'a TriangleSurface);

impl Reference for Stroke<'_> {
    fn duration(&self) -> f64 {
        4.0
    }

    fn at(&self, t: f64) -> ReferenceState {
        let (y, speed) = (0.15 * t.clamp(0.0, 4.0) - 0.3, if (0.0..=4.0).contains(&t) { 0.15 } else { 0.0 });
        let position = Point3::new(-0.6, y, CENTRE);
        let hit = self.0.cast(&position, &Vector3::x_axis(), 5.0).unwrap();
        ReferenceState {
            position,
            velocity: Vector3::new(0.0, speed, 0.0),
            acceleration: Vector3::zeros(),
            heading: 0.0,
            heading_rate: 0.0,
            lever: Vector3::new(0.2, 0.0, 0.0),
            aim: Some(position + Vector3::x() * hit.distance),
            nozzle_distance: hit.distance - 0.5,
            flow: if speed > 0.0 { 1e-6 } else { 0.0 },
        }
    }
}

/// Flies the stroke before a wall in the map of the first one.
fn fly(mesh: &TriangleMesh, fault: Option<(SensorFault, i64)>) -> Result<(FlightLog, LocalisationFigures), Error> {
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    // The same stone as in the scan, which has seed 1.
    let camera = SimulatedCamera::new(mesh, &surface, Vector3::x(), 1, 1);
    let mut onboard = LocalisedFlight::new(camera, map(), 7).unwrap();
    if let Some((fault, duration)) = fault {
        let from = BEFORE + 1500;
        onboard = onboard.with_fault(FaultInterval { fault, when: from..from + duration });
    }
    let valve = Valve { interlock: Some(Interlock { miss: SPOT, ..Interlock::default() }), ..Valve::default() };
    let settings = FlightSettings { valve, settle: 1.0, seed: 3, ..FlightSettings::default() };
    let mut controller = CascadedController::new(settings.airframe, ControllerSettings::default());
    let mut gun = IdealPanTilt::new(Point3::new(0.2, 0.0, 0.0), 0.3, [0.8; 2]).unwrap();
    let stroke = Stroke(&surface);
    let approach = Approach::to(&stroke);
    let log = fly_localised(&approach, &mut controller, &mut gun, &surface, &mut onboard, &settings)?;
    Ok((Approach::cut(log), onboard.figures()))
}

/// Samples with paint that leaves more than a spot beside its aim, and with paint at all.
fn astray(log: &FlightLog) -> (usize, usize) {
    let sprays = || log.samples.iter().filter(|sample| sample.flow > 0.0);
    let off = |sample: &&paint_sim::flight::FlightSample| {
        let (Some(hit), Some(aim)) = (sample.hit, sample.aim) else { return true };
        (hit - aim).norm() > SPOT
    };
    (sprays().filter(off).count(), sprays().count())
}

/// The bounds are the goal of a painting flight; motion capture errs by about a millimetre.
#[test]
fn the_robot_paints_by_its_own_senses() {
    let (log, figures) = fly(&wall(1), None).unwrap();
    println!("{figures:?} {:?}", log.statistics());
    assert!(figures.relocalised_after_s <= 1.0 && figures.relocalisation_error_m < 0.01, "{figures:?}");
    assert!(figures.position_error_rms_m() < 0.01, "{figures:?}");
    assert_eq!(figures.unconfirmed, 0);
    let statistics = log.statistics();
    assert!(statistics.hit_error_rms < 0.015 && statistics.hit_error_p95 < 0.03, "{statistics:?}");
    let (astray, sprayed) = astray(&log);
    assert!(astray == 0 && sprayed as f64 > 0.95 * log.samples.len() as f64, "{astray} of {sprayed}");
}

#[test]
fn before_another_wall_it_does_not_take_off() {
    let error = fly(&wall(2), None).err().unwrap();
    assert!(matches!(error, Error::Localisation { .. }) && error.to_string().contains("does not take off"), "{error}");
}

/// Images are back after the fault, and the robot paints on.
#[test]
fn without_images_it_holds_and_then_paints_on() {
    let (log, figures) = fly(&wall(1), Some((SensorFault::NoImages, 1200))).unwrap();
    let (astray, sprayed) = astray(&log);
    println!("{astray} of {sprayed} of {}, {figures:?}", log.samples.len());
    assert_eq!(astray, 0);
    let held = log.samples.iter().filter(|sample| sample.held).count();
    assert!(held >= 50 && sprayed > 200, "{held} held, {sprayed} sprayed");
    assert!(log.samples.last().unwrap().flow > 0.0);
}

/// `cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture faults_of_sensors`
#[test]
#[ignore = "some minutes; reprints the table of the chapter"]
fn faults_of_sensors() {
    let faults = [
        SensorFault::CameraBlack,
        SensorFault::NoDepth,
        SensorFault::NoImages,
        SensorFault::NoMotion,
        SensorFault::Clipped(9.0),
        SensorFault::Swapped,
    ];
    let mut all = 0;
    for fault in faults {
        for duration in [200, 600, 2000] {
            match fly(&wall(1), Some((fault, duration))) {
                Ok((log, figures)) => {
                    let (astray, sprayed) = astray(&log);
                    let error = figures.position_error_rms_m();
                    all += astray;
                    println!("{fault:?} {duration} ms: {astray} astray, {sprayed} sprayed, error {error:.4} m");
                }
                Err(error) => println!("{fault:?} {duration} ms: {error}"),
            }
        }
    }
    assert_eq!(all, 0);
}
