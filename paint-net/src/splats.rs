use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Limits, Painter, Painting, Spray, Task};
use crate::projected_lbfgs::Stop;
use crate::saturation::Saturation;

mod fit;
mod plane;
mod relocate;
mod scene;
mod start;

use fit::fit;
use relocate::relocate;
use scene::Scene;
use start::start;

/// Few sprays at free places, of free volumes and spreads: all of them fitted together. Ours.
///
/// Minimises `½ Σ w (f(c₀ + Σ_k v_k g_k) - y)²`, `g_k = exp(-|p - μ_k|² / 2σ_k²)`, over places `μ_k` in the picture, volumes
/// `0 ≤ v_k ≤ v_max` and spreads `σ ≤ σ_k ≤ largest_spread · σ` (a robot opens the cone by stepping back; the nozzle's own
/// spread is the smallest). The cost has many minima: the splats start where there is detail, and between rounds of
/// fitting those that do least are put where one more would do most.
///
/// `Limits::along` and `row_spacing` do not apply. The kernel's cut applies to every spray, in units of its own spread; with a
/// cut below about three deviations footprints have edges that the fit does not feel, and quality suffers.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct FreeSplats {
    /// Largest number of sprays; [`Limits::max_sprays`] applies as well. Default 400, ours.
    pub sprays: usize,
    /// Largest spread of a spray over the nozzle's own, at least 1. Default 4, ours.
    pub largest_spread: f64,
    /// Rounds of fitting. Default 3, ours.
    pub rounds: usize,
    /// Iterations in each. Default 30, ours.
    pub iterations: usize,
    /// Largest share of the sprays that is moved elsewhere between two rounds. Default 0.1, ours.
    pub moved: f64,
}

impl Default for FreeSplats {
    fn default() -> Self {
        Self { sprays: 400, largest_spread: 4.0, rounds: 3, iterations: 30, moved: 0.1 }
    }
}

/// A spray in single precision, in the units of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Splat {
    x: f32,
    y: f32,
    volume: f32,
    sigma: f32,
}

/// What a splat may be, in the units of the scene.
struct Nozzle {
    sigma: f32,
    widest: f32,
    most: f32,
}

impl Nozzle {
    fn spread(&self, sigma: f32) -> f32 {
        sigma.clamp(self.sigma, self.widest)
    }
}

impl Painter for FreeSplats {
    fn name(&self) -> &'static str {
        "splats"
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        self.check()?;
        task.check()?;
        limits.check()?;
        saturation.check()?;
        let mut scene = Scene::new(task, kernel, saturation);
        let most = limits.max_sprays.unwrap_or(usize::MAX).min(self.sprays);
        let nozzle = Nozzle {
            sigma: kernel.sigma() as f32,
            widest: (self.largest_spread * kernel.sigma()) as f32,
            most: (limits.max_volume / scene.unit) as f32,
        };
        let stop = Stop { iterations: self.iterations, relative_decrease: 1e-5 };
        let mut splats = start(&scene, most, &nozzle);
        for round in 0..self.rounds {
            if round > 0 {
                relocate(&mut scene, &mut splats, &nozzle, self.moved, most);
            }
            fit(&mut scene, &mut splats, &nozzle, &stop, &mut |share| {
                progress((round as f64 + share) / self.rounds as f64);
            });
        }
        let least = (limits.min_volume / scene.unit) as f32;
        if splats.iter().any(|s| s.volume < least) {
            splats.retain(|s| s.volume >= least);
            fit(&mut scene, &mut splats, &nozzle, &stop, &mut |_| ());
        }
        let mut sprays: Vec<Spray> = splats.iter().map(|s| s.spray(scene.unit, limits.max_volume)).collect();
        // The bar is a promise, and a spray without paint is none.
        sprays.retain(|s| s.volume > 0.0 && s.volume >= limits.min_volume);
        sprays.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
        let mut canvas = task.bare();
        for spray in &sprays {
            kernel.stamp(spray, &mut canvas);
        }
        let ink: Image = canvas.map(|c| saturation.forward(c));
        progress(1.0);
        Ok(Painting { sprays, canvas, ink })
    }
}

impl FreeSplats {
    fn check(&self) -> Result<(), Error> {
        let whole = |name, value: usize, most: usize, rule| require(name, value as f64, value <= most, rule);
        whole("sprays", self.sprays, 10_000_000, "it must be at most 10,000,000")?;
        whole("rounds", self.rounds, 1000, "it must be at most 1000")?;
        whole("iterations", self.iterations, 100_000, "it must be at most 100,000")?;
        let spread = self.largest_spread;
        require("largest_spread", spread, (1.0..=1000.0).contains(&spread), "it must lie in [1, 1000]")?;
        require("moved", self.moved, (0.0..=1.0).contains(&self.moved), "it must lie in [0, 1]")
    }
}

impl Splat {
    /// In the caller's units.
    fn spray(&self, unit: f64, most: f64) -> Spray {
        let volume = (f64::from(self.volume) * unit).min(most);
        Spray { x: self.x.into(), y: self.y.into(), volume, sigma: self.sigma.into() }
    }
}
