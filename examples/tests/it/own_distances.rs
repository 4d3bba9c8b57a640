//! Painters whose sprays have spreads of their own: the nozzle flies as far off as each asks for.

use paint_net::Image;
use paint_net::thesis::Network;
use paintcopter::design::Design;
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mission::{Mission, MissionSettings, PainterChoice, PaintingTask, save};
use paintcopter::region::Scene;
use paintcopter::report::Report;

use crate::scratch::Scratch;

/// A wall of two triangles, 1.6 m wide and 1.2 m high, in the plane x = 0, facing -x.
fn wall() -> TriangleMesh {
    let corner = |y: f32, z: f32| [0.0, y, z];
    let positions = vec![corner(0.8, 2.0), corner(-0.8, 2.0), corner(-0.8, 3.2), corner(0.8, 3.2)];
    TriangleMesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]], ..TriangleMesh::default() }
}

/// The report, and the distances from the nozzle to the wall along its axis while it sprays.
fn flown(design: &str, painter: PainterChoice) -> (Report, Vec<f64>) {
    let s = Scratch::new("own_distances");
    let settings = MissionSettings { painter, ..MissionSettings::default() };
    let design = Design::from_name(design, settings.seed).unwrap();
    let mission = PaintingTask::new("wall", &Scene::whole(wall()), &design, settings).and_then(Mission::run).unwrap();
    let report = save(&mission, &s.0).unwrap();
    let table = std::fs::read_to_string(s.0.join("trajectory.csv")).unwrap();
    let mut lines = table.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let [x, axis, flow] = ["nozzle_x_m", "axis_x", "nozzle_flow_m3_per_s"]
        .map(|name| head.iter().position(|column| *column == name).unwrap());
    let rows = lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>());
    (report, rows.filter(|row| row[flow] > 0.0).map(|row| -row[x] / row[axis]).collect())
}

fn share(distances: &[f64], of: impl Fn(f64) -> bool) -> f64 {
    distances.iter().filter(|distance| of(**distance)).count() as f64 / distances.len() as f64
}

/// From twice the spread, twice as far: 2 px are 10 cm, and the nozzle ends 2 mm before 15.
#[test]
fn the_thesis_network_paints_from_where_its_spots_are_as_wide() {
    let (report, distances) = flown("strata", PainterChoice::Thesis);
    let steps = Network::shipped().unwrap().paint(&[(Image::filled(32, 32, 0.4), None)]).unwrap().remove(0);
    let sigma = steps.iter().map(|step| step.sigma).sum::<f64>() / steps.len() as f64;
    let expected = f64::min(0.05 * sigma, 0.148);
    let there = share(&distances, |d| (d - expected).abs() < 0.01);
    println!("SSIM {:.3}, {there:.3} about {expected:.3} m", report.ssim_painted);
    assert!(sigma > 2.2 && there > 0.9, "{sigma} px, {there} about {expected} m");
    assert!(report.nozzle_distance_std_m < 0.01, "{}", report.nozzle_distance_std_m);
    assert!(report.ssim_painted > 0.8, "{}", report.ssim_painted);
    assert_eq!((report.collisions, report.limit_violations), (0, 0));
}

/// Bands that cross the wall are painted with half of the rows, from farther off.
#[test]
fn wide_rows_paint_a_smooth_picture_in_less_time() {
    let (usual, near) = flown("gradient", PainterChoice::Feedback);
    let (wide, far) = flown("gradient", PainterChoice::AdaptiveRows);
    println!(
        "{} s and {} s, SSIM {} and {}",
        usual.flight_time_s, wide.flight_time_s, usual.ssim_painted, wide.ssim_painted
    );
    assert!(share(&near, |d| (0.08..0.12).contains(&d)) > 0.95);
    assert!(share(&far, |d| d > 0.13) > 0.5, "{}", share(&far, |d| d > 0.13));
    assert!(wide.flight_time_s < 0.65 * usual.flight_time_s, "{} {}", wide.flight_time_s, usual.flight_time_s);
    assert!(wide.ssim_painted > usual.ssim_painted - 0.02, "{} {}", wide.ssim_painted, usual.ssim_painted);
    assert_eq!((wide.collisions, wide.limit_violations), (0, 0));
}
