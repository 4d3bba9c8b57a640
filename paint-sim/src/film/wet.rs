//! Paint before it is dry: it runs on steep walls, soaks into the ground, and loses its solvent.
//!
//! A thin film on a wall that is steeper than flat is sheared by its own weight. Where it is thicker than its yield stress carries it flows
//! downhill as a Bingham fluid; what it loses of its solvent makes it stiffer until it is dry to touch. Everything is counted in whole
//! femtolitres, so nothing is lost or invented however long it runs.

mod descents;
mod flow;
mod ground;
mod levelling;
mod liquid_balance;
mod wet_paint;
mod wet_state;

pub use descents::Side;
pub use flow::Flow;
pub use ground::Ground;
pub use levelling::Levelling;
pub use liquid_balance::LiquidBalance;
pub use wet_paint::WetPaint;

use descents::Descents;
use wet_state::WetState;

#[cfg(feature = "gpu")]
use super::GpuSpray;
use super::{Film, MassBalance};
use crate::error::{Error, check_not_negative};
use crate::spray::{QUANTUM, Shot, SprayModel};
use crate::surface::Surface;
use crate::trace::span;

/// Longest time over which stiffness is taken to be constant, s.
const LONGEST_STEP: f64 = 5.0;

/// A [`Film`] whose paint is wet where it was sprayed last.
///
/// The film's own volumes are those of the paint that stays (its solids); the solvent is counted beside them. Paint that is dry to touch
/// is part of the wall for what is sprayed onto it later.
#[derive(Debug, Clone)]
pub struct WetFilm(WetState);

impl WetFilm {
    /// `film` with nothing wet on it: what it holds is dry. `sides` are the sides of its texels; between texels that have none nothing runs.
    ///
    /// # Errors
    /// A paint or ground out of range, a side that names no texel.
    pub fn new(film: Film, sides: &[Side], paint: WetPaint, ground: Ground) -> Result<Self, Error> {
        paint.check()?;
        ground.check()?;
        let descents = Descents::new(film.texels(), sides, &paint)?;
        let count = film.texels().len();
        let dry = film.volumes.clone();
        Ok(Self(WetState {
            film,
            paint,
            ground,
            descents,
            dry,
            solvent: vec![0; count],
            soaked: vec![0; count],
            ran: vec![false; count],
            balance: LiquidBalance::default(),
            fastest: Some(0.0),
        }))
    }

    /// Sprays `shots`, whose volumes are solids as everywhere, with the solvent of the can; see [`Film::deposit`].
    ///
    /// # Errors
    /// As [`Film::deposit`]; the film is then unchanged.
    pub fn deposit(
        &mut self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        let (film, mut landed) = self.0.filled();
        film.deposit_told(shots, spray, surface, threads, &mut landed, progress)
    }

    /// The same with a GPU that knows the film's texels; see [`Film::deposit_on`].
    ///
    /// # Errors
    /// As [`Film::deposit_on`]; the film is then unchanged.
    #[cfg(feature = "gpu")]
    pub fn deposit_on(
        &mut self,
        gpu: &GpuSpray,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        let (film, mut landed) = self.0.filled();
        film.deposit_on_told(gpu, (shots, spray, surface), threads, &mut landed, progress)
    }

    /// The same of shots with sprays of their own; see [`Film::deposit_each`].
    ///
    /// # Errors
    /// As [`Film::deposit`]; the film is then unchanged.
    pub fn deposit_each(
        &mut self,
        shots: &[(Shot, SprayModel)],
        surface: &dyn Surface,
        threads: usize,
    ) -> Result<MassBalance, Error> {
        let (film, mut landed) = self.0.filled();
        film.deposit_each_told(shots, surface, threads, &mut landed)
    }

    /// Lets `seconds` pass.
    ///
    /// # Errors
    /// A time that is negative or not finite.
    pub fn step(&mut self, seconds: f64) -> Result<Flow, Error> {
        span!("wet_step");
        check_not_negative("seconds", seconds)?;
        let pieces = (seconds / LONGEST_STEP).ceil().max(1.0);
        let mut flow = Flow::default();
        for _ in 0..pieces as u64 {
            if self.is_dry() {
                break;
            }
            flow = flow.and(self.0.advance(seconds / pieces));
        }
        Ok(flow)
    }

    /// The film: thickness and volumes of the solids, wet and dry.
    pub fn film(&self) -> &Film {
        &self.0.film
    }

    /// The same with what was wet as if it were dry.
    pub fn into_film(self) -> Film {
        self.0.film
    }

    /// Thickness of what is wet on texel `index`, solids and solvent, m; zero where there is no such texel.
    pub fn wet_thickness(&self, index: usize) -> f64 {
        match (self.wet_solids(index), self.0.film.texels().get(index)) {
            (Some(solids), Some(texel)) => (solids + self.0.solvent[index]) as f64 * QUANTUM / texel.area,
            _ => 0.0,
        }
    }

    /// Time in which all is dry to touch, s, at most (the ground makes it shorter); infinite where no solvent evaporates.
    pub fn time_to_dry(&self) -> f64 {
        let left = |k: usize| {
            self.0.solvent[k] as f64 - self.0.paint.solvent_left() * (self.0.film.volumes[k] - self.0.dry[k]) as f64
        };
        let thickness = |k: usize| left(k) * QUANTUM / self.0.film.texels()[k].area;
        let wet = (0..self.0.solvent.len()).filter(|&k| self.0.solvent[k] > 0).map(thickness).fold(0.0, f64::max);
        if wet > 0.0 { wet / self.0.paint.evaporation } else { 0.0 }
    }

    /// Whether nothing is wet.
    pub fn is_dry(&self) -> bool {
        self.0.solvent.iter().all(|&solvent| solvent == 0)
    }

    /// Texels from which paint has run.
    pub fn ran(&self) -> &[bool] {
        &self.0.ran
    }

    /// Share by area of the painted texels from which paint has run; zero without paint.
    pub fn share_ran(&self) -> f64 {
        let (mut painted, mut ran) = (0.0, 0.0);
        for ((texel, &volume), &runs) in self.0.film.texels().iter().zip(&self.0.film.volumes).zip(&self.0.ran) {
            if volume > 0 || runs {
                painted += texel.area;
                ran += if runs { texel.area } else { 0.0 };
            }
        }
        ran / f64::max(painted, f64::MIN_POSITIVE)
    }

    /// Where the solvent went; that of the solids is [`Film::mass_balance`].
    pub fn liquid_balance(&self) -> LiquidBalance {
        LiquidBalance { on_surface: self.0.solvent.iter().sum(), soaked: self.0.soaked.iter().sum(), ..self.0.balance }
    }

    fn wet_solids(&self, index: usize) -> Option<u64> {
        Some(self.0.film.volumes.get(index)? - self.0.dry[index])
    }
}
