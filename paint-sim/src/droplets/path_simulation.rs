//! Spraying along paths of the gantry: what each would put where (handheld paper, Section V).

use std::collections::BTreeMap;

use super::cast::Caster;
use super::coverage::Coverage;
use super::directions::Droplets;
use super::step::{DepositSettings, StepCast, StepHits};
use super::sweep::{GantryGeometry, Sweep};
use super::texel_surface::TexelSurface;
use crate::error::Error;

/// A straight movement of the nozzle along the gantry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedSegment {
    /// Name under which its hits are kept: the same movement from the same start at the same time.
    pub key: [i32; 3],
    /// When it begins, s after the sweep's time 0.
    pub start: f64,
    /// How long it lasts, s.
    pub duration: f64,
    /// Gantry position at its start, m.
    pub from: f64,
    /// Gantry position at its end, m.
    pub to: f64,
}

/// What a path does.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PathOutcome {
    /// Paint on texels, femtolitres.
    pub paint: u64,
    /// The part of it that was wanted where it landed, femtolitres.
    pub useful: u64,
    /// Sum of the scores of the steps that sprayed.
    pub score: f64,
    /// Whether the valve is open, step by step.
    pub valve: Vec<bool>,
}

/// Simulates paths from one state of the paint, over one extrapolated motion of the robot. Hits depend on the motion alone and are kept
/// from path to path; the paint is not changed.
pub struct PathSimulation<'a> {
    surface: &'a TexelSurface,
    gantry: GantryGeometry,
    sweep: Sweep,
    deposit: DepositSettings,
    sets: &'a [Droplets],
    hits: BTreeMap<[i32; 3], Vec<StepHits>>,
    remaining: Vec<i64>,
    /// Texels that a path has changed, with what they needed before it.
    changed: Vec<(u32, i64)>,
    caster: Caster,
}

impl<'a> PathSimulation<'a> {
    /// From the state of the paint and the motion of the robot. The sets of droplets ([`Droplets::sets`]) take turns from step to step.
    ///
    /// # Errors
    /// Settings out of range, no set, or sets of another size than the settings say.
    pub fn new(
        surface: &'a TexelSurface,
        coverage: &Coverage,
        sets: &'a [Droplets],
        deposit: &DepositSettings,
        gantry: &GantryGeometry,
        sweep: &Sweep,
    ) -> Result<Self, Error> {
        deposit.check()?;
        gantry.check()?;
        if sets.is_empty() {
            return Err(Error::Empty { what: "sets of droplets" });
        }
        if let Some(other) = sets.iter().find(|set| set.len() != deposit.droplets) {
            let (value, allowed) = (other.len() as f64, "as large as deposit.droplets says");
            return Err(Error::OutOfRange { what: "size of a set of droplets", value, allowed });
        }
        Ok(Self {
            surface,
            gantry: *gantry,
            sweep: *sweep,
            deposit: *deposit,
            sets,
            hits: BTreeMap::new(),
            remaining: (0..coverage.target().len()).map(|texel| coverage.remaining(texel)).collect(),
            changed: Vec::new(),
            caster: Caster::default(),
        })
    }

    /// Sprays along a path, segment by segment, the valve open in the steps whose score is positive.
    pub fn simulate(&mut self, path: &[SimulatedSegment]) -> PathOutcome {
        let mut outcome = PathOutcome::default();
        for segment in path {
            if !self.hits.contains_key(&segment.key) {
                let (steps, caster) = (self.steps(segment), &mut self.caster);
                let cast = |s: &StepCast| StepHits::cast_with(caster, self.surface, &s.nozzle, &self.sets[s.set]);
                self.hits.insert(segment.key, steps.iter().map(cast).collect());
            }
            let droplet = self.deposit.droplet();
            for step in &self.hits[&segment.key] {
                let found = step.score(droplet, self.deposit.punishment, |texel| self.remaining[texel as usize]);
                let open = found.score > 0.0;
                outcome.valve.push(open);
                if !open {
                    continue;
                }
                outcome.paint += found.paint;
                outcome.useful += found.useful;
                outcome.score += found.score;
                for &(texel, count) in &step.texels {
                    let remaining = &mut self.remaining[texel as usize];
                    self.changed.push((texel, *remaining));
                    *remaining -= (u64::from(count) * droplet) as i64;
                }
            }
        }
        for (texel, before) in self.changed.drain(..).rev() {
            self.remaining[texel as usize] = before;
        }
        outcome
    }

    /// The steps of a segment whose hits are not kept yet: none of one that is known. Who casts them elsewhere hands them back with
    /// [`Self::keep`].
    pub fn missing(&self, segment: &SimulatedSegment) -> Vec<StepCast> {
        if self.hits.contains_key(&segment.key) { Vec::new() } else { self.steps(segment) }
    }

    /// Keeps the hits of a segment, one for each of its steps, that were cast elsewhere.
    ///
    /// # Errors
    /// Another number of hits than the segment has steps, or texels beside the texture.
    pub fn keep(&mut self, segment: &SimulatedSegment, hits: Vec<StepHits>) -> Result<(), Error> {
        if hits.len() != self.step_count(segment) {
            let (value, allowed) = (hits.len() as f64, "one for each step of the segment");
            return Err(Error::OutOfRange { what: "number of hits of a segment", value, allowed });
        }
        let texels = || hits.iter().flat_map(|step| &step.texels).map(|(texel, _)| *texel);
        if let Some(texel) = texels().find(|texel| *texel as usize >= self.remaining.len()) {
            let (value, allowed) = (f64::from(texel), "below the number of texels");
            return Err(Error::OutOfRange { what: "texel of a hit", value, allowed });
        }
        self.hits.insert(segment.key, hits);
        Ok(())
    }

    fn step_count(&self, segment: &SimulatedSegment) -> usize {
        (segment.duration / self.deposit.step).round().max(1.0) as usize
    }

    /// Every step of a segment, in its middle.
    fn steps(&self, segment: &SimulatedSegment) -> Vec<StepCast> {
        let steps = self.step_count(segment);
        (0..steps)
            .map(|k| {
                let share = (k as f64 + 0.5) / steps as f64;
                let time = segment.start + share * segment.duration;
                let position = segment.from + share * (segment.to - segment.from);
                let nozzle = self.gantry.nozzle(&self.sweep.at(time), position);
                let set = (time / self.deposit.step).floor().max(0.0) as usize % self.sets.len();
                StepCast { nozzle, set }
            })
            .collect()
    }
}
