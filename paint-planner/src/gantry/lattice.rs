//! The lattice of gantry positions over time, and the movements on it (handheld paper, Section IV-B).
//!
//! A node is a layer (time), a cell (position) and the speed with which the nozzle came. Only movements that keep the change of speed
//! and the ends of the slide are edges. Nodes of one cell share the scores of their movements.

use super::settings::GantrySettings;
use crate::error::Error;

/// Where the nozzle is when a plan begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GantryState {
    /// Position along the gantry, m.
    pub position: f64,
    /// Speed with which it comes, in steps of `max_speed / (directions / 2)`.
    pub speed: i32,
}

/// A movement of the nozzle during one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Number of the interval, from 0.
    pub layer: usize,
    /// Cell in which it begins, counted from the plan's start.
    pub cell: i32,
    /// Speed, in steps: the cells that it covers.
    pub speed: i32,
    /// Seconds after the plan's start at which it begins.
    pub start: f64,
    /// Its duration, s.
    pub duration: f64,
    /// Gantry position at its start, m.
    pub from: f64,
    /// Gantry position at its end, m.
    pub to: f64,
}

/// The lattice of one plan.
#[derive(Debug, Clone)]
pub struct Lattice {
    state: GantryState,
    interval: f64,
    cell: f64,
    /// Decisions that are looked ahead.
    pub(super) horizon: usize,
    /// Fastest movement, in steps.
    pub(super) fastest: i32,
    speed_change: i32,
    /// First and last cell on the slide.
    cells: [i32; 2],
}

impl Lattice {
    /// Around a state. A position beside the slide by less than a tenth of a millimetre counts as its end.
    ///
    /// # Errors
    /// Settings out of range, or a start that is not on the slide.
    pub fn new(state: GantryState, settings: &GantrySettings) -> Result<Self, Error> {
        settings.check()?;
        let slack = 1e-4;
        let on_slide = (-slack..=settings.travel + slack).contains(&state.position);
        if !on_slide {
            let requirement = "between 0 and gantry.travel";
            return Err(Error::Setting { name: "gantry position at the start", value: state.position, requirement });
        }
        let (cell, fastest) = (settings.cell(), settings.fastest());
        // Rounding must not take the last cell from a start that is a whole number of cells away from an end.
        let count = |length: f64| (length.max(0.0) / cell + 1e-9).floor() as i32;
        Ok(Self {
            state: GantryState { speed: state.speed.clamp(-fastest, fastest), ..state },
            interval: settings.interval,
            cell,
            horizon: settings.horizon,
            fastest,
            speed_change: settings.speed_change as i32,
            cells: [-count(state.position), count(settings.travel - state.position)],
        })
    }

    /// Speed at the start, in steps.
    pub fn start_speed(&self) -> i32 {
        self.state.speed
    }

    /// First and last cell that the nozzle can reach by the start of a layer.
    pub(super) fn reach(&self, layer: usize) -> [i32; 2] {
        let farthest = self.fastest.saturating_mul(layer as i32);
        [self.cells[0].max(-farthest), self.cells[1].min(farthest)]
    }

    /// Whether a movement stays on the slide.
    pub(super) fn stays(&self, cell: i32, speed: i32) -> bool {
        (self.cells[0]..=self.cells[1]).contains(&(cell + speed))
    }

    /// Speeds that may follow a speed in a cell, ascending. Where the end of the slide leaves none that keeps the change of speed, those that stay
    /// on it: a nozzle stops at the end rather than in it.
    pub(super) fn next_speeds(&self, cell: i32, speed: i32) -> impl Iterator<Item = i32> + '_ {
        let change = self.speed_change;
        let gentle = (speed - change).max(-self.fastest)..=(speed + change).min(self.fastest);
        let any = gentle.clone().any(|next| self.stays(cell, next));
        let range = if any { gentle } else { -self.fastest..=self.fastest };
        range.filter(move |&next| self.stays(cell, next))
    }

    /// The movement from a cell in a layer.
    pub fn segment(&self, layer: usize, cell: i32, speed: i32) -> Segment {
        let at = |cell: i32| self.state.position + f64::from(cell) * self.cell;
        Segment {
            layer,
            cell,
            speed,
            start: layer as f64 * self.interval,
            duration: self.interval,
            from: at(cell),
            to: at(cell + speed),
        }
    }

    /// The segments of a path given by its speeds.
    pub fn path(&self, speeds: &[i32]) -> Vec<Segment> {
        let mut cell = 0;
        speeds
            .iter()
            .enumerate()
            .map(|(layer, &speed)| {
                let segment = self.segment(layer, cell, speed);
                cell += speed;
                segment
            })
            .collect()
    }
}
