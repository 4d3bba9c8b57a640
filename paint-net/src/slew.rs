use crate::deconvolution::ink_cost;
use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Board, Limits, Painter, Painting, Spray, Task};
use crate::projected_lbfgs::{Stop, minimise};
use crate::route::Route;
use crate::saturation::Saturation;

/// Volumes that a valve of limited speed can follow: along a path over all cells the volume changes by at most
/// `largest_change` from one cell to the next. Ours.
///
/// Starts from a painter's plan and minimises
///
/// ```text
/// ½ Σ w (f(c₀ + G v) - y)²    subject to  |v_k - v_{k-1}| ≤ L,  0 ≤ v ≤ v_max
/// ```
///
/// by augmented Lagrangians (Hestenes 1969, Powell 1969; for bounds on both sides Rockafellar 1973): the limit costs
/// `ρ/2 dist(v_k - v_{k-1} + λ_k/ρ, [-L, L])²`, and after each round the prices `λ` take over what the limit still gives. What
/// changes too fast in the end, by a percent or so, is cut down to the largest sequence below it that does not.
///
/// Volumes on a path that follows what is alike ([`Route::Alike`]) can change more slowly; which cells are alike is known better
/// once the volumes are: the path is laid three times. A finer grid along the path gives the valve more time per pixel as well.
#[derive(Debug, Clone, PartialEq)]
pub struct SlewLimited<P> {
    /// Who plans without the limit.
    pub painter: P,
    /// Largest change of volume from one cell of the path to the next.
    pub largest_change: f64,
    /// The path over the cells. Default row by row.
    pub route: Route,
    /// Iterations of each round. Default 30, ours.
    pub iterations: usize,
}

/// Rounds of prices, and the weight `ρ` of the first and its growth, for inks in `[0, 1]` and volumes of that order.
const ROUNDS: usize = 14;
const FIRST_WEIGHT: f64 = 1.0;
const GROWTH: f64 = 1.5;
/// How often a path that follows the volumes is laid.
const PATHS: usize = 3;

impl<P: Painter> SlewLimited<P> {
    /// Row by row, 30 iterations per round.
    pub fn new(painter: P, largest_change: f64) -> Self {
        Self { painter, largest_change, route: Route::Rows, iterations: 30 }
    }

    /// The cells in flying order, those where the valve is shut (volume 0) included, and what is painted.
    pub fn fly(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Vec<Spray>, Painting), Error> {
        let limit = self.largest_change;
        require("largest_change", limit, limit > 0.0 && limit.is_finite(), "it must be positive and finite")?;
        let board = Board::new(task, kernel, saturation, limits)?;
        let plan = self.painter.paint(task, kernel, saturation, limits, &mut |share| progress(0.3 * share))?;
        let mut volumes = board.volumes(&plan.sprays);
        let laps = if self.route == Route::Rows { 1 } else { PATHS };
        let (columns, rows) = (board.footprints.columns.len(), board.footprints.rows.len());
        let mut path = Vec::new();
        for lap in 0..laps {
            path = self.route.path(columns, rows, &volumes);
            let valve = Valve { task, board: &board, saturation, path: &path, limit };
            valve.slow(&mut volumes, self.iterations, &mut |share| {
                progress(0.3 + 0.7 * (lap as f64 + share) / laps as f64);
            });
        }
        envelope(&path, &mut volumes, limit);
        progress(1.0);
        let waypoints: Vec<Spray> = path.iter().map(|&cell| board.spray(cell, volumes[cell])).collect();
        let canvas = board.canvas(&volumes);
        let ink: Image = canvas.map(|c| saturation.forward(c));
        let sprays = waypoints.iter().copied().filter(|s| s.volume > 0.0).collect();
        Ok((waypoints, Painting { sprays, canvas, ink }))
    }
}

/// How often the volume changes by more than `largest_change` from one waypoint to the next.
pub fn slew_violations(waypoints: &[Spray], largest_change: f64) -> usize {
    waypoints.windows(2).filter(|p| (p[1].volume - p[0].volume).abs() > largest_change).count()
}

