//! Broken meshes of all kinds through `unwrap_atlas`.

use std::collections::BTreeMap;
use std::panic::catch_unwind;

use cpu_time::ThreadTime;
use serde_json::json;
use uv_param::atlas::{AtlasQuality, PackSettings};
use uv_param::{Atlas, AtlasSettings, unwrap_atlas};

use crate::Rng;

type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Prints one line about the meshes of some seeds: how many were laid out and refused, and of the atlases what they promise not to be. Flips in
/// single precision are only counted: a part may be smaller than single precision is on a page that holds another one a million times its
/// size. An error if any mesh panicked or breaks a promise.
///
/// # Errors
/// What was found.
pub fn run(first: u64, count: u64) -> Result<(), Box<dyn std::error::Error>> {
    let settings =
        AtlasSettings { pack: PackSettings { texel_m: 0.02, ..PackSettings::default() }, ..AtlasSettings::default() };
    let (mut laid_out, mut panics, mut broken, mut not_finite, mut in_f32) = (0_u64, 0_u64, 0_u64, 0_u64, 0_u64);
    let mut largest_overlap = 0.0_f64;
    let mut refused: BTreeMap<String, u64> = BTreeMap::new();
    let (mut longest, mut longest_seed, mut faces) = (0.0_f64, 0, 0);
    for seed in first..first.saturating_add(count) {
        let mesh = fuzzed(&mut Rng::new(seed));
        faces += mesh.1.len();
        let clock = ThreadTime::now();
        let found = catch_unwind(|| unwrap_atlas(&mesh.0, &mesh.1, &[], &settings, |_| ()));
        let seconds = clock.elapsed().as_secs_f64();
        if seconds > longest {
            (longest, longest_seed) = (seconds, seed);
        }
        match found {
            Err(_) => {
                eprintln!("seed {seed} panicked");
                panics += 1;
            }
            Ok(Err(error)) => *refused.entry(kind(&error)).or_default() += 1,
            Ok(Ok(atlas)) => {
                laid_out += 1;
                not_finite += u64::from(!finite(&atlas));
                let q = AtlasQuality::of(&atlas);
                largest_overlap = largest_overlap.max(q.overlap_share);
                in_f32 += u64::from(q.flips_f32 > 0);
                if q.flips + q.overlap_pairs > 0 || q.stretch_max > settings.charts.worst_stretch {
                    let (flips, overlaps, share, stretch) = (q.flips, q.overlap_pairs, q.overlap_share, q.stretch_max);
                    eprintln!(
                        "seed {seed}: {flips} flips, {overlaps} overlaps, {share:e} of the area, stretch {stretch}"
                    );
                    broken += 1;
                }
            }
        }
    }
    println!(
        "{}",
        json!({
            "fig": "uv-param_fuzz", "meshes": count, "faces": faces, "laid_out": laid_out, "refused": refused, "panics": panics,
            "not_finite": not_finite, "broken": broken, "flips_in_f32": in_f32,
            "largest_overlap_share": largest_overlap, "longest_s": longest, "longest_seed": longest_seed,
        })
    );
    if panics + not_finite + broken > 0 { Err("an atlas breaks what it promises".into()) } else { Ok(()) }
}

/// The variant of an error.
fn kind(error: &uv_param::Error) -> String {
    format!("{error:?}").split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().into()
}

fn finite(atlas: &Atlas) -> bool {
    let quality = AtlasQuality::of(atlas);
    let figures = [quality.utilisation, quality.seam_relative, quality.stretch_p99, quality.stretch_max];
    let places = atlas.charts().iter().zip(atlas.placements());
    figures.iter().all(|x| x.is_finite())
        && places.flat_map(|(c, p)| c.uv().iter().map(|&uv| p.apply(uv))).flatten().all(f64::is_finite)
}

/// One to 45 pieces, joined into one mesh and then damaged in several ways.
fn fuzzed(rng: &mut Rng) -> Mesh {
    let parts = [1, 1, 1, 2, 3, 5, 45][below(rng, 7)];
    let mut mesh = Mesh::default();
    for _ in 0..parts {
        let (positions, faces) = piece(rng);
        let first = mesh.0.len() as u32;
        let (shift, scale) = ([0; 3].map(|_| rng.between(-1.0, 1.0)), 10.0_f64.powf(rng.between(-1.5, 0.3)));
        mesh.0.extend(positions.iter().map(|p| [0, 1, 2].map(|k| scale * p[k] + shift[k])));
        mesh.1.extend(faces.iter().map(|f| f.map(|v| v + first)));
    }
    for _ in 0..below(rng, 5) {
        damage(rng, &mut mesh);
    }
    if rng.unit() < 0.01 {
        mesh.1.clear();
    }
    mesh
}

