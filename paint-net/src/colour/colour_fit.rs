//! Volumes of the sprays of several paints for the footprints that they really have, all at once.

use super::colour_metric::ciede2000_rows;
use super::footprint_set::FootprintSet;
use super::mixing_model::{MOST_PAINTS, MixingModel};
use super::pixel_fit::{difference, dot, times};
use super::texel_separation::in_parallel;
use crate::error::{Error, require};
use crate::optimise::{StoppingRule, minimise};
use crate::trace::span;

/// Pixels whose costs are summed up in one piece: sums do not depend on the threads.
const BLOCK: usize = 2048;
/// Curvature that every volume has at least, as a share of the mean.
const FLOOR: f64 = 0.03;

/// A fit of the volumes of all paints to wanted colours:
///
/// ```text
/// ½ Σ w |B (Lab(d) - T)|² + λ Σ w d + Σ c v    with  d_p = S_p v_p    subject to  v_min ≤ v ≤ v_max
/// ```
///
/// with footprints as columns of `S_p` and the rows `B` of CIEDE2000 at the wanted colour `T`. Each volume is scaled by the root of its
/// Gauss-Newton curvature at the start, `Σ w g² |B ∂Lab/∂d_p|²`, which makes strong and weak paints, shown and hidden ones, alike. Ours.
#[derive(Clone, Copy)]
pub struct ColourFit<'a> {
    /// Wanted colour of each pixel, CIELAB.
    pub wanted: &'a [[f64; 3]],
    /// How much each pixel matters, 0 or more.
    pub weight: &'a [f64],
    /// What films look like there.
    pub model: &'a dyn MixingModel,
    /// For each paint, one footprint for each spray.
    pub footprints: &'a [&'a FootprintSet],
    /// What every spray has at least that leaves anything.
    pub min_volume: f64,
    /// What it has at most.
    pub max_volume: f64,
    /// `λ`, per unit of depth.
    pub paint_weight: f64,
    /// `c`: what a unit of each volume costs besides, paint after paint, 0 or more. Infinity leaves a spray out: its volume becomes 0. Empty: nothing.
    pub prices: &'a [Vec<f64>],
    /// Largest number of iterations.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row.
    pub tolerance: f64,
    /// Worker threads; results do not depend on them.
    pub threads: usize,
}

