//! Atlases of surfaces of any topology.

mod box_cutter;
mod levels;
mod relaxed;
mod seams;
mod update;

use crate::common::{Mesh, Rng, fixture, grid};
use uv_param::atlas::{AtlasQuality, ChartSettings, PackSettings, Turns};
use uv_param::disk::largest_disk_with;
use uv_param::parametrizer::Tutte;
use uv_param::surface::Surface;
use uv_param::{Atlas, AtlasSettings, Error, Parametrizer, Settings, unwrap, unwrap_atlas};

fn atlas(mesh: &Mesh, texel_m: f64) -> Atlas {
    unwrap_atlas(&mesh.0, &mesh.1, &[], &settings(texel_m), |_| ()).unwrap()
}

fn settings(texel_m: f64) -> AtlasSettings {
    AtlasSettings { pack: PackSettings { texel_m, ..PackSettings::default() }, ..AtlasSettings::default() }
}

/// What every atlas promises.
fn assert_sound(atlas: &Atlas) {
    let q = AtlasQuality::of(atlas);
    assert_eq!((q.flips, q.flips_f32, q.overlap_pairs), (0, 0, 0));
    assert!(q.stretch_max <= 1.5, "{q:?}");
    // By the definitions, face by face.
    let (mut flat, mut error, mut area, mut worst) = (0.0, 0.0, 0.0, 1.0_f64);
    for chart in atlas.charts() {
        for (face, corners) in chart.disk().faces().iter().enumerate() {
            let [a, b, c] = corners.map(|v| chart.uv()[v as usize]);
            flat += 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
            let (size, stretch) = (chart.disk().face_area(face), chart.stretch(face as u32));
            error += size * stretch.map(|s| (s - 1.0).abs()).into_iter().fold(0.0, f64::max);
            worst = worst.max(stretch[0]).max(1.0 / stretch[1]);
            area += size;
        }
    }
    assert!((worst - q.stretch_max).abs() < 1e-9, "{worst} {q:?}");
    let texels: usize = atlas.pages().iter().map(|[columns, rows]| columns * rows).sum();
    assert!((flat / (texels as f64 * atlas.texel_m().powi(2)) - q.utilisation).abs() < 1e-9, "{q:?}");
    assert!((error / area - q.length_err_mean).abs() < 1e-9 && (area - q.area_m2).abs() < 1e-9 * area, "{q:?}");
    let members: usize = (0..atlas.charts().len()).map(|c| atlas.chart_faces(c).len()).sum();
    assert_eq!(members, atlas.surface().faces().len());
    assert!(q.utilisation > 0.0 && q.utilisation <= 1.0 && q.seam_relative.is_finite());
    for (chart, placement) in atlas.charts().iter().zip(atlas.placements()) {
        let size = atlas.pages()[placement.page].map(|texels| texels as f64 * atlas.texel_m());
        for &uv in chart.uv() {
            let at = placement.apply(uv);
            assert!((0..2).all(|k| at[k] >= -1e-9 && at[k] <= size[k] + 1e-9), "{at:?} off the page {size:?}");
        }
    }
}

