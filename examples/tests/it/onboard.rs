//! A robot that knows of its place only what its own sensors tell: it finds itself in the map of its scan, flies and paints by it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use paint_sim::flight::{
    CascadedController, ControllerSettings, FlightLog, FlightSettings, IdealPanTilt, Interlock, PoseSource, Reference,
    ReferenceState, Valve, Vehicle, fly_localised,
};
use paint_sim::paint::PaintName;
use paint_sim::{Error, Shot, SprayModel, Surface, TriangleSurface};
use paintcopter::appearance::UNIT_THICKNESS;
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::onboard::{
    Approach, Bridging, LocalisationFigures, LocalisedFlight, OnboardLocalisation, read_map, surveyed_map,
};
use paintcopter::scan_flight::{MAP_FILE, ScanFlight, save};
use paintcopter::simulated_sensors::{FaultInterval, PaintedFront, SensorFault, SimulatedCamera, SimulatedImage};
use paintcopter::world::{CENTRE, rock_wall};
use tsdf_hash::slam::SlamState;
use vio_ekf::fusion::MapAidedSettings;
use vio_ekf::{Imu, Stamp};

/// Deviation of a spot, m.
const SPOT: f64 = 0.025;

/// 1.6 m by 0.8 m, as high above the ground as the whole wall.
pub(crate) fn wall(seed: u64) -> TriangleMesh {
    let mut mesh = rock_wall(seed);
    for [x, y, z] in &mut mesh.positions {
        (*x, *y, *z) = (0.35 * *x, 0.35 * *y, (CENTRE + 0.35 * (f64::from(*z) - CENTRE)) as f32);
    }
    mesh
}

/// The file of the first wall's map.
pub(crate) fn map() -> &'static Path {
    static MAP: OnceLock<PathBuf> = OnceLock::new();
    MAP.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("paintcopter-onboard-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        save(&ScanFlight::fly(&wall(1), 1, 2).unwrap(), &folder).unwrap();
        folder.join(MAP_FILE)
    })
}

