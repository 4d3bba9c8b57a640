//! As-rigid-as-possible layout by alternating a local and a global step (Liu et al. 2008), accelerated.

mod anderson;

use crate::disk::Disk;
use crate::error::Error;
use crate::laplacian::Laplacian;
use crate::parametrizer::tutte::tutte_layout;
use crate::parametrizer::{Layout, Parametrizer, Progress, Stage, StoppingCriterion};
use crate::triangle::{Frame, Jacobian};
use anderson::Anderson;

/// Energies per area below this are rounding.
const ZERO_ENERGY: f64 = 1e-28;
/// How far projections go, over the way to what they project onto: below 2 they converge (over-relaxation), in fewer iterations than with 1.
const RELAXATION: f64 = 1.6;

/// As-rigid-as-possible: the energy `sum A |J - R|^2`, from Tutte's layout. It may fold triangles over.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Arap {
    /// When to stop.
    pub stopping: StoppingCriterion,
}

impl Parametrizer for Arap {
    fn parametrize(&self, disk: &Disk, progress: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
        self.stopping.check()?;
        let (mut laplacian, mut uv) = tutte_layout(disk, progress)?;
        let iterations = minimise_arap(disk, &disk.frames(), &mut laplacian, &mut uv, &self.stopping, progress)?;
        Ok(Layout { uv, iterations })
    }
}

/// Improves `uv` until the energy `sum A |J - R|^2` stops falling; returns the number of iterations.
pub(crate) fn minimise_arap(
    disk: &Disk,
    frames: &[Frame],
    laplacian: &mut Laplacian,
    uv: &mut [[f64; 2]],
    stopping: &StoppingCriterion,
    progress: &mut dyn FnMut(Progress),
) -> Result<usize, Error> {
    laplacian.factorize_cotangent(disk, frames, pin(disk))?;
    Ok(iterate_arap(disk, frames, laplacian, uv, stopping, progress))
}

/// The vertex that stays at the origin.
fn pin(disk: &Disk) -> u32 {
    disk.loops[0][0]
}

/// The iterations of [`minimise_arap`] once the cotangent Laplacian is factorised: they may be gone on with.
pub(crate) fn iterate_arap(
    disk: &Disk,
    frames: &[Frame],
    laplacian: &mut Laplacian,
    uv: &mut [[f64; 2]],
    stopping: &StoppingCriterion,
    progress: &mut dyn FnMut(Progress),
) -> usize {
    let pinned = pin(disk) as usize;
    let area: f64 = frames.iter().map(|f| f.area).sum();
    let size = laplacian.size();
    let mut rotations = vec![[1.0, 0.0]; frames.len()];
    let mut right = vec![0.0; 2 * size];
    let mut anderson = Anderson::new();
    // All u, then all v; the places of hole centres stay zero.
    let mut x = vec![0.0; 2 * size];
    for (v, at) in uv.iter().enumerate() {
        (x[v], x[size + v]) = (at[0], at[1]);
    }
    let mut plain = x.clone();
    let mut last = f64::INFINITY;
    let mut slow = 0;
    let mut iterations = stopping.iterations;
    for iteration in 1..=stopping.iterations {
        let mut energy = local_step(disk, frames, &x, &mut rotations, &mut right) / area;
        if energy > last {
            // The extrapolation went too far; the plain step never does.
            anderson.reset();
            x.copy_from_slice(&plain);
            energy = local_step(disk, frames, &x, &mut rotations, &mut right) / area;
        }
        progress(Progress { stage: Stage::Arap, iteration, energy });
        // Accelerated steps are uneven: one that gains little says nothing yet.
        let gains = last.is_infinite() || last - energy > stopping.tolerance * last;
        slow = if gains { 0 } else { slow + 1 };
        if slow == 2 || energy < ZERO_ENERGY {
            iterations = iteration - 1;
            break;
        }
        last = energy;
        // Global step: L u = sum_t A_t R_t g, with the pin at the origin.
        right[pinned] = 0.0;
        right[size + pinned] = 0.0;
        laplacian.solve(&mut right);
        plain.copy_from_slice(&right);
        x = anderson.next(&x, &plain);
    }
    // The last extrapolation has not been evaluated; the plain step it came from is never worse than its start.
    let best = if iterations == stopping.iterations { &plain } else { &x };
    for (v, at) in uv.iter_mut().enumerate() {
        *at = [best[v], best[size + v]];
    }
    iterations
}

