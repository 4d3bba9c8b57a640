//! All paints of all cells at once, in single precision: what they look like, how far that is from what is wanted, and the
//! derivative.

use super::colour_metric::ColourMetric;
use super::colour_problem::ColourProblem;
use super::mixture::{Block, Mixture, ROWS};
use super::palette::MAX_PAINTS;
use super::unmix::unmix;
use crate::model::cells;
use crate::network::{BLOCK, FootprintOperator, PaddedGrid};

/// The cost of paint. Paint of a cell is measured by the depth that it gives where all cells have the same.
pub(super) struct MixtureCost {
    mixture: Mixture,
    cells: PaddedGrid,
    pixels: PaddedGrid,
    footprint: FootprintOperator<f32>,
    /// The same for squared footprints.
    squared: FootprintOperator<f32>,
    scratch: Vec<f32>,
    /// One plane per band.
    wanted: Vec<f32>,
    /// The metric `M = w BᵀB` of differences in planes `M₀₀ M₀₁ M₀₂ M₁₁ M₁₂ M₂₂`, zero outside the picture.
    metric: Vec<f32>,
    /// One plane per paint.
    paint: Vec<f32>,
    /// Depth of each paint, then what is gathered from it.
    depth: Vec<f32>,
}

impl MixtureCost {
    pub(super) fn new(problem: &ColourProblem, metric: ColourMetric) -> Self {
        let ColourProblem { palette, kernel, limits, .. } = *problem;
        let (width, height) = (problem.wanted.width(), problem.wanted.height());
        let (columns, rows) = (cells(width, limits.spray_spacing), cells(height, limits.row_spacing));
        let of_profile =
            |taps| FootprintOperator::new(taps, (limits.spray_spacing, limits.row_spacing), (columns[0], rows[0]));
        let (footprint, squared) = (of_profile(kernel.taps()), of_profile(kernel.squared().taps()));
        let cells = PaddedGrid::new(columns.len(), rows.len(), footprint.reach());
        let pixels = PaddedGrid::new(width, height, 0);
        let (mut wanted, mut tensor) = (pixels.planes(3), pixels.planes(6));
        // Only shares count, and any weight fits single precision as a share.
        let largest = problem.weight.map_or(1.0, |w| w.data().iter().copied().fold(0.0, f64::max));
        for (k, colour) in problem.wanted.data().iter().enumerate() {
            let at = pixels.at(k % width, k / width);
            let share = problem.weight.map_or(1.0, |w| w.data()[k] / largest);
            let jacobian = metric.jacobian(*colour);
            for i in 0..3 {
                wanted[i * pixels.plane() + at] = colour[i] as f32;
                for j in i..3 {
                    let sum: f64 = jacobian.iter().map(|row| row[i] * row[j]).sum();
                    tensor[ROWS[i][j] * pixels.plane() + at] = (share * sum) as f32;
                }
            }
        }
        let mixture = Mixture::new(palette);
        Self {
            scratch: footprint.scratch(&cells).planes(limits.spray_spacing),
            paint: cells.planes(mixture.paints),
            depth: pixels.planes(mixture.paints),
            mixture,
            cells,
            pixels,
            footprint,
            squared,
            wanted,
            metric: tensor,
        }
    }

    /// For a start, paint after paint: the mean under the footprint of every cell of the depth that its pixels would need if
    /// each could be painted alone; and `Σ g² (∂I/∂d)ᵀ M (∂I/∂d)` there, with a floor where that is nothing.
    pub(super) fn start(&mut self, deepest: f64, mass_of_squares: f64) -> (Vec<f64>, Vec<f64>) {
        const FLOOR: f64 = 0.03;
        let cells = self.cells.width * self.cells.height;
        let ones = vec![1.0; self.mixture.paints * cells];
        let (mut means, mut curvatures) = (ones.clone(), ones.clone());
        self.for_blocks(|mixture, depths, wanted, metric| unmix(mixture, depths, wanted, metric, deepest as f32));
        self.gather_means(false, 1.0, &ones, &mut means);
        self.for_blocks(Mixture::curvature);
        self.gather_means(true, mass_of_squares, &ones, &mut curvatures);
        for curvatures in curvatures.chunks_exact_mut(cells) {
            let floor = FLOOR * curvatures.iter().sum::<f64>() / cells as f64 + 1e-12;
            for v in curvatures {
                *v += floor;
            }
        }
        (means, curvatures)
    }