impl<P: Painter> Painter for SlewLimited<P> {
    fn name(&self) -> &'static str {
        "slew limited"
    }

    /// The sprays in the order of the path; `min_volume` and `max_sprays` are left to the painter, as a valve that must not
    /// jump cannot skip small volumes.
    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        self.fly(task, kernel, saturation, limits, progress).map(|(_, painting)| painting)
    }
}

/// A path with a valve that follows it slowly.
struct Valve<'a> {
    task: &'a Task<'a>,
    board: &'a Board,
    saturation: &'a Saturation,
    path: &'a [usize],
    limit: f64,
}

impl Valve<'_> {
    /// Slows the volumes down, nearly to the limit.
    fn slow(&self, volumes: &mut Vec<f64>, iterations: usize, progress: &mut dyn FnMut(f64)) {
        let mut canvas = self.board.bare.data().to_vec();
        let mut prices = vec![0.0; self.path.len()];
        let mut weight = FIRST_WEIGHT;
        for round in 0..ROUNDS {
            let mut cost = |v: &[f64], gradient: &mut [f64]| {
                canvas.copy_from_slice(self.board.bare.data());
                self.board.footprints.add(v, &mut canvas);
                let value = ink_cost(self.task, self.task.reference, self.saturation, &mut canvas);
                self.board.footprints.gather(&canvas, gradient);
                value + self.excess_cost(v, weight, &prices, gradient)
            };
            let stop = Stop { iterations, relative_decrease: 1e-7 };
            minimise(volumes, &self.board.ceiling, &stop, &mut cost, &mut |_| ());
            for (price, pair) in prices.iter_mut().zip(self.path.windows(2)) {
                *price = weight * self.excess(volumes, pair, *price / weight);
            }
            weight *= GROWTH;
            progress((round + 1) as f64 / ROUNDS as f64);
        }
    }

    /// How far a change, shifted, lies outside of the limit.
    fn excess(&self, volumes: &[f64], pair: &[usize], shift: f64) -> f64 {
        let change = volumes[pair[1]] - volumes[pair[0]] + shift;
        change - change.clamp(-self.limit, self.limit)
    }

    /// `ρ/2 Σ dist(Δv + λ/ρ, [-L, L])²`; adds its derivative.
    fn excess_cost(&self, volumes: &[f64], weight: f64, prices: &[f64], gradient: &mut [f64]) -> f64 {
        let mut value = 0.0;
        for (pair, price) in self.path.windows(2).zip(prices) {
            let excess = self.excess(volumes, pair, price / weight);
            value += 0.5 * weight * excess * excess;
            gradient[pair[1]] += weight * excess;
            gradient[pair[0]] -= weight * excess;
        }
        value
    }
}

/// The largest sequence below `volumes` that changes by no more than `limit`: once forwards, once back.
fn envelope(path: &[usize], volumes: &mut [f64], limit: f64) {
    // The sum may round up: stay below the limit by more than that.
    let limit = limit * (1.0 - 1e-12);
    for pair in path.windows(2) {
        volumes[pair[1]] = volumes[pair[1]].min(volumes[pair[0]] + limit);
    }
    for pair in path.windows(2).rev() {
        volumes[pair[0]] = volumes[pair[0]].min(volumes[pair[1]] + limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    #[test]
    fn the_envelope_is_the_largest_slow_sequence_below() {
        // In closed form: min_j v_j + L |k - j| along the path.
        let path = Route::Rows.path(5, 4, &[]);
        assert_eq!(path[..8], [0, 1, 2, 3, 4, 9, 8, 7]);
        let volumes: Vec<f64> = (0..20).map(|k| lattice(1, k, 0)).collect();
        let mut found = volumes.clone();
        envelope(&path, &mut found, 0.1);
        for (k, &cell) in path.iter().enumerate() {
            let expected = path.iter().enumerate().map(|(j, &c)| volumes[c] + 0.1 * k.abs_diff(j) as f64);
            let expected = expected.fold(f64::INFINITY, f64::min);
            assert!((found[cell] - expected).abs() < 1e-9, "place {k}: {} is not {expected}", found[cell]);
        }
    }
}
