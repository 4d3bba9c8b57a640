//! What is accepted, what is repaired, and what is refused with which words.

use crate::common::{Rng, grid};
use uv_param::disk::{Repair, largest_disk_with};
use uv_param::{Error, Settings, largest_disk, unwrap};

const SQUARE: [[f64; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn refusal(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Error {
    largest_disk(positions, faces).unwrap_err()
}

#[test]
fn bad_numbers_are_named() {
    assert_eq!(refusal(&[], &HALVES), Error::Empty);
    assert_eq!(refusal(&SQUARE, &[]), Error::Empty);
    assert_eq!(refusal(&SQUARE, &[[0, 1, 2], [0, 2, 4]]), Error::IndexOutOfRange { face: 1, index: 4, vertices: 4 });
    let mut broken = SQUARE;
    broken[3][1] = f64::NAN;
    assert_eq!(refusal(&broken, &HALVES), Error::NonFinite { vertex: 3 });
    let far = [[1e200, 0.0, 0.0], [0.0, 1e200, 0.0], [0.0; 3]];
    assert_eq!(refusal(&far, &[[0, 1, 2]]), Error::NonFinite { vertex: 0 });
    // A NaN that no face uses is dropped with its vertex.
    assert!(largest_disk(&broken, &HALVES[..1]).is_ok());
    assert_eq!(refusal(&[[0.0; 3], [1.0; 3], [2.0; 3]], &[[0, 1, 2], [0, 0, 1]]), Error::ZeroArea);
}

#[test]
fn surfaces_that_are_no_disk_are_named() {
    // A tetrahedron; three leaves on one edge; a strip with a half twist.
    let p = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., -1., 0.]];
    assert_eq!(refusal(&p, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]), Error::Closed { genus: 0 });
    assert_eq!(refusal(&p, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]), Error::NonManifoldEdge { a: 0, b: 1, faces: 3 });
    let (positions, mut faces) = grid(12, 1, |s, t| {
        let (turn, off) = (std::f64::consts::TAU * s, 0.3 * (t - 0.5));
        let r = 1.0 + off * (0.5 * turn).cos();
        [r * turn.cos(), r * turn.sin(), off * (0.5 * turn).sin()]
    });
    // Glue the last column to the first one upside down.
    for corner in faces.iter_mut().flatten() {
        *corner = match *corner {
            12 => 13,
            25 => 0,
            other => other,
        };
    }
    assert!(matches!(largest_disk_with(&positions, &faces, Repair::default()), Err(Error::NotOrientable { .. })));
}

#[test]
fn handles_are_counted() {
    // A torus of 8 x 6 squares; without one face it has one boundary loop.
    let (positions, mut faces) = grid(8, 6, |s, t| {
        let (a, b) = (std::f64::consts::TAU * s, std::f64::consts::TAU * t);
        [(2.0 + b.cos()) * a.cos(), (2.0 + b.cos()) * a.sin(), b.sin()]
    });
    for corner in faces.iter_mut().flatten() {
        *corner = (*corner / 9 % 6) * 9 + *corner % 9 % 8;
    }
    let refused = |faces: &[[u32; 3]]| largest_disk_with(&positions, faces, Repair::default()).unwrap_err();
    assert_eq!(refused(&faces), Error::Closed { genus: 1 });
    assert_eq!(refused(&faces[1..]), Error::HigherGenus { genus: 1, boundary_loops: 1 });
}

