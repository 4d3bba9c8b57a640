//! The two textures: paint wanted and paint there, texel by texel, in whole femtolitres.

use super::step::StepHits;
use super::texel_surface::TexelSurface;
use crate::error::Error;
use crate::spray::QUANTUM;

/// Paint wanted and paint on the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Paint wanted, femtolitres.
    target: Vec<u64>,
    /// Paint there, femtolitres.
    current: Vec<u64>,
    /// Thickness that is missing, m; negative where there is too much.
    deficit: Vec<f32>,
    /// One femtolitre as thickness, m; zero where there is no surface.
    thickness: Vec<f32>,
    /// The largest target thickness, m.
    full: f64,
}

/// How a painting stands. Masses are shares of the target's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CoverageFigures {
    /// Paint where some is wanted, up to the target of each texel.
    pub inside: f64,
    /// Paint where none is wanted.
    pub outside: f64,
    /// Paint above the target where some is wanted.
    pub above: f64,
    /// Share of the surface's texels where paint is wanted and which have more than their target by a tenth of the largest thickness
    /// wanted.
    pub overdosed_wanted: f64,
    /// The same of the texels where none is wanted, over all of the surface too.
    pub overdosed_bare: f64,
}

impl CoverageFigures {
    /// Share of all of the surface's texels that have more than their target by a tenth of the largest thickness wanted.
    pub fn overdosed(&self) -> f64 {
        self.overdosed_wanted + self.overdosed_bare
    }
}

impl Coverage {
    /// Bare, from the wanted thickness of each texel, m, row by row.
    ///
    /// # Errors
    /// As many values as the surface has no texels, values that are negative or not finite, or nothing wanted on the surface.
    pub fn new(surface: &TexelSurface, thickness: &[f64]) -> Result<Self, Error> {
        let areas = surface.areas();
        if thickness.len() != areas.len() {
            let value = thickness.len() as f64;
            return Err(Error::OutOfRange {
                what: "number of target texels",
                value,
                allowed: "columns times rows of the surface's texture: give a target of the atlas's size",
            });
        }
        if let Some(index) = thickness.iter().position(|t| !(t.is_finite() && *t >= 0.0)) {
            return Err(Error::NotFinite { what: "target thickness", index });
        }
        let target: Vec<u64> =
            thickness.iter().zip(areas).map(|(t, area)| (t * area / QUANTUM).round() as u64).collect();
        if target.iter().all(|&t| t == 0) {
            return Err(Error::Empty { what: "the target on the surface" });
        }
        let per_femtolitre = |area: &f64| if *area > 0.0 { (QUANTUM / area) as f32 } else { 0.0 };
        let mut coverage = Self {
            current: vec![0; target.len()],
            deficit: vec![0.0; target.len()],
            thickness: areas.iter().map(per_femtolitre).collect(),
            full: thickness.iter().copied().fold(0.0, f64::max),
            target,
        };
        (0..coverage.target.len()).for_each(|texel| coverage.update(texel));
        Ok(coverage)
    }

    /// Adds paint to a texel; what lies beside the surface is passed over. Returns what was added, femtolitres.
    pub fn add(&mut self, texel: usize, femtolitres: u64) -> u64 {
        if self.thickness.get(texel).is_none_or(|thickness| *thickness == 0.0) {
            return 0;
        }
        self.current[texel] += femtolitres;
        self.update(texel);
        femtolitres
    }

    /// Adds what one step sprays, with `droplet` femtolitres in each droplet. Returns the paint that landed on texels, femtolitres.
    pub fn spray(&mut self, hits: &StepHits, droplet: u64) -> u64 {
        hits.texels.iter().map(|&(texel, count)| self.add(texel as usize, u64::from(count) * droplet)).sum()
    }

    fn update(&mut self, texel: usize) {
        self.deficit[texel] = self.remaining(texel) as f32 * self.thickness[texel];
    }

    /// Paint that a texel still needs, femtolitres; negative where it has too much.
    pub fn remaining(&self, texel: usize) -> i64 {
        self.target[texel] as i64 - self.current[texel] as i64
    }

    /// Paint wanted, femtolitres.
    pub fn target(&self) -> &[u64] {
        &self.target
    }

    /// Paint there, femtolitres.
    pub fn current(&self) -> &[u64] {
        &self.current
    }

    /// Thickness that is missing, m.
    pub(super) fn deficit(&self) -> &[f32] {
        &self.deficit
    }

    /// The largest thickness wanted anywhere, m.
    pub fn full_thickness(&self) -> f64 {
        self.full
    }

    /// Root mean square of the difference of two thicknesses of the same surface where a full coat is wanted, in such coats: how far
    /// books that were kept of a painting are off.
    pub fn difference(&self, other: &Self) -> f64 {
        let pairs = self.current.iter().zip(&other.current).zip(&self.target).zip(&self.thickness);
        // A texel's target is rounded to whole femtolitres.
        let full = |&(((_, _), &target), &per): &(((_, _), &u64), &f32)| {
            target as f64 * f64::from(per) > (1.0 - 1e-3) * self.full && target > 0
        };
        let squares = pairs.filter(full).map(|(((&one, &two), &target), _)| {
            let off = (one as f64 - two as f64) / target as f64;
            off * off
        });
        let (count, sum) = squares.fold((0_u32, 0.0), |(count, sum), square| (count + 1, sum + square));
        (sum / f64::from(count.max(1))).sqrt()
    }

    /// How the painting stands.
    pub fn figures(&self) -> CoverageFigures {
        let (mut wanted, mut inside, mut outside, mut above) = (0, 0, 0, 0);
        let (mut texels, mut overdosed) = (0_usize, [0_usize; 2]);
        for (texel, (&target, &current)) in self.target.iter().zip(&self.current).enumerate() {
            wanted += target;
            if target == 0 {
                outside += current;
            } else {
                inside += current.min(target);
                above += current.saturating_sub(target);
            }
            texels += usize::from(self.thickness[texel] > 0.0);
            overdosed[usize::from(target == 0)] += usize::from(f64::from(-self.deficit[texel]) > 0.1 * self.full);
        }
        let share = |part: u64| part as f64 / wanted as f64;
        CoverageFigures {
            inside: share(inside),
            outside: share(outside),
            above: share(above),
            overdosed_wanted: overdosed[0] as f64 / texels as f64,
            overdosed_bare: overdosed[1] as f64 / texels as f64,
        }
    }
}
