//! The built-in world: a procedural rock wall, 4.6 m wide and 2.2 m high, its centre 2.6 m above the ground (the size and
//! place of the rock in the VR paper, section VI).

use paint_net::procedural::value_noise;

use crate::mesh_io::TriangleMesh;

/// Width of the wall, metres.
pub const WIDTH: f64 = 4.6;
/// Height of the wall, metres.
pub const HEIGHT: f64 = 2.2;
/// Height of its centre above the ground, metres.
pub const CENTRE: f64 = 2.6;
/// Largest bulge or hollow, metres.
pub const RELIEF: f64 = 0.25;

/// Spacing of the vertices, metres.
const SPACING: f64 = 0.025;
/// (lattice spacing, amplitude) of the noise octaves in metres: bulges that a robot must fly around, ledges that turn
/// the normals, and roughness below the size of a spray spot.
const OCTAVES: [(f64, f64); 4] = [(1.30, 0.200), (0.62, 0.050), (0.31, 0.012), (0.11, 0.0015)];

/// The wall as a mesh: facing -x, z up, deterministic in the seed.
pub fn rock_wall(seed: u64) -> TriangleMesh {
    let columns = (WIDTH / SPACING).round() as usize;
    let rows = (HEIGHT / SPACING).round() as usize;
    let mut relief = Vec::with_capacity((columns + 1) * (rows + 1));
    for row in 0..=rows {
        for column in 0..=columns {
            relief.push(bulge(seed, column as f64 * SPACING, row as f64 * SPACING));
        }
    }
    let (low, high) = relief.iter().fold((f64::MAX, f64::MIN), |(l, h), &b| (l.min(b), h.max(b)));
    let (middle, scale) = (0.5 * (low + high), 2.0 * RELIEF / (high - low));

    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let bulge = (relief[row * (columns + 1) + column] - middle) * scale;
            // Scanned meshes are not grids: interior vertices are shifted by up to an eighth of the spacing.
            let inside = row > 0 && row < rows && column > 0 && column < columns;
            let shift = |salt: u64| {
                let noise = value_noise(seed ^ salt, column as f64, row as f64) - 0.5;
                if inside { 0.25 * SPACING * noise } else { 0.0 }
            };
            let y = 0.5 * WIDTH - column as f64 * SPACING + shift(0x5157);
            let z = CENTRE - 0.5 * HEIGHT + row as f64 * SPACING + shift(0xA3C1);
            mesh.positions.push([-bulge as f32, y as f32, z as f32]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |r: usize, c: usize| (r * (columns + 1) + c) as u32;
            let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            // Alternate the diagonal: a single direction would show in the shading.
            if (row + column) % 2 == 0 {
                mesh.faces.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.faces.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    mesh
}

/// Relief before scaling: a sum of value-noise octaves.
fn bulge(seed: u64, x: f64, y: f64) -> f64 {
    let octave = |k: usize, (spacing, amplitude): (f64, f64)| {
        amplitude * (2.0 * value_noise(seed.wrapping_add(17 * k as u64 + 1), x / spacing, y / spacing) - 1.0)
    };
    OCTAVES.iter().enumerate().map(|(k, &o)| octave(k, o)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wall_has_its_size_relief_and_side() {
        for seed in [1, 7] {
            let mesh = rock_wall(seed);
            let extent = |k: usize| {
                let of = |p: &[f32; 3]| f64::from(p[k]);
                let (low, high) =
                    mesh.positions.iter().map(of).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
                (low, high)
            };
            assert!((extent(0).0 + RELIEF).abs() < 1e-6 && (extent(0).1 - RELIEF).abs() < 1e-6);
            assert!((extent(1).1 - extent(1).0 - WIDTH).abs() < 1e-5);
            assert!((extent(2).0 - 1.5).abs() < 1e-5 && (extent(2).1 - 3.7).abs() < 1e-5);
            for face in &mesh.faces {
                let [a, b, c] = face.map(|i| nalgebra::Vector3::from(mesh.positions[i as usize]));
                assert!((b - a).cross(&(c - a)).x < 0.0, "every face looks towards the robot");
            }
        }
        assert_ne!(rock_wall(1), rock_wall(2));
        assert_eq!(rock_wall(3), rock_wall(3));
    }
}
