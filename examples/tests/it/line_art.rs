//! A drawing of lines is flown along its lines: the valve is open most of the time.

use paintcopter::design::{Design, Picture};
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mission::{Mission, MissionSettings, PainterChoice, PaintingTask, save};
use paintcopter::region::Scene;
use paintcopter::report::Report;

use crate::scratch::Scratch;

/// A wall of two triangles, 1.6 m wide and 0.8 m high, facing -x.
fn wall() -> TriangleMesh {
    let corner = |y: f32, z: f32| [0.0, y, z];
    let positions = vec![corner(0.8, 2.0), corner(-0.8, 2.0), corner(-0.8, 2.8), corner(0.8, 2.8)];
    TriangleMesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]], ..TriangleMesh::default() }
}

/// An o and two letters l, strokes of 5 cm on a wall of 1.6 m.
fn letters(s: &Scratch) -> Picture {
    let distance = |x: f64, y: f64| {
        let ring = ((x - 0.4).hypot(y - 0.4) - 0.22).abs();
        let stem = |at: f64| (x - at).hypot(y - y.clamp(0.15, 0.65));
        ring.min(stem(0.9)).min(stem(1.2))
    };
    let shade = |x: u32, y: u32| {
        let inside = distance(f64::from(x) / 200.0, f64::from(y) / 200.0) < 0.025;
        image::Luma([if inside { 0 } else { 255 }])
    };
    let path = s.0.join("letters.png");
    image::GrayImage::from_fn(320, 160, shade).save(&path).unwrap();
    Picture::open(&path).unwrap()
}

fn painted(painter: PainterChoice) -> Report {
    let s = Scratch::new("line_art");
    let settings = MissionSettings { painter, ..MissionSettings::default() };
    let design = Design::Picture(letters(&s));
    let mission = PaintingTask::new("wall", &Scene::whole(wall()), &design, settings).and_then(Mission::run).unwrap();
    save(&mission, &s.0).unwrap()
}

#[test]
fn strokes_along_lines_keep_the_valve_open_and_paint_them_better_in_less_time() {
    let (lines, rows) = (painted(PainterChoice::Centrelines), painted(PainterChoice::Deconvolution));
    for (name, r) in [("along lines", &lines), ("in rows", &rows)] {
        let valve = 100.0 * r.valve_open_share;
        println!("{name}: {:.0} s, valve open {valve:.0} %, SSIM {:.3}", r.flight_time_s, r.ssim_painted);
    }
    assert!(lines.valve_open_share > 0.6, "{}", lines.valve_open_share);
    assert!(lines.flight_time_s < 0.8 * rows.flight_time_s, "{} {}", lines.flight_time_s, rows.flight_time_s);
    assert!(lines.ssim_painted > rows.ssim_painted, "{} {}", lines.ssim_painted, rows.ssim_painted);
    assert_eq!((lines.collisions, lines.limit_violations), (0, 0));
}
