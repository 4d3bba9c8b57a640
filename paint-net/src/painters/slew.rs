//! A painter whose valve has a slew-rate limit.

use super::fitting::ink_cost;
use crate::error::{Error, require};
use crate::model::Spray;
use crate::optimise::{StoppingRule, minimise};
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painting::Painting;
use crate::path::ScanOrder;
use crate::problem::{PaintGrid, PaintProblem};

/// Volumes that a valve of limited speed can follow: along a path over all cells the volume changes by at most
/// `slew_limit` from one cell to the next. Ours.
///
/// Starts from a painter's plan and minimises
///
/// ```text
/// ½ Σ w (f(c₀ + G v) - y)²    subject to  |v_k - v_{k-1}| ≤ L,  0 ≤ v ≤ v_max
/// ```
///
/// by augmented Lagrangians (Hestenes 1969, Powell 1969; for bounds on both sides Rockafellar 1973): the limit costs
/// `ρ/2 dist(v_k - v_{k-1} + λ_k/ρ, [-L, L])²`, and after each round the multipliers `λ` take over what the limit still gives.
/// What changes too fast in the end, by a percent or so, is cut down to its largest `L`-Lipschitz minorant.
///
/// On a context-based path ([`ScanOrder::ContextBased`]) the wanted volumes change more slowly; which cells are alike is known
/// better once the volumes are, so that path is laid three times. A finer grid along the path gives the valve more time per
/// pixel as well.
///
/// The result's [`Painting::waypoints`] are the cells in flying order, those where the valve is shut included.
#[derive(Debug, Clone, PartialEq)]
pub struct SlewLimited<P> {
    /// The painter that plans without the limit.
    pub inner: P,
    /// Largest change of volume from one cell of the path to the next.
    pub slew_limit: f64,
    /// The path over the cells. Default: boustrophedon.
    pub order: ScanOrder,
    /// Iterations of each round. Default 30, ours.
    pub iterations: usize,
}

/// Rounds of the augmented Lagrangian, and the penalty `ρ` of the first and its growth, for inks in `[0, 1]` and volumes of that
/// order.
const ROUNDS: usize = 14;
const FIRST_PENALTY: f64 = 1.0;
const PENALTY_GROWTH: f64 = 1.5;
/// How often a path that depends on the volumes is laid.
const PATHS: usize = 3;
/// Share of the progress that the unlimited plan stands for.
const PLAN_SHARE: f64 = 0.3;

impl<P: Painter> SlewLimited<P> {
    /// Row by row, 30 iterations per round.
    pub fn new(inner: P, slew_limit: f64) -> Self {
        Self { inner, slew_limit, order: ScanOrder::Boustrophedon, iterations: 30 }
    }
}

impl<P: Painter> Painter for SlewLimited<P> {
    fn name(&self) -> &'static str {
        "slew limited"
    }

    /// The sprays in the order of the path; `min_volume` and `max_sprays` are left to the inner painter, as a valve that must
    /// not jump cannot skip small volumes.
    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let limit = self.slew_limit;
        require("slew_limit", limit, limit > 0.0 && limit.is_finite(), "it must be positive and finite")?;
        let grid = PaintGrid::new(problem)?;
        // The plan is changed before it is sprayed: the inner painter must not spray it.
        let plan = self.inner.paint_observed(problem, &mut |share: f64| observer.progress(PLAN_SHARE * share))?;
        let mut volumes = grid.volumes(&plan.sprays);
        let paths = if self.order == ScanOrder::Boustrophedon { 1 } else { PATHS };
        let (columns, rows) = (grid.footprints.columns.len(), grid.footprints.rows.len());
        let mut path = Vec::new();
        for lap in 0..paths {
            path = self.order.path(columns, rows, &volumes);
            let part = (1.0 - PLAN_SHARE) / paths as f64;
            let from = PLAN_SHARE + lap as f64 * part;
            let fit = SlewFit { problem, grid: &grid, path: &path, limit };
            fit.minimise(&mut volumes, self.iterations, &mut PartialProgress { observer, from, share: part });
        }
        lipschitz_minorant(&path, &mut volumes, limit);
        observer.progress(1.0);
        let waypoints: Vec<Spray> = path.iter().map(|&cell| grid.spray(cell, volumes[cell])).collect();
        let sprays = waypoints.iter().copied().filter(|s| s.volume > 0.0).collect();
        Ok(Painting { waypoints, ..Painting::new(sprays, grid.canvas(problem, &volumes), problem.saturation) })
    }
}

