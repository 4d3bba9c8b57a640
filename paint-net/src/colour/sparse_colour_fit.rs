//! Volumes of the sprays of several paints, each where the picture needs it.

use std::collections::BTreeMap;

use super::coarse_picture::CoarsePicture;
use super::colour_fit::ColourFit;
use super::footprint_set::FootprintSet;
use crate::error::{Error, require};
use crate::model::Spray;
use crate::path::Stroke;

/// Fits with prices. The last leaves out hardly more than the one before it (ours).
const ROUNDS: usize = 4;
/// Share of a paint's mean over all blocks below which what lies in one does not count, as the price of its way sees it.
const SOFTENING: f64 = 0.05;
/// Share of that mean below which the block is left out in the end.
const LEAST: f64 = 0.03;
/// Shares of the progress for the first fit and for each round; the last fit has the rest.
const SHARES: [f64; 2] = [0.3, 0.1];

/// A [`ColourFit`] that leaves each paint out where the others show the picture nearly as well, so that the nozzle need not go there:
///
/// ```text
/// cost of the colours + μ Σ l log(1 + m / ε)
/// ```
///
/// with a term for each paint and each block of the picture: `l` the way of the paint's rows there, `m` the paint that they leave and ε a share of
/// its mean. The logarithm is replaced by its tangent again and again (Candès, Wakin, Boyd, *Enhancing Sparsity by Reweighted ℓ1 Minimization*, 2008,
/// for groups). Blocks in which hardly anything is left are emptied, and the volumes fitted once more without a price. Ours.
#[derive(Clone, Copy)]
pub struct SparseColourFit<'a> {
    /// The fit, a footprint for each spray of `rows`. Its `prices` are not heeded.
    pub fit: ColourFit<'a>,
    /// For each paint the rows over which it may be sprayed.
    pub rows: &'a [&'a [Stroke]],
    /// Edge of the blocks, pixels.
    pub block: f64,
    /// What a pixel of way costs beside half the square of a colour difference: `μ`. With 0, nothing is left out.
    pub price: f64,
    /// For each pixel the coarse pixel that it belongs to, from 0: all fits but the last are made on those. Empty: on the pixels themselves.
    pub coarse: &'a [u32],
}

impl SparseColourFit<'_> {
    /// As [`ColourFit::solve`]. The volumes of sprays that are left out are 0, whatever `min_volume` is.
    ///
    /// # Errors
    /// Those of [`ColourFit::solve`]; rows of another number than paints or footprints; a price or blocks out of range.
    pub fn solve(&self, volumes: &mut [Vec<f64>], progress: &mut dyn FnMut(f64)) -> Result<Vec<Vec<f64>>, Error> {
        self.check()?;
        let fit = ColourFit { prices: &[], ..self.fit };
        if self.price == 0.0 {
            return fit.solve(volumes, progress);
        }
        let coarse = if self.coarse.is_empty() { None } else { Some(CoarsePicture::new(&fit, self.coarse)?) };
        let model = coarse.as_ref().map(|coarse| coarse.model(fit.model));
        let footprints = coarse.as_ref().map(CoarsePicture::footprints);
        let rough = match (&coarse, &model, &footprints) {
            (Some(coarse), Some(model), Some(footprints)) => coarse.fit(&fit, model, footprints),
            _ => fit,
        };
        let [first, share] = SHARES;
        rough.solve(volumes, &mut |done| progress(first * done))?;
        let mut blocks: Vec<Blocks> =
            self.rows.iter().zip(self.fit.footprints).map(|(rows, f)| Blocks::new(rows, f, self.block)).collect();
        blocks.iter_mut().zip(&*volumes).for_each(|(blocks, volumes)| blocks.measure(volumes));
        let means: Vec<f64> = blocks.iter().map(Blocks::mean).collect();
        for round in 0..ROUNDS {
            let prices = |(blocks, mean): (&Blocks, &f64)| blocks.prices(self.price, SOFTENING * mean);
            let prices: Vec<Vec<f64>> = blocks.iter().zip(&means).map(prices).collect();
            let from = first + round as f64 * share;
            let iterations = self.fit.iterations.div_ceil(3);
            let priced = ColourFit { prices: &prices, iterations, ..rough };
            priced.solve(volumes, &mut |done| progress(from + share * done))?;
            blocks.iter_mut().zip(&*volumes).for_each(|(blocks, volumes)| blocks.measure(volumes));
        }
        let left_out = |(blocks, mean): (&Blocks, &f64)| blocks.left_out(LEAST * mean);
        let prices: Vec<Vec<f64>> = blocks.iter().zip(&means).map(left_out).collect();
        let from = first + ROUNDS as f64 * share;
        ColourFit { prices: &prices, ..self.fit }.solve(volumes, &mut |done| progress(from + (1.0 - from) * done))
    }

    fn check(&self) -> Result<(), Error> {
        require("price", self.price, (0.0..=1e6).contains(&self.price), "it must lie in [0, 1000000]")?;
        require("block", self.block, self.block >= 1.0 && self.block.is_finite(), "it must be 1 or more")?;
        let sprays = |rows: &&[Stroke]| rows.iter().map(|row| row.sprays.len()).sum::<usize>();
        let of_paints = self.rows.iter().zip(self.fit.footprints);
        let sizes = of_paints.map(|(rows, footprints)| ("rows", sprays(rows), footprints.len()));
        let mut sizes = sizes.chain([("list of rows", self.rows.len(), self.fit.footprints.len())]);
        match sizes.find(|(_, found, expected)| found != expected) {
            Some((what, found, expected)) => Err(Error::Mismatch { what, found: (found, 1), expected: (expected, 1) }),
            None => Ok(()),
        }
    }
}

