//! A mesh with every face split into four, again and again: how the time of an atlas grows.

use std::path::Path;

use nalgebra::Vector3;
use paintcopter::mesh_io::read_mesh;
use serde_json::json;
use uv_param::atlas::{AtlasQuality, PackSettings};
use uv_param::{AtlasSettings, unwrap_atlas};

use crate::cpu::seconds;

type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Texels along a page on which the charts fill two thirds.
const PAGE: f64 = 1024.0;

/// Lays out a mesh, and the same after each of `splits` splits; prints one line for each.
///
/// # Errors
/// Of reading and of the atlas.
pub fn run(file: &Path, splits: u32) -> Result<(), Box<dyn std::error::Error>> {
    let read = read_mesh(file)?;
    let mut mesh: Mesh = (read.positions.iter().map(|p| p.map(f64::from)).collect(), read.faces);
    for split in 0..=splits {
        if split > 0 {
            mesh = split_into_four(&mesh);
        }
        let texel_m = (1.5 * area(&mesh)).sqrt() / PAGE;
        let settings =
            AtlasSettings { pack: PackSettings { texel_m, ..PackSettings::default() }, ..AtlasSettings::default() };
        let (atlas, cpu_s) = seconds(|| unwrap_atlas(&mesh.0, &mesh.1, &[], &settings, |_| ()));
        let q = AtlasQuality::of(&atlas?);
        println!(
            "{}",
            json!({
                "fig": "uv-param_split", "faces": mesh.1.len(), "cpu_s": cpu_s, "charts": q.charts,
                "seam_relative": q.seam_relative, "utilisation": q.utilisation, "stretch_p99": q.stretch_p99,
                "stretch_max": q.stretch_max, "flips": q.flips, "flips_f32": q.flips_f32,
                "overlap_pairs": q.overlap_pairs,
            })
        );
    }
    Ok(())
}

fn corners(mesh: &Mesh, face: [u32; 3]) -> [Vector3<f64>; 3] {
    face.map(|v| Vector3::from(mesh.0[v as usize]))
}

fn area(mesh: &Mesh) -> f64 {
    let cross = |[a, b, c]: [Vector3<f64>; 3]| (b - a).cross(&(c - a)).norm();
    mesh.1.iter().map(|&face| 0.5 * cross(corners(mesh, face))).sum()
}

/// New vertices lie half-way between the middle of an edge and the tangent planes at its ends (Phong tessellation, Boubekeur and Alexa 2008):
/// the surface is no copy of the coarse one.
fn split_into_four(mesh: &Mesh) -> Mesh {
    let mut normals = vec![Vector3::zeros(); mesh.0.len()];
    for &face in &mesh.1 {
        let [a, b, c] = corners(mesh, face);
        let cross = (b - a).cross(&(c - a));
        for v in face {
            normals[v as usize] += cross;
        }
    }
    let normals: Vec<Vector3<f64>> =
        normals.iter().map(|n: &Vector3<f64>| n.try_normalize(0.0).unwrap_or_else(Vector3::zeros)).collect();
    let (mut positions, mut faces) = (mesh.0.clone(), Vec::with_capacity(4 * mesh.1.len()));
    let mut middles = std::collections::HashMap::new();
    for &face in &mesh.1 {
        let middle = [0, 1, 2].map(|k| {
            let [a, b] = [face[k], face[(k + 1) % 3]];
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [p, q] = [a, b].map(|v| Vector3::from(mesh.0[v as usize]));
                let (flat, [n, m]) = (0.5 * (p + q), [a, b].map(|v| normals[v as usize]));
                let onto = |at: Vector3<f64>, normal: Vector3<f64>| flat - normal * normal.dot(&(flat - at));
                let round = 0.5 * (onto(p, n) + onto(q, m));
                positions.push((0.5 * (flat + round)).into());
                positions.len() as u32 - 1
            })
        });
        let [ab, bc, ca] = middle;
        faces.extend([[face[0], ab, ca], [face[1], bc, ab], [face[2], ca, bc], middle]);
    }
    (positions, faces)
}
