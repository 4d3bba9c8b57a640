//! The person: sweeps to and fro before one part of the object after the other, with tremor.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::error::{Error, check_not_negative, check_positive};
use crate::rng::Rng;

/// How steady the hand is. All amplitudes are those of sums of sines with random phases.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct HandSettings {
    /// Fastest speed of the sweeps, m/s (default 0.1).
    pub speed: f64,
    /// Slow sway across the sweep, m (default 3 mm, at 0.2 to 0.8 Hz).
    pub sway: f64,
    /// Slow turning about each axis, rad (default 1.5 degrees, at 0.2 to 0.8 Hz).
    pub turn: f64,
    /// Physiological tremor, m (default 0.1 mm, at 8 to 12 Hz).
    pub tremor: f64,
    /// Time to change from one part of the object to the next, s (default 2).
    pub change: f64,
}

impl Default for HandSettings {
    fn default() -> Self {
        Self { speed: 0.1, sway: 3e-3, turn: 1.5_f64.to_radians(), tremor: 1e-4, change: 2.0 }
    }
}

/// Sweeps before one part of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// The robot in the middle of its sweep; it sweeps along its y axis.
    pub middle: Isometry3<f64>,
    /// Half of the sweep's width, m.
    pub half_width: f64,
    /// How long the person stays, s: rounded to whole sweeps.
    pub duration: f64,
}

/// Poses of the robot over time.
#[derive(Debug, Clone)]
pub struct HandMotion {
    settings: HandSettings,
    passes: Vec<Pass>,
    /// For each of six coordinates a few sines: amplitude, frequency, phase.
    waves: [Vec<[f64; 3]>; 6],
}

/// Sines of each kind in a coordinate.
const SINES: usize = 3;
/// How far the person steps back between two parts, m.
const RETREAT: f64 = 0.15;

impl HandMotion {
    /// A motion of its own for each seed.
    ///
    /// # Errors
    /// No passes, or numbers that are not positive.
    pub fn new(passes: &[Pass], settings: HandSettings, seed: u64) -> Result<Self, Error> {
        check_positive("hand.speed", settings.speed)?;
        check_positive("hand.change", settings.change)?;
        for (what, value) in
            [("hand.sway", settings.sway), ("hand.turn", settings.turn), ("hand.tremor", settings.tremor)]
        {
            check_not_negative(what, value)?;
        }
        if passes.is_empty() {
            return Err(Error::Empty { what: "passes of the hand" });
        }
        for pass in passes {
            check_positive("half width of a pass", pass.half_width)?;
            check_positive("duration of a pass", pass.duration)?;
        }
        let mut random = Rng::new(seed, 24);
        let waves = std::array::from_fn(|coordinate| {
            let slow = if coordinate < 3 { settings.sway } else { settings.turn };
            // Tremor turns the hand about a lever of a tenth of a metre.
            let fast = if coordinate < 3 { settings.tremor } else { settings.tremor / 0.1 };
            let mut sines = |amplitude: f64, low: f64, high: f64| {
                let one = |random: &mut Rng| {
                    let frequency = low + (high - low) * random.uniform();
                    [amplitude / (SINES as f64).sqrt(), frequency, TAU * random.uniform()]
                };
                (0..SINES).map(|_| one(&mut random)).collect::<Vec<_>>()
            };
            [sines(slow, 0.2, 0.8), sines(fast, 8.0, 12.0)].concat()
        });
        let whole = |pass: &Pass| {
            let sweep = 0.5 * TAU * pass.half_width / settings.speed;
            Pass { duration: (pass.duration / sweep).round().max(1.0) * sweep, ..*pass }
        };
        Ok(Self { settings, passes: passes.iter().map(whole).collect(), waves })
    }

    /// How long it takes, s.
    pub fn duration(&self) -> f64 {
        let changes = self.settings.change * (self.passes.len() - 1) as f64;
        self.passes.iter().map(|pass| pass.duration).sum::<f64>() + changes
    }

    /// The robot at a time, s; before and after the motion at its ends.
    pub fn at(&self, time: f64) -> Isometry3<f64> {
        let time = time.clamp(0.0, self.duration());
        let mut since = time;
        for (index, pass) in self.passes.iter().enumerate() {
            if since <= pass.duration || index + 1 == self.passes.len() {
                return self.unsteady(time, &pass.middle, self.sweep(pass, since));
            }
            since -= pass.duration;
            if since < self.settings.change {
                let (from, to) = (&pass.middle, &self.passes[index + 1].middle);
                let ends = [self.sweep(pass, pass.duration), self.sweep(&self.passes[index + 1], 0.0)];
                return self.between(time, [from, to], since / self.settings.change, ends);
            }
            since -= self.settings.change;
        }
        self.passes[0].middle
    }

    /// Place along the sweep, which begins and ends where the hand turns round.
    fn sweep(&self, pass: &Pass, since: f64) -> f64 {
        -pass.half_width * (self.settings.speed / pass.half_width * since).cos()
    }

    fn between(&self, time: f64, [from, to]: [&Isometry3<f64>; 2], share: f64, aside: [f64; 2]) -> Isometry3<f64> {
        let smooth = share * share * (3.0 - 2.0 * share);
        // Opposite orientations have no shortest way between them; either end will do.
        let rotation = from.rotation.try_slerp(&to.rotation, smooth, 1e-9).unwrap_or(to.rotation);
        let straight = from.translation.vector.lerp(&to.translation.vector, smooth);
        let back = rotation * Vector3::x() * (RETREAT * (0.5 * TAU * share).sin().powi(2));
        let middle = Isometry3::from_parts(Translation3::from(straight - back), rotation);
        self.unsteady(time, &middle, aside[0] + (aside[1] - aside[0]) * smooth)
    }

    fn unsteady(&self, time: f64, middle: &Isometry3<f64>, aside: f64) -> Isometry3<f64> {
        let wave =
            |k: usize| -> f64 { self.waves[k].iter().map(|[a, f, phase]| a * (TAU * f * time + phase).sin()).sum() };
        let shift = Vector3::new(wave(0), aside + wave(1), wave(2));
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(wave(3), wave(4), wave(5)));
        middle * Isometry3::from_parts(Translation3::from(shift), turn)
    }
}