/// That of its mesh alone, without keyframes.
pub(crate) fn surveyed() -> &'static Path {
    static MAP: OnceLock<PathBuf> = OnceLock::new();
    MAP.get_or_init(|| {
        let mesh = wall(1);
        let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
        let file = std::env::temp_dir().join(format!("paintcopter-onboard-surveyed-{}.tsdf", std::process::id()));
        surveyed_map(&surface, &-Vector3::x(), 2).unwrap().save(&file, None, BTreeMap::new()).unwrap();
        file
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

/// Flies the stroke before a wall in the map of the first one; the camera sees the paint.
pub(crate) fn fly(
    mesh: &TriangleMesh,
    fault: Option<(SensorFault, i64)>,
) -> Result<(FlightLog, LocalisationFigures), Error> {
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    fly_again(&surface, fault, bare(&surface)).map(|(log, figures, _)| (log, figures))
}

/// A wall without paint on it, for the nozzle of the stroke.
pub(crate) fn bare(surface: &TriangleSurface) -> PaintedFront {
    let spray = SprayModel { sigma: (SPOT / 0.5).atan(), ..SprayModel::default() };
    let charcoal = PaintName::Charcoal.paint(UNIT_THICKNESS).unwrap();
    PaintedFront::new(surface, &Vector3::x_axis(), spray, &charcoal).unwrap()
}

/// The same before a wall with paint on it; returns what is on it then.
fn fly_again(
    surface: &TriangleSurface,
    fault: Option<(SensorFault, i64)>,
    paint: PaintedFront,
) -> Result<(FlightLog, LocalisationFigures, PaintedFront), Error> {
    fly_bridged(surface, fault, paint, Bridging::default(), 3)
}

/// The same with a choice of inertial sensors and the wind of a seed.
fn fly_bridged(
    surface: &TriangleSurface,
    fault: Option<(SensorFault, i64)>,
    paint: PaintedFront,
    bridging: Bridging,
    seed: u64,
) -> Result<(FlightLog, LocalisationFigures, PaintedFront), Error> {
    let from = 1.5;
    let until = |duration| from + 1e-3 * duration as f64;
    let fault = fault.map(|(fault, duration)| FaultInterval { fault, of_vehicle: false, from, until: until(duration) });
    fly_faulty(&Stroke(surface), surface, map(), fault.into_iter().collect(), paint, bridging, seed)
}

/// A stroke of any kind before a wall with paint on it, in the map of a file, with faults.
pub(crate) fn fly_faulty(
    stroke: &dyn Reference,
    surface: &TriangleSurface,
    map: &Path,
    faults: Vec<FaultInterval>,
    paint: PaintedFront,
    bridging: Bridging,
    seed: u64,
) -> Result<(FlightLog, LocalisationFigures, PaintedFront), Error> {
    // The same stone as in the scan, which has seed 1.
    let camera = SimulatedCamera::new(surface, Vector3::x(), 1, 1).before(paint);
    let onboard = LocalisedFlight::bridged(camera, read_map(map).unwrap(), seed + 4, bridging).unwrap();
    let mut onboard = onboard.with_faults(faults);
    let valve = Valve { interlock: Some(Interlock::within(SPOT)), ..Valve::default() };
    let settings = FlightSettings { valve, settle: 1.0, seed, ..FlightSettings::default() };
    let mut controller = CascadedController::new(settings.airframe, ControllerSettings::default());
    let mut gun = IdealPanTilt::new(Point3::new(0.2, 0.0, 0.0), 0.3, [0.8; 2]).unwrap();
    let approach = Approach::to(stroke, 0.9);
    let log = fly_localised(&approach, &mut controller, &mut gun, surface, &mut onboard, &settings)?;
    Ok((approach.cut(log), onboard.figures(), onboard.into_paint().unwrap()))
}

/// By how much paint misses its aim, m, at each sample with paint; infinite where it meets nothing.
pub(crate) fn misses(log: &FlightLog) -> impl Iterator<Item = f64> {
    let sprays = log.samples.iter().filter(|sample| sample.flow > 0.0);
    sprays.map(|sample| sample.hit.zip(sample.aim).map_or(f64::INFINITY, |(hit, aim)| (hit - aim).norm()))
}

/// Samples with paint that leaves more than a spot beside its aim, and with paint at all.
pub(crate) fn astray(log: &FlightLog) -> (usize, usize) {
    (misses(log).filter(|miss| *miss > SPOT).count(), misses(log).count())
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

/// The map and its keyframes show bare stone; a black band of 10 cm is on it when the robot comes back.
#[test]
fn it_finds_itself_before_a_wall_that_it_has_painted() {
    let mesh = wall(1);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    let (_, _, paint) = fly_again(&surface, None, bare(&surface)).unwrap();
    let look = |camera: &mut SimulatedCamera| {
        let body = Isometry3::translation(-1.5, 0.0, CENTRE);
        camera.capture(1, &(body * camera.camera.body_from_camera)).unwrap()
    };
    let mean = |image: &SimulatedImage, rows: std::ops::Range<usize>| {
        let image = image.grey();
        let middle = |row: usize| &image.data[row * image.width + 170..][..36];
        let rows: Vec<u8> = rows.flat_map(|row| middle(row).to_vec()).collect();
        rows.iter().map(|grey| f64::from(*grey)).sum::<f64>() / rows.len() as f64
    };
    let before = look(&mut SimulatedCamera::new(&surface, Vector3::x(), 1, 1));
    let mut camera = SimulatedCamera::new(&surface, Vector3::x(), 1, 1).before(paint);
    let after = look(&mut camera);
    // The stroke is at the height of the body's centre, 2 cm below the camera.
    let [bare, painted, beside] = [mean(&before, 117..128), mean(&after, 117..128), mean(&after, 20..40)];
    assert!(painted < 0.7 * bare && (beside - mean(&before, 20..40)).abs() < 2.0, "{bare} {painted} {beside}");
    let (log, figures, _) = fly_again(&surface, None, camera.into_paint().unwrap()).unwrap();
    println!("{figures:?}");
    assert!(figures.relocalisation_error_m < 0.01 && figures.position_error_rms_m() < 0.01, "{figures:?}");
    let (astray, sprayed) = astray(&log);
    assert!(astray == 0 && sprayed as f64 > 0.95 * log.samples.len() as f64, "{astray} of {sprayed}");
}

/// Strokes 12 cm apart all over the wall: no keyframe looks like it any more, its shape is the same.
#[test]
fn it_finds_itself_by_shape_before_a_wall_that_is_painted_all_over() {
    let mesh = wall(1);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    let mut paint = bare(&surface);
    let shot = |row: i32, column: i32| Shot {
        origin: Point3::new(-0.5, 0.01 * f64::from(column), CENTRE + 0.12 * f64::from(row)),
        axis: Vector3::x_axis(),
        volume: 2e-7,
    };
    let shots: Vec<Shot> = (-4..=4).flat_map(|row| (-90..=90).map(move |column| shot(row, column))).collect();
    paint.spray(&shots, &surface, 1).unwrap();
    let camera = SimulatedCamera::new(&surface, Vector3::x(), 1, 1).before(paint);
    let mut flight = LocalisedFlight::new(camera, read_map(map()).unwrap(), 9).unwrap();
    let pose = flight.pose(0.0, &Vehicle::at_rest(Point3::new(-1.5, 0.0, CENTRE), 0.0)).unwrap();
    let figures = flight.figures();
    println!("{figures:?}");
    assert!(
        pose.is_some() && figures.relocalised_after_s > 1.0 && figures.relocalisation_error_m < 0.01,
        "{figures:?}"
    );
    // What it takes its error for is of the size of the map's own.
    let [position, attitude] = pose.unwrap().sigma;
    assert!((1e-3..0.02).contains(&position) && (3e-4..0.02).contains(&attitude), "{position} m, {attitude} rad");
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

/// What became of standing at a place and looking for it.
#[derive(Debug, PartialEq)]
enum Found {
    /// Error of the position, m, and the time it took, s.
    At(f64, f64),
    NotHere,
}

/// Stands before a wall with a map of its own for 3 s.
fn stand(camera: &mut SimulatedCamera, map: SlamState, body: &Isometry3<f64>) -> Found {
    let (odometry, settings) = (vio_ekf::Settings::default(), MapAidedSettings::default());
    let mut onboard = OnboardLocalisation::new(map, camera.camera, odometry, settings).unwrap();
    for tenth in 1..=30 {
        let stamp = Stamp::from_nanos(100_000_000 * tenth);
        let accel = body.rotation.inverse() * Vector3::new(0.0, 0.0, 9.81);
        onboard.imu(&Imu { stamp, gyro: Vector3::zeros(), accel }).unwrap();
        let image = camera.capture(tenth as usize, &(body * camera.camera.body_from_camera)).unwrap();
        let views = camera.views(&image);
        if let Some(found) = onboard.relocalise(stamp, &views.depth(), Some(&views.colour()), true).unwrap() {
            return Found::At((found.translation.vector - body.translation.vector).norm(), 0.1 * tenth as f64);
        }
    }
    Found::NotHere
}

/// Places before a wall of a width from which half of the image shows it: 0.9 to 2 m away, up to 25 degrees aside, leaning up to 3 degrees.
fn places(width: f64, count: u64) -> Vec<Isometry3<f64>> {
    let uniform = |k: u64, which: u64| 2.0 * paint_net::procedural::lattice(5, k as i64, which as i64) - 1.0;
    let place = |k: u64| {
        let u: [f64; 6] = std::array::from_fn(|which| uniform(k, which as u64));
        let shift = Translation3::new(-1.45 + 0.55 * u[0], 0.5 * (width - 1.0) * u[1], CENTRE + 0.3 * u[2]);
        let rotation = UnitQuaternion::from_euler_angles(0.05 * u[3], 0.05 * u[4], 0.44 * u[5]);
        Isometry3::from_parts(shift, rotation)
    };
    (0..count).map(place).collect()
}

/// (right, false, longest time, largest error) of all places.
fn count(camera: &mut SimulatedCamera, map: &Path, places: &[Isometry3<f64>]) -> (usize, usize, f64, f64) {
    let found: Vec<Found> = places.iter().map(|body| stand(camera, read_map(map).unwrap(), body)).collect();
    let errors: Vec<[f64; 2]> = found
        .iter()
        .filter_map(|found| if let Found::At(error, time) = found { Some([*error, *time]) } else { None })
        .collect();
    let right = errors.iter().filter(|[error, _]| *error < 0.05).count();
    let largest = |k: usize| errors.iter().map(|e| e[k]).fold(0.0, f64::max);
    (right, errors.len() - right, largest(1), largest(0))
}

/// By the keyframes of its scan, before its own wall and before others.
///
/// `cargo test --release --workspace --all-features --test it -- --ignored --nocapture found_from_random_places`
#[test]
#[ignore = "some minutes; reprints the table of the chapter"]
fn found_from_random_places() {
    let folder = std::env::temp_dir().join(format!("paintcopter-places-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (mesh, places) = (rock_wall(1), places(4.5, 20));
    save(&ScanFlight::fly(&mesh, 1, 2).unwrap(), &folder).unwrap();
    let map = folder.join(MAP_FILE);
    let mut wrong = 0;
    for (wall, stone) in [(1, 1), (1, 2), (2, 1), (3, 3), (4, 4)] {
        let mesh = rock_wall(wall);
        let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
        let mut camera = SimulatedCamera::new(&surface, Vector3::x(), stone, 2);
        let (right, false_, time, error) = count(&mut camera, &map, &places);
        println!("wall {wall}, stone {stone}: {right} right, {false_} false, {time:.1} s, {error:.4} m");
        wrong += if wall == 1 { false_ } else { right + false_ };
    }
    assert_eq!(wrong, 0);
}

/// The same without keyframes, against the mesh of the wall alone: the robot sways where it does not find itself at once.
///
/// `cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture found_by_the_mesh_alone`
#[test]
#[ignore = "some minutes; reprints the table of the chapter"]
fn found_by_the_mesh_alone() {
    let mesh = rock_wall(1);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    let map = std::env::temp_dir().join(format!("paintcopter-surveyed-{}.tsdf", std::process::id()));
    surveyed_map(&surface, &-Vector3::x(), 2).unwrap().save(&map, None, BTreeMap::new()).unwrap();
    let places = places(4.5, 20);
    let mut false_ = 0;
    for (wall, stone) in [(1, 1), (1, 2), (2, 1), (3, 3), (4, 4)] {
        let mesh = rock_wall(wall);
        let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
        let (mut right, mut slowest, mut worst) = (0, 0.0_f64, 0.0_f64);
        // Elsewhere every fourth.
        let every = if (wall, stone) == (1, 1) { 1 } else { 4 };
        for (k, body) in places.iter().enumerate().step_by(every) {
            let camera = SimulatedCamera::new(&surface, Vector3::x(), stone, 2);
            let mut flight = LocalisedFlight::new(camera, read_map(&map).unwrap(), k as u64).unwrap();
            let (roll, pitch, yaw) = body.rotation.euler_angles();
            let place = Point3::from(body.translation.vector);
            let stood = Vehicle { attitude: [roll, pitch, yaw], ..Vehicle::at_rest(place, yaw) };
            let found = flight.pose(0.0, &stood);
            let figures = flight.figures();
            let error = figures.relocalisation_error_m;
            println!(
                "wall {wall}, stone {stone}, place {k}: {} {:.1} s {error:.4} m, CPU {:.1} s",
                found.is_ok(),
                figures.relocalised_after_s,
                figures.cpu.as_secs_f64()
            );
            if found.is_ok() {
                right += usize::from(wall == 1 && error < 0.05);
                false_ += usize::from(wall != 1 || error >= 0.05);
                (slowest, worst) = (slowest.max(figures.relocalised_after_s), worst.max(error));
            }
        }
        println!("wall {wall}, stone {stone}: {right} right, {slowest:.1} s, {worst:.4} m; {false_} false so far");
        assert!(wall != 1 || right >= 16 / every, "{right} right");
    }
    assert_eq!(false_, 0);
}

/// The hit error by the odometry's own poses, by those moved on with the camera's inertial sensor, and with the vehicle's as well.
///
/// `cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture fused_with_the_vehicles_sensor`
#[test]
#[ignore = "some minutes; reprints the table of the chapter"]
fn fused_with_the_vehicles_sensor() {
    let mesh = wall(1);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    let mut together = [0.0_f64; 3];
    for seed in 1..=5 {
        let flown = [Bridging::Odometry, Bridging::CameraImu, Bridging::BothImus].map(|bridging| {
            let (log, figures, _) = fly_bridged(&surface, None, bare(&surface), bridging, seed).unwrap();
            (log.statistics().hit_error_rms, figures.position_error_rms_m(), log.statistics().held_samples)
        });
        println!("seed {seed}: {flown:?}");
        together = [0, 1, 2].map(|k| together[k] + flown[k].0.powi(2));
    }
    let rms = together.map(|sum| (0.2 * sum).sqrt());
    println!("hit error: {:.5} m by odometry alone, {:.5} m by one sensor, {:.5} m by both", rms[0], rms[1], rms[2]);
    assert!(rms[2] <= 0.9 * rms[0], "{rms:?}");
}
