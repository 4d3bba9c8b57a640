//! Surface tension draws ripples level.

use super::WetFilm;
use super::descents::Side;
use super::flow::Flow;
use super::wet_paint::WetPaint;
use super::wet_state::WetState;
use crate::error::{Error, check_not_negative, check_range};
use crate::film::Film;
use crate::spray::QUANTUM;

/// Largest share of its paint that a texel gives in a step.
const MOST_GIVEN: f64 = 0.25;
/// Most steps into which one is divided.
const MOST_STEPS: f64 = 10_000.0;
/// Curvatures are summed as whole numbers of this part of 1/m, so that no order of neighbours changes the sum.
const UNIT: f64 = 1.0 / (1_u64 << 32) as f64;
/// Curvatures beyond this make no film, 1/m.
const LARGEST: f64 = 1e6;

impl WetPaint {
    /// Time in which ripples of fresh paint fall to a share of 1/e, s (Orchard 1962), infinite without surface tension:
    ///
    /// ```text
    /// tau = 3 mu lambda^4 / (16 pi^4 s h^3)
    /// ```
    ///
    /// `thickness` is that of the wet film, `wavelength` that of the ripples, both m. With a tenth of a millimetre of the default paint, but no
    /// yield stress, ripples of 4 mm take 8 s and those of 25 mm three hours and a half: on texels of a centimetre nothing levels before the
    /// paint is dry.
    pub fn levelling_time(&self, thickness: f64, wavelength: f64) -> f64 {
        let wave_number = std::f64::consts::TAU / wavelength;
        3.0 * self.viscosity / (self.surface_tension * thickness.powi(3) * wave_number.powi(4))
    }

    /// Amplitude of ripples that stay, m: their pressure shears the paint at the wall by no more than its yield stress, `s h a (2 pi /
    /// lambda)^3 = tau` (Orchard 1962; Smith, Orchard and Rhind-Tutt 1961).
    pub fn lasting_ripple(&self, thickness: f64, wavelength: f64) -> f64 {
        let wave_number = std::f64::consts::TAU / wavelength;
        self.yield_stress / (self.surface_tension * thickness * wave_number.powi(3))
    }
}

/// Levels a [`WetFilm`]: the pressure `-s d²h` under its surface drives the paint as a Bingham fluid from texel to texel.
///
/// It is for texels of a few millimetres and paint with little yield stress; [`WetPaint::levelling_time`] and [`WetPaint::lasting_ripple`] at
/// two texels tell whether it can matter. Where it does, its steps alternate with those of [`WetFilm::step`], which knows nothing of it.
/// Ripples of twelve texels or more decay within 5 % of Orchard's rate.
///
/// The film ends where it ends: paint moves from wet texels to wet ones. Bends of the surface below, and a slope's part in overcoming the yield
/// stress, are left out. The account is exact, and the numbering of texels changes nothing.
#[derive(Debug, Clone)]
pub struct Levelling {
    /// Where the neighbours of each texel begin; one more than texels.
    first: Vec<usize>,
    neighbours: Vec<Neighbour>,
}

#[derive(Debug, Clone, Copy)]
struct Neighbour {
    texel: u32,
    /// One over its distance, 1/m.
    inverse: f64,
}

/// A wet texel in a step.
#[derive(Debug, Clone, Copy, Default)]
struct Here {
    /// Of what is wet, m; zero where nothing is.
    thickness: f64,
    /// Of all paint, m.
    height: f64,
    /// In [`UNIT`].
    curvature: i64,
}

impl Levelling {
    /// For films on these texels; `sides` as for [`WetFilm::new`].
    ///
    /// # Errors
    /// A side that names no texel.
    pub fn new(film: &Film, sides: &[Side]) -> Result<Self, Error> {
        let texels = film.texels();
        let mut lists = vec![Vec::new(); texels.len()];
        for side in sides {
            let last = texels.len() as f64 - 1.0;
            for texel in [Some(side.texel), side.beyond].into_iter().flatten() {
                check_range("texel of a side", f64::from(texel), 0.0, last, "the index of a texel of the film")?;
            }
            let Some(texel) = side.beyond else { continue };
            let inverse = 1.0 / (texels[texel as usize].point - texels[side.texel as usize].point).norm();
            // Centres on one another: a degenerate texel, which has no way there.
            if inverse.is_finite() {
                lists[side.texel as usize].push(Neighbour { texel, inverse });
            }
        }
        let mut first = vec![0];
        first.extend(lists.iter().scan(0, |end, list| {
            *end += list.len();
            Some(*end)
        }));
        Ok(Self { first, neighbours: lists.concat() })
    }

