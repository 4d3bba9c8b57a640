//! Meshes far from the origin of their coordinates.

use crate::error::Error;

/// A mesh whose middle is farther from the origin than this many times its longest side is moved: single precision keeps seven digits, and six
/// of them are to be left for the mesh.
const FAR: f64 = 16.0;
/// Coordinates in steps of more than this share of an edge have lost the relief of the surface.
const COARSE: f64 = 1.0 / 16.0;
/// Share of the edges that are one step long, or none, along an axis of a lattice that somebody chose, such as an elevation model of 1 m.
const LATTICE: f64 = 0.95;
/// A mesh of fewer vertices may well have coordinates in few steps: a house.
const FEW_VERTICES: usize = 64;
/// Share of faces without area beyond which a mesh was flattened.
const FLATTENED: f64 = 0.01;

/// Positions in single precision about an origin.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recentred {
    /// What to add to every position, in the unit of the file; zero for a mesh that lies near the origin of its coordinates.
    pub origin: [f64; 3],
    /// The positions less the origin.
    pub positions: Vec<[f32; 3]>,
}

/// Moves a mesh that lies far from the origin of its coordinates (`positions` in the unit of the file) to its own middle, so that single precision
/// keeps its relief. Others stay where they are, and what is not finite stays so.
///
/// # Errors
/// [`Error::LostRelief`] where the file itself has lost it: its coordinates come in steps too large for its faces.
/// [`Error::IndexOutOfRange`] where a face names a vertex that does not exist.
pub fn recentre(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<Recentred, Error> {
    let vertices = positions.len();
    for (face, corners) in faces.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&v| v as usize >= vertices) {
            return Err(Error::IndexOutOfRange { face, index, vertices });
        }
    }
    let (low, high) = bounds(positions, faces);
    let longest = (0..3).map(|c| high[c] - low[c]).fold(0.0, f64::max);
    let middle = [0, 1, 2].map(|c| f64::midpoint(low[c], high[c]));
    let away = middle.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    // Also false for a mesh without extent or with infinite coordinates.
    if !(longest > 0.0 && away > FAR * longest && away.is_finite()) {
        return Ok(Recentred { origin: [0.0; 3], positions: positions.iter().map(|p| p.map(|c| c as f32)).collect() });
    }
    let far = [0, 1, 2].map(|c| middle[c].abs() > FAR * longest);
    check_resolution(positions, faces, far)?;
    // A number of single precision: what a file of such numbers can hold, and what leaves the differences exact.
    let origin = middle.map(|c| f64::from(c as f32));
    let moved = |p: &[f64; 3]| [0, 1, 2].map(|c| (p[c] - origin[c]) as f32);
    Ok(Recentred { origin, positions: positions.iter().map(moved).collect() })
}

/// Least and largest coordinates of the vertices that faces use.
fn bounds(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> ([f64; 3], [f64; 3]) {
    let used = faces.iter().flatten().map(|&v| positions[v as usize]);
    used.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
        ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])))
    })
}

/// Refuses coordinates in steps too large for the faces, along the axes on which the mesh is far away: heights may well be whole decimetres.
fn check_resolution(positions: &[[f64; 3]], faces: &[[u32; 3]], far: [bool; 3]) -> Result<(), Error> {
    let edge = |[a, b]: [u32; 2]| {
        let (p, q) = (positions[a as usize], positions[b as usize]);
        (0..3).map(|c| (p[c] - q[c]).powi(2)).sum::<f64>().sqrt()
    };
    let mut edges: Vec<f64> = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(edge).collect();
    let half = edges.len() / 2;
    let median = *edges.select_nth_unstable_by(half, f64::total_cmp).1;
    let flat = faces.iter().filter(|face| doubled_area(face.map(|v| positions[v as usize])) <= 1e-9 * median * median);
    let flattened = flat.count() as f64 > FLATTENED * faces.len() as f64;
    let steps = [0, 1, 2].map(|c| if far[c] { step(positions, faces, c) } else { 0.0 });
    let step = steps.into_iter().fold(0.0, f64::max);
    let coarse = |c: usize| steps[c] > COARSE * median && !is_lattice(positions, faces, c, steps[c]);
    let coarse = positions.len() >= FEW_VERTICES && (0..3).any(coarse);
    if flattened && step > COARSE * median || coarse {
        let coordinate =
            faces.iter().flatten().flat_map(|&v| positions[v as usize]).fold(0.0, |m: f64, c| m.max(c.abs()));
        return Err(Error::LostRelief { coordinate, step, edge: median });
    }
    Ok(())
}

/// Shortest distance between two different values of a coordinate; 0 for a single value.
fn step(positions: &[[f64; 3]], faces: &[[u32; 3]], c: usize) -> f64 {
    let mut values: Vec<f64> = faces.iter().flatten().map(|&v| positions[v as usize][c]).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    let shortest = values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    if shortest.is_finite() { shortest } else { 0.0 }
}

/// Whether the edges along an axis are one step long, if they are not across it.
fn is_lattice(positions: &[[f64; 3]], faces: &[[u32; 3]], c: usize, step: f64) -> bool {
    let along = |a: u32, b: u32| (positions[a as usize][c] - positions[b as usize][c]).abs();
    let edges = || faces.iter().flat_map(|&[a, b, d]| [along(a, b), along(b, d), along(d, a)]).filter(|l| *l > 0.0);
    let whole = edges().filter(|l| (l - step).abs() < 1e-3 * step).count();
    whole as f64 >= LATTICE * edges().count() as f64
}

