//! The least-squares fit in ink that all painters on a grid share, and the dropping of sprays that are not worth it.

use crate::model::Saturation;
use crate::optimise::{StoppingRule, minimise};
use crate::problem::{Limits, PaintGrid, PaintProblem};

/// Fits the volumes under their upper bounds so that the ink comes as near the reference as it can.
pub(super) fn fit(
    problem: &PaintProblem,
    grid: &PaintGrid,
    upper_bounds: &[f64],
    volumes: &mut Vec<f64>,
    stop: &StoppingRule,
    progress: &mut dyn FnMut(f64),
) {
    let mut canvas = grid.initial.data().to_vec();
    let mut cost = |v: &[f64], gradient: &mut [f64]| {
        canvas.copy_from_slice(grid.initial.data());
        grid.footprints.deposit(v, &mut canvas);
        problem.settle(grid.initial.data(), &mut canvas);
        let value = ink_cost(problem, problem.saturation, &mut canvas);
        problem.settle_adjoint(&mut canvas);
        grid.footprints.adjoint(&canvas, gradient);
        value
    };
    minimise(volumes, upper_bounds, stop, &mut cost, progress);
}

/// `½ Σ w (f(c) - y)²`, and what stands above the ceiling; replaces the canvas by its derivative with respect to each pixel's depth.
///
/// The saturation is an argument of its own so that the compiler knows that writing the canvas does not change it.
pub(super) fn ink_cost(problem: &PaintProblem, saturation: &Saturation, canvas: &mut [f64]) -> f64 {
    let mut value = 0.0;
    for (k, (depth, wanted)) in canvas.iter_mut().zip(problem.reference.data()).enumerate() {
        let (ink, slope) = saturation.forward_and_derivative(*depth);
        let (residual, above) = (ink - wanted, problem.above_ceiling(k, ink));
        let weight = problem.weight_of(k, residual);
        value += 0.5 * (weight * residual * residual + PaintProblem::CEILING_WEIGHT * above * above);
        *depth = (weight * residual + PaintProblem::CEILING_WEIGHT * above) * slope;
    }
    value
}

/// Drops sprays below the smallest volume and beyond the largest number, refitting the rest in between.
pub(super) fn prune(problem: &PaintProblem, grid: &PaintGrid, volumes: &mut Vec<f64>, stop: &StoppingRule) {
    let stop = StoppingRule { iterations: stop.iterations.min(40), relative_decrease: stop.relative_decrease };
    prune_with(&grid.upper_bounds, problem.limits, volumes, &mut |upper_bounds, volumes| {
        fit(problem, grid, upper_bounds, volumes, &stop, &mut |_| ());
    });
}

/// The same for any way to refit the volumes under their upper bounds.
pub(super) fn prune_with(
    most: &[f64],
    limits: &Limits,
    volumes: &mut Vec<f64>,
    refit: &mut dyn FnMut(&[f64], &mut Vec<f64>),
) {
    // Dropping all small ones at once would drop neighbours that could have stood in for each other: the threshold rises in
    // three steps.
    for share in [0.25, 0.5, 1.0] {
        let threshold = share * limits.min_volume;
        let mut keep: Vec<bool> = volumes.iter().map(|&v| v > threshold).collect();
        if let Some(count) = limits.max_sprays {
            let mut order: Vec<usize> = (0..volumes.len()).filter(|&k| keep[k]).collect();
            let target = count + ((1.0 - share) * order.len().saturating_sub(count) as f64) as usize;
            order.sort_by(|&a, &b| volumes[b].total_cmp(&volumes[a]).then(a.cmp(&b)));
            order.iter().skip(target).for_each(|&k| keep[k] = false);
        }
        if keep.iter().zip(volumes.iter()).all(|(&kept, &v)| kept || v == 0.0) {
            continue;
        }
        let upper_bounds: Vec<f64> =
            most.iter().zip(&keep).map(|(&upper, &kept)| if kept { upper } else { 0.0 }).collect();
        refit(&upper_bounds, volumes);
    }
    // The refit may have pushed a survivor below the threshold, which is a promise.
    volumes.iter_mut().filter(|v| **v < limits.min_volume).for_each(|v| *v = 0.0);
}

/// The volume of every cell that would give the mean missing depth everywhere: where a fit starts.
pub(super) fn uniform_volume(problem: &PaintProblem, grid: &PaintGrid) -> f64 {
    let (mut missing, mut pixels) = (0.0, 0.0);
    for (k, (&ink, &depth)) in problem.reference.data().iter().zip(grid.initial.data()).enumerate() {
        if problem.weight(k) > 0.0 {
            missing += (problem.saturation.inverse(ink) - depth).max(0.0);
            pixels += 1.0;
        }
    }
    let limits = problem.limits;
    missing / pixels * (limits.spray_spacing * limits.row_spacing) as f64 / problem.kernel.mass()
}

/// Ink that is wanted and not there yet, 0 beside the surface.
pub(super) fn missing_ink(problem: &PaintProblem, grid: &PaintGrid) -> Vec<f64> {
    let there = grid.initial.data().iter().map(|&depth| problem.saturation.forward(depth));
    let wanted = problem.reference.data().iter().enumerate();
    wanted.zip(there).map(|((k, ink), there)| if problem.weight(k) > 0.0 { ink - there } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    /// The derivative against differences of the cost, with ink that is missing, too much, and above a ceiling.
    #[test]
    fn the_derivative_is_that_of_the_cost() {
        let image = |values: [f64; 4]| Image::new(4, 1, values.to_vec()).unwrap();
        let reference = image([0.2, 0.6, 0.1, 0.9]);
        let (weight, missing, ceiling) = (image([1.0, 0.5, 2.0, 1.0]), image([3.0; 4]), image([0.9, 0.9, 0.3, 1.0]));
        let problem =
            PaintProblem::new(&reference).with_weight(&weight).with_missing_weight(&missing).with_ceiling(&ceiling);
        let depths = [0.5, 0.3, 0.6, 0.2];
        let cost = |depths: [f64; 4]| ink_cost(&problem, problem.saturation, &mut { depths });
        let mut derivative = depths;
        ink_cost(&problem, problem.saturation, &mut derivative);
        for k in 0..4 {
            let moved = |by: f64| {
                let mut depths = depths;
                depths[k] += by;
                cost(depths)
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!(
                (derivative[k] - difference).abs() < 1e-6 * difference.abs().max(1.0),
                "{k}: {derivative:?} {difference}"
            );
        }
    }
}