/// A box with `n` x `n` squares on each side, corners at 0 and 1.
fn cube(n: u32) -> Mesh {
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    for (axis, far) in (0..6).map(|k| (k / 2, k % 2 == 1)) {
        let (positions, faces) = grid(n, n, |x, y| {
            let mut p = [0.0; 3];
            p[axis] = f64::from(u8::from(far));
            (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (x, y);
            p
        });
        let first = mesh.0.len() as u32;
        mesh.0.extend(positions);
        mesh.1.extend(
            faces.iter().map(|f| f.map(|v| v + first)).map(|[a, b, c]| if far { [a, b, c] } else { [a, c, b] }),
        );
    }
    mesh
}

/// Squares of 1 m side that do not touch.
fn squares(count: u32) -> Mesh {
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    for k in 0..count {
        let (positions, faces) = grid(3, 3, |x, y| [x + 2.0 * f64::from(k), y, 0.0]);
        let first = mesh.0.len() as u32;
        mesh.0.extend(positions);
        mesh.1.extend(faces.iter().map(|f| f.map(|v| v + first)));
    }
    mesh
}

/// Points of a grid pushed onto the unit sphere.
fn sphere(n: u32) -> Mesh {
    let (positions, faces) = cube(n);
    let onto = |p: [f64; 3]| {
        let q = p.map(|c| (std::f64::consts::FRAC_PI_4 * (2.0 * c - 1.0)).tan());
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        q.map(|c| c / length)
    };
    (positions.into_iter().map(onto).collect(), faces)
}

/// A cube unfolds into isometric pieces whose seams join its eight corners: no tree on it is shorter than 6.19, and its edges
/// alone take 7 for one piece.
#[test]
fn a_cube_becomes_a_net() {
    let net = atlas(&cube(4), 0.01);
    let q = AtlasQuality::of(&net);
    assert_sound(&net);
    assert!(q.charts <= 2, "{q:?}");
    assert!(q.seam_length_m > 6.19 && q.seam_length_m < 9.0, "{}", q.seam_length_m);
    assert!((q.symmetric_dirichlet - 1.0).abs() < 1e-10, "{}", q.symmetric_dirichlet);
    assert!((q.area_m2 - 6.0).abs() < 1e-12);
}

/// A tetrahedron has six edges: one piece cuts three of them, two pieces four.
#[test]
fn a_tetrahedron_is_unfolded_along_edges() {
    let net = atlas(&fixture("tetrahedron.off"), 0.01);
    assert_sound(&net);
    let borders: usize = net.charts().iter().map(|chart| chart.disk().boundary_loops()[0].len()).sum();
    assert_eq!(borders, 2 * (2 + net.charts().len()));
    assert!(net.charts().len() <= 2);
    assert!((AtlasQuality::of(&net).symmetric_dirichlet - 1.0).abs() < 1e-10);
}

#[test]
fn closed_and_knotted_surfaces_are_laid_out_within_the_bounds() {
    for (name, mesh) in [
        ("sphere", sphere(12)),
        ("torus", fixture("torus.off")),
        ("punctured torus", fixture("punctured_torus.off")),
        ("open box", fixture("open_box.obj")),
        ("ring", fixture("ring.off")),
    ] {
        let size = Surface::new(&mesh.0, &mesh.1, true).unwrap().0.area().sqrt();
        let found = atlas(&mesh, size / 300.0);
        assert_sound(&found);
        let q = AtlasQuality::of(&found);
        assert!(q.stretch_p99 <= 1.15 + 1e-9, "{name}: {q:?}");
        assert_eq!(found.report().parts, 1, "{name}");
    }
    // A sphere needs few: four caps of its curvature fit within a stretch of 1.15, and no fewer do.
    let q = AtlasQuality::of(&atlas(&sphere(16), 0.01));
    assert!(q.charts <= 8 && q.seam_relative < 5.5, "{} charts, {}", q.charts, q.seam_relative);
}

#[test]
fn what_is_not_manifold_is_opened_and_counted() {
    let fins = atlas(&fixture("fins.obj"), 0.01);
    assert_sound(&fins);
    assert!(fins.report().non_manifold_edges_opened > 0);
    let moebius = atlas(&fixture("moebius.obj"), 0.01);
    assert_sound(&moebius);
    assert!(moebius.report().one_sided_edges_opened > 0);
}

/// Vertices stay where they are; what is dropped is counted.
#[test]
fn vertices_stay_and_useless_faces_are_left_out() {
    let (mut positions, mut faces) = cube(2);
    positions.push([9.0; 3]);
    faces.extend([[0, 1, 1], faces[3], [0, 1, 2]]);
    let found = atlas(&(positions.clone(), faces.clone()), 0.01);
    assert_eq!(found.surface().positions(), positions);
    let report = found.report();
    assert_eq!((report.degenerate_faces_dropped, report.duplicate_faces_dropped), (2, 1));
    assert_eq!(report.unreferenced_vertices, 1);
    // The six sides of the box have vertices of their own, which count as one.
    assert!(report.welded_vertices > 0 && report.parts == 1);
    assert_eq!(found.surface().face_source().len(), faces.len() - 3);
}

/// Where one piece is good enough the atlas is that piece.
#[test]
fn a_disk_that_is_nearly_flat_is_laid_out_as_ever() {
    let (positions, faces) = grid(20, 14, |x, y| [2.0 * x, y, 0.05 * (5.0 * x).sin() * (4.0 * y).cos()]);
    let (disk, _) = largest_disk_with(&positions, &faces, uv_param::disk::Repair::default()).unwrap();
    let chart = unwrap(&disk, &Settings::default(), |_| ()).unwrap();
    let found = atlas(&(positions, faces), 0.01);
    assert_eq!(found.charts().len(), 1);
    assert!(found.charts()[0].uv() == chart.uv());
    assert_eq!(AtlasQuality::of(&found).seam_length_m, 0.0);
}

#[test]
fn seams_of_the_caller_are_kept() {
    let (positions, faces) = grid(6, 6, |x, y| [x, y, 0.0]);
    let across: Vec<[u32; 2]> = (0..6).map(|j| [7 * j + 3, 7 * (j + 1) + 3]).collect();
    let halves = unwrap_atlas(&positions, &faces, &across, &settings(0.01), |_| ()).unwrap();
    assert_sound(&halves);
    assert_eq!(halves.charts().len(), 2);
    assert!((AtlasQuality::of(&halves).seam_length_m - 1.0).abs() < 1e-12);
    // A seam that ends inside opens without parting.
    let slit = unwrap_atlas(&positions, &faces, &across[..4], &settings(0.01), |_| ()).unwrap();
    assert!((AtlasQuality::of(&slit).seam_length_m - 4.0 / 6.0).abs() < 1e-12, "{:?}", AtlasQuality::of(&slit));
    let none = unwrap_atlas(&positions, &faces, &[[0, 1], [0, 40]], &settings(0.01), |_| ());
    assert!(matches!(none, Err(Error::Seam { index: 1, edge: [0, 40] })));
}

#[test]
fn another_parametrizer_decides_what_fits() {
    let (positions, faces) = grid(8, 8, |x, y| [x, y, 0.0]);
    let (surface, report) = Surface::new(&positions, &faces, true).unwrap();
    let by = |parametrizer: &dyn Parametrizer| {
        Atlas::new(surface.clone(), report, &[], &settings(0.01), Some(parametrizer), |_| ()).unwrap()
    };
    // Tutte's layout makes a circle of a square: beyond the bound, so that the square is taken apart.
    assert!(by(&Tutte).charts().len() > 1);
    assert_eq!(by(&uv_param::parametrizer::Arap::default()).charts().len(), 1);
}

/// Every texel that a chart touches is its own, and so are those around it.
fn assert_distance(found: &Atlas, gutter: usize) {
    let texel_m = found.texel_m();
    // Just inside, so that lines between texels belong to one of them.
    let inside = |k: i32| 1e-7 + (1.0 - 3e-7) * f64::from(k) / 12.0;
    for (number, &[columns, rows]) in found.pages().iter().enumerate() {
        let mut owner = vec![usize::MAX; columns * rows];
        for (c, (chart, placement)) in found.charts().iter().zip(found.placements()).enumerate() {
            for face in chart.disk().faces().iter().filter(|_| placement.page == number) {
                let corners = face.map(|v| placement.apply(chart.uv()[v as usize]).map(|x| x / texel_m));
                for (i, j) in (0..=12).flat_map(|i| (0..=12 - i).map(move |j| (inside(i), inside(j)))) {
                    let at = [0, 1].map(|k| {
                        corners[0][k] + i * (corners[1][k] - corners[0][k]) + j * (corners[2][k] - corners[0][k])
                    });
                    let cell = (at[1] as usize).min(rows - 1) * columns + (at[0] as usize).min(columns - 1);
                    assert!(owner[cell] == usize::MAX || owner[cell] == c);
                    owner[cell] = c;
                }
            }
        }
        for (cell, &c) in owner.iter().enumerate().filter(|(_, c)| **c != usize::MAX) {
            let (x, y) = (cell % columns, cell / columns);
            for row in y.saturating_sub(gutter)..(y + gutter + 1).min(rows) {
                for column in x.saturating_sub(gutter)..(x + gutter + 1).min(columns) {
                    let other = owner[row * columns + column];
                    assert!(other == usize::MAX || other == c, "charts {c} and {other} are too near");
                }
            }
        }
    }
}

#[test]
fn charts_keep_their_distance() {
    let cases =
        [(0.015, 2, None, Turns::Any), (0.015, 5, None, Turns::Quarter), (0.02, 3, Some([110, 60]), Turns::None)];
    for (texel_m, gutter, page, turns) in cases {
        // Two squares of 50 x 50 texels fit on a page of 110 x 60.
        let mesh = if page.is_some() { squares(5) } else { sphere(10) };
        let settings = AtlasSettings {
            pack: PackSettings { texel_m, gutter, page, turns, ..PackSettings::default() },
            charts: ChartSettings { max_stretch: 1.05, ..ChartSettings::default() },
        };
        let found = unwrap_atlas(&mesh.0, &mesh.1, &[], &settings, |_| ()).unwrap();
        assert_sound(&found);
        assert_eq!(found.pages().len(), if page.is_some() { 3 } else { 1 });
        assert_distance(&found, gutter);
    }
}

#[test]
fn a_page_that_is_too_small_is_refused() {
    let pack = PackSettings { texel_m: 0.01, page: Some([50, 50]), ..PackSettings::default() };
    let mesh = cube(2);
    let refused = unwrap_atlas(&mesh.0, &mesh.1, &[], &AtlasSettings { pack, ..AtlasSettings::default() }, |_| ());
    assert!(matches!(refused, Err(Error::TooManyTexels { .. })));
    for (max_stretch, worst_stretch) in [(1.0, 1.5), (f64::NAN, 1.5), (1.2, 1.1)] {
        let charts = ChartSettings { max_stretch, worst_stretch, ..ChartSettings::default() };
        let refused =
            unwrap_atlas(&mesh.0, &mesh.1, &[], &AtlasSettings { charts, ..AtlasSettings::default() }, |_| ());
        assert!(matches!(refused, Err(Error::Setting { .. })));
    }
}

/// The same shape in other units is cut the same.
/// Beside a square of 100 m doubles are 1.4e-14 m apart: two of the corners of a triangle of 1e-15 m become one.
#[test]
fn a_part_that_is_finer_than_the_numbers_of_its_page_is_refused() {
    let mesh_with = |side: f64| {
        let square = [[0.0; 3], [100.0, 0.0, 0.0], [100.0, 100.0, 0.0], [0.0, 100.0, 0.0]];
        let triangle = [[0.0; 3], [side, 0.0, 0.0], [0.0, side, 0.0]].map(|[x, y, z]| [x, y, z + 1e-20]);
        ([&square[..], &triangle[..]].concat(), vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    };
    assert_sound(&atlas(&mesh_with(1e-3), 1.0));
    let (positions, faces) = mesh_with(1e-15);
    let found = unwrap_atlas(&positions, &faces, &[], &settings(1.0), |_| ());
    assert_eq!(found.err(), Some(Error::CollapsedOnPage { faces: 1 }));
}

#[test]
fn the_unit_of_length_changes_nothing() {
    let mesh = sphere(8);
    let usual = AtlasQuality::of(&atlas(&mesh, 0.02));
    // Powers of two: on a symmetric shape rounding would decide between equals.
    for scale in [1.0 / 1024.0, 1024.0] {
        let scaled: Vec<[f64; 3]> = mesh.0.iter().map(|p| p.map(|c| c * scale)).collect();
        let q = AtlasQuality::of(&atlas(&(scaled, mesh.1.clone()), 0.02 * scale));
        assert_eq!(q.charts, usual.charts);
        assert!((q.seam_relative - usual.seam_relative).abs() < 1e-6);
        assert!((q.stretch_p99 - usual.stretch_p99).abs() < 1e-4);
    }
}

/// Whatever soup comes: an atlas that is sound, or an error; never a panic, never a NaN.
#[test]
fn soups_do_no_harm() {
    let mut rng = Rng(17);
    let (mut laid_out, mut refused) = (0, 0);
    for _ in 0..120 {
        let vertices = 3 + rng.below(12);
        let mut positions: Vec<[f64; 3]> =
            (0..vertices).map(|_| [0; 3].map(|_: i32| (rng.unit() * 4.0).round() * 0.25)).collect();
        if rng.below(20) == 0 {
            positions[0][1] = f64::NAN;
        }
        let mut faces: Vec<[u32; 3]> =
            (0..=rng.below(24)).map(|_| [0; 3].map(|_: i32| rng.below(vertices) as u32)).collect();
        if rng.below(20) == 0 {
            faces[0][2] = 99;
        }
        match unwrap_atlas(&positions, &faces, &[], &settings(0.01), |_| ()) {
            Ok(found) => {
                assert_sound(&found);
                laid_out += 1;
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                refused += 1;
            }
        }
    }
    assert!(laid_out > 75 && refused > 6, "{laid_out} {refused}");
}