    /// `½ Σ (I - T)ᵀ M (I - T)` and its derivative by `values`, one per cell, paint after paint. `unit` of the depth that a cell
    /// gives where all cells have the same is a value of 1.
    pub(super) fn cost(&mut self, values: &[f64], unit: &[f64], gradient: &mut [f64]) -> f64 {
        let (columns, rows) = (self.cells.width, self.cells.height);
        for p in 0..self.mixture.paints {
            for j in 0..rows {
                let from = (p * rows + j) * columns..(p * rows + j + 1) * columns;
                let to = self.cells.row_mut(&mut self.paint, p, j);
                for ((to, v), unit) in to.iter_mut().zip(&values[from.clone()]).zip(&unit[from]) {
                    *to = (v * unit) as f32;
                }
            }
            let (from, to) = (&self.paint[p * self.cells.plane()..], &mut self.depth[p * self.pixels.plane()..]);
            self.footprint.deposit(&self.cells, from, &self.pixels, to, &mut self.scratch);
        }
        let mut cost = 0.0;
        self.for_blocks(|mixture, depths, wanted, metric| {
            cost += f64::from(mixture.cost_and_gradient(depths, wanted, metric));
        });
        // A footprint's mean is its sum over as many pixels as a cell has.
        let stride = self.footprint.stride();
        self.gather_means(false, (stride.0 * stride.1) as f64, unit, gradient);
        0.5 * cost
    }

    /// Works on the depths of all paints, a block of pixels after the other, given what is wanted there and its metric.
    #[inline(always)]
    fn for_blocks(&mut self, mut work: impl FnMut(&Mixture, &mut [Block; MAX_PAINTS], &[Block; 3], &[Block; 6])) {
        let plane = self.pixels.plane();
        let mut depths = [[0.0; BLOCK]; MAX_PAINTS];
        for y in 0..self.pixels.height {
            for x in (0..self.pixels.width).step_by(BLOCK) {
                let at = self.pixels.at(x, y);
                let (mut wanted, mut metric) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 6]);
                load(&self.wanted, plane, at, &mut wanted);
                load(&self.metric, plane, at, &mut metric);
                let paints = &mut depths[..self.mixture.paints];
                load(&self.depth, plane, at, paints);
                work(&self.mixture, &mut depths, &wanted, &metric);
                for (p, depth) in depths[..self.mixture.paints].iter().enumerate() {
                    self.depth[p * plane + at..][..BLOCK].copy_from_slice(depth);
                }
            }
        }
    }

    /// `cells = factor · unit · mean under each footprint` of the planes of `depth`.
    fn gather_means(&mut self, squared: bool, factor: f64, unit: &[f64], out: &mut [f64]) {
        let (columns, rows) = (self.cells.width, self.cells.height);
        let operator = if squared { &self.squared } else { &self.footprint };
        for p in 0..self.mixture.paints {
            let from = &self.depth[p * self.pixels.plane()..];
            operator.mean(&self.cells, &mut self.paint, p, &self.pixels, from, &mut self.scratch);
            for j in 0..rows {
                let to = (p * rows + j) * columns..(p * rows + j + 1) * columns;
                let from = self.cells.row(&self.paint, p, j);
                for ((to, unit), &v) in out[to.clone()].iter_mut().zip(&unit[to]).zip(from) {
                    *to = factor * unit * f64::from(v);
                }
            }
        }
    }
}