#[test]
fn what_is_left_out_is_reported() {
    // A square with one half wound the other way, a repeated face, a sliver, a far small triangle, an unused vertex.
    let mut positions = SQUARE.to_vec();
    positions.extend([[0.5, 0., 0.], [9., 9., 0.], [9.1, 9., 0.], [9., 9.1, 0.], [7., 7., 7.]]);
    let faces = [[5, 6, 7], [0, 1, 2], [0, 3, 2], [2, 0, 1], [0, 4, 1]];
    let (disk, report) = largest_disk(&positions, &faces).unwrap();
    assert_eq!(report.components, 2);
    assert_eq!(report.faces_in_other_components, 1);
    assert!((report.area_in_other_components_m2 - 0.005).abs() < 1e-6);
    assert_eq!(report.unreferenced_vertices, 1);
    assert_eq!((report.degenerate_faces_dropped, report.duplicate_faces_dropped), (1, 1));
    assert_eq!((report.reversed_faces, report.boundary_loops), (1, 1));
    assert_eq!(disk.vertex_source(), [0, 1, 2, 3]);
    assert_eq!(disk.face_source(), [1, 2]);
    assert_eq!(disk.faces(), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(disk.boundary_loops(), [[0, 1, 2, 3]]);
    assert_eq!([0, 1, 2].map(|k| disk.source_corner(1, k)), [0, 2, 1]);
    assert_eq!((disk.twin(2), disk.twin(3), disk.twin(0)), (Some(3), Some(2), None));
}

#[test]
fn welding_and_splitting_are_done_when_asked() {
    // Two triangles that share positions but no vertices.
    let p = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 0., -0.], [1., 1., 0.], [0., 1., 0.]];
    let soup = [[0, 1, 2], [3, 4, 5]];
    let (apart, found) = largest_disk_with(&p, &soup, Repair::default()).unwrap();
    assert_eq!((apart.faces().len(), found.components), (1, 2));
    let (whole, found) = largest_disk_with(&p, &soup, Repair { weld: true, ..Repair::default() }).unwrap();
    assert_eq!((whole.faces().len(), whole.positions().len(), found.welded_vertices), (2, 4, 2));

    // A ring of squares that touches itself at one vertex: the far corners of two neighbours of a missing square.
    let (positions, mut faces) = grid(3, 3, |s, t| [s, t, 0.0]);
    faces.retain(|f| !matches!(f, [0, 1, 5] | [0, 5, 4] | [5, 6, 10] | [5, 10, 9]));
    let refused = largest_disk_with(&positions, &faces, Repair::default()).unwrap_err();
    assert_eq!(refused, Error::NonManifoldVertex { vertex: 5 });
    let (disk, found) =
        largest_disk_with(&positions, &faces, Repair { split_vertices: true, ..Repair::default() }).unwrap();
    assert_eq!((found.split_vertices, found.boundary_loops), (1, 1));
    assert_eq!(disk.vertex_source().iter().filter(|&&v| v == 5).count(), 2);
}

#[test]
fn reversing_keeps_the_mesh_consistent() {
    let (positions, faces) = grid(3, 2, |s, t| [s, t, 0.1 * s * t]);
    let (mut disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    let reversed: Vec<[u32; 3]> = faces.iter().map(|f| [f[0], f[2], f[1]]).collect();
    let (expected, _) = largest_disk_with(&positions, &reversed, Repair::default()).unwrap();
    disk.reverse();
    assert_eq!(disk.faces(), expected.faces());
    for h in 0..3 * faces.len() {
        assert_eq!(disk.twin(h), expected.twin(h));
    }
    let edges = |around: &[u32]| {
        let mut e: Vec<(u32, u32)> = around.iter().copied().zip(around.iter().copied().cycle().skip(1)).collect();
        e.sort_unstable();
        e
    };
    assert_eq!(edges(&disk.boundary_loops()[0]), edges(&expected.boundary_loops()[0]));
}

#[test]
fn random_soup_never_breaks_it() {
    let mut rng = Rng(7);
    let mut unwrapped = 0;
    for _ in 0..4000 {
        let vertices = 3 + rng.below(7);
        let mut positions: Vec<[f32; 3]> =
            (0..vertices).map(|_| [0; 3].map(|_| rng.below(4) as f32 * 0.5 + 0.1 * rng.unit() as f32)).collect();
        if rng.below(20) == 0 {
            positions[0][0] = f32::INFINITY;
        }
        let faces: Vec<[u32; 3]> = (0..=rng.below(9)).map(|_| [0; 3].map(|_| rng.below(vertices) as u32)).collect();
        let positions64: Vec<[f64; 3]> = positions.iter().map(|p| p.map(f64::from)).collect();
        let repair = Repair { weld: rng.below(2) == 0, split_vertices: rng.below(2) == 0 };
        let Ok((disk, _)) = largest_disk_with(&positions64, &faces, repair) else { continue };
        let chart = unwrap(&disk, &Settings::default(), |_| ()).unwrap();
        assert!(chart.uv().iter().flatten().all(|x| x.is_finite()));
        assert_eq!(chart.quality().flips, 0);
        unwrapped += 1;
    }
    assert!(unwrapped > 1000, "only {unwrapped} of the random soups were disks");
}
