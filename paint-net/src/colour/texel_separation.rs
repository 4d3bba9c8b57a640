//! Colour separation pixel by pixel: how much of each paint every pixel would need if it could be painted alone.

use std::collections::BTreeMap;

use super::mixing_model::{MOST_PAINTS, MixingModel};
use super::pixel_fit::PixelFit;
use crate::error::{Error, require};
use crate::trace::span;

/// Edge of the cells of CIELAB whose pixels begin at one place.
const CELL: f64 = 6.0;
/// Depth of a single paint from which the search of a cell begins beside the bare wall.
const ALONE: f64 = 0.7;

/// Colour separation pixel by pixel. Ours.
///
/// Minimises `½ |B (Lab(d) - T)|² + λ Σ d_p + ½ ρ Σ d_p²` over depths `0 ≤ d ≤ deepest` for every pixel, with `B` the rows of CIEDE2000 at the
/// wanted colour `T`. `λ` saves paint; `ρ` makes the depths change little where the colour does, also where several mixtures look alike, so that a
/// soft spray can follow. The search begins from several mixtures for one pixel of each small cell of CIELAB, and from what it found for the
/// others of the cell.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct TexelSeparation {
    /// Depth beyond which no paint goes. Default 4.
    pub deepest: f64,
    /// `λ`, per unit of depth. Default 0.5.
    pub paint_weight: f64,
    /// `ρ`. Default 0.5.
    pub spread_weight: f64,
    /// Largest number of iterations for a pixel. Default 20.
    pub iterations: usize,
    /// Worker threads; results do not depend on them. Default 1.
    pub threads: usize,
}

impl Default for TexelSeparation {
    fn default() -> Self {
        Self { deepest: 4.0, paint_weight: 0.5, spread_weight: 0.5, iterations: 20, threads: 1 }
    }
}

/// What each pixel needs, and what it then looks like.
#[derive(Debug, Clone, PartialEq)]
pub struct Separated {
    /// Depths, paint after paint, one for each pixel.
    pub depths: Vec<Vec<f64>>,
    /// CIELAB with these depths; that of the bare wall where nothing is wanted.
    pub lab: Vec<[f64; 3]>,
}

impl TexelSeparation {
    /// Separates colours in CIELAB; `None` where the wall stays bare.
    ///
    /// # Errors
    /// Settings out of range, no paints or more than [`MOST_PAINTS`], colours that are not finite.
    pub fn separate(&self, wanted: &[Option<[f64; 3]>], model: &dyn MixingModel) -> Result<Separated, Error> {
        span!("separate_texels");
        let fit = self.pixel_fit(model)?;
        for (k, colour) in wanted.iter().enumerate() {
            if let Some(&value) = colour.iter().flatten().find(|v| !v.is_finite()) {
                return Err(Error::Pixel { what: "wanted colour", x: k, y: 0, value, range: "CIELAB, finite" });
            }
        }
        let n = model.paints();
        let mut cells: BTreeMap<[i32; 3], usize> = BTreeMap::new();
        let cell = |lab: [f64; 3]| lab.map(|v| (v / CELL).round() as i32);
        for (k, lab) in wanted.iter().enumerate().filter_map(|(k, lab)| Some((k, (*lab)?))) {
            cells.entry(cell(lab)).or_insert(k);
        }
        let cells: Vec<([i32; 3], usize)> = cells.into_iter().collect();
        let start = |&(key, k): &([i32; 3], usize)| (key, search(&fit, n, k, wanted[k].unwrap_or_default()).1);
        let starts: BTreeMap<[i32; 3], [f64; MOST_PAINTS]> =
            in_parallel(&cells, self.threads, &start).into_iter().collect();
        let pixels: Vec<usize> = (0..wanted.len()).collect();
        let pixel = |&k: &usize| {
            let Some(lab) = wanted[k] else {
                return ([0.0; MOST_PAINTS], model.lab(k, &[0.0; MOST_PAINTS][..n], &mut [[0.0; 3]; MOST_PAINTS][..n]));
            };
            let mut depths = starts.get(&cell(lab)).copied().unwrap_or_default();
            let (_, found) = fit.solve(k, lab, &mut depths[..n]);
            (depths, found)
        };
        let found = in_parallel(&pixels, self.threads, &pixel);
        Ok(Separated {
            depths: (0..n).map(|p| found.iter().map(|(depths, _)| depths[p]).collect()).collect(),
            lab: found.into_iter().map(|(_, lab)| lab).collect(),
        })
    }

    /// What a few colours cost at best, each as often as its weight says: what a choice or an order of paints is judged by. The model is asked for
    /// pixel 0.
    ///
    /// # Errors
    /// As [`separate`](Self::separate).
    pub fn cost(&self, colours: &[([f64; 3], f64)], model: &dyn MixingModel) -> Result<f64, Error> {
        let fit = self.pixel_fit(model)?;
        let each = |&(lab, weight): &([f64; 3], f64)| weight * search(&fit, model.paints(), 0, lab).0;
        Ok(in_parallel(colours, self.threads, &each).into_iter().sum())
    }

    fn pixel_fit<'a>(&self, model: &'a dyn MixingModel) -> Result<PixelFit<'a>, Error> {
        let n = model.paints();
        require("paints", n as f64, (1..=MOST_PAINTS).contains(&n), "a separation takes 1 to 12 paints")?;
        require("deepest", self.deepest, self.deepest > 0.0 && self.deepest.is_finite(), "it must be positive")?;
        for (name, value) in [("paint_weight", self.paint_weight), ("spread_weight", self.spread_weight)] {
            require(name, value, (0.0..=1e6).contains(&value), "it must lie in [0, 1000000]")?;
        }
        require("threads", self.threads as f64, self.threads > 0, "it must be at least 1")?;
        let Self { deepest, paint_weight, spread_weight, iterations, .. } = *self;
        Ok(PixelFit { model, deepest, paint_weight, spread_weight, iterations })
    }
}

/// The cheapest of the fits from a bare wall and from each paint alone.
fn search(fit: &PixelFit, paints: usize, pixel: usize, wanted: [f64; 3]) -> (f64, [f64; MOST_PAINTS]) {
    let begin = |paint: Option<usize>| {
        let mut depths = [0.0; MOST_PAINTS];
        if let Some(paint) = paint {
            depths[paint] = ALONE.min(fit.deepest);
        }
        let (cost, _) = fit.solve(pixel, wanted, &mut depths[..paints]);
        (cost, depths)
    };
    let others = (0..paints).map(|p| begin(Some(p)));
    others.fold(begin(None), |best, other| if other.0 < best.0 { other } else { best })
}

/// `work` on every item, in the order of the items, by as many threads.
pub(super) fn in_parallel<T: Sync, R: Send>(items: &[T], threads: usize, work: &(dyn Fn(&T) -> R + Sync)) -> Vec<R> {
    let share = items.len().div_ceil(threads).max(1);
    if threads < 2 || items.len() < 2 {
        return items.iter().map(work).collect();
    }
    std::thread::scope(|scope| {
        let parts: Vec<_> =
            items.chunks(share).map(|part| scope.spawn(move || part.iter().map(work).collect::<Vec<R>>())).collect();
        let join = |part: std::thread::ScopedJoinHandle<'_, Vec<R>>| {
            part.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        parts.into_iter().flat_map(join).collect()
    })
}