/// Twice the area of a triangle.
fn doubled_area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let [u, v] = [b, c].map(|p| nalgebra::Vector3::from(p) - nalgebra::Vector3::from(a));
    u.cross(&v).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A relief of 3 m, 40 x 40 cells of 7.5 cm with bumps of 2 cm.
    fn relief(origin: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let n = 40_u32;
        let at = |i: u32, j: u32| {
            let [x, y] = [i, j].map(|k| f64::from(k) * 0.075);
            let wave = 0.02 * (5.0 * x).sin() * (7.0 * y).cos();
            [origin[0] + x + 0.3 * wave, origin[1] + y - 0.2 * wave, origin[2] + wave]
        };
        let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
        let corner = |i: u32, j: u32| j * (n + 1) + i;
        let cell = |i, j| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        };
        (positions, (0..n).flat_map(|j| (0..n).flat_map(move |i| cell(i, j))).collect())
    }

    #[test]
    fn a_mesh_near_the_origin_stays_and_a_surveyed_one_is_moved() {
        let (near, faces) = relief([3.0, -20.0, 1.0]);
        let kept = recentre(&near, &faces).unwrap();
        assert_eq!(kept.origin, [0.0; 3]);
        assert_eq!(kept.positions[77], near[77].map(|c| c as f32));
        let (home, _) = relief([-1.5, -1.5, 0.0]);
        for origin in [[431_250.37, 5_412_307.91, 212.4], [1e7, 1e7, 1e7], [-3.4e9, 0.0, 0.0]] {
            let (far, _) = relief(origin);
            let moved = recentre(&far, &faces).unwrap();
            // Differences to the first vertex; the double has steps of 5e-7 m at 3.4e9.
            for (m, h) in moved.positions.iter().zip(&home) {
                for c in 0..3 {
                    let found = f64::from(m[c]) - f64::from(moved.positions[0][c]);
                    assert!((found - (h[c] - home[0][c])).abs() < 2e-6, "{origin:?}: {found}");
                }
            }
            for (m, f) in moved.positions.iter().zip(&far) {
                assert!((0..3).all(|c| (f64::from(m[c]) + moved.origin[c] - f[c]).abs() < 1e-6), "written back");
            }
        }
    }

    /// What single precision made of a surveyed mesh before it came here.
    #[test]
    fn a_file_that_has_lost_the_relief_is_refused() {
        let (far, faces) = relief([431_250.37, 5_412_307.91, 212.4]);
        let rounded: Vec<[f64; 3]> = far.iter().map(|p| p.map(|c| f64::from(c as f32))).collect();
        let error = recentre(&rounded, &faces).unwrap_err();
        assert!(matches!(error, Error::LostRelief { step, .. } if step == 0.5), "{error}");
        // Six digits.
        let short: Vec<[f64; 3]> = far.iter().map(|p| p.map(|c| format!("{c:.5e}").parse().unwrap())).collect();
        assert!(matches!(recentre(&short, &faces), Err(Error::LostRelief { .. })));
        // One decimal: the steps are as long as the edges and the faces are not flat, but they are.
        let tenths: Vec<[f64; 3]> = far.iter().map(|p| p.map(|c| format!("{c:.1}").parse().unwrap())).collect();
        assert!(matches!(recentre(&tenths, &faces), Err(Error::LostRelief { .. })));
        let centimetres: Vec<[f64; 3]> = far.iter().map(|p| p.map(|c| format!("{c:.3}").parse().unwrap())).collect();
        assert!(recentre(&centimetres, &faces).is_ok());
    }

    #[test]
    fn a_lattice_and_a_house_of_whole_metres_are_kept() {
        let n = 20_u32;
        let height = |i: u32, j: u32| 100.0 + 0.37 * f64::from((i * 7 + j * 13) % 11);
        let at = |i: u32, j: u32| [431_000.0 + f64::from(i), 5_412_000.0 + f64::from(j), height(i, j)];
        let positions: Vec<_> = (0..n).flat_map(|j| (0..n).map(move |i| at(i, j))).collect();
        let faces: Vec<[u32; 3]> =
            (0..n - 1).flat_map(|j| (0..n - 1).map(move |i| [j * n + i, j * n + i + 1, (j + 1) * n + i])).collect();
        assert!(recentre(&positions, &faces).is_ok());
        let house = [[4e6, 1e7, 0.0], [4e6 + 9.0, 1e7, 0.0], [4e6 + 9.0, 1e7 + 6.0, 0.0], [4e6 + 4.0, 1e7 + 3.0, 7.0]];
        assert!(recentre(&house, &[[0, 1, 3], [1, 2, 3]]).is_ok());
    }

    #[test]
    fn broken_meshes_pass_or_are_refused_without_a_panic() {
        assert_eq!(recentre(&[], &[]).unwrap(), Recentred::default());
        assert!(recentre(&[[1e9; 3]; 3], &[[0, 1, 2]]).is_ok());
        assert!(recentre(&[[f64::NAN; 3], [1e300; 3], [-1e300; 3]], &[[0, 1, 2]]).is_ok());
        assert!(matches!(recentre(&[[0.0; 3]], &[[0, 0, 1]]), Err(Error::IndexOutOfRange { index: 1, .. })));
    }
}
