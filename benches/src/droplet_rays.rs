//! Droplets as rays on a mesh of a million triangles, for `droplet_peers.py` to cast as well.

use std::error::Error;
use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};
use paint_sim::droplets::Droplets;
use paint_sim::{SprayModel, Surface, TriangleSurface};
use serde_json::json;

use crate::cpu::median_seconds;
use crate::npy;

/// Cells of the wall along its width and height; two triangles each.
const CELLS: [usize; 2] = [1024, 489];
/// Width and height of the wall, metres.
const SIZE: [f64; 2] = [4.6, 2.2];
/// Cones of 1024 droplets: about a million rays.
const CONES: usize = 977;
const DROPLETS: usize = 1024;
/// Sets of droplets that the cones take in turns.
const SETS: u64 = 16;
/// Rays that meet nothing before, metres.
const FARTHEST: f64 = 10.0;
/// What stands for a ray that meets nothing.
const NOTHING: f64 = -1.0;

/// What was cast, and how fast.
pub struct Cast {
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Rays.
    pub rays: usize,
    /// Rays that meet nothing.
    pub misses: usize,
    /// Median over the runs of the processor time for all rays, milliseconds.
    pub cpu_ms: f64,
}

/// How far the wall stands out, metres: bulges, ledges and roughness.
fn relief(y: f64, z: f64) -> f64 {
    0.2 * (2.4 * y + 0.3).sin() * (2.1 * z).cos()
        + 0.05 * (5.0 * y + 1.0).sin() * (6.1 * z + 0.5).sin()
        + 0.012 * (11.0 * y).cos() * (9.0 * z).sin()
        + 0.0015 * (29.0 * y).sin() * (31.0 * z).cos()
}

/// Vertices and triangles of an uneven wall that faces -x, z up.
fn wall() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let [columns, rows] = CELLS;
    let place = |row: usize, column: usize| {
        let y = SIZE[0] * (0.5 - column as f64 / columns as f64);
        let z = SIZE[1] * row as f64 / rows as f64;
        [-relief(y, z) as f32, y as f32, z as f32]
    };
    let positions = (0..=rows).flat_map(|row| (0..=columns).map(move |column| place(row, column))).collect();
    let at = |row: usize, column: usize| (row * (columns + 1) + column) as u32;
    let cell = |row: usize, column: usize| {
        let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
        [[a, b, c], [a, c, d]]
    };
    let faces = (0..rows).flat_map(|row| (0..columns).flat_map(move |column| cell(row, column))).collect();
    (positions, faces)
}

/// A cone: where it starts, and its droplets' directions. In single precision, so that the peer casts the same.
struct ConeRays {
    origin: [f32; 3],
    directions: Vec<[f32; 3]>,
}

/// Cones of the default spray in rows over the wall, `stand_off` metres before it.
fn cones(stand_off: f64) -> Result<Vec<ConeRays>, paint_sim::Error> {
    let sets = Droplets::sets(&SprayModel::default(), DROPLETS, SETS)?;
    let per_row = 2 * CONES.isqrt();
    let rows = CONES.div_ceil(per_row);
    let cone = |k: usize| {
        let (column, row) = (k % per_row, k / per_row);
        let part = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        let y = 0.8 * SIZE[0] * (0.5 - part(column, per_row));
        let z = SIZE[1] * (0.1 + 0.8 * part(row, rows));
        let origin = [-relief(y, z) - stand_off, y, z].map(|v| v as f32);
        // Aimed a little to all sides.
        let axis = Vector3::new(1.0, 0.3 * (k as f64).sin(), 0.3 * (0.7 * k as f64).cos()).normalize();
        let left = Vector3::z().cross(&axis).normalize();
        let world_from_nozzle = Matrix3::from_columns(&[left, axis.cross(&left), axis]);
        let direction = |[x, y]: [f32; 2]| {
            let direction = world_from_nozzle * Vector3::new(f64::from(x), f64::from(y), 1.0);
            direction.normalize().map(|v| v as f32).into()
        };
        ConeRays { origin, directions: sets[k % sets.len()].slopes().map(direction).collect() }
    };
    Ok((0..CONES).map(cone).collect())
}

/// Casts the droplets of all cones, and writes mesh, rays and the triangles that they meet into a folder.
///
/// # Errors
/// A folder that cannot be written, a distance that is no number.
pub fn run(folder: &Path, stand_off: f64, runs: usize) -> Result<Cast, Box<dyn Error>> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let (positions, faces) = wall();
    let surface = TriangleSurface::new(&positions, &faces)?;
    let cones = cones(stand_off)?;
    let wide: Vec<(Point3<f64>, Vec<Vector3<f64>>)> = cones
        .iter()
        .map(|cone| {
            let directions = cone.directions.iter().map(|d| Vector3::from(d.map(f64::from))).collect();
            (Point3::from(cone.origin.map(f64::from)), directions)
        })
        .collect();
    let ids = || {
        let cast = |(origin, directions): &(Point3<f64>, Vec<Vector3<f64>>)| {
            surface.cast_beam(origin, directions, FARTHEST).into_iter()
        };
        wide.iter().flat_map(cast).map(|hit| hit.map_or(NOTHING, |hit| f64::from(hit.face))).collect::<Vec<f64>>()
    };
    let hits = ids();
    let each = |of: fn(&ConeRays, usize) -> [f32; 3]| {
        cones.iter().flat_map(move |cone| (0..cone.directions.len()).flat_map(move |k| of(cone, k).map(f64::from)))
    };
    npy::save(folder, "positions", positions.iter().flatten().map(|v| f64::from(*v)))?;
    npy::save(folder, "faces", faces.iter().flatten().map(|v| f64::from(*v)))?;
    npy::save(folder, "origins", each(|cone, _| cone.origin))?;
    npy::save(folder, "directions", each(|cone, k| cone.directions[k]))?;
    npy::save(folder, "ids", hits.iter().copied())?;
    let misses = hits.iter().filter(|id| **id == NOTHING).count();
    let cpu_ms = 1e3 * median_seconds(runs, ids);
    Ok(Cast { triangles: faces.len(), rays: hits.len(), misses, cpu_ms })
}

/// [`run`], told as a line of JSON.
///
/// # Errors
/// As [`run`].
pub fn print(folder: &Path, stand_off: f64, runs: usize) -> Result<(), Box<dyn Error>> {
    let cast = run(folder, stand_off, runs)?;
    let per_second = cast.rays as f64 / cast.cpu_ms * 1e-3;
    println!(
        "{}",
        json!({
            "fig": "droplet_rays", "peer": "paint-sim", "rays": cast.rays, "triangles": cast.triangles, "runs": runs.max(1),
            "cpu_ms": cast.cpu_ms, "million_per_second": per_second, "misses": cast.misses,
        })
    );
    Ok(())
}
