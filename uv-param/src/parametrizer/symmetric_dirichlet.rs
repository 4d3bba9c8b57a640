//! Flip-free layout: projected Newton on the symmetric Dirichlet energy (Smith and Schaefer 2015, Smith et al. 2019).
//!
//! `W = s1^2 + s2^2 + s1^-2 + s2^-2` is infinite for a triangle without area, so a layout that starts without flips and never
//! steps past the first collapse keeps none.

mod local;
mod penalty;

use faer::sparse::linalg::SupernodalThreshold;

use crate::disk::Disk;
use crate::error::Error;
use crate::linear::Spd;
use crate::parametrizer::tutte::tutte_layout;
use crate::parametrizer::{Layout, Parametrizer, Progress, Stage, StoppingCriterion};
use crate::triangle::{Frame, Jacobian, flips};
use local::Local;
pub(crate) use penalty::Penalty;

/// Fraction of the step to the first collapse that is tried.
const COLLAPSE_MARGIN: f64 = 0.9;
/// Sufficient decrease of a step (Armijo; the usual value).
const ARMIJO: f64 = 1e-4;
/// Shortest step relative to the Newton step; below it rounding decides.
const MIN_STEP: f64 = 1e-12;
/// Added to the diagonal, relative to it, so that the projected Hessian stays definite.
const DAMPING: f64 = 1e-10;

/// The symmetric Dirichlet energy, from Tutte's layout: no triangle can fold over.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SymmetricDirichlet {
    /// When to stop.
    pub stopping: StoppingCriterion,
}

impl Parametrizer for SymmetricDirichlet {
    fn parametrize(&self, disk: &Disk, progress: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
        self.stopping.check()?;
        let (_, mut uv) = tutte_layout(disk, progress)?;
        let iterations = minimise_symmetric_dirichlet(disk, &disk.frames(), &mut uv, &self.stopping, progress)?;
        Ok(Layout { uv, iterations })
    }
}

/// Improves a flip-free `uv` until the energy stops falling; returns the number of iterations.
pub(crate) fn minimise_symmetric_dirichlet(
    disk: &Disk,
    frames: &[Frame],
    uv: &mut Vec<[f64; 2]>,
    stopping: &StoppingCriterion,
    progress: &mut dyn FnMut(Progress),
) -> Result<usize, Error> {
    let mut heard = |at: Progress, _: &[[f64; 2]]| {
        progress(at);
        false
    };
    minimise_penalty(disk, frames, uv, Penalty::NONE, &[], stopping, &mut heard)
}

/// The same with a penalty on the worst faces; stops as well when a layout is `enough`. Vertices for which `fixed` holds stay; empty: none.
pub(crate) fn minimise_penalty(
    disk: &Disk,
    frames: &[Frame],
    uv: &mut Vec<[f64; 2]>,
    penalty: Penalty,
    fixed: &[bool],
    stopping: &StoppingCriterion,
    enough: &mut dyn FnMut(Progress, &[[f64; 2]]) -> bool,
) -> Result<usize, Error> {
    let faces = flips(uv, &disk.faces);
    if faces > 0 {
        return Err(Error::CollapsedStart { faces });
    }
    let area: f64 = frames.iter().map(|f| f.area).sum();
    let mut system = Newton::new(disk)?;
    let mut last = energy(disk, frames, uv, penalty);
    for iteration in 1..=stopping.iterations {
        let step = system.step(disk, frames, uv, penalty, fixed)?;
        let Some(next) = line_search(disk, frames, uv, penalty, &step, last) else { return Ok(iteration - 1) };
        // Over 4, so that an isometry reads 1; progress is measured against what is above it.
        let (before, now) = (last / area / 4.0, next / area / 4.0);
        last = next;
        let is_enough = enough(Progress { stage: Stage::SymmetricDirichlet, iteration, energy: now }, uv);
        if is_enough || before - now <= stopping.tolerance * (before - 1.0).max(0.0) + f64::EPSILON {
            return Ok(iteration);
        }
    }
    Ok(stopping.iterations)
}

/// Moves `uv` along a step that lowers the energy enough and flips nothing; returns the new energy, or `None` where rounding
/// leaves no such step.
fn line_search(
    disk: &Disk,
    frames: &[Frame],
    uv: &mut Vec<[f64; 2]>,
    penalty: Penalty,
    step: &Step,
    last: f64,
) -> Option<f64> {
    let limit = COLLAPSE_MARGIN * first_collapse(disk, uv, &step.direction);
    let moved = |length: f64| -> Vec<[f64; 2]> {
        let along = |(at, d): (&[f64; 2], &[f64])| [at[0] + length * d[0], at[1] + length * d[1]];
        uv.iter().zip(step.direction.chunks_exact(2)).map(along).collect()
    };
    // The energy is evaluated in floating point; only the exact predicate promises that nothing flipped.
    let lowers = |trial: &[[f64; 2]], length: f64| {
        let next = energy(disk, frames, trial, penalty);
        (next <= last + ARMIJO * length * step.slope && flips(trial, &disk.faces) == 0).then_some(next)
    };
    let mut length = limit.min(1.0);
    let (mut best, mut next) = loop {
        let trial = moved(length);
        if let Some(next) = lowers(&trial, length) {
            break (trial, next);
        }
        length *= 0.5;
        if length < MIN_STEP {
            return None;
        }
    };
    // Near a collapse Newton is too timid: on 1 / s^2 it grows s by a third only. Go on while that pays.
    while 2.0 * length <= limit {
        length *= 2.0;
        let trial = moved(length);
        match lowers(&trial, length) {
            Some(longer) if longer < next => (best, next) = (trial, longer),
            _ => break,
        }
    }
    *uv = best;
    Some(next)
}

