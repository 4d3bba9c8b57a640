//! Atlases of surfaces of any topology.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Mesh, Rng, fixture, grid};
use uv_param::nalgebra::Vector3;
use uv_param::{
    Atlas, AtlasQuality, AtlasSettings, ChartSettings, Error, Gutter, PackSettings, PageTexels, Parametrizer, Settings,
    Surface, SurfacePoint, TexelKind, TexelMap, Turns, Tutte, largest_disk_with, unwrap, unwrap_atlas, update_atlas,
};

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
    let (disk, _) = largest_disk_with(&positions, &faces, uv_param::Repair::default()).unwrap();
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
    assert_eq!(by(&uv_param::Arap::default()).charts().len(), 1);
}

/// Every texel that a chart touches is its own, and so are those around it.
#[test]
fn charts_keep_their_distance() {
    let cases =
        [(0.015, 2, None, Turns::Any), (0.015, 5, None, Turns::Quarter), (0.02, 3, Some([110, 60]), Turns::None)];
    for (texel_m, gutter, page, turns) in cases {
        // Two squares of 50 x 50 texels fit on a page of 110 x 60.
        let mesh = if page.is_some() { squares(5) } else { sphere(10) };
        let settings = AtlasSettings {
            pack: PackSettings { texel_m, gutter, page, turns },
            charts: ChartSettings { max_stretch: 1.05, ..ChartSettings::default() },
        };
        let found = unwrap_atlas(&mesh.0, &mesh.1, &[], &settings, |_| ()).unwrap();
        assert_sound(&found);
        assert_eq!(found.pages().len(), if page.is_some() { 3 } else { 1 });
        for (number, &[columns, rows]) in found.pages().iter().enumerate() {
            let mut owner = vec![usize::MAX; columns * rows];
            for (c, (chart, placement)) in found.charts().iter().zip(found.placements()).enumerate() {
                for face in chart.disk().faces().iter().filter(|_| placement.page == number) {
                    let corners = face.map(|v| placement.apply(chart.uv()[v as usize]).map(|x| x / texel_m));
                    for (i, j) in
                        (0..=12).flat_map(|i| (0..=12 - i).map(move |j| (f64::from(i) / 12.0, f64::from(j) / 12.0)))
                    {
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

/// A smooth function, sampled into the page and read back bilinearly, is the same on the two sides of every seam: far nearer
/// than with gutters that repeat the rim.
#[test]
fn gutters_continue_what_lies_beyond_the_seam() {
    let mesh = sphere(12);
    let texel_m = 0.02;
    let found = atlas(&mesh, texel_m);
    let value = |p: [f64; 3]| (6.0 * p[0] + 1.0).sin() + (5.0 * p[1] - 3.0 * p[2]).cos();
    let surface = found.surface();
    let at = |point: SurfacePoint| {
        let corners = surface.faces()[point.face as usize].map(|v| surface.positions()[v as usize]);
        [0, 1, 2].map(|k| (0..3).map(|c| point.barycentric[c] * corners[c][k]).sum::<f64>())
    };
    let page = &PageTexels::of(&found, 2)[0];
    let image = page.fill(f64::NAN, |point| value(at(point)));
    let bare: Vec<f64> =
        image.iter().zip(&page.kinds).map(|(v, kind)| if *kind == TexelKind::Inside { *v } else { f64::NAN }).collect();
    let sample = |image: &[f64], uv: [f64; 2]| {
        let (x, y) = (uv[0] / texel_m - 0.5, page.height as f64 - uv[1] / texel_m - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (mut sum, mut weight) = (0.0, 0.0);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let w = (1.0 - (x - left - dx).abs()) * (1.0 - (y - top - dy).abs());
            let (column, row) = (left + dx, top + dy);
            let inside = column >= 0.0 && row >= 0.0 && column < page.width as f64 && row < page.height as f64;
            let v = if inside { image[row as usize * page.width + column as usize] } else { f64::NAN };
            if v.is_finite() {
                sum += w * v;
                weight += w;
            }
        }
        sum / weight
    };
    let (mut error, mut without, mut count) = (0.0_f64, 0.0_f64, 0);
    for h in 0..3 * surface.faces().len() {
        let Some(twin) = surface.twin(h) else { continue };
        let on = |h: usize, t: f64| {
            let mut barycentric = [0.0; 3];
            (barycentric[h % 3], barycentric[(h + 1) % 3]) = (1.0 - t, t);
            SurfacePoint { face: (h / 3) as u32, barycentric }
        };
        for t in [0.2, 0.5, 0.8] {
            let (here, there) = (on(h, t), on(twin, 1.0 - t));
            let (one, other) = (found.uv_of(here).1, found.uv_of(there).1);
            if (one[0] - other[0]).hypot(one[1] - other[1]) < 1e-6 {
                continue;
            }
            error = error.max((sample(&image, one) - sample(&image, other)).abs());
            without = without.max((sample(&bare, one) - sample(&bare, other)).abs());
            count += 1;
        }
    }
    assert!(count > 100);
    // The interpolation error of the function itself: h^2 f'' / 8 on each axis and side, and what the stretch adds.
    assert!(error < 0.02, "{error}");
    assert!(without > 3.0 * error, "{without} against {error}");
}

/// A page as one chart: the same places, every texel found again, and normals that do not jump at seams.
#[test]
fn a_page_is_a_chart_of_charts() {
    let found = atlas(&sphere(12), 0.02);
    let page = found.page_chart(0).unwrap();
    assert!(found.page_chart(1).is_none());
    assert_eq!(page.width(), found.pages()[0][0] as f64 * 0.02);
    let q = page.quality();
    assert_eq!((q.flips, q.overlap_pairs), (0, 0));
    assert!((q.seam_length_m - AtlasQuality::of(&found).seam_length_m).abs() < 1e-9);
    let texels = TexelMap::new(&page, 0.02).unwrap();
    assert_eq!([texels.width, texels.height], found.pages()[0]);
    assert!((texels.area_m2.iter().sum::<f64>() - q.area_m2).abs() < 1e-9);
    let middle = [1.0 / 3.0; 3];
    for face in 0..page.disk().faces().len() {
        let at = SurfacePoint { face: face as u32, barycentric: middle };
        assert_eq!(found.uv_of(at).1.map(|x| (1e9 * x).round()), page.uv_of(at).map(|x| (1e9 * x).round()));
        assert_eq!(page.locate(page.uv_of(at)).unwrap().face, face as u32);
    }
    let mut seams = 0;
    for h in 0..3 * page.disk().faces().len() {
        let Some(other) = page.disk().across_seam(h) else { continue };
        let half = |h: usize| {
            let mut barycentric = [0.5; 3];
            barycentric[(h + 2) % 3] = 0.0;
            SurfacePoint { face: (h / 3) as u32, barycentric }
        };
        assert!((page.point(half(h)) - page.point(half(other))).norm() < 1e-12);
        assert!(
            (page.smooth_normal(half(h)).into_inner() - page.smooth_normal(half(other)).into_inner()).norm() < 1e-9
        );
        seams += 1;
    }
    assert!(seams > 20);
}

/// Straight on from a point of a cube, computed on the cube itself: over an edge the way turns by a right angle.
#[test]
fn a_straight_line_goes_on_over_seams() {
    let found = atlas(&cube(4), 0.02);
    let page = found.page_chart(0).unwrap();
    let mut random = Rng(5);
    let (mut crossed, mut seams) = (0, 0);
    for _ in 0..2000 {
        let from = SurfacePoint {
            face: random.below(page.disk().faces().len()) as u32,
            barycentric: {
                let (a, b) = (random.unit(), random.unit());
                if a + b < 1.0 { [a, b, 1.0 - a - b] } else { [1.0 - a, 1.0 - b, a + b - 1.0] }
            },
        };
        let (angle, length) = (6.3 * random.unit(), 0.1 + 0.8 * random.unit());
        let offset = [length * angle.cos(), length * angle.sin()];
        // The direction in space, by the corners of the face.
        let corners = page.disk().faces()[from.face as usize];
        let place = |k: usize| Vector3::from(page.disk().positions()[corners[k] as usize]);
        let uv = |k: usize| page.uv()[corners[k] as usize];
        let [[a, b], [c, d]] = [1, 2].map(|k| [uv(k)[0] - uv(0)[0], uv(k)[1] - uv(0)[1]]);
        let det = a * d - b * c;
        let (s, t) = ((offset[0] * d - offset[1] * c) / det, (a * offset[1] - b * offset[0]) / det);
        let mut way = s * (place(1) - place(0)) + t * (place(2) - place(0));
        assert!((way.norm() - length).abs() < 1e-9, "a cube is laid out without stretch");
        let mut point = page.point(from).coords;
        let mut normal = page.face_normal(from.face).into_inner();
        let middle = Vector3::repeat(0.5);
        let mut folds = 0;
        loop {
            // How far to the next edge of this side of the cube, and over which.
            let to_edge = |k: usize| {
                let room = if way[k] > 0.0 { 1.0 - point[k] } else { -point[k] };
                if normal[k].abs() > 0.5 || way[k].abs() < 1e-12 { f64::INFINITY } else { room / way[k] }
            };
            let first = (0..3).min_by(|&i, &j| to_edge(i).total_cmp(&to_edge(j))).unwrap();
            let share = to_edge(first);
            if share >= 1.0 {
                point += way;
                break;
            }
            point += share * way;
            let mut out = Vector3::zeros();
            out[first] = way[first].signum();
            let rest = (1.0 - share) * way;
            way = rest - rest.dot(&out) * out - rest.dot(&out) * normal;
            normal = out;
            folds += 1;
        }
        let reached = page.straight_on(from, offset).expect("a cube has no border");
        assert!((page.point(reached).coords - point).norm() < 1e-9, "{reached:?} from {from:?} by {offset:?}");
        assert!((point - middle).amax() < 0.5 + 1e-9);
        crossed += usize::from(folds > 0);
        let flat = page.uv_of(from);
        seams += usize::from(page.locate([flat[0] + offset[0], flat[1] + offset[1]]) != Some(reached));
    }
    assert!(crossed > 500 && seams > 100, "{crossed} crossed an edge of the cube, {seams} a seam");
}

/// A gutter texel of a cube lies on another side of it, as far from the seam as on the page; and what it interpolates is that place.
#[test]
fn the_gutter_is_the_other_side_of_the_seam() {
    let texel = 0.02;
    let found = atlas(&cube(4), texel);
    let page = found.page_chart(0).unwrap();
    let map = TexelMap::new(&page, texel).unwrap();
    let gutter = Gutter::new(&page, &map, 3);
    let open: Vec<usize> = (0..3 * page.disk().faces().len()).filter(|&h| page.disk().twin(h).is_none()).collect();
    let corner = |h: usize| page.disk().faces()[h / 3][h % 3] as usize;
    let mut checked = 0;
    for gutter in &gutter.texels {
        let centre = map.uv_of_texel(gutter.texel % map.width, gutter.texel / map.width);
        assert!(page.locate(centre).is_none());
        // The nearest point of the rim, in the plane and on the cube.
        let nearest = open.iter().map(|&h| {
            let ends = [h, h / 3 * 3 + (h + 1) % 3].map(corner);
            let [a, b] = ends.map(|v| page.uv()[v]);
            let edge = [b[0] - a[0], b[1] - a[1]];
            let along = ((centre[0] - a[0]) * edge[0] + (centre[1] - a[1]) * edge[1]) / edge[0].hypot(edge[1]).powi(2);
            let along = along.clamp(0.0, 1.0);
            let distance = (a[0] + along * edge[0] - centre[0]).hypot(a[1] + along * edge[1] - centre[1]);
            let [p, q] = ends.map(|v| Vector3::from(page.disk().positions()[v]));
            (distance, p + along * (q - p))
        });
        let (distance, rim) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        // Off the corners of the cube, where nothing unfolds, and off its other edges, where the way would bend again.
        let to_edge = rim.map(|x| x.min(1.0 - x));
        let bends = to_edge.iter().any(|x| (1e-9..0.08).contains(x)) || to_edge.iter().all(|x| *x < 1e-9);
        if bends {
            continue;
        }
        let point = page.point(gutter.point).coords;
        assert!(((point - rim).norm() - distance).abs() < 1e-9, "{point} beyond {rim}, {distance} m");
        let sum: f64 = gutter.sources.iter().map(|s| s.1).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let shown: Vector3<f64> =
            gutter.sources.iter().map(|&(k, weight)| weight * page.point(map.cells[k].unwrap()).coords).sum();
        // A texel that straddles the edge of the cube has its middle on one of the sides.
        assert!((shown - point).norm() < texel, "shows {shown} for {point}");
        checked += 1;
    }
    assert!(checked > 500, "{checked}");
}

/// A dent in a sphere of many charts: what is away from it stays to the bit, what is near is laid out again within the bounds.
#[test]
fn charts_that_a_change_does_not_touch_stay_to_the_bit() {
    let mesh = sphere(24);
    let options = settings(0.02);
    let before = atlas(&mesh, 0.02);
    assert!(before.charts().len() > 1);
    // In the middle of the first chart: as far as can be from the faces of the others.
    let middle = |f: u32| mesh.1[f as usize].iter().map(|&v| Vector3::from(mesh.0[v as usize])).sum::<Vector3<f64>>();
    let others: Vec<Vector3<f64>> = before.chart_faces(1).iter().map(|&f| middle(f)).collect();
    let distance = |f: u32| others.iter().map(|p| (p - middle(f)).norm_squared()).fold(f64::INFINITY, f64::min);
    let faces = before.chart_faces(0).iter().copied();
    let centre = middle(faces.max_by(|&f, &g| distance(f).total_cmp(&distance(g))).unwrap()).normalize();
    let dent = |p: [f64; 3], depth: f64| {
        let near = (Vector3::from(p).dot(&centre) - 0.96).max(0.0) / 0.04;
        p.map(|x| x * (1.0 - depth * near))
    };
    let dented = |depth| mesh.0.iter().map(|&p| dent(p, depth)).collect::<Vec<_>>();
    let moved = dented(0.01);
    let same = |f: &[u32; 3]| f.iter().all(|&v| mesh.0[v as usize] == moved[v as usize]);
    let kept_faces = mesh.1.iter().filter(|f| same(f)).count();
    assert!((0.95..0.99).contains(&(kept_faces as f64 / mesh.1.len() as f64)), "{kept_faces} of {}", mesh.1.len());

    let (after, update) = update_atlas(&before.layout(), &moved, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!(update.kept_faces, kept_faces);
    assert!(update.kept_charts > 0 && update.changed_charts > 0, "{update:?}");
    assert_eq!(update.kept_charts + update.changed_charts + update.new_charts, after.charts().len());
    let bits = |atlas: &Atlas, f: usize| {
        let (chart, local) = atlas.chart_of_face(f);
        let uv = atlas.charts()[chart].disk().faces()[local].map(|v| atlas.charts()[chart].uv()[v as usize]);
        (uv.map(|p| p.map(f64::to_bits)), atlas.placements()[chart])
    };
    let untouched = |chart: usize| before.chart_faces(chart).iter().all(|&f| same(&mesh.1[f as usize]));
    let (mut stayed, mut charts) = (0, 0);
    for chart in (0..before.charts().len()).filter(|&c| untouched(c)) {
        for &f in before.chart_faces(chart) {
            assert_eq!(bits(&before, f as usize), bits(&after, f as usize));
            stayed += 1;
        }
        charts += 1;
    }
    assert!(stayed > 0);
    assert_eq!(charts, update.kept_charts);
    // The page grows to the right alone: rows are counted from its top.
    assert!(after.pages()[0][1] == before.pages()[0][1] && after.pages()[0][0] >= before.pages()[0][0]);
    assert_eq!(after.pages()[0][0] - before.pages()[0][0], update.added_columns);
    assert_eq!(apart(&after, options.pack.gutter), 0);
    let (again, _) = update_atlas(&before.layout(), &moved, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(again.layout(), after.layout());
    // One too deep to be laid out with the rest of its chart: that stays where it is, with a hole.
    let (deep, update) = update_atlas(&before.layout(), &dented(0.2), &mesh.1, &[], &options, |_| ()).unwrap();
    assert_sound(&deep);
    assert!(update.changed_charts == 1 && update.new_charts > 0, "{update:?}");
    // All but what the dent cuts off from the rest.
    let as_before = (0..mesh.1.len()).filter(|&f| same(&mesh.1[f]) && bits(&before, f) == bits(&deep, f)).count();
    assert!(as_before * 20 > 19 * kept_faces, "{as_before} of {kept_faces}");
    assert_eq!(apart(&deep, options.pack.gutter), 0);
    // Nothing changed: the same atlas. Nothing left: as if there had been none.
    let (same, update) = update_atlas(&before.layout(), &mesh.0, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(same.layout(), before.layout());
    assert_eq!((update.kept_charts, update.changed_charts, update.new_charts), (before.charts().len(), 0, 0));
    let grown: Vec<[f64; 3]> = mesh.0.iter().map(|p| p.map(|x| 1.5 * x)).collect();
    let (anew, update) = update_atlas(&before.layout(), &grown, &mesh.1, &[], &options, |_| ()).unwrap();
    assert_eq!(anew.layout(), unwrap_atlas(&grown, &mesh.1, &[], &options, |_| ()).unwrap().layout());
    assert_eq!(update.kept_charts, 0);
}

/// Faces that go, and faces that come: a hole cut into a sphere, a box set on it, and both files in any order of faces.
#[test]
fn what_comes_and_goes_is_laid_out_again() {
    let mesh = sphere(24);
    let before = atlas(&mesh, 0.02);
    let hole = |f: &[u32; 3]| f.iter().all(|&v| mesh.0[v as usize][0] > 0.97);
    let mut faces: Vec<[u32; 3]> = mesh.1.iter().filter(|f| !hole(f)).copied().collect();
    faces.reverse();
    let (after, update) = update_atlas(&before.layout(), &mesh.0, &faces, &[], &settings(0.02), |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!((update.kept_faces, update.new_charts), (faces.len(), 0));
    assert_eq!(apart(&after, 2), 0);

    let (mut positions, mut faces) = mesh.clone();
    let first = positions.len() as u32;
    let (more, box_faces) = cube(6);
    positions.extend(more.iter().map(|p| [0.3 * p[0] + 2.0, 0.3 * p[1], 0.3 * p[2]]));
    faces.extend(box_faces.iter().map(|f| f.map(|v| v + first)));
    let (after, update) = update_atlas(&before.layout(), &positions, &faces, &[], &settings(0.02), |_| ()).unwrap();
    assert_sound(&after);
    assert_eq!((update.kept_charts, update.changed_charts), (before.charts().len(), 0));
    assert!(update.new_charts > 0 && update.new_charts < 7, "{update:?}");
    assert_eq!(apart(&after, 2), 0);
    // A layout of another scale, or one that is none, is refused.
    let other = update_atlas(&before.layout(), &positions, &faces, &[], &settings(0.03), |_| ());
    assert!(matches!(other, Err(Error::Setting { name: "texel_m", .. })));
    let mut broken = before.layout();
    broken.chart.pop();
    let broken = update_atlas(&broken, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(broken, Err(Error::Length { .. })));
    let mut broken = before.layout();
    broken.chart[0] = 1000;
    let broken = update_atlas(&broken, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(broken, Err(Error::Setting { name: "chart", .. })));
    let mut vast = before.layout();
    vast.pages[0] = [1 << 40, 1 << 40];
    let vast = update_atlas(&vast, &positions, &faces, &[], &settings(0.02), |_| ());
    assert!(matches!(vast, Err(Error::TooManyTexels { .. })), "pages are not believed before they are counted");
}

/// Pairs of texels of different charts that are nearer to each other than a gutter, by texels whose centres charts cover.
fn apart(atlas: &Atlas, gutter: usize) -> usize {
    let mut too_near = 0;
    for (page, texels) in PageTexels::of(atlas, 0).iter().enumerate() {
        let [width, height] = atlas.pages()[page];
        let owner = |x: usize, y: usize| {
            let k = y * width + x;
            (texels.kinds[k] == TexelKind::Inside)
                .then(|| atlas.chart_of_face(texels.points[k].unwrap().face as usize).0)
        };
        for y in 0..height {
            for x in 0..width {
                let Some(here) = owner(x, y) else { continue };
                for (i, j) in (0..=gutter).flat_map(|i| (0..=gutter).map(move |j| (x + i, y + j))) {
                    too_near += usize::from(i < width && j < height && owner(i, j).is_some_and(|o| o != here));
                }
            }
        }
    }
    too_near
}

/// Whatever soup comes: an atlas that is sound, or an error; never a panic, never a NaN.
#[test]
fn soups_do_no_harm() {
    let mut rng = Rng(17);
    let (mut laid_out, mut refused) = (0, 0);
    for _ in 0..400 {
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
    assert!(laid_out > 250 && refused > 20, "{laid_out} {refused}");
}