impl ColourFit<'_> {
    /// Changes `volumes`, paint after paint, from where they are; the depths that they give, paint after paint. `progress` is told the share done.
    ///
    /// # Errors
    /// Settings out of range; sizes that do not fit together; footprints beside the pixels.
    pub fn solve(&self, volumes: &mut [Vec<f64>], progress: &mut dyn FnMut(f64)) -> Result<Vec<Vec<f64>>, Error> {
        span!("fit_colours");
        self.check(volumes)?;
        let of_used = |value: f64| -> Vec<Vec<f64>> {
            let used = |p: usize, k: usize| {
                !self.footprints[p].leaves_nothing(k) && self.prices.get(p).is_none_or(|prices| prices[k].is_finite())
            };
            let of_paint =
                |p: usize| (0..self.footprints[p].len()).map(|k| if used(p, k) { value } else { 0.0 }).collect();
            (0..self.footprints.len()).map(of_paint).collect()
        };
        let least = of_used(self.min_volume);
        let room = of_used(self.max_volume - self.min_volume);
        let mut planes = Planes::new(self, least);
        let start: Vec<Vec<f64>> = volumes
            .iter()
            .zip(planes.least.iter().zip(&room))
            .map(|(volumes, (least, room))| {
                volumes.iter().zip(least.iter().zip(room)).map(|(v, (l, room))| (v - l).clamp(0.0, *room)).collect()
            })
            .collect();
        let unit = planes.units(&start);
        let mut values: Vec<f64> = start.iter().flatten().zip(&unit).map(|(v, unit)| v / unit).collect();
        let upper: Vec<f64> = room.iter().flatten().zip(&unit).map(|(room, unit)| room / unit).collect();
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        minimise(&mut values, &upper, &stop, &mut |values, gradient| planes.cost(values, &unit, gradient), progress);
        let mut k = 0;
        for (volumes, least) in volumes.iter_mut().zip(&planes.least) {
            for (volume, least) in volumes.iter_mut().zip(least) {
                *volume = least + values[k] * unit[k];
                k += 1;
            }
        }
        planes.deposit(volumes);
        Ok(planes.depths.into_iter().map(|plane| plane.into_iter().map(f64::from).collect()).collect())
    }

    fn check(&self, volumes: &[Vec<f64>]) -> Result<(), Error> {
        let n = self.model.paints();
        require("paints", n as f64, (1..=MOST_PAINTS).contains(&n), "a fit takes 1 to 12 paints")?;
        require("threads", self.threads as f64, self.threads > 0, "it must be at least 1")?;
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        require("paint_weight", self.paint_weight, (0.0..=1e6).contains(&self.paint_weight), "it must be 0 or more")?;
        let ordered = 0.0 <= self.min_volume && self.min_volume < self.max_volume && self.max_volume.is_finite();
        require("max_volume", self.max_volume, ordered, "it must be above min_volume, which is 0 or more")?;
        let pixels = self.wanted.len();
        let sizes = [("weight", self.weight.len(), pixels), ("list of paints", self.footprints.len(), n)];
        let of_paints = volumes.iter().zip(self.footprints).map(|(v, f)| ("list of footprints", f.len(), v.len()));
        let sizes = sizes.into_iter().chain([("volumes", volumes.len(), n)]).chain(of_paints);
        let of_prices = self.prices.iter().zip(self.footprints).map(|(c, f)| ("list of prices", c.len(), f.len()));
        let priced = if self.prices.is_empty() { n } else { self.prices.len() };
        let sizes = sizes.chain([("prices", priced, n)]).chain(of_prices);
        if let Some((what, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(Error::Mismatch { what, found: (found, 1), expected: (expected, 1) });
        }
        if let Some(beside) = self.footprints.iter().map(|of_paint| of_paint.pixels()).find(|found| *found > pixels) {
            return Err(Error::Mismatch { what: "pixels under footprints", found: (beside, 1), expected: (pixels, 1) });
        }
        let least = self.prices.iter().flatten().copied().find(|price| price.is_nan() || *price < 0.0).unwrap_or(0.0);
        require("prices", least, least >= 0.0, "they must be 0 or more")?;
        let finite = self.wanted.iter().flatten().chain(self.weight).find(|v| !v.is_finite());
        match finite {
            Some(&value) => Err(Error::Pixel { what: "wanted colour", x: 0, y: 0, value, range: "finite" }),
            None => Ok(()),
        }
    }
}

/// A pixel that counts: where it is, its metric and its weight.
struct Pixel {
    k: usize,
    rows: [[f64; 3]; 3],
}

/// CIELAB of a pixel, and the depths of all paints there together.
struct Look {
    lab: [f64; 3],
    paint: f64,
}

/// What becomes of the weight, look and slopes of a pixel: a value for each paint, and one for the sum.
type OfPixel<'a> = dyn Fn(f64, &Pixel, &Look, &[[f64; 3]], &mut [f32]) -> f64 + Sync + 'a;

/// Depths of all paints on all pixels, then what pulls at them, in single precision as the model of the colours.
struct Planes<'a> {
    fit: &'a ColourFit<'a>,
    counted: Vec<Pixel>,
    least: Vec<Vec<f64>>,
    depths: Vec<Vec<f32>>,
    /// What pulls at the depths; 0 on pixels that do not count.
    pulls: Vec<Vec<f32>>,
}

impl<'a> Planes<'a> {
    fn new(fit: &'a ColourFit, least: Vec<Vec<f64>>) -> Self {
        let counted = (0..fit.wanted.len()).filter(|&k| fit.weight[k] > 0.0);
        let pixel = |k: usize| Pixel { k, rows: ciede2000_rows(fit.wanted[k]) };
        let depths = vec![vec![0.0; fit.wanted.len()]; fit.footprints.len()];
        Self { fit, counted: counted.map(pixel).collect(), least, pulls: depths.clone(), depths }
    }

    fn deposit(&mut self, volumes: &[Vec<f64>]) {
        let paints: Vec<usize> = (0..volumes.len()).collect();
        let pixels = self.fit.wanted.len();
        let plane = |&p: &usize| {
            let mut plane = vec![0.0; pixels];
            for (k, &volume) in volumes[p].iter().enumerate().filter(|(_, volume)| **volume > 0.0) {
                self.fit.footprints[p].deposit(k, volume, &mut plane);
            }
            plane
        };
        self.depths = in_parallel(&paints, self.fit.threads, &plane);
    }

