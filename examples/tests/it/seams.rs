//! An egg painted all around, in several charts: what falls over a seam lies on the other side of it.

use std::f64::consts::{PI, TAU};

use paintcopter::design::Design;
use paintcopter::mesh_io::TriangleMesh;
use paintcopter::mission::{MissionSettings, PaintingTask, preview};
use paintcopter::region::Scene;

use crate::scratch::Scratch;

/// An egg, 1.4 m high and 1.1 m across.
fn egg() -> TriangleMesh {
    const SIDES: u32 = 36;
    const RINGS: u32 = 24;
    let mut mesh = TriangleMesh::default();
    let mut add = |sin: f64, z: f64, turn: f64| {
        let (y, x) = turn.sin_cos();
        mesh.positions.push([0.55 * sin * x, 0.55 * sin * y, 1.8 + 0.7 * z].map(|c| c as f32));
    };
    for ring in 1..RINGS {
        let (sin, cos) = (PI * f64::from(ring) / f64::from(RINGS)).sin_cos();
        (0..SIDES).for_each(|side| add(sin, -cos, TAU * f64::from(side) / f64::from(SIDES)));
    }
    let (bottom, top) = ((RINGS - 1) * SIDES, (RINGS - 1) * SIDES + 1);
    add(0.0, -1.0, 0.0);
    add(0.0, 1.0, 0.0);
    let at = |ring: u32, side: u32| (ring - 1) * SIDES + side % SIDES;
    for side in 0..SIDES {
        for ring in 1..RINGS - 1 {
            let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
        mesh.faces
            .extend([[bottom, at(1, side + 1), at(1, side)], [top, at(RINGS - 1, side), at(RINGS - 1, side + 1)]]);
    }
    mesh
}

/// The painter's canvas is what the simulated spray puts on the egg, as well at its seams as elsewhere.
#[test]
fn a_canvas_knows_what_falls_over_its_seams() {
    let s = Scratch::new("seams");
    let settings = MissionSettings::default();
    let task = PaintingTask::new("egg", &Scene::whole(egg()), &Design::Even { ink: 0.5 }, settings).unwrap();
    let figures = preview(&task, &s.0).unwrap();
    let [at, naive, off] =
        [figures.deposit_error_at_seams, figures.deposit_error_at_seams_naive, figures.deposit_error_off_seams]
            .map(Option::unwrap);
    println!("{at} at seams, {naive} if what falls beyond were lost, {off} elsewhere");
    assert!(naive > 0.2, "there is no seam to paint across");
    assert!(at < 0.01 && off < 0.01, "{at} at seams, {naive} naive, {off} elsewhere");
}
