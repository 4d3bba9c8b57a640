//! A part of a mesh is painted: which faces that are, and that the rest is in the way.

use std::collections::HashMap;
use std::fmt::Write as _;

use nalgebra::{Point3, Vector3};
use paint_sim::{Surface as _, TriangleSurface};
use paintcopter::mesh_io::{MeshUv, TriangleMesh};
use paintcopter::mesh_placement::UpAxis;
use paintcopter::mission::{Mission, MissionSettings, inspect, report};
use paintcopter::mission_file::{MissionFile, MissionFileError};
use paintcopter::region::{Region, RegionError, Scene};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

use crate::scratch::Scratch;

fn region(text: &str) -> Region {
    text.parse().unwrap()
}

/// A wall of two triangles, 3 x 2 m in the plane x = 0, that faces -x, with coordinates of its own.
fn wall() -> TriangleMesh {
    TriangleMesh {
        positions: vec![[0., 3., 0.], [0., 0., 0.], [0., 0., 2.], [0., 3., 2.]],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        uv: Some(MeshUv {
            coordinates: vec![[0., 0.], [1., 0.], [1., 1.], [0., 1.]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
        }),
        ..TriangleMesh::default()
    }
}

/// Length of the edges, by places, that only one face has.
fn border(meshes: [&TriangleMesh; 2]) -> f64 {
    let mut edges: HashMap<[[u32; 3]; 2], (usize, f64)> = HashMap::new();
    for mesh in meshes {
        for face in &mesh.faces {
            for k in 0..3 {
                let [a, b] = [face[k], face[(k + 1) % 3]].map(|i| mesh.positions[i as usize]);
                let mut key = [a, b].map(|p| p.map(f32::to_bits));
                key.sort_unstable();
                let length = (Vector3::from(a) - Vector3::from(b)).cast::<f64>().norm();
                let edge = edges.entry(key).or_insert((0, length));
                edge.0 += 1;
            }
        }
    }
    edges.values().filter(|(count, _)| *count == 1).map(|(_, length)| length).sum()
}

#[test]
fn two_triangles_are_divided_at_the_border_and_nothing_tears() {
    let picture = Scratch::new("mask");
    image::GrayImage::from_fn(300, 200, |x, y| {
        image::Luma([if (90..180).contains(&x) && (40..140).contains(&y) { 255 } else { 0 }])
    })
    .save(picture.0.join("mask.png"))
    .unwrap();
    let mask = format!("mask:{}", picture.path("mask.png"));
    // u runs along -y: columns 90 to 180 are y = 2.1 to 1.2, rows 40 to 140 are z = 1.6 to 0.6.
    for (text, area) in [
        ("box:-1,1.2,0.6,1,2.1,1.6", 0.9),
        ("box:1,2.1,1.6,-1,1.2,0.6", 0.9),
        (mask.as_str(), 0.9),
        ("plane:0,1.5,1,-2,0,0,0.5", std::f64::consts::PI * 0.25),
    ] {
        let finest = 0.0125;
        let Scene { canvas, obstacles, .. } = region(text).split(wall(), finest, 1.0).unwrap();
        let perimeter = 4.0;
        assert!((canvas.area() - area).abs() < finest * perimeter, "{text}: {}", canvas.area());
        assert!((canvas.area() + obstacles.area() - 6.0).abs() < 1e-5, "{text}");
        // All that is open is the outer border: the two halves meet edge to edge.
        assert!((border([&canvas, &obstacles]) - 10.0).abs() < 1e-4, "{text}: {}", border([&canvas, &obstacles]));
        // A wall of 2 triangles has not become one of millions.
        assert!(canvas.faces.len() + obstacles.faces.len() < 20_000, "{text}: {}", canvas.faces.len());
        // Coordinates went with the faces: u = 1 - y / 3, v = z / 2.
        let uv = canvas.uv.unwrap();
        assert_eq!(uv.faces.len(), canvas.faces.len());
        for (face, corners) in canvas.faces.iter().zip(&uv.faces) {
            for (&i, &c) in face.iter().zip(corners) {
                let ([_, y, z], [u, v]) = (canvas.positions[i as usize], uv.coordinates[c as usize]);
                assert!((u - (1.0 - y / 3.0)).abs() < 1e-5 && (v - z / 2.0).abs() < 1e-5);
            }
        }
    }
}

/// What stays clean is marked on the canvas, as large as its regions, however often the faces are divided.
#[test]
fn windows_are_marked_on_the_canvas() {
    let finest = 0.0125;
    let mut scene = Scene::whole(wall());
    scene.keep_clean(&region("box:-1,1.2,0.6,1,2.1,1.6"), finest, 1.0).unwrap();
    scene.keep_clean(&region("plane:0,0.6,1,-2,0,0,0.3"), finest, 1.0).unwrap();
    let area = |wanted: bool| -> f64 {
        let faces = scene.canvas.faces.iter().zip(&scene.clean).filter(|(_, clean)| **clean == wanted);
        let part = TriangleMesh { faces: faces.map(|(face, _)| *face).collect(), ..scene.canvas.clone() };
        part.area()
    };
    let closed = 0.9 + std::f64::consts::PI * 0.09;
    assert!((area(true) - closed).abs() < finest * 6.0, "{} of {closed}", area(true));
    assert!((area(true) + area(false) - 6.0).abs() < 1e-5 && scene.obstacles.faces.is_empty());
    let nothing = scene.keep_clean(&region("box:5,5,5,6,6,6"), finest, 1.0).unwrap_err().to_string();
    assert!(nothing.contains("holds nothing of the mesh"), "{nothing}");
    let all = scene.keep_clean(&region("box:-9,-9,-9,9,9,9"), finest, 1.0).unwrap_err().to_string();
    assert!(all.starts_with("--keep-clean box:") && all.contains("nothing of the mesh is left to paint"), "{all}");
}

/// Files double vertices along the seams of their textures: the two triangles share no vertex.
#[test]
fn faces_that_share_places_but_no_vertices_stay_together() {
    let whole = wall();
    let corners = whole.faces.concat();
    let torn = TriangleMesh {
        positions: corners.iter().map(|&i| whole.positions[i as usize]).collect(),
        faces: vec![[0, 1, 2], [3, 4, 5]],
        ..TriangleMesh::default()
    };
    // In the lower one alone, so that only it asks for a division of their common side.
    let Scene { canvas, obstacles, .. } = region("box:-1,0.3,0.2,1,1,0.8").split(torn, 0.05, 1.0).unwrap();
    assert!((border([&canvas, &obstacles]) - 10.0).abs() < 1e-4, "{}", border([&canvas, &obstacles]));
}

/// A scanned cupboard: a box of 1.2 x 0.5 x 0.8 m in quads of 2 cm, its points off by millimetres.
fn cupboard() -> TriangleMesh {
    let mut random = SplitMix64::seed_from_u64(5);
    let mut noise = move || (random.next_u64() >> 40) as f32 / (1 << 24) as f32 * 0.008 - 0.004;
    let mut mesh = TriangleMesh::default();
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    let cells = [25, 60, 40];
    for axis in 0..3 {
        let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
        for end in [0, cells[axis]] {
            for (i, j) in (0..cells[b]).flat_map(|i| (0..cells[c]).map(move |j| (i, j))) {
                let mut vertex = |di: i32, dj: i32| {
                    let mut at = [0; 3];
                    (at[axis], at[b], at[c]) = (end, i + di, j + dj);
                    *numbers.entry(at).or_insert_with(|| {
                        mesh.positions.push(at.map(|k| k as f32 * 0.02 + noise()));
                        mesh.positions.len() as u32 - 1
                    })
                };
                let [p, q, r, s] = [vertex(0, 0), vertex(1, 0), vertex(1, 1), vertex(0, 1)];
                let faces = if end == 0 { [[p, r, q], [p, s, r]] } else { [[p, q, r], [p, r, s]] };
                mesh.faces.extend(faces);
            }
        }
    }
    mesh
}

#[test]
fn a_picked_front_of_a_noisy_scan_ends_at_its_creases() {
    let mesh = cupboard();
    // The front is x = 0: 60 x 40 quads.
    let front = 2 * 60 * 40;
    let Scene { canvas, .. } = region("pick:-0.05,0.6,0.4").split(mesh, 0.0125, 1.0).unwrap();
    assert!((canvas.faces.len() as f64 / f64::from(front) - 1.0).abs() < 0.05, "{} of {front}", canvas.faces.len());
    let beyond = canvas.faces.iter().flatten().filter(|&&i| canvas.positions[i as usize][0] > 0.05).count();
    assert_eq!(beyond, 0, "grown around the edge");
}

#[test]
fn crumbs_stay_bare_and_are_counted() {
    let mut mesh = wall();
    // 5 x 5 cm beside the wall.
    mesh.positions.extend([[-0.3, 1.5, 1.0], [-0.3, 1.45, 1.0], [-0.3, 1.5, 1.05]]);
    mesh.faces.push([4, 5, 6]);
    mesh.uv = None;
    let scene = region("box:-1,1,0.5,1,2,1.5").split(mesh, 0.0125, 1.0).unwrap();
    assert!(
        scene.canvas.notes.iter().any(|n| n.starts_with("1 parts of the region (1 faces)")),
        "{:?}",
        scene.canvas.notes
    );
    assert!((scene.canvas.area() - 1.0).abs() < 0.05);
}

#[test]
fn what_is_no_region_is_said() {
    for text in
        ["box:1,2,3", "plane:0,0,0,0,0,0,1", "plane:0,0,0,1,0,0,-1", "pick:a,b,c", "mask:", "ball:1,2,3", "1,2,3"]
    {
        let error = text.parse::<Region>().unwrap_err();
        assert!(error.contains(text) && error.contains("box:x0"), "{error}");
    }
    let refused = |text: &str, mesh| region(text).split(mesh, 0.02, 1.0).unwrap_err();
    let empty = refused("box:5,5,5,6,6,6", wall()).to_string();
    assert!(empty.contains("[0.0, 0.0, 0.0] to [0.0, 3.0, 2.0]"), "{empty}");
    let far = refused("pick:40,0,0", wall()).to_string();
    assert!(far.contains("nearest point is 40") && far.contains("[0.0, 3.0, 2.0]"), "{far}");
    let behind = refused("plane:0,1,1,1,0,0,0.5", wall()).to_string();
    assert!(behind.contains("turn the normal about"), "{behind}");
    let crumb = refused("box:-1,1,1,1,1.05,1.05", wall()).to_string();
    assert!(crumb.contains("smaller than a spray"), "{crumb}");
    assert!(matches!(refused("mask:x.png", TriangleMesh { uv: None, ..wall() }), RegionError::NoCoordinates(_)));
    assert!(refused("mask:nowhere.png", wall()).to_string().contains("nowhere.png"));
    let mut broken = wall();
    broken.positions[2][1] = f32::NAN;
    assert!(matches!(refused("pick:0,1,1", broken), RegionError::NotFinite(2)));
}

/// A box as 12 triangles in an OBJ, wound outwards.
fn add_box(text: &mut String, count: &mut usize, low: [f64; 3], high: [f64; 3]) {
    for k in 0..8 {
        let pick = |axis: usize| if k >> axis & 1 == 1 { high[axis] } else { low[axis] };
        writeln!(text, "v {} {} {}", pick(0), pick(1), pick(2)).unwrap();
    }
    for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        let [a, b, c, d] = face.map(|i| i + *count + 1);
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    *count += 8;
}

/// A kitchen in metres, z up: floor, wall, a cupboard that stands before it with a handle, and a wall beside it.
fn kitchen() -> String {
    let (mut text, mut count) = (String::new(), 0);
    add_box(&mut text, &mut count, [-3.0, -1.5, -0.1], [0.1, 1.5, 0.0]);
    add_box(&mut text, &mut count, [0.0, -1.5, 0.0], [0.1, 1.5, 2.4]);
    add_box(&mut text, &mut count, [-0.5, -0.6, 0.01], [-0.01, 0.6, 1.1]);
    add_box(&mut text, &mut count, [-0.55, -0.15, 0.95], [-0.51, 0.15, 0.97]);
    add_box(&mut text, &mut count, [-1.2, 0.9, 0.0], [0.0, 1.0, 2.4]);
    text
}

fn job(s: &Scratch, region: &str) -> MissionFile {
    s.write("kitchen.obj", kitchen());
    MissionFile {
        mesh: Some(s.0.join("kitchen.obj")),
        up: Some(UpAxis::Direction([0.0, 0.0, 9.8])),
        region: Some(region.parse().unwrap()),
        settings: MissionSettings { texel: 0.02, threads: 1, ..MissionSettings::default() },
        ..MissionFile::default()
    }
}

/// The front of the cupboard is painted, nothing else is a target, and the robot hits neither floor nor walls nor handle.
#[test]
fn a_cupboard_is_painted_in_its_kitchen() {
    let s = Scratch::new("kitchen");
    let told = job(&s, "box:-0.505,-0.6,0.3,-0.495,0.6,1.1");
    let mission = told.decide(&s.0).map(|d| Mission::run(d).unwrap()).unwrap();
    let figures = report(&mission, &inspect(&mission).unwrap()).unwrap();
    assert!((figures.surface_area_m2 - 0.96).abs() < 0.03, "{}", figures.surface_area_m2);
    assert_eq!((figures.collisions, figures.limit_violations), (0, 0));
    assert!(figures.ssim_painted > 0.9 * figures.ssim_canvas, "{} {}", figures.ssim_painted, figures.ssim_canvas);
    // Floor, side wall and handle take their share of the reach.
    assert!((0.4..0.99).contains(&figures.reach_share), "{}", figures.reach_share);
    // By another account than the mission's own: the rotors keep clear of everything that the file holds.
    let Scene { canvas, obstacles, .. } = told.read_surface().unwrap().1;
    let first = canvas.positions.len() as u32;
    let faces: Vec<[u32; 3]> =
        canvas.faces.iter().copied().chain(obstacles.faces.iter().map(|f| f.map(|i| i + first))).collect();
    let kitchen = TriangleSurface::new(&[canvas.positions, obstacles.positions].concat(), &faces).unwrap();
    for sample in mission.flights().iter().flat_map(|f| f.flight.samples.iter()) {
        let body = Point3::from(sample.world_from_body.translation.vector);
        let distance = kitchen.distance(&body, 1.0);
        assert!(distance > 0.35, "{distance} m at {body}");
    }
    let targets: Vec<_> = mission.flights().iter().flat_map(|f| f.route.targets.iter().map(|t| t.point)).collect();
    let range = |c: usize| {
        let (low, high) = targets.iter().map(|p| p[c]).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    assert!(range(0) < 1e-4 && range(1) < 1.2 && range(2) < 0.8, "{} {} {}", range(0), range(1), range(2));
}

#[test]
fn a_region_that_nothing_reaches_says_where_the_mesh_is() {
    let s = Scratch::new("kitchen-floor");
    // The underside of the floor.
    let told = job(&s, "box:-3,-1.5,-0.11,0.1,1.5,-0.09");
    let Err(error) = told.decide(&s.0) else { panic!("painted the underside of the floor") };
    assert!(matches!(error, MissionFileError::RegionOutOfReach { .. }), "{error}");
    assert!(error.to_string().contains("[-3.0, -1.5, -0.1] to [0.1, 1.5, 2.4]"), "{error}");
    let Err(error) = job(&s, "box:7,7,7,8,8,8").decide(&s.0) else { panic!("painted nothing") };
    assert!(error.to_string().contains("kitchen.obj") && error.to_string().contains("[0.1, 1.5, 2.4]"), "{error}");
    let Err(error) = (MissionFile { scan: true, ..job(&s, "pick:-0.5,0,0.5") }).decide(&s.0) else { panic!("scanned") };
    assert!(matches!(error, MissionFileError::RegionBeforeScan));
}
