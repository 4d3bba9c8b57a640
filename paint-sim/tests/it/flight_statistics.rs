//! The figures of a flight, by hand.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_sim::flight::{FlightSample, FlightStatistics};

/// A sample that sprays at its aim from 0.3 m, as wanted, and errs in nothing.
fn exact() -> FlightSample {
    FlightSample {
        time: 0.0,
        world_from_body: Isometry3::translation(1.0, 2.0, 3.0),
        velocity: Vector3::zeros(),
        acceleration: Vector3::zeros(),
        attitude: [0.0; 3],
        estimated_position: Point3::new(1.0, 2.0, 3.0),
        reference_position: Point3::new(1.0, 2.0, 3.0),
        pan_tilt: [0.2, -0.1],
        desired_pan_tilt: [0.2, -0.1],
        nozzle: Point3::new(1.5, 2.0, 3.0),
        axis: UnitVector3::new_unchecked(Vector3::x()),
        aim: Some(Point3::new(1.8, 2.0, 3.0)),
        hit: Some(Point3::new(1.8, 2.0, 3.0)),
        distance: 0.3,
        wanted_distance: 0.3,
        flow: 1e-6,
        held: false,
    }
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
}

/// Each error in a sample of its own, of a size of its own: whatever takes one for another differs.
#[test]
fn every_figure_is_that_of_its_own_error() {
    let e = exact();
    let moved = |p: Point3<f64>, by: f64| p + Vector3::new(0.0, by, 0.0);
    let samples = [
        FlightSample { hit: e.hit.map(|hit| moved(hit, 0.02)), ..e },
        FlightSample { distance: 0.34, ..e },
        FlightSample { pan_tilt: [0.26, -0.1], ..e },
        FlightSample { pan_tilt: [0.2, -0.02], ..e },
        FlightSample { reference_position: moved(e.reference_position, 0.1), ..e },
        FlightSample { estimated_position: moved(e.estimated_position, 0.14), ..e },
        FlightSample { velocity: Vector3::new(0.3, 0.0, -0.4), attitude: [0.1, 0.0, 2.0], ..e },
        FlightSample { acceleration: Vector3::new(0.0, 1.2, 0.5), attitude: [0.0, -0.15, -3.0], ..e },
        // The valve is open and nothing is hit; it is shut, wide of the aim; the interlock keeps it shut.
        FlightSample { hit: None, distance: f64::INFINITY, ..e },
        FlightSample { flow: 0.0, hit: e.hit.map(|hit| moved(hit, 9.0)), pan_tilt: [9.0; 2], ..e },
        FlightSample { flow: 0.0, held: true, ..e },
    ];
    let found = FlightStatistics::of(&[&samples]);
    assert_eq!((found.open_samples, found.missed_samples, found.held_samples), (9, 1, 1));
    // Root mean squares of one error among the eight samples that hit.
    let rms = |error: f64| error / 8.0_f64.sqrt();
    near(found.hit_error_rms, rms(0.02));
    near(found.hit_error_p95, 0.02);
    near(found.hit_error_max, 0.02);
    near(found.nozzle_distance_bias, 0.04 / 8.0);
    near(found.nozzle_distance_std, 0.04 * (1.0_f64 / 8.0 - 1.0 / 64.0).sqrt());
    near(found.pan_error_rms, rms(0.06));
    near(found.tilt_error_rms, rms(0.08));
    near(found.position_error_rms, rms(0.1));
    near(found.localisation_error_rms, rms(0.14));
    near(found.max_speed, 0.5);
    near(found.max_acceleration, 1.3);
    near(found.max_tilt, 0.15);
}

#[test]
fn the_95th_percentile_leaves_out_one_in_twenty() {
    let e = exact();
    let off = |k: u32| FlightSample { hit: e.aim.map(|aim| aim + Vector3::z() * f64::from(k)), ..e };
    // In any order.
    let samples: Vec<FlightSample> = (1..=40).map(|k| off(1 + 17 * k % 40)).collect();
    let found = FlightStatistics::of(&[&samples]);
    near(found.hit_error_p95, 38.0);
    near(found.hit_error_max, 40.0);
    assert_eq!(FlightStatistics::of(&[]), FlightStatistics::default());
}