/// A grid rolled into a patch, a tube, a torus or a ball, rough or smooth; or a soup.
fn piece(rng: &mut Rng) -> Mesh {
    let (columns, rows) = (2 + below(rng, 9), 2 + below(rng, 9));
    let rough = if rng.unit() < 0.5 { 0.0 } else { 10.0_f64.powf(rng.between(-3.0, -0.5)) };
    let shape = below(rng, 5);
    if shape == 4 {
        let count = 3 + below(rng, 20);
        let positions = (0..count).map(|_| [0; 3].map(|_| (4.0 * rng.unit()).round() / 4.0)).collect();
        let faces = (0..=below(rng, 40)).map(|_| [0; 3].map(|_| below(rng, count) as u32)).collect();
        return (positions, faces);
    }
    let closed = [shape > 0, shape == 2];
    let sides = [columns + usize::from(!closed[0]), rows + usize::from(!closed[1])];
    let mut positions = Vec::new();
    for j in 0..sides[1] {
        for i in 0..sides[0] {
            let (s, t) = (i as f64 / columns as f64, j as f64 / rows as f64);
            let (a, b) = (std::f64::consts::TAU * s, std::f64::consts::TAU * t);
            let p = match shape {
                0 => [s, t, 0.3 * (3.0 * s).sin() * t],
                1 => [a.cos(), a.sin(), 2.0 * t],
                2 => [(2.0 + b.cos()) * a.cos(), (2.0 + b.cos()) * a.sin(), b.sin()],
                _ => [(b / 2.0).sin() * a.cos(), (b / 2.0).sin() * a.sin(), -(b / 2.0).cos()],
            };
            positions.push(p.map(|x| x + rough * (rng.unit() - 0.5)));
        }
    }
    let at = |i: usize, j: usize| ((j % sides[1]) * sides[0] + i % sides[0]) as u32;
    let squares = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let faces = squares
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    (positions, faces)
}

fn damage(rng: &mut Rng, (positions, faces): &mut Mesh) {
    let (vertex, face) = (below(rng, positions.len()), below(rng, faces.len()));
    match below(rng, 14) {
        // Seldom, since nothing else counts then.
        0 if rng.unit() < 0.2 => positions[vertex][below(rng, 3)] = [f64::NAN, f64::INFINITY, -1e308][below(rng, 3)],
        1 if rng.unit() < 0.2 => faces[face][below(rng, 3)] = u32::MAX - below(rng, 2) as u32,
        2 => faces.push(faces[face]),
        3 => faces.push([faces[face][0], faces[face][2], faces[face][1]]),
        4 => faces[face][1] = faces[face][0],
        5 => positions[vertex] = positions[below(rng, positions.len())],
        6 => {
            let [a, b, _] = faces[face];
            faces.push([a, b, vertex as u32]);
        }
        7 => faces[face].swap(1, 2),
        8 => {
            let keep = rng.between(0.2, 1.0);
            faces.retain(|_| rng.unit() < keep);
        }
        9 => positions.push([rng.unit(), rng.unit(), 1e6 * rng.unit()]),
        10 => {
            let scale = 10.0_f64.powf(rng.between(-9.0, 9.0));
            for p in positions.iter_mut() {
                *p = p.map(|x| scale * x);
            }
        }
        11 => {
            let axis = below(rng, 3);
            for p in positions.iter_mut() {
                p[axis] = 0.0;
            }
        }
        12 => {
            for _ in 0..below(rng, faces.len() + 1) {
                let f = below(rng, faces.len());
                faces[f].rotate_left(1);
                faces[f][2] = below(rng, positions.len()) as u32;
            }
        }
        _ => {
            // A needle.
            let [a, b, c] = faces[face].map(|v| (v as usize).min(positions.len() - 1));
            positions[c] =
                [0, 1, 2].map(|k| positions[a][k] + (1.0 + 1e-12) * 0.5 * (positions[b][k] - positions[a][k]));
        }
    }
    if faces.is_empty() {
        faces.push([0, 1, 2]);
    }
}

fn below(rng: &mut Rng, count: usize) -> usize {
    ((rng.unit() * count as f64) as usize).min(count.saturating_sub(1))
}