/// How often the volume changes by more than `slew_limit` from one waypoint to the next.
pub fn slew_violations(waypoints: &[Spray], slew_limit: f64) -> usize {
    waypoints.windows(2).filter(|p| (p[1].volume - p[0].volume).abs() > slew_limit).count()
}

/// The fit of volumes along a path under a slew limit.
struct SlewFit<'a> {
    problem: &'a PaintProblem<'a>,
    grid: &'a PaintGrid,
    path: &'a [usize],
    limit: f64,
}

impl SlewFit<'_> {
    /// Minimises the augmented Lagrangian, round by round; the limit holds nearly.
    fn minimise(&self, volumes: &mut Vec<f64>, iterations: usize, observer: &mut dyn Observer) {
        let mut canvas = self.grid.initial.data().to_vec();
        let mut multipliers = vec![0.0; self.path.len()];
        let mut penalty = FIRST_PENALTY;
        for round in 0..ROUNDS {
            let mut cost = |v: &[f64], gradient: &mut [f64]| {
                canvas.copy_from_slice(self.grid.initial.data());
                self.grid.footprints.deposit(v, &mut canvas);
                self.problem.settle(self.grid.initial.data(), &mut canvas);
                let value = ink_cost(self.problem, self.problem.saturation, &mut canvas);
                self.problem.settle_adjoint(&mut canvas);
                self.grid.footprints.adjoint(&canvas, gradient);
                value + self.penalty(v, penalty, &multipliers, gradient)
            };
            let stop = StoppingRule { iterations, relative_decrease: 1e-7 };
            minimise(volumes, &self.grid.upper_bounds, &stop, &mut cost, &mut |_| ());
            for (multiplier, pair) in multipliers.iter_mut().zip(self.path.windows(2)) {
                *multiplier = penalty * self.violation(volumes, pair, *multiplier / penalty);
            }
            penalty *= PENALTY_GROWTH;
            observer.progress((round + 1) as f64 / ROUNDS as f64);
        }
    }

    /// How far a change, shifted, lies outside of the limit.
    fn violation(&self, volumes: &[f64], pair: &[usize], shift: f64) -> f64 {
        let change = volumes[pair[1]] - volumes[pair[0]] + shift;
        change - change.clamp(-self.limit, self.limit)
    }

    /// `ρ/2 Σ dist(Δv + λ/ρ, [-L, L])²`; adds its derivative.
    fn penalty(&self, volumes: &[f64], penalty: f64, multipliers: &[f64], gradient: &mut [f64]) -> f64 {
        let mut value = 0.0;
        for (pair, multiplier) in self.path.windows(2).zip(multipliers) {
            let violation = self.violation(volumes, pair, multiplier / penalty);
            value += 0.5 * penalty * violation * violation;
            gradient[pair[1]] += penalty * violation;
            gradient[pair[0]] -= penalty * violation;
        }
        value
    }
}

/// The largest sequence below `volumes` that changes by no more than `limit` per step of the path, its largest Lipschitz
/// minorant: once forwards, once back.
fn lipschitz_minorant(path: &[usize], volumes: &mut [f64], limit: f64) {
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
    fn the_minorant_is_the_largest_slow_sequence_below() {
        // In closed form: min_j v_j + L |k - j| along the path.
        let path = ScanOrder::Boustrophedon.path(5, 4, &[]);
        assert_eq!(path[..8], [0, 1, 2, 3, 4, 9, 8, 7]);
        let volumes: Vec<f64> = (0..20).map(|k| lattice(1, k, 0)).collect();
        let mut found = volumes.clone();
        lipschitz_minorant(&path, &mut found, 0.1);
        for (k, &cell) in path.iter().enumerate() {
            let expected = path.iter().enumerate().map(|(j, &c)| volumes[c] + 0.1 * k.abs_diff(j) as f64);
            let expected = expected.fold(f64::INFINITY, f64::min);
            assert!((found[cell] - expected).abs() < 1e-9, "place {k}: {} is not {expected}", found[cell]);
        }
    }
}
