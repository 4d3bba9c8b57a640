//! Parts of a mesh against closed forms.

use std::collections::HashMap;
use std::f64::consts::PI;

use crate::common::grid;
use uv_param::Error;
use uv_param::region::{
    DEFAULT_MEMORY_M, EditableMesh, SmallParts, divide_at_border, drop_small_parts, grow_to_creases,
};

type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

fn mesh(nx: u32, ny: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let (positions, faces) = grid(nx, ny, place);
    (positions.into_iter().map(|p| p.map(|c| c as f32)).collect(), faces)
}

/// Half of the cross product, summed over some faces.
fn area((positions, faces): &Mesh, inside: &[bool]) -> f64 {
    let of = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| nalgebra::Vector3::from(positions[v as usize].map(f64::from)));
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    faces.iter().zip(inside).filter(|(_, inside)| **inside).map(|(face, _)| of(face)).sum()
}

#[test]
fn a_part_ends_at_a_crease_and_goes_round_a_bend() {
    // Two square metres, folded by a right angle in the middle: from either side one of them.
    let folded = mesh(40, 20, |s, t| if s <= 0.5 { [2.0 * s, 0.0, t] } else { [1.0, 2.0 * s - 1.0, t] });
    for (seed, low) in [(0, true), (folded.1.len() - 1, false)] {
        let inside = grow_to_creases(&folded.0, &folded.1, seed, DEFAULT_MEMORY_M).unwrap();
        assert!((area(&folded, &inside) - 1.0).abs() < 1e-6);
        assert_eq!(inside[0], low);
    }
    // Half a turn of a column of one metre: no crease anywhere.
    let bent = mesh(60, 20, |s, t| [(PI * s).cos(), (PI * s).sin(), t]);
    assert!(grow_to_creases(&bent.0, &bent.1, 7, DEFAULT_MEMORY_M).unwrap().iter().all(|inside| *inside));
}

#[test]
fn small_parts_are_left_out() {
    let wall = mesh(10, 10, |s, t| [s, t, 0.0]);
    // The lower left square of a hundredth, and the upper half.
    let mut inside: Vec<bool> = (0..200).map(|f| !(2..100).contains(&f)).collect();
    let dropped = drop_small_parts(&wall.0, &wall.1, &mut inside, 0.02).unwrap();
    assert_eq!(dropped, SmallParts { parts: 1, faces: 2 });
    assert_eq!(inside, (0..200).map(|f| f >= 100).collect::<Vec<_>>());
}