    /// Lets a film level for `seconds`, in which it neither dries nor runs.
    ///
    /// # Errors
    /// A time that is negative or not finite, a film of other texels.
    pub fn step(&self, film: &mut WetFilm, seconds: f64) -> Result<Flow, Error> {
        check_not_negative("seconds", seconds)?;
        let state = &mut film.0;
        let (expected, found) = (self.first.len() - 1, state.solvent.len());
        if expected != found {
            return Err(Error::WrongLength { what: "texels", expected, found });
        }
        let mut flow = Flow::default();
        let mut rates = vec![0.0; self.neighbours.len()];
        let mut left = seconds;
        while left > 0.0 {
            let fastest = self.rates(state, &mut rates);
            if fastest <= 0.0 {
                break;
            }
            let (wanted, least) = (1.0 / fastest, seconds / MOST_STEPS);
            let step = wanted.max(least).min(left);
            flow.steps += 1;
            flow.held_back += u64::from(wanted < least);
            self.give(state, &rates, step);
            left -= step;
        }
        state.fastest = None;
        Ok(flow)
    }

    fn neighbours(&self, texel: usize) -> (std::ops::Range<usize>, &[Neighbour]) {
        let range = self.first[texel]..self.first[texel + 1];
        (range.clone(), &self.neighbours[range])
    }

    /// Share of its paint that each texel gives to each neighbour, 1/s; the rate that bounds the step, 1/s, zero where nothing moves.
    fn rates(&self, state: &WetState, rates: &mut [f64]) -> f64 {
        let WetState { film, paint, dry, solvent, .. } = state;
        let quanta = |quanta: u64, texel: usize| quanta as f64 * QUANTUM / film.texels()[texel].area;
        let surface = |k: usize| match solvent[k] {
            0 => Here::default(),
            liquid => Here {
                thickness: quanta(film.volumes[k] - dry[k] + liquid, k),
                height: quanta(film.volumes[k] + liquid, k),
                curvature: 0,
            },
        };
        rates.fill(0.0);
        let mut here: Vec<Here> = (0..solvent.len()).map(surface).collect();
        for k in 0..here.len() {
            let bend = |near: &Neighbour| {
                let other = here[near.texel as usize];
                let bend = (other.height - here[k].height) * near.inverse * near.inverse;
                if other.thickness > 0.0 { (bend.clamp(-LARGEST, LARGEST) / UNIT).round() as i64 } else { 0 }
            };
            here[k].curvature = self.neighbours(k).1.iter().map(bend).sum();
        }
        let mut fastest = 0.0_f64;
        for (k, at) in here.iter().enumerate().filter(|(_, at)| at.thickness > 0.0) {
            let (range, near) = self.neighbours(k);
            let stiffening = paint.stiffening(quanta(film.volumes[k] - dry[k], k) / at.thickness);
            let (mut given, mut spread) = (0.0, 0.0);
            for (rate, near) in rates[range].iter_mut().zip(near) {
                let other = here[near.texel as usize];
                let fall = (other.curvature - at.curvature) as f64 * UNIT;
                // Paint goes where the surface is more hollow: the pressure is -s times the curvature.
                let gradient = paint.surface_tension * fall * near.inverse;
                if other.thickness > 0.0 && gradient > 0.0 {
                    *rate = paint.flux(at.thickness, gradient, stiffening) * near.inverse / at.thickness;
                }
                given += *rate;
                spread += near.inverse * near.inverse;
            }
            if given > 0.0 {
                // Half of what the fastest ripples on the grid stand.
                let mobility = paint.surface_tension * at.thickness.powi(3) / (3.0 * paint.viscosity * stiffening);
                fastest = fastest.max(mobility * (2.0 * spread).powi(2)).max(given / MOST_GIVEN);
            }
        }
        fastest
    }

    /// All give at once, of what they had.
    fn give(&self, state: &mut WetState, rates: &[f64], step: f64) {
        let WetState { film, dry, solvent, .. } = state;
        let had: Vec<[u64; 2]> = (0..solvent.len()).map(|k| [film.volumes[k] - dry[k], solvent[k]]).collect();
        for (k, had) in had.into_iter().enumerate() {
            let mut left = had;
            let (range, near) = self.neighbours(k);
            for (rate, near) in rates[range].iter().zip(near).filter(|(rate, _)| **rate > 0.0) {
                let given: [u64; 2] =
                    std::array::from_fn(|part| ((had[part] as f64 * rate * step).round() as u64).min(left[part]));
                left = std::array::from_fn(|part| left[part] - given[part]);
                film.volumes[near.texel as usize] += given[0];
                solvent[near.texel as usize] += given[1];
            }
            film.volumes[k] -= had[0] - left[0];
            solvent[k] -= had[1] - left[1];
        }
    }
}