/// A block of every plane.
#[inline(always)]
fn load(planes: &[f32], plane: usize, at: usize, blocks: &mut [Block]) {
    for (k, block) in blocks.iter_mut().enumerate() {
        block.copy_from_slice(&planes[k * plane + at..][..BLOCK]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::colour_image::ColourImage;
    use crate::colour::palette::{Paint, Palette};
    use crate::image::Image;
    use crate::model::{FootprintMatrix, SprayKernel};
    use crate::problem::Limits;
    use crate::procedural::lattice;

    const SIZE: (usize, usize) = (21, 14);

    fn of(k: usize, salt: i64) -> f64 {
        lattice(11, k as i64, salt)
    }

    fn pixels<T>(value: impl Fn(usize) -> T) -> Vec<T> {
        (0..SIZE.0 * SIZE.1).map(value).collect()
    }

    /// With a paint that covers, and with glazes alone.
    fn palettes() -> [Palette; 2] {
        let blue = Paint::glaze("blue", [0.1, 0.3, 0.8]);
        let others = [Paint::opaque("white", [0.9; 3], 2.0), Paint::glaze("red", [0.9, 0.2, 0.3])];
        others.map(|other| Palette::new([0.9, 0.8, 0.7], vec![blue.clone(), other]).unwrap())
    }

    fn nozzle() -> (SprayKernel, Limits) {
        (SprayKernel::new(2.0, 2.0).unwrap(), Limits { spray_spacing: 2, row_spacing: 3, ..Limits::default() })
    }

    #[test]
    fn cost_and_derivative_are_those_of_the_definition() {
        let wanted = ColourImage::new(SIZE.0, SIZE.1, pixels(|k| [of(k, 0), of(k, 1), of(k, 2)])).unwrap();
        // Only their ratios count, and the largest is more than single precision holds.
        let weight = Image::new(SIZE.0, SIZE.1, pixels(|k| 1e200 * of(k, 4))).unwrap();
        let heaviest = weight.data().iter().copied().fold(0.0, f64::max);
        let (kernel, limits) = nozzle();
        let footprints = FootprintMatrix::new(&kernel, SIZE, limits.spray_spacing, limits.row_spacing);
        let cells = footprints.cells();
        let depth_per_volume = kernel.mass() / 6.0;
        let values: Vec<f64> = (0..2 * cells).map(|k| 0.6 * of(k, 3)).collect();
        let unit: Vec<f64> = (0..2 * cells).map(|k| 0.5 + of(k, 5)).collect();
        for palette in palettes() {
            let problem = ColourProblem::new(&wanted, &palette).with_kernel(&kernel).with_limits(&limits);
            let problem = ColourProblem { weight: Some(&weight), ..problem };
            let mut model = MixtureCost::new(&problem, ColourMetric::Ciede2000);
            let exact = |values: &[f64]| {
                let volumes: Vec<f64> = values.iter().zip(&unit).map(|(v, unit)| v * unit / depth_per_volume).collect();
                let mut depths = [pixels(|_| 0.0), pixels(|_| 0.0)];
                for (volumes, depth) in volumes.chunks_exact(cells).zip(&mut depths) {
                    footprints.deposit(volumes, depth);
                }
                let mut cost = 0.0;
                for (k, &wanted) in wanted.data().iter().enumerate() {
                    let colour = palette.colour(&depths.each_ref().map(|depth| depth[k]));
                    for row in ColourMetric::Ciede2000.jacobian(wanted) {
                        let residual: f64 = (0..3).map(|b| row[b] * (colour[b] - wanted[b])).sum();
                        cost += 0.5 * weight.data()[k] / heaviest * residual * residual;
                    }
                }
                cost
            };
            let mut gradient = vec![0.0; values.len()];
            let cost = model.cost(&values, &unit, &mut gradient);
            assert!((cost / exact(&values) - 1.0).abs() < 1e-4, "{cost} {}", exact(&values));
            for k in (0..2 * cells).step_by(7) {
                let shifted = |h: f64| {
                    let mut values = values.clone();
                    values[k] += h;
                    exact(&values)
                };
                let (found, expected) = (gradient[k], (shifted(1e-5) - shifted(-1e-5)) / 2e-5);
                assert!((found - expected).abs() < 2e-3 * expected.abs() + 0.05, "{k}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_start_shows_an_even_colour_and_knows_its_curvature() {
        let (kernel, limits) = nozzle();
        // Of glazes, which add up as the start takes all paints to do.
        let palette = &palettes()[1];
        let (depths, metric) = ([0.7, 0.4], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let wanted = ColourImage::new(SIZE.0, SIZE.1, pixels(|_| palette.colour(&depths))).unwrap();
        let problem = ColourProblem::new(&wanted, palette).with_kernel(&kernel).with_limits(&limits);
        let mut model = MixtureCost::new(&problem, ColourMetric::Euclidean);
        let squared = kernel.squared();
        let footprints = FootprintMatrix::new(&squared, SIZE, limits.spray_spacing, limits.row_spacing);
        let cells = footprints.cells();
        let (found, curvatures) = model.start(3.0, squared.mass());
        // An odd number of columns and of rows.
        let middle = cells / 2;
        for (p, depth) in depths.into_iter().enumerate() {
            assert!((found[p * cells + middle] - depth).abs() < 1e-3, "paint {p}: {}", found[p * cells + middle]);
            let slopes = metric.map(|band| palette.adjoint(&depths, band)[p]);
            let curvature = slopes.iter().map(|s| s * s).sum::<f64>();
            let mut expected = vec![0.0; cells];
            footprints.adjoint(&pixels(|_| curvature), &mut expected);
            let floor = 0.03 * expected.iter().sum::<f64>() / cells as f64;
            for (k, (found, expected)) in curvatures[p * cells..].iter().zip(&expected).enumerate() {
                assert!((found / (expected + floor) - 1.0).abs() < 1e-3, "paint {p}, cell {k}: {found}, {expected}");
            }
        }
    }
}
