//! Opening surfaces: what a cut must not change, and surfaces whose opened shape is known.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::common::{Mesh, Rng, data_mesh, grid};
use uv_param::cut::CutSettings;
use uv_param::disk::{Repair, largest_disk_with};
use uv_param::parametrizer::Stage;
use uv_param::texture::TexelMap;
use uv_param::{Chart, Disk, Error, Method, Settings, SurfacePoint, unwrap, unwrap_with_cuts};

fn disk((positions, faces): &Mesh) -> Disk {
    largest_disk_with(positions, faces, Repair { weld: true, ..Repair::default() }).unwrap().0
}

fn cut_open(mesh: &Mesh, settings: &Settings) -> Chart {
    unwrap_with_cuts(&disk(mesh), settings, &CutSettings::default(), |_| ()).unwrap()
}

fn exact() -> Settings {
    Settings { tolerance: 0.0, iterations: 500, ..Settings::default() }
}

/// A surface of revolution: radius and height from t in 0..=1.
fn lathe(sides: u32, rings: u32, profile: impl Fn(f64) -> [f64; 2]) -> Mesh {
    let (mut positions, faces) = grid(sides, rings, |s, t| {
        let [r, z] = profile(t);
        // A pole is one point, not a hole of 1e-17 m.
        let r = if r < 1e-9 { 0.0 } else { r };
        [r * (TAU * s).cos(), r * (TAU * s).sin(), z]
    });
    // The last column is the first one to the bit, so that welding closes the turn.
    for ring in positions.chunks_mut(sides as usize + 1) {
        ring[sides as usize] = ring[0];
    }
    (positions, faces)
}

/// The part of the area beyond a stretch.
fn beyond(chart: &Chart, bound: f64) -> f64 {
    let faces = 0..chart.disk().faces().len();
    let stretched = |&f: &usize| {
        let [s1, s2] = chart.stretch(f as u32);
        s1.max(1.0 / s2) > bound || s2 <= 0.0
    };
    faces.filter(stretched).map(|f| chart.disk().face_area(f)).sum::<f64>() / chart.disk().area()
}

/// Vertices, edges and faces counted from the face list alone.
fn euler(disk: &Disk) -> isize {
    let mut edges: Vec<(u32, u32)> = disk
        .faces()
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    disk.positions().len() as isize - edges.len() as isize + disk.faces().len() as isize
}

#[test]
fn a_cut_changes_nothing_but_the_connections() {
    let mesh = grid(8, 6, |s, t| [0.8 * s, 0.6 * t, 0.1 * (7.0 * s * t).sin()]);
    let whole = disk(&mesh);
    // From the left edge inwards, round a corner; then a branch of this seam; then a hole inside.
    let at = |i: u32, j: u32| j * 9 + i;
    let slit = whole.cut(&[at(0, 3), at(1, 3), at(2, 3), at(3, 3), at(3, 2)]).unwrap();
    // Of the two copies of (2, 3) the one on the side of (2, 4).
    let side = slit.faces().iter().filter(|f| f.contains(&at(2, 4))).flatten();
    let fork = *side.into_iter().find(|&&v| slit.vertex_source()[v as usize] == at(2, 3)).unwrap();
    let branched = slit.cut(&[fork, at(2, 4)]).unwrap();
    let pierced = branched.cut(&[at(5, 2), at(6, 2), at(6, 3)]).unwrap();
    for (n, opened) in [&slit, &branched, &pierced].into_iter().enumerate() {
        assert_eq!(opened.cuts(), n + 1);
        assert_eq!(opened.area().to_bits(), whole.area().to_bits());
        assert_eq!(opened.face_source(), whole.face_source());
        assert_eq!(opened.positions()[..63], *whole.positions());
        let holes = opened.boundary_loops().len() - 1;
        assert_eq!((euler(opened), opened.euler_characteristic()), (1 - holes as isize, 1 - holes as isize));
        assert_eq!(holes, n / 2);
        for (a, b) in opened.faces().iter().flatten().zip(whole.faces().iter().flatten()) {
            assert_eq!(opened.vertex_source()[*a as usize], whole.vertex_source()[*b as usize]);
            assert_eq!(opened.positions()[*a as usize], whole.positions()[*b as usize]);
        }
        for h in 0..3 * opened.faces().len() {
            let other = opened.across_seam(h);
            assert!(other.is_none() || opened.twin(h).is_none() && opened.across_seam(other.unwrap()) == Some(h));
            assert_eq!(whole.twin(h), opened.twin(h).or(other));
        }
    }
    // Copies: 3 inner vertices and 1 at the rim; 1 more at the branch; 1 in the middle of the hole.
    assert_eq!([&slit, &branched, &pierced].map(|d| d.positions().len() - 63), [4, 5, 6]);
    let length = |path: &[(u32, u32)]| -> f64 {
        let p = |(i, j): (u32, u32)| uv_param::nalgebra::Vector3::from(mesh.0[at(i, j) as usize]);
        path.windows(2).map(|e| (p(e[0]) - p(e[1])).norm()).sum()
    };
    assert!((slit.seam_length() - length(&[(0, 3), (1, 3), (2, 3), (3, 3), (3, 2)])).abs() < 1e-12);
    assert_eq!(whole.seam_length(), 0.0);
    let mut reversed = slit.clone();
    reversed.reverse();
    assert!((reversed.seam_length() - slit.seam_length()).abs() < 1e-12);
    for h in 0..3 * reversed.faces().len() {
        assert_eq!(reversed.across_seam(h).is_some(), slit.across_seam(h / 3 * 3 + 2 - h % 3).is_some());
        assert!(reversed.across_seam(h).is_none_or(|other| reversed.across_seam(other) == Some(h)));
    }
}