/// The sprays of a paint by the block in which they lie.
struct Blocks {
    /// Block of each spray, and what a unit of its volume leaves on all pixels.
    of_spray: Vec<(usize, f64)>,
    /// Way over each block and what the volumes leave there.
    ways: Vec<f64>,
    amounts: Vec<f64>,
}

impl Blocks {
    fn new(rows: &[Stroke], footprints: &FootprintSet, edge: f64) -> Self {
        let mut numbers: BTreeMap<[i64; 2], usize> = BTreeMap::new();
        let mut ways = Vec::new();
        let mut of_spray = Vec::with_capacity(footprints.len());
        for (spray, way) in rows.iter().flat_map(way_of_each) {
            let cell = [spray.x, spray.y].map(|v| (v / edge).floor() as i64);
            let block = *numbers.entry(cell).or_insert_with(|| {
                ways.push(0.0);
                ways.len() - 1
            });
            ways[block] += way;
            let whole = footprints.iter(of_spray.len()).map(|(_, depth)| f64::from(depth)).sum();
            of_spray.push((block, whole));
        }
        Self { of_spray, amounts: vec![0.0; ways.len()], ways }
    }

    fn measure(&mut self, volumes: &[f64]) {
        self.amounts.fill(0.0);
        for ((block, whole), volume) in self.of_spray.iter().zip(volumes) {
            self.amounts[*block] += whole * volume;
        }
    }

    fn mean(&self) -> f64 {
        self.amounts.iter().sum::<f64>() / self.amounts.len().max(1) as f64
    }

    /// Slope of the price of a block's way over the volume of each of its sprays.
    fn prices(&self, price: f64, softening: f64) -> Vec<f64> {
        let of = |&(block, whole): &(usize, f64)| {
            let amount = self.amounts[block] + softening;
            // A paint that lies nowhere costs nothing.
            if amount > 0.0 { price * self.ways[block] * whole / amount } else { 0.0 }
        };
        self.of_spray.iter().map(of).collect()
    }

    /// Without a price, but for blocks with less than `least`: these at any.
    fn left_out(&self, least: f64) -> Vec<f64> {
        let of = |(block, _): &(usize, f64)| if self.amounts[*block] < least { f64::INFINITY } else { 0.0 };
        self.of_spray.iter().map(of).collect()
    }
}

/// The sprays of a row, each with half of the way to its neighbours.
fn way_of_each(row: &Stroke) -> impl Iterator<Item = (&Spray, f64)> {
    let sprays = &row.sprays;
    let way = |k: usize| (sprays[k].x - sprays[k + 1].x).hypot(sprays[k].y - sprays[k + 1].y);
    let before = move |k: usize| if k == 0 { 0.0 } else { way(k - 1) };
    let after = move |k: usize| if k + 1 == sprays.len() { 0.0 } else { way(k) };
    sprays.iter().enumerate().map(move |(k, spray)| (spray, 0.5 * (before(k) + after(k))))
}
