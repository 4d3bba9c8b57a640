//! Lays a closed surface out as an atlas, and writes it as OBJ with texture coordinates.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use uv_param::atlas::AtlasQuality;
use uv_param::{AtlasSettings, SurfacePoint, unwrap_atlas};

/// A torus, 2 m across.
fn torus() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (around, across) = (48, 24);
    let vertex = |k: u32| {
        let (turn, tube) =
            (TAU * f64::from(k / across) / f64::from(around), TAU * f64::from(k % across) / f64::from(across));
        let r = 0.7 + 0.3 * (tube + PI).cos();
        [r * turn.cos(), r * turn.sin(), 0.3 * (tube + PI).sin()]
    };
    let at = |i: u32, j: u32| i % around * across + j % across;
    let quad = |k: u32| {
        let (i, j) = (k / across, k % across);
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    };
    ((0..around * across).map(vertex).collect(), (0..around * across).flat_map(quad).collect())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (positions, faces) = torus();
    let atlas = unwrap_atlas(&positions, &faces, &[], &AtlasSettings::default(), |_progress| ())?;
    let quality = AtlasQuality::of(&atlas);
    println!(
        "{} charts, stretch {:.2} at most, {:.1} m of seams",
        quality.charts, quality.stretch_max, quality.seam_length_m
    );
    assert!(quality.flips == 0 && quality.overlap_pairs == 0);

    let surface = atlas.surface();
    let mut obj = String::new();
    for [x, y, z] in surface.positions() {
        writeln!(obj, "v {x} {y} {z}")?;
    }
    for (face, corners) in (0..).zip(surface.faces()) {
        for barycentric in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let (page, [u, v]) = atlas.uv_of(SurfacePoint { face, barycentric });
            let [columns, rows] = atlas.pages()[page].map(|texels| texels as f64 * atlas.texel_m());
            writeln!(obj, "vt {} {}", u / columns, v / rows)?;
        }
        let [a, b, c] = corners.map(|v| v + 1);
        writeln!(obj, "f {a}/{} {b}/{} {c}/{}", 3 * face + 1, 3 * face + 2, 3 * face + 3)?;
    }
    let path = std::env::temp_dir().join("atlas.obj");
    std::fs::write(&path, obj)?;
    println!("{}", path.display());
    Ok(())
}
