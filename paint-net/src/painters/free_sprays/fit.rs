//! The joint fit of all positions, volumes and spreads.

use std::f64::consts::PI;

use super::free_spray::{FreeSpray, SprayBounds};
use super::rasteriser::{Rasteriser, SprayGradient};
use crate::optimise::{StoppingRule, minimise};

/// Volume below which a spray counts as one of this volume where its place is measured: what has no paint has no place.
const MIN_VOLUME_SCALE: f64 = 0.05;

/// Moves, fills, opens and closes the sprays so that the ink comes as near the reference as it can; the cost never rises.
///
/// Projected L-BFGS on variables of one scale: each is measured by the root of what its square costs on white paper under a
/// linear saturation curve, `Σ (∂g/∂·)²` over all pixels, which is `πσ²` for the volume, `πv²/2` for the place and `2πv²` for the
/// spread.
pub(super) fn fit(
    rasteriser: &mut Rasteriser,
    sprays: &mut [FreeSpray],
    bounds: &SprayBounds,
    stop: &StoppingRule,
    progress: &mut dyn FnMut(f64),
) {
    if sprays.is_empty() {
        return;
    }
    let boxes: Vec<Variables> = sprays.iter().map(|s| Variables::of(s, rasteriser, bounds)).collect();
    let mut values: Vec<f64> = sprays.iter().zip(&boxes).flat_map(|(s, b)| b.values(s)).collect();
    let upper_bounds: Vec<f64> = boxes.iter().flat_map(Variables::upper_bounds).collect();
    let mut gradients = vec![SprayGradient::default(); sprays.len()];
    let set = |values: &[f64], sprays: &mut [FreeSpray]| {
        for ((spray, b), v) in sprays.iter_mut().zip(&boxes).zip(values.chunks_exact(4)) {
            *spray = b.spray(v);
        }
    };
    let mut cost = |values: &[f64], gradient: &mut [f64]| {
        set(values, sprays);
        let cost = rasteriser.render(sprays);
        rasteriser.backward(sprays, &mut gradients);
        for ((slope, b), g) in gradients.iter().zip(&boxes).zip(gradient.chunks_exact_mut(4)) {
            let by = [slope.x, slope.y, slope.volume, slope.sigma];
            g.iter_mut().zip(by).zip(b.scale).for_each(|((g, by), scale)| *g = f64::from(by) / scale);
        }
        cost
    };
    minimise(&mut values, &upper_bounds, stop, &mut cost, progress);
    set(&values, sprays);
}

/// The box in which a spray may change (column, row, volume, spread), and the scale of each variable.
struct Variables {
    low: [f64; 4],
    high: [f64; 4],
    scale: [f64; 4],
}

impl Variables {
    fn of(spray: &FreeSpray, rasteriser: &Rasteriser, bounds: &SprayBounds) -> Self {
        let ([left, right], [top, bottom]) = rasteriser.position_bounds(spray);
        let volume = f64::from(spray.volume).max(MIN_VOLUME_SCALE);
        let place = (0.5 * PI).sqrt() * volume;
        Self {
            low: [left, top, 0.0, bounds.min_sigma.into()],
            high: [right, bottom, bounds.max_volume.into(), bounds.max_sigma.into()],
            scale: [place, place, PI.sqrt() * f64::from(spray.sigma), (2.0 * PI).sqrt() * volume],
        }
    }

    fn values(&self, spray: &FreeSpray) -> [f64; 4] {
        let at = [spray.x, spray.y, spray.volume, spray.sigma];
        std::array::from_fn(|d| (f64::from(at[d]) - self.low[d]) * self.scale[d])
    }

    fn upper_bounds(&self) -> [f64; 4] {
        std::array::from_fn(|d| (self.high[d] - self.low[d]) * self.scale[d])
    }

    fn spray(&self, values: &[f64]) -> FreeSpray {
        let at = |d: usize| (self.low[d] + values[d] / self.scale[d]) as f32;
        FreeSpray { x: at(0), y: at(1), volume: at(2), sigma: at(3) }
    }
}