/// `sum A phi(W)`.
fn energy(disk: &Disk, frames: &[Frame], uv: &[[f64; 2]], penalty: Penalty) -> f64 {
    let density = |w: f64| penalty.derivatives(w)[0];
    let of_face = |(f, frame): (&[u32; 3], &Frame)| frame.area * density(jacobian(frame, f, uv).symmetric_dirichlet());
    disk.faces.iter().zip(frames).map(of_face).sum()
}

fn jacobian(frame: &Frame, face: &[u32; 3], uv: &[[f64; 2]]) -> Jacobian {
    frame.jacobian(face.map(|v| uv[v as usize]))
}

/// Smallest step along `direction` at which a triangle loses its area; infinite if none does.
fn first_collapse(disk: &Disk, uv: &[[f64; 2]], direction: &[f64]) -> f64 {
    let mut first = f64::INFINITY;
    for face in &disk.faces {
        let [p0, p1, p2] = face.map(|v| uv[v as usize]);
        let [d0, d1, d2] = face.map(|v| [direction[2 * v as usize], direction[2 * v as usize + 1]]);
        let (e1, e2) = (sub(p1, p0), sub(p2, p0));
        let (f1, f2) = (sub(d1, d0), sub(d2, d0));
        let root = smallest_positive_root(cross(f1, f2), cross(e1, f2) + cross(f1, e2), cross(e1, e2));
        first = first.min(root);
    }
    first
}

/// Smallest positive root of `a t^2 + b t + c`; infinite if there is none.
fn smallest_positive_root(a: f64, b: f64, c: f64) -> f64 {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // The sum of equal signs loses no digits; the other root follows from the product c / a.
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let positive = |t: f64| if t > 0.0 { t } else { f64::INFINITY };
    positive(q / a).min(positive(c / q))
}

fn sub(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// A search direction (u and v of each vertex in turn) and the slope of the energy along it.
struct Step {
    direction: Vec<f64>,
    slope: f64,
}

/// The Newton system: two unknowns per vertex, one symbolic analysis for all iterations.
struct Newton {
    spd: Spd,
    /// Where the 2x2 blocks of each face go: corners (0,0) (1,1) (2,2) (1,0) (2,1) (0,2), each as the two entries that
    /// start its columns.
    places: Vec<[[u32; 2]; 6]>,
}

/// Corner pairs in the order of [`Newton::places`].
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 0), (2, 1), (0, 2)];

impl Newton {
    fn new(disk: &Disk) -> Result<Self, Error> {
        let mut below = Vec::with_capacity(7 * disk.faces.len());
        below.extend((0..disk.positions.len() as u32).map(|v| (2 * v + 1, 2 * v)));
        for h in 0..disk.twins.len() {
            if (h as u32) < disk.twins[h] {
                let face = disk.faces[h / 3];
                let (a, b) = (face[h % 3], face[(h + 1) % 3]);
                let (i, j) = (2 * a.max(b), 2 * a.min(b));
                below.extend([(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)]);
            }
        }
        let spd = Spd::new(2 * disk.positions.len(), &below, SupernodalThreshold::FORCE_SUPERNODAL)?;
        let places = disk
            .faces
            .iter()
            .map(|face| {
                PAIRS.map(|(k, l)| {
                    let (i, j) = (2 * face[k].max(face[l]), 2 * face[k].min(face[l]));
                    // The two rows of a block follow each other in both of its columns; on the diagonal the second
                    // column starts one row lower.
                    let second = if i == j { spd.entry(i + 1, j + 1) } else { spd.entry(i, j + 1) };
                    [spd.entry(i, j) as u32, second as u32]
                })
            })
            .collect();
        Ok(Self { spd, places })
    }

    /// Solves `H p = -gradient` with every triangle's Hessian projected to be semi-definite.
    fn step(
        &mut self,
        disk: &Disk,
        frames: &[Frame],
        uv: &[[f64; 2]],
        penalty: Penalty,
        fixed: &[bool],
    ) -> Result<Step, Error> {
        let stays = |v: u32| fixed.get(v as usize) == Some(&true);
        self.spd.values.fill(0.0);
        let mut gradient = vec![0.0; 2 * uv.len()];
        for ((face, frame), places) in disk.faces.iter().zip(frames).zip(&self.places) {
            let local = Local::new(frame, jacobian(frame, face, uv), penalty);
            for (k, &v) in face.iter().enumerate().filter(|(_, v)| !stays(**v)) {
                let g = local.gradient(k);
                gradient[2 * v as usize] += g[0];
                gradient[2 * v as usize + 1] += g[1];
            }
            for ((k, l), place) in PAIRS.into_iter().zip(places) {
                // What stays has no equations but those of its diagonal.
                if k != l && (stays(face[k]) || stays(face[l])) {
                    continue;
                }
                // The block of the larger vertex's rows and the smaller one's columns.
                let (k, l) = if face[k] >= face[l] { (k, l) } else { (l, k) };
                let [[uu, uv], [vu, vv]] = local.block(k, l);
                let [first, second] = place.map(|p| p as usize);
                self.spd.values[first] += uu;
                self.spd.values[first + 1] += vu;
                if k == l {
                    self.spd.values[second] += vv;
                } else {
                    self.spd.values[second] += uv;
                    self.spd.values[second + 1] += vv;
                }
            }
        }
        for i in 0..gradient.len() as u32 {
            let diagonal = self.spd.diagonal(i);
            self.spd.values[diagonal] *= 1.0 + DAMPING;
        }
        self.spd.factorize()?;
        let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
        self.spd.solve(&mut direction);
        let slope = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        Ok(Step { direction, slope })
    }
}