#[test]
fn paths_that_cannot_be_cut_are_named() {
    let sheet = disk(&grid(4, 4, |s, t| [s, t, 0.0]));
    let refused = |path: &[u32]| match sheet.cut(path) {
        Err(Error::Cut { index, problem }) => (index, problem.split(';').next().unwrap().to_owned()),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(&[10, 11, 14]), (1, "no edge joins it to the next".to_owned()));
    assert_eq!(refused(&[10, 99]), (0, "no edge joins it to the next".to_owned()));
    assert_eq!(refused(&[0, 1, 2]), (0, "it has no edge inside the surface".to_owned()));
    assert_eq!(refused(&[]), (0, "it has no edge inside the surface".to_owned()));
    assert_eq!(refused(&[10, 11, 12, 13, 14]), (4, "it would cut off a part".to_owned()));
    assert_eq!(refused(&[11, 12]), (1, "an edge alone inside does not open".to_owned()));
}

#[test]
fn a_cone_is_cut_through_its_apex_and_becomes_its_sector() {
    let a = 20.0_f64.to_radians();
    let chart = cut_open(&lathe(32, 24, |t| [(1.0 - t) * a.sin(), t * a.cos()]), &exact());
    let q = chart.quality();
    assert_eq!((q.cuts, q.flips, chart.disk().boundary_loops().len()), (1, 0, 1));
    // A polyhedral cone cut to its apex is developable.
    assert!(q.symmetric_dirichlet - 1.0 < 1e-9, "{}", q.symmetric_dirichlet);
    let apex = |v: u32| chart.disk().positions()[v as usize][2] > 0.999 * a.cos();
    let tip = *chart.disk().boundary_loops()[0].iter().find(|&&v| apex(v)).unwrap();
    // All corners at the apex add up to n 2 asin(sin a sin(pi / n)) in the chart.
    let angle: f64 = chart
        .disk()
        .faces()
        .iter()
        .filter_map(|face| face.iter().position(|&v| v == tip).map(|k| [0, 1, 2].map(|i| face[(k + i) % 3] as usize)))
        .map(|corners| {
            let [o, p, q] = corners.map(|v| chart.uv()[v]);
            let (x, y) = ([p[0] - o[0], p[1] - o[1]], [q[0] - o[0], q[1] - o[1]]);
            (x[0] * y[1] - x[1] * y[0]).atan2(x[0] * y[0] + x[1] * y[1])
        })
        .sum();
    assert!((angle - 64.0 * (a.sin() * (PI / 32.0).sin()).asin()).abs() < 1e-6, "{angle}");
}

#[test]
fn an_open_cylinder_is_slit_from_rim_to_rim() {
    let mesh = lathe(32, 12, |t| [0.3, t]);
    assert_eq!(disk(&mesh).boundary_loops().len(), 2);
    let chart = cut_open(&mesh, &exact());
    let q = chart.quality();
    assert_eq!((q.cuts, chart.disk().boundary_loops().len(), euler(chart.disk())), (1, 1, 1));
    assert!(q.symmetric_dirichlet - 1.0 < 1e-9, "{}", q.symmetric_dirichlet);
    // The strip is 32 chords wide at every height, and no two faces of it lie on each other.
    assert!((q.area_m2 - 32.0 * 0.6 * (PI / 32.0).sin()).abs() < 1e-12 && q.overlap_share < 1e-12);
    let texels = TexelMap::new(&chart, 0.02).unwrap();
    assert!((texels.area_m2.iter().sum::<f64>() - q.area_m2).abs() < 1e-9);
}

