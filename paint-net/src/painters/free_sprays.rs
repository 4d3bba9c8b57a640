//! Few sprays at free places.

mod fit;
mod free_spray;
mod initial;
mod plane;
mod rasteriser;
mod reseed;

use crate::error::{Error, require};
use crate::model::Spray;
use crate::optimise::StoppingRule;
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::PaintProblem;
use fit::fit;
use free_spray::SprayBounds;
use initial::initial;
use rasteriser::Rasteriser;
use reseed::reseed;

/// Few sprays at free places, of free volumes and spreads: all of them fitted together. Ours.
///
/// Minimises `½ Σ w (f(c₀ + Σ_k v_k g_k) - y)²`, `g_k = exp(-|p - μ_k|² / 2σ_k²)`, over places `μ_k` in the picture, volumes
/// `0 ≤ v_k ≤ v_max` and spreads `σ ≤ σ_k ≤ max_sigma_ratio · σ` (a robot opens the cone by stepping back; the nozzle's own
/// spread is the smallest). The cost has many minima: the sprays start where there is detail, and between rounds of
/// fitting those that do least are reseeded where one more would do most.
///
/// `Limits::spray_spacing` and `row_spacing` do not apply. The kernel's cut applies to every spray, in units of its own spread; with a
/// cut below about three deviations footprints have edges that the fit does not feel, and quality suffers.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct FreeSprays {
    /// Largest number of sprays; [`crate::Limits::max_sprays`] applies as well. Default 400, ours.
    pub sprays: usize,
    /// Largest spread of a spray over the nozzle's own, at least 1. Default 4, ours.
    pub max_sigma_ratio: f64,
    /// Rounds of fitting. Default 3, ours.
    pub rounds: usize,
    /// Iterations in each. Default 30, ours.
    pub iterations: usize,
    /// Largest share of the sprays that is reseeded elsewhere between two rounds. Default 0.1, ours.
    pub reseed_fraction: f64,
}

impl Default for FreeSprays {
    fn default() -> Self {
        Self { sprays: 400, max_sigma_ratio: 4.0, rounds: 3, iterations: 30, reseed_fraction: 0.1 }
    }
}

impl Painter for FreeSprays {
    fn name(&self) -> &'static str {
        "free sprays"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        self.check()?;
        problem.check()?;
        let (kernel, limits) = (problem.kernel, problem.limits);
        let mut rasteriser = Rasteriser::new(problem);
        let most = limits.max_sprays.unwrap_or(usize::MAX).min(self.sprays);
        let bounds = SprayBounds {
            min_sigma: kernel.sigma() as f32,
            max_sigma: (self.max_sigma_ratio * kernel.sigma()) as f32,
            max_volume: (limits.max_volume / rasteriser.unit) as f32,
        };
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: 1e-5 };
        let mut free = initial(&rasteriser, most, &bounds);
        for round in 0..self.rounds {
            if round > 0 {
                reseed(&mut rasteriser, &mut free, &bounds, self.reseed_fraction, most);
            }
            fit(&mut rasteriser, &mut free, &bounds, &stop, &mut |share| {
                observer.progress((round as f64 + share) / self.rounds as f64);
            });
        }
        let least = (limits.min_volume / rasteriser.unit) as f32;
        if free.iter().any(|s| s.volume < least) {
            free.retain(|s| s.volume >= least);
            fit(&mut rasteriser, &mut free, &bounds, &stop, &mut |_| ());
        }
        let mut sprays: Vec<Spray> = free.iter().map(|s| s.spray(rasteriser.unit, limits.max_volume)).collect();
        // The refit may have pushed a survivor below `min_volume`, which is a promise; and a spray without paint is none.
        sprays.retain(|s| s.volume > 0.0 && s.volume >= limits.min_volume);
        sprays.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
        observer.progress(1.0);
        Ok(Painting::render(problem, sprays))
    }
}

impl FreeSprays {
    fn check(&self) -> Result<(), Error> {
        let whole = |name, value: usize, most: usize, rule| require(name, value as f64, value <= most, rule);
        whole("sprays", self.sprays, 10_000_000, "it must be at most 10,000,000")?;
        whole("rounds", self.rounds, 1000, "it must be at most 1000")?;
        whole("iterations", self.iterations, 100_000, "it must be at most 100,000")?;
        let ratio = self.max_sigma_ratio;
        require("max_sigma_ratio", ratio, (1.0..=1000.0).contains(&ratio), "it must lie in [1, 1000]")?;
        require(
            "reseed_fraction",
            self.reseed_fraction,
            (0.0..=1.0).contains(&self.reseed_fraction),
            "it must lie in [0, 1]",
        )
    }
}
