//! Faults of sensors while the robot paints by nothing else: no paint beside its place, whatever they say.

use nalgebra::{Point3, Vector3};
use paint_sim::flight::{Reference, ReferenceState};
use paint_sim::{Surface, TriangleSurface};
use paintcopter::onboard::Bridging;
use paintcopter::simulated_sensors::{FaultInterval, SensorFault};
use paintcopter::world::CENTRE;

use crate::onboard::{astray, bare, fly, fly_faulty, map, misses, surveyed, wall};

/// `cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture faults_of_sensors`
#[test]
#[ignore = "some minutes: every kind of fault, for three durations"]
fn faults_of_sensors() {
    let faults = [
        SensorFault::CameraBlack,
        SensorFault::NoDepth,
        SensorFault::NoImages,
        SensorFault::DepthOfElsewhere(0.1),
        SensorFault::NoMotion,
        SensorFault::LateMotion(100),
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

/// Seconds of the strokes of [`BackAndForth`].
const DURATION: f64 = 16.0;

/// A stroke of 60 cm over the wall and back, twice, painted all the way.
struct BackAndForth<'a> {
    surface: &'a TriangleSurface,
    /// Its middle beside and above that of the wall, m.
    middle: [f64; 2],
}

impl Reference for BackAndForth<'_> {
    fn duration(&self) -> f64 {
        DURATION
    }

    fn at(&self, t: f64) -> ReferenceState {
        let turning = std::f64::consts::TAU / 8.0;
        let (sin, cos) = (turning * t.clamp(0.0, DURATION)).sin_cos();
        let [beside, above] = self.middle;
        let position = Point3::new(-0.6, beside - 0.3 * cos, CENTRE + above);
        let hit = self.surface.cast(&position, &Vector3::x_axis(), 5.0).unwrap();
        let along = |value: f64| Vector3::new(0.0, value, 0.0);
        ReferenceState {
            position,
            velocity: along(0.3 * turning * sin),
            acceleration: along(0.3 * turning.powi(2) * cos),
            heading: 0.0,
            heading_rate: 0.0,
            lever: Vector3::new(0.2, 0.0, 0.0),
            aim: Some(position + Vector3::x() * hit.distance),
            nozzle_distance: hit.distance - 0.5,
            flow: if (0.0..=DURATION).contains(&t) { 1e-6 } else { 0.0 },
        }
    }
}

/// Faults of random kinds, from .2 to 5 s long, those of inertial samples of either sensor, two to a flight of 16 s anywhere on the wall, its rims
/// included, in a map that was scanned or surveyed; `FLIGHTS` of them (100), from `SEED` (1) on.
///
/// `FLIGHTS=100 cargo test --release -p paintcopter --all-features --test it -- --ignored --nocapture hundreds_of_sensor_faults`
#[test]
#[ignore = "a quarter of an hour on two cores"]
fn hundreds_of_sensor_faults() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (count, first) = (number("FLIGHTS", 100), number("SEED", 1));
    let mesh = wall(1);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap();
    let one = |seed: u64| {
        let random = |which: i64| paint_net::procedural::lattice(17, seed as i64, which);
        let fault = |k: i64| {
            let kinds = [
                SensorFault::CameraBlack,
                SensorFault::NoDepth,
                SensorFault::NoImages,
                SensorFault::DepthOfElsewhere(0.03 + 0.3 * random(10 + k)),
                SensorFault::NoMotion,
                SensorFault::LateMotion(10 + (290.0 * random(20 + k)) as i64),
                SensorFault::Clipped(8.0 + 1.8 * random(30 + k)),
                SensorFault::Swapped,
            ];
            let from = 8.0 * k as f64 + 3.0 * random(40 + k);
            let fault = kinds[(8.0 * random(50 + k)) as usize];
            let of_vehicle = random(70 + k) < 0.5;
            FaultInterval { fault, of_vehicle, from, until: from + 0.2 * 25.0_f64.powf(random(60 + k)) }
        };
        let faults: Vec<_> = [0, 1].map(fault).into();
        let middle = [0.4 * (2.0 * random(80) - 1.0), 0.35 * (2.0 * random(81) - 1.0)];
        let stroke = BackAndForth { surface: &surface, middle };
        let (kind, map) = if seed.is_multiple_of(2) { ("scanned", map()) } else { ("surveyed", surveyed()) };
        let flown = fly_faulty(&stroke, &surface, map, faults.clone(), bare(&surface), Bridging::default(), seed);
        let (astray, said) = match &flown {
            Ok((log, figures, _)) => {
                let (astray, sprayed) = astray(log);
                let share = sprayed as f64 / log.samples.len() as f64;
                let error = figures.position_error_rms_m();
                let most = misses(log).fold(0.0, f64::max);
                (astray, format!("at most {most:.3} m, {share:.2} sprayed, position error {error:.4} m"))
            }
            Err(error) => (0, format!("{error}")),
        };
        println!("{seed}: {faults:?} at {middle:.2?}, {kind}: {astray} astray, {said}");
        (astray, flown.is_ok())
    };
    let half = |from: u64| (first + from..first + count).step_by(2).map(one).collect::<Vec<_>>();
    let all = std::thread::scope(|scope| {
        let other = scope.spawn(|| half(1));
        let mut all = half(0);
        all.extend(other.join().unwrap());
        all
    });
    let (astray, ended) = (all.iter().map(|a| a.0).sum::<usize>(), all.iter().filter(|a| !a.1).count());
    println!("{} faults: {astray} samples astray; {ended} of {count} flights ended in the air", 2 * count);
    assert_eq!(astray, 0);
}
