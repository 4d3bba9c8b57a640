//! All places, volumes and spreads at once.

use std::f64::consts::PI;

use super::scene::{Scene, Slope};
use super::{Nozzle, Splat};
use crate::projected_lbfgs::{Stop, minimise};

/// Volume below which a splat counts as one of this volume where its place is measured: what has no paint has no place.
const LEAST: f64 = 0.05;

/// Moves, fills, opens and closes the splats so that the ink comes as near the reference as it can; the cost never rises.
///
/// Projected L-BFGS on variables of one scale: each is measured by the root of what its square costs on white paper under a
/// wide open law, `Σ (∂g/∂·)²` over all pixels, which is `πσ²` for the volume, `πv²/2` for the place and `2πv²` for the
/// spread.
pub(super) fn fit(
    scene: &mut Scene,
    splats: &mut [Splat],
    nozzle: &Nozzle,
    stop: &Stop,
    progress: &mut dyn FnMut(f64),
) {
    if splats.is_empty() {
        return;
    }
    let boxes: Vec<Variables> = splats.iter().map(|s| Variables::of(s, scene, nozzle)).collect();
    let mut values: Vec<f64> = splats.iter().zip(&boxes).flat_map(|(s, b)| b.values(s)).collect();
    let ceiling: Vec<f64> = boxes.iter().flat_map(Variables::ceiling).collect();
    let mut slopes = vec![Slope::default(); splats.len()];
    let set = |values: &[f64], splats: &mut [Splat]| {
        for ((splat, b), v) in splats.iter_mut().zip(&boxes).zip(values.chunks_exact(4)) {
            *splat = b.splat(v);
        }
    };
    let mut cost = |values: &[f64], gradient: &mut [f64]| {
        set(values, splats);
        let cost = scene.look(splats);
        scene.gather(splats, &mut slopes);
        for ((slope, b), g) in slopes.iter().zip(&boxes).zip(gradient.chunks_exact_mut(4)) {
            let by = [slope.x, slope.y, slope.volume, slope.sigma];
            g.iter_mut().zip(by).zip(b.scale).for_each(|((g, by), scale)| *g = f64::from(by) / scale);
        }
        cost
    };
    minimise(&mut values, &ceiling, stop, &mut cost, progress);
    set(&values, splats);
}

/// The box in which a splat may change (column, row, volume, spread), and the scale of each variable.
struct Variables {
    low: [f64; 4],
    high: [f64; 4],
    scale: [f64; 4],
}

impl Variables {
    fn of(splat: &Splat, scene: &Scene, nozzle: &Nozzle) -> Self {
        let ([left, right], [top, bottom]) = scene.room(splat);
        let volume = f64::from(splat.volume).max(LEAST);
        let place = (0.5 * PI).sqrt() * volume;
        Self {
            low: [left, top, 0.0, nozzle.sigma.into()],
            high: [right, bottom, nozzle.most.into(), nozzle.widest.into()],
            scale: [place, place, PI.sqrt() * f64::from(splat.sigma), (2.0 * PI).sqrt() * volume],
        }
    }

    fn values(&self, splat: &Splat) -> [f64; 4] {
        let at = [splat.x, splat.y, splat.volume, splat.sigma];
        std::array::from_fn(|d| (f64::from(at[d]) - self.low[d]) * self.scale[d])
    }

    fn ceiling(&self) -> [f64; 4] {
        std::array::from_fn(|d| (self.high[d] - self.low[d]) * self.scale[d])
    }

    fn splat(&self, values: &[f64]) -> Splat {
        let at = |d: usize| (self.low[d] + values[d] / self.scale[d]) as f32;
        Splat { x: at(0), y: at(1), volume: at(2), sigma: at(3) }
    }
}