#[test]
fn a_disc_is_cut_out_of_a_square_without_gaps() {
    let (mut positions, mut faces) = mesh(2, 2, |s, t| [s, t, 0.0]);
    let editable = EditableMesh { positions: &mut positions, faces: &mut faces, colours: None, uv: None };
    let disc = |s: &uv_param::region::Sample| {
        // Only what lies on the square is asked about.
        assert!([s.point.x, s.point.y].iter().all(|c| (0.0..=1.0).contains(c)), "{}", s.point);
        (s.point.x - 0.5).hypot(s.point.y - 0.5) < 0.3
    };
    let division = divide_at_border(editable, 0.01, &disc).unwrap();
    assert_eq!((division.inside.len(), division.source.len()), (faces.len(), faces.len()));
    assert!(division.source.iter().all(|&f| f < 8));
    let all = (positions, faces);
    // The border is resolved to half a centimetre.
    assert!((area(&all, &division.inside) - PI * 0.09).abs() < 0.005 * 2.0 * PI * 0.3);
    assert!((area(&all, &vec![true; all.1.len()]) - 1.0).abs() < 1e-6);
    // Edges of one face lie on the border of the square: nothing tears where faces were divided.
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    for face in &all.1 {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    for (edge, count) in edges {
        let outer = |c: usize, side: f32| edge.iter().all(|&v| (all.0[v as usize][c] - side).abs() < 1e-6);
        let border = (0..2).any(|c| outer(c, 0.0) || outer(c, 1.0));
        assert_eq!(count, if border { 1 } else { 2 }, "{edge:?}");
    }
}

/// Files double vertices: what meets at a place is divided there, whether it shares the vertex or not.
#[test]
fn nothing_tears_where_vertices_are_doubled() {
    let (shared, shared_faces) = mesh(2, 2, |s, t| [s, t, 0.0]);
    let mut positions: Vec<[f32; 3]> = shared_faces.iter().flatten().map(|&v| shared[v as usize]).collect();
    let mut faces: Vec<[u32; 3]> = (0..shared_faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let editable = EditableMesh { positions: &mut positions, faces: &mut faces, colours: None, uv: None };
    // Well inside one of the eight triangles: its neighbours are divided for its sake alone.
    divide_at_border(editable, 0.02, &|s| (s.point.x - 0.3).hypot(s.point.y - 0.15) < 0.08).unwrap();
    let key = |v: u32| positions[v as usize].map(f32::to_bits);
    let mut edges: HashMap<[[u32; 3]; 2], usize> = HashMap::new();
    for face in &faces {
        for k in 0..3 {
            let (a, b) = (key(face[k]), key(face[(k + 1) % 3]));
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    for (edge, count) in edges {
        let outer = |c: usize, side: f32| edge.iter().all(|p| (f32::from_bits(p[c]) - side).abs() < 1e-6);
        let border = (0..2).any(|c| outer(c, 0.0) || outer(c, 1.0));
        assert_eq!(count, if border { 1 } else { 2 }, "{edge:?}");
    }
}

/// Colours and texture coordinates that are linear on the square are linear on what it is divided into.
#[test]
fn what_is_divided_keeps_its_colours_and_coordinates() {
    let (mut positions, mut faces) = mesh(2, 2, |s, t| [s, t, 0.0]);
    let colour = |p: [f32; 3]| [p[0], 1.0 - p[1], 0.5 * p[0] + 0.25 * p[1]];
    let at = |p: [f32; 3]| [2.0 * p[0] - p[1], 3.0 * p[1] + 1.0];
    let mut colours: Vec<[f32; 3]> = positions.iter().map(|&p| colour(p)).collect();
    // In an order of their own, each once for every corner.
    let mut coordinates: Vec<[f32; 2]> =
        faces.iter().rev().flat_map(|f| f.map(|v| at(positions[v as usize]))).collect();
    let last = faces.len() as u32 - 1;
    let mut uv_faces: Vec<[u32; 3]> = (0..=last).map(|f| [0, 1, 2].map(|k| 3 * (last - f) + k)).collect();
    let uv = uv_param::region::EditableUv { coordinates: &mut coordinates, faces: &mut uv_faces };
    let editable =
        EditableMesh { positions: &mut positions, faces: &mut faces, colours: Some(&mut colours), uv: Some(uv) };
    divide_at_border(editable, 0.02, &|s| (s.point.x - 0.4).hypot(s.point.y - 0.6) < 0.25).unwrap();
    assert!(faces.len() > 100 && colours.len() == positions.len() && uv_faces.len() == faces.len());
    for (p, found) in positions.iter().zip(&colours) {
        assert!(colour(*p).iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-5), "{p:?}: {found:?}");
    }
    for (face, corners) in faces.iter().zip(&uv_faces) {
        for (v, i) in face.iter().zip(corners) {
            let (expected, found) = (at(positions[*v as usize]), coordinates[*i as usize]);
            assert!((0..2).all(|k| (expected[k] - found[k]).abs() < 1e-5), "{expected:?}: {found:?}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let (mut positions, mut faces) = mesh(1, 1, |s, t| [s, t, 0.0]);
    assert!(matches!(grow_to_creases(&positions, &faces, 2, 0.1), Err(Error::Setting { name: "seed", .. })));
    assert!(matches!(drop_small_parts(&positions, &faces, &mut [true], 0.1), Err(Error::Length { .. })));
    let editable = EditableMesh { positions: &mut positions, faces: &mut faces, colours: None, uv: None };
    assert!(matches!(divide_at_border(editable, 0.0, &|_| true), Err(Error::Setting { name: "finest", .. })));
    faces[1][2] = 4;
    assert!(matches!(
        grow_to_creases(&positions, &faces, 0, 0.1),
        Err(Error::IndexOutOfRange { face: 1, index: 4, vertices: 4 })
    ));
}
