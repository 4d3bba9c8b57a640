//! A coat of one thickness over a wall with a window: all of it, and evenly.

use std::f64::consts::PI;

use paintcopter::appearance::{Appearance, DENSITY, UNIT_THICKNESS};
use paintcopter::design::Design;
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mission::{Mission, MissionSettings, PainterChoice, PaintingTask, save};
use paintcopter::mission_file::{MissionFile, MissionFileError};
use paintcopter::region::Scene;
use paintcopter::report::Report;

use crate::scratch::Scratch;

/// Thickness of the coat, metres.
const COAT: f64 = 25e-6;
/// Cells of the wall, 5 cm each.
const CELLS: (u32, u32) = (32, 20);

/// A wall of 1.6 x 1.0 m that faces -x and swells by 35 cm in its middle, with a window of 0.4 x 0.3 m beside that.
fn wall() -> TriangleMesh {
    let (columns, rows) = CELLS;
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (s, t) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            let swelling = 0.35 * (PI * s).sin() * (PI * t).sin();
            mesh.positions.push([-swelling, 0.8 - 1.6 * s, 2.0 + t].map(|c| c as f32));
        }
    }
    for row in 0..rows {
        for column in (0..columns).filter(|column| !((6..14).contains(column) && (8..14).contains(&row))) {
            let corner = |r: u32, c: u32| (row + r) * (columns + 1) + column + c;
            let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn painted(painter: PainterChoice) -> Report {
    let s = Scratch::new("area_fill");
    let settings = MissionSettings { painter, ..MissionSettings::default() };
    let ink = Appearance::charcoal_on_sandstone().unwrap().ink().forward(COAT / UNIT_THICKNESS);
    let design = Design::Even { ink };
    let mission = PaintingTask::new("wall", &Scene::whole(wall()), &design, settings).and_then(Mission::run).unwrap();
    save(&mission, &s.0).unwrap()
}

#[test]
fn a_wall_with_a_window_gets_an_even_coat() {
    let report = painted(PainterChoice::Fill);
    let (covered, deviation) = (report.fill_coverage_share.unwrap(), report.fill_deviation.unwrap());
    let asked = COAT * DENSITY * report.surface_area_m2;
    println!(
        "covered {:.1} %, deviation {:.1} %, {:.0} s, {:.1} m, {} strokes, valve open {:.0} %, {:.4} of {asked:.4} kg",
        100.0 * covered,
        100.0 * deviation,
        report.flight_time_s,
        report.path_length_m,
        report.strokes,
        100.0 * report.valve_open_share,
        report.paint_deposited_kg
    );
    assert!(covered >= 0.99, "{covered}");
    // 8.7 % with the doses of the plane.
    assert!(deviation <= 0.075, "{deviation}");
    // The paint that it takes, from the area alone.
    assert!((report.paint_deposited_kg / asked - 1.0).abs() < 0.04, "{} of {asked} kg", report.paint_deposited_kg);
    assert_eq!((report.collisions, report.limit_violations), (0, 0));
    assert!(report.reach_share > 0.95, "{}", report.reach_share);
    // Rows every 1.87 deviations of the spot: the way cannot be much longer than the area over their distance.
    assert!(report.path_length_m < 1.4 * report.surface_area_m2 / 0.0467, "{} m", report.path_length_m);
}

#[test]
fn a_coat_that_cannot_be_is_refused() {
    let s = Scratch::new("coat");
    let refused = |file: MissionFile| match file.decide(&s.0) {
        Err(error @ MissionFileError::Fill(_)) => error.to_string(),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("decided"),
    };
    for thickness in [0.0, -1e-6, 20.0, f64::NAN, f64::INFINITY] {
        let message = refused(MissionFile { fill: Some(thickness), ..MissionFile::default() });
        assert!(message.contains("micrometres"), "{message}");
    }
    let both = MissionFile { fill: Some(2e-5), design: Some("stripes".into()), ..MissionFile::default() };
    assert!(refused(both).contains("takes the place"));
}