    /// Depth that makes an equal change of colour, one for each volume.
    fn units(&mut self, start: &[Vec<f64>]) -> Vec<f64> {
        let full: Vec<Vec<f64>> =
            start.iter().zip(&self.least).map(|(v, l)| v.iter().zip(l).map(|(v, l)| v + l).collect()).collect();
        self.deposit(&full);
        self.on_each_pixel(&|weight, pixel, _, slopes, out| {
            for (out, slope) in out.iter_mut().zip(slopes) {
                let slope = times(&pixel.rows, *slope);
                *out = (weight * dot(slope, slope)) as f32;
            }
            0.0
        });
        let mut units = Vec::new();
        for (field, footprints) in self.pulls.iter().zip(self.fit.footprints) {
            let of = |k: usize| footprints.iter(k).map(|(pixel, g)| f64::from(g * g * field[pixel])).sum::<f64>();
            let curvatures: Vec<f64> = (0..footprints.len()).map(of).collect();
            let floor = FLOOR * curvatures.iter().sum::<f64>() / curvatures.len().max(1) as f64 + 1e-9;
            units.extend(curvatures.iter().map(|c| 1.0 / (c + floor).sqrt()));
        }
        units
    }

    /// Puts what `of` makes of the weight, colour and slopes of each pixel into `pulls`, paint after paint; the sum of what it returns.
    fn on_each_pixel(&mut self, of: &OfPixel) -> f64 {
        let (n, fit) = (self.depths.len(), self.fit);
        let of_block = |block: &&[Pixel]| {
            let (mut values, mut sum) = (vec![0.0; n * block.len()], 0.0);
            let mut slopes = [[0.0; 3]; MOST_PAINTS];
            for (pixel, values) in block.iter().zip(values.chunks_exact_mut(n)) {
                let mut depths = [0.0; MOST_PAINTS];
                depths.iter_mut().zip(&self.depths).for_each(|(depth, plane)| *depth = f64::from(plane[pixel.k]));
                let lab = fit.model.lab(pixel.k, &depths[..n], &mut slopes[..n]);
                let look = Look { lab, paint: depths[..n].iter().sum() };
                sum += of(fit.weight[pixel.k], pixel, &look, &slopes[..n], values);
            }
            (values, sum)
        };
        let blocks: Vec<&[Pixel]> = self.counted.chunks(BLOCK).collect();
        let found = in_parallel(&blocks, fit.threads, &of_block);
        for (block, (values, _)) in blocks.iter().zip(&found) {
            for (pixel, values) in block.iter().zip(values.chunks_exact(n)) {
                self.pulls.iter_mut().zip(values).for_each(|(plane, value)| plane[pixel.k] = *value);
            }
        }
        found.iter().map(|(_, sum)| sum).sum()
    }

    fn cost(&mut self, values: &[f64], unit: &[f64], gradient: &mut [f64]) -> f64 {
        let mut k = 0;
        let volume = |least: &f64| {
            k += 1;
            least + values[k - 1] * unit[k - 1]
        };
        let mut next = volume;
        let volumes: Vec<Vec<f64>> = self.least.iter().map(|least| least.iter().map(&mut next).collect()).collect();
        self.deposit(&volumes);
        let ColourFit { wanted, paint_weight, footprints, prices, threads, .. } = *self.fit;
        let colours = self.on_each_pixel(&|weight, pixel, look, slopes, out| {
            let residual = times(&pixel.rows, difference(look.lab, wanted[pixel.k]));
            for (out, slope) in out.iter_mut().zip(slopes) {
                *out = (weight * (dot(times(&pixel.rows, *slope), residual) + paint_weight)) as f32;
            }
            weight * (0.5 * dot(residual, residual) + paint_weight * look.paint)
        });
        let paints: Vec<usize> = (0..self.pulls.len()).collect();
        let gathered = in_parallel(&paints, threads, &|&p: &usize| {
            (0..footprints[p].len()).map(|k| footprints[p].gather(k, &self.pulls[p])).collect::<Vec<f64>>()
        });
        for ((slot, pull), unit) in gradient.iter_mut().zip(gathered.into_iter().flatten()).zip(unit) {
            *slot = pull * unit;
        }
        let mut ways = 0.0;
        for (k, price) in prices.iter().flatten().enumerate().filter(|(_, price)| price.is_finite()) {
            ways += price * values[k] * unit[k];
            gradient[k] += price * unit[k];
        }
        colours + ways
    }
}
