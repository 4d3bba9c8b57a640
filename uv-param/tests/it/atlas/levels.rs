//! Surfaces of so many faces that their seams are found on a coarser one.

use uv_param::atlas::AtlasQuality;
use uv_param::{Atlas, unwrap_atlas};

use super::{assert_sound, settings};
use crate::common::Mesh;

/// Steps around a torus, both ways: 2 `STEPS`^2 faces.
const STEPS: u32 = 150;

/// A torus (radii 1 m and 0.45 m) with bumps, and beside it a square that lies flat.
fn bumpy_torus_and_square() -> Mesh {
    let at = |i: u32, j: u32| (i % STEPS) * STEPS + j % STEPS;
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    for (i, j) in (0..STEPS * STEPS).map(|k| (k / STEPS, k % STEPS)) {
        let (u, v) = (f64::from(i), f64::from(j));
        let (u, v) = (u * std::f64::consts::TAU / f64::from(STEPS), v * std::f64::consts::TAU / f64::from(STEPS));
        let r = 0.45 + 0.02 * (7.0 * u).sin() * (5.0 * v).cos() + 0.001 * (40.0 * u).sin() * (30.0 * v).sin();
        mesh.0.push([(1.0 + r * v.cos()) * u.cos(), (1.0 + r * v.cos()) * u.sin(), r * v.sin()]);
        mesh.1.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        mesh.1.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    let first = mesh.0.len() as u32;
    mesh.0.extend([[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0], [3.0, 1.0, 0.0]]);
    mesh.1.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh
}

/// A line around the tube.
fn wanted_seam() -> Vec<[u32; 2]> {
    (0..STEPS).map(|j| [3 * STEPS + j, 3 * STEPS + (j + 1) % STEPS]).collect()
}

/// Whether the two sides of a half-edge lie apart.
fn is_seam(atlas: &Atlas, h: usize) -> bool {
    let Some(twin) = atlas.surface().twin(h) else { return true };
    let ((chart, f), (other, g)) = (atlas.chart_of_face(h / 3), atlas.chart_of_face(twin / 3));
    chart != other || atlas.charts()[chart].disk().twin(3 * f + h % 3) != Some(3 * g + twin % 3)
}

#[test]
fn many_faces_in_few_charts_within_the_bounds() {
    let mesh = bumpy_torus_and_square();
    let seam = wanted_seam();
    let make = || unwrap_atlas(&mesh.0, &mesh.1, &seam, &settings(0.01), |_| ()).unwrap();
    let atlas = make();
    assert_sound(&atlas);
    let q = AtlasQuality::of(&atlas);
    assert!(q.stretch_p99 <= 1.15, "{q:?}");
    assert!(q.charts <= 30 && q.seam_relative < 14.0, "{q:?}");
    // What is flat already stays whole.
    let (square, _) = atlas.chart_of_face(mesh.1.len() - 1);
    assert_eq!(atlas.chart_faces(square).len(), 2);
    let ends = |h: usize| {
        let face = atlas.surface().faces()[h / 3];
        [face[h % 3].min(face[(h + 1) % 3]), face[h % 3].max(face[(h + 1) % 3])]
    };
    let mut wanted: Vec<[u32; 2]> = seam.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
    wanted.sort_unstable();
    let along: Vec<usize> = (0..3 * mesh.1.len()).filter(|&h| wanted.binary_search(&ends(h)).is_ok()).collect();
    assert_eq!(along.len(), 2 * wanted.len());
    assert!(along.iter().all(|&h| is_seam(&atlas, h)));

    let again = make();
    assert_eq!(atlas.placements(), again.placements());
    assert!(atlas.charts().iter().zip(again.charts()).all(|(a, b)| a.uv() == b.uv()));
}