#[test]
fn few_cuts_bring_bulges_under_the_bound() {
    let bulge = lathe(48, 40, |t| {
        let latitude = -0.5 + t * (0.5 + FRAC_PI_2);
        [latitude.cos(), latitude.sin()]
    });
    let finger = lathe(20, 60, |t| {
        let past = ((t - 0.8) / 0.2).max(0.0) * FRAC_PI_2;
        [0.1 * past.cos(), t.min(0.8) + 0.1 * past.sin()]
    });
    for (mesh, most) in [(bulge, 2), (finger, 3)] {
        let uncut = unwrap(&disk(&mesh), &Settings::default(), |_| ()).unwrap();
        assert!(beyond(&uncut, 1.5) > 0.1);
        let mut heard = Vec::new();
        let cuts = CutSettings::default();
        let listen = |p: uv_param::parametrizer::Progress| {
            if p.stage == Stage::Cut {
                heard.push(p.iteration);
            }
        };
        let chart = unwrap_with_cuts(&disk(&mesh), &Settings::default(), &cuts, listen).unwrap();
        let q = chart.quality();
        assert!((1..=most).contains(&q.cuts), "{q:?}");
        assert_eq!(heard, (1..=q.cuts).collect::<Vec<_>>());
        assert!(beyond(&chart, 1.5) <= 0.031 && q.overlap_share < 1e-3 && q.flips == 0, "{q:?}");
        assert!(q.symmetric_dirichlet < uncut.quality().symmetric_dirichlet);
        assert_eq!((euler(chart.disk()), chart.disk().area().to_bits()), (1, uncut.disk().area().to_bits()));
        let one = CutSettings { max_cuts: 1, share: 0.0, ..cuts };
        assert_eq!(unwrap_with_cuts(&disk(&mesh), &Settings::default(), &one, |_| ()).unwrap().quality().cuts, 1);
    }
}

#[test]
fn a_tube_too_long_to_be_laid_out_is_cut_instead() {
    let tube = lathe(24, 600, |t| {
        let past = ((t - 0.98) / 0.02).max(0.0) * FRAC_PI_2;
        [0.1 * past.cos(), 12.0 * t.min(0.98) + 0.1 * past.sin()]
    });
    let refused = unwrap(&disk(&tube), &Settings::default(), |_| ()).unwrap_err();
    assert!(matches!(refused, Error::CollapsedStart { .. }));
    let chart = cut_open(&tube, &Settings::default());
    assert!(chart.quality().flips == 0 && chart.quality().symmetric_dirichlet < 1.01, "{:?}", chart.quality());
    assert!(chart.quality().seam_length_m > 12.0 * 0.98);
    let none = CutSettings { max_cuts: 0, ..CutSettings::default() };
    assert_eq!(unwrap_with_cuts(&disk(&tube), &Settings::default(), &none, |_| ()).unwrap_err(), refused);
}

#[test]
fn what_needs_no_cut_gets_none() {
    let cylinder = grid(64, 16, |s, t| [0.5 * (TAU * s).cos(), 0.5 * (TAU * s).sin(), 1.3 * t]);
    let mut meshes = vec![largest_disk_with(&cylinder.0, &cylinder.1, Repair::default()).unwrap().0];
    meshes.push(disk(&lathe(48, 24, |t| [(t * FRAC_PI_2).cos(), (t * FRAC_PI_2).sin()])));
    let cut = |mesh: &Disk| unwrap_with_cuts(mesh, &Settings::default(), &CutSettings::default(), |_| ()).unwrap();
    for mesh in meshes {
        let chart = cut(&mesh);
        assert_eq!((chart.quality().cuts, chart.quality().seam_length_m), (0, 0.0));
        assert_eq!(chart.uv(), unwrap(&mesh, &Settings::default(), |_| ()).unwrap().uv());
    }
    if let Some(mountain) = data_mesh("odedstein/mountain/mountain.obj") {
        assert_eq!(cut(&disk(&mountain)).quality().cuts, 0);
    }
}

#[test]
fn a_head_becomes_paintable() {
    // A head with two holes; uncut its energy is 2.03, it covers itself at the holes, and 72 % are beyond 1.6.
    let Some(mesh) = data_mesh("../textures/open3d_monkey_cc0/monkey.obj") else { return };
    let repair = Repair { weld: true, split_vertices: true };
    let (disk, _) = largest_disk_with(&mesh.0, &mesh.1, repair).unwrap();
    let chart = unwrap_with_cuts(&disk, &Settings::default(), &CutSettings::default(), |_| ()).unwrap();
    let q = *chart.quality();
    assert!(beyond(&chart, 1.6) < 0.1 && q.symmetric_dirichlet < 1.2, "{q:?}");
    assert!((q.flips, q.flips_f32) == (0, 0) && q.overlap_share < 1e-3 && q.cuts <= 8, "{q:?}");
    assert!(q.seam_length_m < 4.0 * q.area_m2.sqrt());
    assert_eq!(euler(chart.disk()), 2 - chart.disk().boundary_loops().len() as isize);
}

