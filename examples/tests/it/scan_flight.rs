//! The scan before the paint, on a small piece of the built-in wall.

use paintcopter::scan_flight::{ScanFlight, ScanFlightError};
use paintcopter::world::{CENTRE, rock_wall};

/// 1.6 m by 0.8 m, as high above the ground as the whole wall.
fn small_wall() -> paintcopter::mesh_io::TriangleMesh {
    let mut mesh = rock_wall(1);
    for [x, y, z] in &mut mesh.positions {
        (*x, *y, *z) = (0.35 * *x, 0.35 * *y, (CENTRE + 0.35 * (f64::from(*z) - CENTRE)) as f32);
    }
    mesh
}

/// The floors are twice and more what is reached; by odometry alone the robot would be off by 7 to 10 mm.
#[test]
fn a_wall_is_mapped_by_the_robots_own_senses_whatever_the_threads() {
    let scan = ScanFlight::fly(&small_wall(), 1, 2).unwrap();
    let figures = &scan.figures;
    println!("{figures:?}");
    assert!(figures.position_error_max_m < 0.004 && figures.ate_se3_rmse_m < 0.002);
    assert!(figures.position_error_max_m < 0.7 * figures.odometry_error_max_m);
    assert!(figures.mesh_error_mean_m < 0.003 && figures.covered_share > 0.97);
    assert!(figures.path_length_m > 1.5 && figures.duration_s > 3.0);
    let again = ScanFlight::fly(&small_wall(), 1, 1).unwrap();
    assert!(again.mesh.positions == scan.mesh.positions && again.mesh.faces == scan.mesh.faces);
}

#[test]
fn a_surface_that_cannot_be_flown_along_is_refused_before_take_off() {
    let mut mesh = small_wall();
    for position in &mut mesh.positions {
        *position = position.map(|c| 100.0 * c);
    }
    let error = ScanFlight::fly(&mesh, 1, 1).err().unwrap();
    assert!(matches!(error, ScanFlightError::Size { .. }), "{error}");
    assert!(error.to_string().contains("change its scale"), "{error}");
}