/// The layout whose Jacobians are nearest to given ones, by area (a Poisson problem); the Laplacian is factorised.
pub(crate) fn fit_jacobians(
    disk: &Disk,
    frames: &[Frame],
    jacobians: &[Jacobian],
    laplacian: &mut Laplacian,
) -> Vec<[f64; 2]> {
    let mut right = vec![0.0; 2 * laplacian.size()];
    for ((face, frame), j) in disk.faces.iter().zip(frames).zip(jacobians) {
        ask(face, frame, j, &mut right);
    }
    solve_pinned(disk, laplacian, &mut right);
    (0..disk.positions.len()).map(|v| [right[v], right[laplacian.size() + v]]).collect()
}

/// What a face that wants a Jacobian adds to the right-hand side (all u, then all v).
fn ask(face: &[u32; 3], frame: &Frame, j: &Jacobian, right: &mut [f64]) {
    let (right_u, right_v) = right.split_at_mut(right.len() / 2);
    for (&v, g) in face.iter().zip(frame.g) {
        right_u[v as usize] += frame.area * (j.a * g[0] + j.b * g[1]);
        right_v[v as usize] += frame.area * (j.c * g[0] + j.d * g[1]);
    }
}

/// Solves in place with the pin at the origin.
fn solve_pinned(disk: &Disk, laplacian: &mut Laplacian, right: &mut [f64]) {
    let pinned = pin(disk) as usize;
    (right[pinned], right[laplacian.size() + pinned]) = (0.0, 0.0);
    laplacian.solve(right);
}

/// Local/global iterations towards the nearest layout in which no length is changed by more than the factor `stretch`: every face asks for its
/// own Jacobian, its singular values brought between `1 / stretch` and `stretch`. Faces within stay as they are, so that few iterations do where
/// few faces are beyond; the others ask for more than that (over-relaxed projections). The Laplacian is factorised; it stops where the stretches of
/// the faces ([`Jacobian::largest_stretch`]) are `enough`.
pub(crate) fn iterate_bounded(
    disk: &Disk,
    frames: &[Frame],
    laplacian: &mut Laplacian,
    uv: &mut [[f64; 2]],
    stretch: f64,
    iterations: usize,
    enough: &mut dyn FnMut(&[f64]) -> bool,
) {
    let size = laplacian.size();
    let mut right = vec![0.0; 2 * size];
    let mut stretches = vec![0.0; frames.len()];
    for _ in 0..iterations {
        right.fill(0.0);
        for ((face, frame), found) in disk.faces.iter().zip(frames).zip(&mut stretches) {
            let jacobian = frame.jacobian(face.map(|v| uv[v as usize]));
            *found = jacobian.largest_stretch();
            let wanted =
                if *found > stretch { jacobian.beyond(RELAXATION, &jacobian.bounded(stretch)) } else { jacobian };
            ask(face, frame, &wanted, &mut right);
        }
        if enough(&stretches) {
            return;
        }
        solve_pinned(disk, laplacian, &mut right);
        for (v, at) in uv.iter_mut().enumerate() {
            *at = [right[v], right[size + v]];
        }
    }
}

/// Nearest rotation of every face, the right-hand side they make, and the energy of `x` (all u, then all v).
fn local_step(disk: &Disk, frames: &[Frame], x: &[f64], rotations: &mut [[f64; 2]], right: &mut [f64]) -> f64 {
    let size = right.len() / 2;
    right.fill(0.0);
    let (right_u, right_v) = right.split_at_mut(size);
    let mut energy = 0.0;
    for ((face, frame), rotation) in disk.faces.iter().zip(frames).zip(rotations) {
        let jacobian = frame.jacobian(face.map(|v| [x[v as usize], x[size + v as usize]]));
        // A face that has shrunk to a point keeps its last rotation.
        *rotation = jacobian.nearest_rotation().unwrap_or(*rotation);
        let [cos, sin] = *rotation;
        energy += frame.area * jacobian.rigidity(*rotation);
        for (&v, g) in face.iter().zip(frame.g) {
            right_u[v as usize] += frame.area * (cos * g[0] - sin * g[1]);
            right_v[v as usize] += frame.area * (sin * g[0] + cos * g[1]);
        }
    }
    energy
}