#[test]
fn the_surface_goes_on_across_a_seam() {
    let mesh = lathe(24, 16, |t| [(1.0 - t) * 0.4, 0.9 * t * (2.0 - t)]);
    let uncut = unwrap(&disk(&mesh), &Settings::default(), |_| ()).unwrap();
    let chart = cut_open(&mesh, &Settings::default());
    let disk = chart.disk();
    let on_edge = |h: usize, share: f64| {
        let mut barycentric = [0.0; 3];
        (barycentric[h % 3], barycentric[(h + 1) % 3]) = (1.0 - share, share);
        SurfacePoint { face: (h / 3) as u32, barycentric }
    };
    let seams: Vec<usize> = (0..3 * disk.faces().len()).filter(|&h| disk.across_seam(h).is_some()).collect();
    assert!(seams.len() >= 8);
    for h in seams {
        let (here, there) = (on_edge(h, 0.3), on_edge(disk.across_seam(h).unwrap(), 0.7));
        assert!((chart.point(here) - chart.point(there)).norm() < 1e-12);
        let normal = chart.smooth_normal(here).into_inner();
        assert!((normal - chart.smooth_normal(there).into_inner()).norm() < 1e-12);
        assert!((normal - uncut.smooth_normal(here).into_inner()).norm() < 1e-12);
    }
    // Every point of the chart still leads to the surface and back.
    let mut rng = Rng(5);
    for _ in 0..2000 {
        let uv = [chart.width() * rng.unit(), chart.height() * rng.unit()];
        if let Some(at) = chart.locate(uv) {
            let back = chart.uv_of(at);
            assert!((back[0] - uv[0]).hypot(back[1] - uv[1]) < 1e-12);
        }
    }
}

#[test]
fn the_same_surface_is_always_cut_the_same() {
    let mesh = lathe(30, 30, |t| [0.5 * (t * FRAC_PI_2).cos(), 1.2 * (t * FRAC_PI_2).sin()]);
    let (first, second) = (cut_open(&mesh, &Settings::default()), cut_open(&mesh, &Settings::default()));
    assert!(first.quality().cuts > 0);
    assert_eq!(first.disk(), second.disk());
    assert_eq!(first.uv(), second.uv());
    // Plain ARAP would fold; it counts as Auto.
    let rigid = cut_open(&mesh, &Settings { method: Method::Arap, ..Settings::default() });
    assert_eq!(rigid.uv(), first.uv());
}

#[test]
fn the_overlap_of_a_strip_wound_too_far_is_what_is_too_much() {
    // A flat ring of 32 steps per turn, wound for 40 steps: 8 of 40 lie on others, with equal and with shifted edges.
    for turn in [TAU / 32.0, TAU / 31.5] {
        let mesh = grid(40, 3, |s, t| [s, t, 0.0]);
        let uv = mesh.0.iter().map(|p| {
            let (angle, r) = (-40.0 * turn * p[0], 1.0 + p[1]);
            [r * angle.cos(), r * angle.sin()]
        });
        let uv: Vec<[f64; 2]> = uv.collect();
        let chart = Chart::new(disk(&mesh), uv, 0, None).unwrap();
        assert_eq!(chart.quality().flips, 0);
        let map = TexelMap::new(&chart, 0.01).unwrap();
        let flat: f64 = map.coverage.iter().map(|&c| f64::from(c)).sum();
        let twice: f64 = map.coverage.iter().map(|&c| f64::from((c - 1.0).max(0.0))).sum();
        let share = chart.quality().overlap_share;
        assert!((share - twice / flat).abs() < 2e-3, "{share} against {} from texels", twice / flat);
        if turn == TAU / 32.0 {
            assert!((share - 8.0 / 40.0).abs() < 1e-9, "{share}");
        }
    }
}

#[test]
fn cut_settings_out_of_range_are_refused() {
    let sheet = disk(&grid(2, 2, |s, t| [s, t, 0.0]));
    let refused = |cuts: CutSettings| match unwrap_with_cuts(&sheet, &Settings::default(), &cuts, |_| ()) {
        Err(Error::Setting { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    for max_stretch in [1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(CutSettings { max_stretch, ..CutSettings::default() }), "max_stretch");
    }
    for share in [-0.1, 1.1, f64::NAN] {
        assert_eq!(refused(CutSettings { share, ..CutSettings::default() }), "share");
    }
    let bad = Settings { iterations: 0, ..Settings::default() };
    assert!(unwrap_with_cuts(&sheet, &bad, &CutSettings::default(), |_| ()).is_err());
}
