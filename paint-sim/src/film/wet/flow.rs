//! One pass over the texels: what leaves each as solvent, and what runs on.

use super::super::Film;
use super::descents::Downhill;
use super::wet_paint::{GRAVITY, WetPaint};
use super::wet_state::WetState;
use crate::spray::QUANTUM;

/// Share of the way over a texel that the fastest wave may go in a step; what gathers between two looks may be twice as fast.
const COURANT: f64 = 0.5;
/// Most steps into which one is divided.
const MOST_STEPS: f64 = 10_000.0;

/// How paint has run in a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flow {
    /// Steps that it took; 1 where nothing ran.
    pub steps: u64,
    /// Steps too long for the fastest paint, which went one texel in each instead: it ran slower than it would.
    pub held_back: u64,
}

impl Flow {
    pub(super) fn and(self, other: Self) -> Self {
        Self { steps: self.steps + other.steps, held_back: self.held_back + other.held_back }
    }
}

impl WetState {
    /// Dries and runs for a time over which stiffness hardly changes: first order, upwind, explicit.
    pub(super) fn advance(&mut self, seconds: f64) -> Flow {
        let mut flow = Flow::default();
        let mut fastest = self.fastest.unwrap_or_else(|| self.pass(0.0, 0.0));
        let (mut left, mut drying) = (seconds, seconds);
        loop {
            let (wanted, least) = (COURANT / fastest, seconds / MOST_STEPS);
            let step = wanted.max(least).min(left);
            flow.steps += 1;
            flow.held_back += u64::from(wanted < least);
            fastest = self.pass(step, drying);
            (left, drying) = (left - step, 0.0);
            if left <= 0.0 || fastest <= 0.0 {
                break;
            }
        }
        self.fastest = Some(fastest);
        self.drip();
        flow
    }

    /// Every texel dries for `drying` seconds, then gives for `step`; the largest rate of a wave over a texel, 1/s, before that. Lower
    /// texels come first: what a texel gives is of what it had.
    fn pass(&mut self, step: f64, drying: f64) -> f64 {
        let fluid = Fluid::of(&self.paint);
        let Self { film, paint, ground, descents, dry, solvent, soaked, ran, balance, .. } = self;
        let Film { volumes, .. } = film;
        let (air, solvent_left) = (paint.evaporation * drying, paint.solvent_left());
        let (mut fastest, mut start) = (0.0_f64, 0);
        for at in &descents.ranked {
            let sides = &descents.downhill[start..at.end as usize];
            start = at.end as usize;
            let texel = at.texel as usize;
            let mut liquid = solvent[texel];
            if liquid == 0 {
                continue;
            }
            let solids = volumes[texel] - dry[texel];
            let quantum = f64::from(at.quantum);
            if drying > 0.0 {
                // Into the ground first, then into the air.
                if ground.sorptivity > 0.0 {
                    let before = float(soaked[texel]) * quantum;
                    let drunk = whole((ground.soaked_after(before, drying) - before) / quantum).min(liquid);
                    soaked[texel] += drunk;
                    liquid -= drunk;
                }
                let gone = whole(air / quantum).min(liquid);
                liquid -= gone;
                balance.evaporated += gone;
                if float(liquid) <= solvent_left * float(solids) {
                    dry[texel] = volumes[texel];
                    solvent[texel] = 0;
                    balance.evaporated += liquid;
                    continue;
                }
            }
            let (mut solids_left, mut liquid_left) = (solids, liquid);
            if let Some((share, wave)) = fluid.readiness(float(solids), float(liquid), quantum, f64::from(at.sag)) {
                let mut falls = 0.0;
                for &Downhill { to, fall } in sides {
                    falls += f64::from(fall);
                    let share = share * f64::from(fall) * step;
                    let given = whole(float(solids) * share).min(solids_left);
                    solids_left -= given;
                    volumes[to as usize] += given;
                    let given = whole(float(liquid) * share).min(liquid_left);
                    liquid_left -= given;
                    solvent[to as usize] += given;
                }
                fastest = fastest.max(wave * falls);
                ran[texel] |= solids_left != solids;
                volumes[texel] -= solids - solids_left;
            }
            solvent[texel] = liquid_left;
        }
        fastest
    }

    /// What hangs from lower edges beyond a bead of the capillary length squared per width.
    fn drip(&mut self) {
        let bead = self.paint.surface_tension / (self.paint.density * GRAVITY);
        for &texel in &self.descents.hanging {
            let texel = texel as usize;
            let area = self.film.index.texels[texel].area;
            let had = [self.film.volumes[texel] - self.dry[texel], self.solvent[texel]];
            let hangs = (had[0] + had[1]) as f64 * QUANTUM;
            let holds = bead * area.sqrt();
            if hangs > holds {
                let [solids, solvent] = had.map(|part| (part as f64 * (1.0 - holds / hangs)) as u64);
                self.film.volumes[texel] -= solids;
                self.film.mass_balance.deposited -= solids;
                self.film.mass_balance.dripped += solids;
                self.solvent[texel] -= solvent;
                self.balance.dripped += solvent;
            }
        }
    }
}

/// A paint as the inner loop needs it.
struct Fluid {
    packing: f64,
    /// `packing - solids` of the can.
    room: f64,
    /// `rho g / mu`, 1/(m s).
    weight: f64,
}

impl Fluid {
    fn of(paint: &WetPaint) -> Self {
        Self {
            packing: paint.packing,
            room: paint.packing - paint.solids,
            weight: paint.density * GRAVITY / paint.viscosity,
        }
    }

    /// Share of its paint that a texel gives, and speed of its waves, both per second and fall; `None` where it carries its paint, as fresh
    /// paint does up to `sag`.
    fn readiness(&self, solids: f64, liquid: f64, quantum: f64, sag: f64) -> Option<(f64, f64)> {
        let wet = solids + liquid;
        let thickness = wet * quantum;
        // One over `WetPaint::stiffening`.
        let softness = ((self.packing * wet - solids) / (self.room * wet)).powi(2);
        // One division for two.
        let inverse = 1.0 / (6.0 * thickness * softness);
        let sheared = thickness - sag * 6.0 * thickness * inverse;
        if sheared <= 0.0 {
            return None;
        }
        let wave = self.weight * softness * sheared;
        // `WetPaint::flux` over the weight and the thickness.
        Some((wave * sheared * (3.0 * thickness - sheared) * softness * inverse, wave * thickness))
    }
}

/// The nearest whole number. Sums of 2^52 and less than that have its digits as their last bits: a conversion that heeds infinities takes
/// three times as long. A texel holds less than 2^52 quanta (4.5 litres); of more, no more goes at a time.
fn whole(quanta: f64) -> u64 {
    const SHIFT: f64 = (1_u64 << 52) as f64;
    (quanta.min(SHIFT - 1.0) + SHIFT).to_bits() & ((1 << 52) - 1)
}

/// Signed numbers are converted in one instruction.
fn float(quanta: u64) -> f64 {
    quanta.cast_signed() as f64
}
