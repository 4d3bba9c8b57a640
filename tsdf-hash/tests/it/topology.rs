//! The mesh as a surface.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use tsdf_hash::mesh::{Mesh, write_ply};
use tsdf_hash::{Map, Settings};

use crate::random::Random;
use crate::scene::{Shot, hit_sphere, look_at};

/// How often each directed edge occurs.
pub(crate) fn directed_edges(mesh: &Mesh) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for &[a, b, c] in &mesh.faces {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
}

/// No edge with more than two faces, and neighbours oriented alike.
pub(crate) fn assert_manifold(mesh: &Mesh) {
    assert!(directed_edges(mesh).values().all(|&count| count == 1));
    let count = mesh.positions.len();
    assert!(mesh.normals.len() == count && mesh.colours.len() == count);
    let mut used = vec![false; count];
    mesh.faces.iter().flatten().for_each(|&k| used[k as usize] = true);
    assert!(used.iter().all(|&u| u), "every vertex belongs to a face");
    for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(p.iter().all(|x| x.is_finite()) && (Vector3::from(*n).norm() - 1.0).abs() < 1e-4);
    }
}

fn sphere_mesh(radius: f64) -> Mesh {
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    for x in -1..=1 {
        for y in -1..=1 {
            for z in -1..=1 {
                let direction = Vector3::new(f64::from(x), f64::from(y), f64::from(z));
                if direction.norm() > 0.0 {
                    let eye = Point3::from(direction.normalize() * 1.6);
                    let pose = look_at(eye, Point3::origin());
                    let shot = Shot::take((240, 240), [260.0; 2], pose, hit_sphere(radius));
                    map.integrate(&shot.view(), None, &pose).unwrap();
                }
            }
        }
    }
    map.mesh()
}

#[test]
fn a_sphere_is_watertight_and_round() {
    let radius = 0.5;
    let mesh = sphere_mesh(radius);
    assert_manifold(&mesh);
    let edges = directed_edges(&mesh);
    assert!(edges.keys().all(|&[a, b]| edges.contains_key(&[b, a])), "no boundary");
    let euler = mesh.positions.len() as i64 - edges.len() as i64 / 2 + mesh.faces.len() as i64;
    assert_eq!(euler, 2);
    let (mut volume, mut worst, mut sum) = (0.0, 0.0_f64, 0.0);
    for face in &mesh.faces {
        let [a, b, c] = face.map(|k| Vector3::from(mesh.positions[k as usize].map(f64::from)));
        volume += a.dot(&b.cross(&c)) / 6.0;
    }
    for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
        let p = Vector3::from(p.map(f64::from));
        let error = (p.norm() - radius).abs();
        sum += error;
        worst = worst.max(error);
        assert!(p.normalize().dot(&Vector3::from(n.map(f64::from))) > 0.95);
    }
    let exact = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    // Positive: the faces look outward. A polyhedron with 2 cm edges inside the sphere lacks about a thousandth.
    assert!((volume / exact - 1.0).abs() < 4e-3, "{}", volume / exact);
    assert!(sum / (mesh.positions.len() as f64) < 0.5e-3 && worst < 3e-3, "worst {worst}");
}

#[test]
fn noise_tears_no_seams() {
    // Random relief of several voxels: every case of the cells, ambiguous ones included, over many block borders.
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    let mut random = Random::new(7);
    for k in 0..6 {
        let pose = look_at(Point3::new(0.0, 0.1 * f64::from(k), 0.0), Point3::new(1.5, 0.0, 0.1 * f64::from(k)));
        let mut shot = Shot::take((160, 120), [130.0; 2], pose, |o, d| Some((1.5 - o.x) / d.x));
        for z in &mut shot.depth {
            *z += 0.02 * (random.uniform() as f32 - 0.5);
        }
        map.integrate(&shot.view(), None, &pose).unwrap();
    }
    let mesh = map.mesh();
    assert!(mesh.faces.len() > 5000);
    assert_manifold(&mesh);
}

#[test]
fn ply_holds_what_the_mesh_holds() {
    let mesh = sphere_mesh(0.3);
    let mut file = Vec::new();
    write_ply(&mesh, &mut file).unwrap();
    let end = file.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&file[..end]).unwrap();
    assert!(header.contains(&format!("element vertex {}\n", mesh.positions.len())));
    assert!(header.contains(&format!("element face {}\n", mesh.faces.len())));
    let body = &file[end..];
    assert_eq!(body.len(), 27 * mesh.positions.len() + 13 * mesh.faces.len());
    let float = |at: usize| f32::from_le_bytes(body[at..at + 4].try_into().unwrap());
    let last = mesh.positions.len() - 1;
    assert_eq!([0, 4, 8].map(|k| float(27 * last + k)), mesh.positions[last]);
    assert_eq!([12, 16, 20].map(|k| float(27 * last + k)), mesh.normals[last]);
    let face = &body[27 * mesh.positions.len() + 13 * (mesh.faces.len() - 1)..];
    assert_eq!(face[0], 3);
    let index = |k: usize| u32::from_le_bytes(face[1 + 4 * k..5 + 4 * k].try_into().unwrap());
    assert_eq!([0, 1, 2].map(index), mesh.faces[mesh.faces.len() - 1]);
}

#[test]
fn no_wall_is_drawn_where_only_its_two_edges_were_seen() {
    // A step: its upper half in one image, its lower half in the other, so that no image has a depth edge.
    let faces_half_way = |voxels: f64| {
        let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
        let step = 0.02 * voxels;
        let pose = look_at(Point3::origin(), Point3::new(1.5, 0.0, 0.0));
        for far in [false, true] {
            let x = if far { 1.5 + step } else { 1.5 };
            let half = |d: &Vector3<f64>| (x / d.x * d.y < 0.0) != far;
            let shot = Shot::take((240, 180), [780.0; 2], pose, |_, d| half(d).then_some(x / d.x));
            map.integrate(&shot.view(), None, &pose).unwrap();
        }
        let mesh = map.mesh();
        assert_manifold(&mesh);
        let middle =
            |face: &&[u32; 3]| face.iter().map(|&k| f64::from(mesh.positions[k as usize][0]) / 3.0).sum::<f64>();
        let half_way = |face: &&[u32; 3]| (middle(face) - 1.5 - 0.5 * step).abs() < 0.25 * step;
        [mesh.faces.iter().filter(half_way).count(), mesh.faces.len()]
    };
    let [wall, planes] = faces_half_way(3.0);
    assert!(wall == 0 && planes > 600, "{wall} {planes}");
    // A step of one voxel is a slope like any other: two faces in each of the 16 voxels that it is long, at least.
    let [slope, _] = faces_half_way(1.0);
    assert!(slope >= 32, "{slope}");
}
