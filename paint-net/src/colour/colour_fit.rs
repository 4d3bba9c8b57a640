//! Volumes of the sprays of several paints for the footprints that they really have, all at once.

use super::colour_metric::ciede2000_rows;
use super::mixing_model::{MOST_PAINTS, MixingModel};
use super::pixel_fit::{difference, dot, times};
use super::texel_separation::in_parallel;
use crate::error::{Error, require};
use crate::optimise::{StoppingRule, minimise};
use crate::painters::SurfaceFootprint;
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
    pub footprints: &'a [&'a [SurfaceFootprint]],
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
        let used = |p: usize, k: usize, f: &SurfaceFootprint| {
            !f.is_empty() && self.prices.get(p).is_none_or(|prices| prices[k].is_finite())
        };
        let of_used = |value: f64| -> Vec<Vec<f64>> {
            let paints = self.footprints.iter().enumerate();
            let of_paint = |(p, footprints): (usize, &&[SurfaceFootprint])| {
                footprints.iter().enumerate().map(|(k, f)| if used(p, k, f) { value } else { 0.0 }).collect()
            };
            paints.map(of_paint).collect()
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
        Ok(planes.depths)
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
        for &(k, depth) in self.footprints.iter().flat_map(|of_paint| of_paint.iter().flatten()) {
            if k as usize >= pixels || !(depth >= 0.0 && depth.is_finite()) {
                let range = "pixels of the picture and a depth of 0 or more";
                return Err(Error::Pixel { what: "footprint", x: k as usize, y: 0, value: f64::from(depth), range });
            }
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

/// Depths of all paints on all pixels, then what pulls at them.
struct Planes<'a> {
    fit: &'a ColourFit<'a>,
    counted: Vec<Pixel>,
    least: Vec<Vec<f64>>,
    depths: Vec<Vec<f64>>,
}

impl<'a> Planes<'a> {
    fn new(fit: &'a ColourFit, least: Vec<Vec<f64>>) -> Self {
        let counted = (0..fit.wanted.len()).filter(|&k| fit.weight[k] > 0.0);
        let pixel = |k: usize| Pixel { k, rows: ciede2000_rows(fit.wanted[k]) };
        let depths = vec![vec![0.0; fit.wanted.len()]; fit.footprints.len()];
        Self { fit, counted: counted.map(pixel).collect(), least, depths }
    }

    fn deposit(&mut self, volumes: &[Vec<f64>]) {
        let paints: Vec<usize> = (0..volumes.len()).collect();
        let pixels = self.fit.wanted.len();
        let plane = |&p: &usize| {
            let mut plane = vec![0.0; pixels];
            for (footprint, volume) in self.fit.footprints[p].iter().zip(&volumes[p]).filter(|(_, v)| **v > 0.0) {
                for &(k, depth) in footprint {
                    plane[k as usize] += volume * f64::from(depth);
                }
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
        let n = self.depths.len();
        let curvature = |pixel: &Pixel| {
            let (_, slopes) = self.look(pixel.k);
            let of = |p: usize| times(&pixel.rows, slopes[p]).iter().map(|v| v * v).sum::<f64>();
            (
                pixel.k,
                std::array::from_fn::<f64, MOST_PAINTS, _>(
                    |p| if p < n { self.fit.weight[pixel.k] * of(p) } else { 0.0 },
                ),
            )
        };
        let found = in_parallel(&self.counted, self.fit.threads, &curvature);
        let mut fields = vec![vec![0.0; self.fit.wanted.len()]; n];
        for (k, of_paints) in found {
            fields.iter_mut().zip(of_paints).for_each(|(field, value)| field[k] = value);
        }
        let mut units = Vec::new();
        for (field, footprints) in fields.iter().zip(self.fit.footprints) {
            let of = |f: &SurfaceFootprint| f.iter().map(|&(k, g)| f64::from(g * g) * field[k as usize]).sum::<f64>();
            let curvatures: Vec<f64> = footprints.iter().map(of).collect();
            let floor = FLOOR * curvatures.iter().sum::<f64>() / curvatures.len().max(1) as f64 + 1e-9;
            units.extend(curvatures.iter().map(|c| 1.0 / (c + floor).sqrt()));
        }
        units
    }

    fn look(&self, k: usize) -> ([f64; 3], [[f64; 3]; MOST_PAINTS]) {
        let n = self.depths.len();
        let (mut depths, mut slopes) = ([0.0; MOST_PAINTS], [[0.0; 3]; MOST_PAINTS]);
        depths.iter_mut().zip(&self.depths).for_each(|(depth, plane)| *depth = plane[k]);
        let lab = self.fit.model.lab(k, &depths[..n], &mut slopes[..n]);
        (lab, slopes)
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
        let n = self.depths.len();
        let ColourFit { wanted, weight, paint_weight, .. } = *self.fit;
        let pull = |block: &&[Pixel]| {
            let mut cost = 0.0;
            let pulls = block.iter().map(|pixel| {
                let (lab, slopes) = self.look(pixel.k);
                let residual = times(&pixel.rows, difference(lab, wanted[pixel.k]));
                let paint: f64 = self.depths.iter().map(|plane| plane[pixel.k]).sum();
                cost += weight[pixel.k] * (0.5 * dot(residual, residual) + paint_weight * paint);
                let pull = |p: usize| dot(times(&pixel.rows, slopes[p]), residual) + paint_weight;
                std::array::from_fn::<f64, MOST_PAINTS, _>(|p| if p < n { weight[pixel.k] * pull(p) } else { 0.0 })
            });
            (pulls.collect::<Vec<_>>(), cost)
        };
        let blocks: Vec<&[Pixel]> = self.counted.chunks(BLOCK).collect();
        let pulled = in_parallel(&blocks, self.fit.threads, &pull);
        let colours: f64 = pulled.iter().map(|(_, cost)| cost).sum();
        let mut fields = vec![vec![0.0; wanted.len()]; n];
        for (block, (pulls, _)) in blocks.iter().zip(&pulled) {
            for (pixel, pulls) in block.iter().zip(pulls) {
                fields.iter_mut().zip(pulls).for_each(|(field, pull)| field[pixel.k] = *pull);
            }
        }
        let paints: Vec<usize> = (0..n).collect();
        let gathered = in_parallel(&paints, self.fit.threads, &|&p: &usize| {
            let of = |f: &SurfaceFootprint| f.iter().map(|&(k, g)| f64::from(g) * fields[p][k as usize]).sum::<f64>();
            self.fit.footprints[p].iter().map(of).collect::<Vec<f64>>()
        });
        for ((slot, pull), unit) in gradient.iter_mut().zip(gathered.into_iter().flatten()).zip(unit) {
            *slot = pull * unit;
        }
        let mut ways = 0.0;
        for (k, price) in self.fit.prices.iter().flatten().enumerate().filter(|(_, price)| price.is_finite()) {
            ways += price * values[k] * unit[k];
            gradient[k] += price * unit[k];
        }
        colours + ways
    }
}
