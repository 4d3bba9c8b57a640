use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Board, Limits, Painter, Painting, Task};
use crate::projected_lbfgs::{Stop, minimise};
use crate::saturation::Saturation;

/// Non-negative deconvolution with the spray kernel: the volumes of all cells at once, optimal in ink.
///
/// Minimises `½ Σ w (f(c₀ + G v) - y)²` over `0 ≤ v ≤ v_max` by projected L-BFGS, from the flat start
/// `mean(f⁻¹(y)) · cell area / footprint mass`. Ours; the papers' painter is a network, and their "ideal" a Gaussian filter.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Deconvolution {
    /// Largest number of iterations. Default 200, ours.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row. Default 1e-5, ours.
    pub tolerance: f64,
}

impl Default for Deconvolution {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-5 }
    }
}

impl Painter for Deconvolution {
    fn name(&self) -> &'static str {
        "deconvolution"
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        let board = Board::new(task, kernel, saturation, limits)?;
        let mut volumes = flat_start(task, &board, kernel, saturation, limits);
        let stop = Stop { iterations: self.iterations, relative_decrease: self.tolerance };
        fit(task, &board, saturation, &board.ceiling, &mut volumes, &stop, progress);
        prune(task, &board, saturation, limits, &mut volumes, &stop);
        progress(1.0);
        Ok(board.painting(&volumes, saturation))
    }
}

/// Every paintable cell gets the volume that would give the mean missing depth everywhere.
fn flat_start(task: &Task, board: &Board, kernel: &SprayKernel, saturation: &Saturation, limits: &Limits) -> Vec<f64> {
    let (mut missing, mut pixels) = (0.0, 0.0);
    for (k, (&ink, &depth)) in task.reference.data().iter().zip(board.bare.data()).enumerate() {
        if task.weight(k) > 0.0 {
            missing += (saturation.inverse(ink) - depth).max(0.0);
            pixels += 1.0;
        }
    }
    let volume = missing / pixels * (limits.along * limits.row_spacing) as f64 / kernel.mass();
    board.ceiling.iter().map(|&top| volume.min(top)).collect()
}

/// Fits the volumes under their ceilings so that the ink comes as near the reference as it can.
pub(crate) fn fit(
    task: &Task,
    board: &Board,
    saturation: &Saturation,
    ceiling: &[f64],
    volumes: &mut Vec<f64>,
    stop: &Stop,
    progress: &mut dyn FnMut(f64),
) {
    let mut canvas = board.bare.data().to_vec();
    let mut cost = |v: &[f64], gradient: &mut [f64]| {
        canvas.copy_from_slice(board.bare.data());
        board.footprints.add(v, &mut canvas);
        let value = ink_cost(task, task.reference, saturation, &mut canvas);
        board.footprints.gather(&canvas, gradient);
        value
    };
    minimise(volumes, ceiling, stop, &mut cost, progress);
}

/// `½ Σ w (f(c) - y)²`; replaces the canvas by its derivative with respect to each pixel's depth.
pub(crate) fn ink_cost(task: &Task, reference: &Image, saturation: &Saturation, canvas: &mut [f64]) -> f64 {
    let mut value = 0.0;
    for (k, (depth, wanted)) in canvas.iter_mut().zip(reference.data()).enumerate() {
        let weight = task.weight(k);
        let miss = saturation.forward(*depth) - wanted;
        value += 0.5 * weight * miss * miss;
        *depth = weight * miss * saturation.derivative(*depth);
    }
    value
}

/// Drops sprays below the smallest volume and beyond the largest number, refitting the rest in between.
pub(crate) fn prune(
    task: &Task,
    board: &Board,
    saturation: &Saturation,
    limits: &Limits,
    volumes: &mut Vec<f64>,
    stop: &Stop,
) {
    let refit = Stop { iterations: stop.iterations.min(40), relative_decrease: stop.relative_decrease };
    prune_with(board, limits, volumes, &mut |ceiling, volumes| {
        fit(task, board, saturation, ceiling, volumes, &refit, &mut |_| ());
    });
}

/// The same for any way to refit the volumes under their ceilings.
pub(crate) fn prune_with(
    board: &Board,
    limits: &Limits,
    volumes: &mut Vec<f64>,
    refit: &mut dyn FnMut(&[f64], &mut Vec<f64>),
) {
    // Dropping all small ones at once would drop neighbours that could have stood in for each other: halve the bar twice.
    for share in [0.25, 0.5, 1.0] {
        let bar = share * limits.min_volume;
        let mut keep: Vec<bool> = volumes.iter().map(|&v| v > bar).collect();
        if let Some(most) = limits.max_sprays {
            let mut order: Vec<usize> = (0..volumes.len()).filter(|&k| keep[k]).collect();
            let target = most + ((1.0 - share) * order.len().saturating_sub(most) as f64) as usize;
            order.sort_by(|&a, &b| volumes[b].total_cmp(&volumes[a]).then(a.cmp(&b)));
            order.iter().skip(target).for_each(|&k| keep[k] = false);
        }
        if keep.iter().zip(volumes.iter()).all(|(&kept, &v)| kept || v == 0.0) {
            continue;
        }
        let ceiling: Vec<f64> =
            board.ceiling.iter().zip(&keep).map(|(&top, &kept)| if kept { top } else { 0.0 }).collect();
        refit(&ceiling, volumes);
    }
    // The refit may have pushed a survivor below the bar: the bar is a promise.
    volumes.iter_mut().filter(|v| **v < limits.min_volume).for_each(|v| *v = 0.0);
}
