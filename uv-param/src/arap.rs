//! As-rigid-as-possible layout by alternating a local and a global step (Liu et al. 2008).

use crate::disk::Disk;
use crate::error::Error;
use crate::layout::Laplacian;
use crate::triangle::Frame;
use crate::unwrap::{Progress, Settings, Stage};

/// Improves `uv` until the energy `sum A |J - R|^2` stops falling; returns the number of iterations.
pub(crate) fn arap(
    disk: &Disk,
    frames: &[Frame],
    laplacian: &mut Laplacian,
    uv: &mut [[f64; 2]],
    settings: &Settings,
    progress: &mut dyn FnMut(Progress),
) -> Result<usize, Error> {
    let pinned = disk.loops[0][0];
    laplacian.factorize_cotangent(disk, frames, pinned)?;
    let area: f64 = frames.iter().map(|f| f.area).sum();
    let size = laplacian.size();
    let mut rotations = vec![[1.0, 0.0]; frames.len()];
    let mut right = vec![0.0; 2 * size];
    let mut last = f64::INFINITY;
    for iteration in 1..=settings.iterations {
        right.fill(0.0);
        let energy = local_step(disk, frames, uv, &mut rotations, &mut right) / area;
        progress(Progress { stage: Stage::Arap, iteration, energy });
        if last.is_finite() && last - energy <= settings.tolerance * last {
            return Ok(iteration - 1);
        }
        last = energy;
        // Global step: L u = sum_t A_t R_t g, with the pin at the origin.
        right[pinned as usize] = 0.0;
        right[size + pinned as usize] = 0.0;
        laplacian.solve(&mut right);
        for (v, at) in uv.iter_mut().enumerate() {
            *at = [right[v], right[size + v]];
        }
    }
    Ok(settings.iterations)
}

/// Nearest rotation of every face, its share of the right-hand side, and the energy of `uv`.
fn local_step(disk: &Disk, frames: &[Frame], uv: &[[f64; 2]], rotations: &mut [[f64; 2]], right: &mut [f64]) -> f64 {
    let size = right.len() / 2;
    let (right_u, right_v) = right.split_at_mut(size);
    let mut energy = 0.0;
    for ((face, frame), rotation) in disk.faces.iter().zip(frames).zip(rotations) {
        let jacobian = frame.jacobian(face.map(|v| uv[v as usize]));
        // A face that has shrunk to a point keeps its last rotation.
        *rotation = jacobian.nearest_rotation().unwrap_or(*rotation);
        let [cos, sin] = *rotation;
        energy += frame.area * jacobian.rigidity();
        for (&v, g) in face.iter().zip(frame.g) {
            right_u[v as usize] += frame.area * (cos * g[0] - sin * g[1]);
            right_v[v as usize] += frame.area * (sin * g[0] + cos * g[1]);
        }
    }
    energy
}
