//! All paints of all cells at once, in single precision: what they look like, how far that is from what is wanted, and the
//! derivative.

use super::Wall;
use crate::kernel::SprayKernel;
use crate::network::{BLOCK, Grid, Spread};
use crate::painter::{Board, Limits};
use crate::palette::{MOST_PAINTS, Palette};

/// One value for each pixel of a block.
type Block = [f32; BLOCK];

/// The cost of paint. Paint of a cell is measured by the depth that it gives where all cells have the same.
pub(super) struct Blend<'a> {
    palette: &'a Palette,
    cells: Grid,
    pixels: Grid,
    spread: Spread<f32>,
    scratch: Vec<f32>,
    /// One plane per band.
    wanted: Vec<f32>,
    /// The measure `M = BᵀB` of differences: `M₀₀ M₀₁ M₀₂ M₁₁ M₁₂ M₂₂`, zero outside the picture.
    measure: Vec<f32>,
    /// One plane per paint.
    paint: Vec<f32>,
    /// Depth of each paint, then the derivative by it.
    depth: Vec<f32>,
}

impl<'a> Blend<'a> {
    pub(super) fn new(wall: &Wall<'a>, board: &Board, kernel: &SprayKernel, limits: &Limits) -> Self {
        let (columns, rows) = (&board.footprints.columns, &board.footprints.rows);
        let stride = (limits.along, limits.row_spacing);
        let spread = Spread::new(kernel.taps(), stride, (columns[0], rows[0]));
        let cells = Grid::new(columns.len(), rows.len(), spread.reach());
        let (width, height) = (wall.wanted.width, wall.wanted.height);
        let pixels = Grid::new(width, height, 0);
        let fill = |count: usize, value: &dyn Fn(usize, usize) -> f64| {
            let mut planes = pixels.planes(count);
            for plane in 0..count {
                for y in 0..height {
                    let row = pixels.row_mut(&mut planes, plane, y);
                    row.iter_mut().enumerate().for_each(|(x, v)| *v = value(plane, y * width + x) as f32);
                }
            }
            planes
        };
        let paints = wall.palette.paints().len();
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        Self {
            palette: wall.palette,
            scratch: spread.scratch(&cells).planes(stride.0),
            wanted: fill(3, &|band, k| wall.wanted.data[k][band]),
            measure: fill(6, &|pair, k| {
                let (i, j) = pairs[pair];
                wall.weight(k) * wall.measures[k].iter().map(|row| row[i] * row[j]).sum::<f64>()
            }),
            paint: cells.planes(paints),
            depth: fill(paints, &|p, k| wall.depths[k][p]),
            cells,
            pixels,
            spread,
        }
    }

    /// For a start: the mean depth that is wanted under each footprint.
    pub(super) fn means(&mut self) -> Vec<f64> {
        let mut means = vec![0.0; self.paints() * self.cells.width * self.cells.height];
        self.gather(&mut means, 1.0);
        means
    }

    /// `½ Σ (I - T)ᵀ M (I - T)` for the paint of every cell, paint after paint, and its derivative.
    pub(super) fn cost(&mut self, paint: &[f64], gradient: &mut [f64]) -> f64 {
        let (columns, rows) = (self.cells.width, self.cells.height);
        for p in 0..self.paints() {
            for j in 0..rows {
                let from = &paint[(p * rows + j) * columns..][..columns];
                let to = self.cells.row_mut(&mut self.paint, p, j);
                to.iter_mut().zip(from).for_each(|(to, &v)| *to = v as f32);
            }
            let (from, to) = (&self.paint[p * self.cells.plane()..], &mut self.depth[p * self.pixels.plane()..]);
            self.spread.spread(&self.cells, from, &self.pixels, to, &mut self.scratch);
        }
        let mut cost = 0.0;
        for y in 0..self.pixels.height {
            for x in (0..self.pixels.width).step_by(BLOCK) {
                cost += f64::from(self.look(self.pixels.at(x, y)));
            }
        }
        // A footprint's mean is its sum over as many pixels as a cell has.
        let stride = self.spread.stride();
        self.gather(gradient, (stride.0 * stride.1) as f64);
        0.5 * cost
    }

    fn paints(&self) -> usize {
        self.palette.paints().len()
    }

    /// `cells = factor · mean under each footprint` of the planes of `depth`.
    fn gather(&mut self, out: &mut [f64], factor: f64) {
        let (columns, rows) = (self.cells.width, self.cells.height);
        for p in 0..self.paints() {
            let from = &self.depth[p * self.pixels.plane()..];
            self.spread.mean(&self.cells, &mut self.paint, p, &self.pixels, from, &mut self.scratch);
            for j in 0..rows {
                let to = &mut out[(p * rows + j) * columns..][..columns];
                let from = self.cells.row(&self.paint, p, j);
                to.iter_mut().zip(from).for_each(|(to, &v)| *to = factor * f64::from(v));
            }
        }
    }

    /// The cost of a block of pixels; puts the derivative in the place of the depths.
    fn look(&mut self, at: usize) -> f32 {
        let plane = self.pixels.plane();
        let block =
            |planes: &[f32], k: usize| -> Block { std::array::from_fn(|lane| planes[k * plane + at..][..BLOCK][lane]) };
        let paints = self.palette.paints();
        let mut depths = [[0.0; BLOCK]; MOST_PAINTS];
        for (p, depth) in depths.iter_mut().take(paints.len()).enumerate() {
            *depth = block(&self.depth, p);
        }
        let films: [Film; 3] = std::array::from_fn(|band| {
            let (mut absorption, mut scattering) = ([0.0; BLOCK], [0.0; BLOCK]);
            for (paint, depth) in paints.iter().zip(&depths) {
                let (k, s) = (paint.absorption[band] as f32, paint.scattering[band] as f32);
                for lane in 0..BLOCK {
                    absorption[lane] += k * depth[lane];
                    scattering[lane] += s * depth[lane];
                }
            }
            Film::new(&absorption, &scattering, self.palette.wall()[band] as f32)
        });
        let miss: [Block; 3] = std::array::from_fn(|band| {
            let wanted = block(&self.wanted, band);
            std::array::from_fn(|lane| films[band].colour[lane] - wanted[lane])
        });
        let m: [Block; 6] = std::array::from_fn(|pair| block(&self.measure, pair));
        // M (I - T), band by band.
        let pull: [Block; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]].map(|row: [usize; 3]| {
            std::array::from_fn(|l| m[row[0]][l] * miss[0][l] + m[row[1]][l] * miss[1][l] + m[row[2]][l] * miss[2][l])
        });
        for (p, paint) in paints.iter().enumerate() {
            let mut slope = [0.0; BLOCK];
            for band in 0..3 {
                let (k, s) = (paint.absorption[band] as f32, paint.scattering[band] as f32);
                let film = &films[band];
                for lane in 0..BLOCK {
                    slope[lane] += pull[band][lane] * (k * film.by_absorption[lane] + s * film.by_scattering[lane]);
                }
            }
            self.depth[p * plane + at..][..BLOCK].copy_from_slice(&slope);
        }
        let costs: Block =
            std::array::from_fn(|l| pull[0][l] * miss[0][l] + pull[1][l] * miss[1][l] + pull[2][l] * miss[2][l]);
        costs.iter().sum()
    }
}

/// `palette::film` for a block of pixels.
struct Film {
    colour: Block,
    by_absorption: Block,
    by_scattering: Block,
}

impl Film {
    #[inline(always)]
    fn new(absorption: &Block, scattering: &Block, g: f32) -> Self {
        let mut out = Self { colour: [0.0; BLOCK], by_absorption: [0.0; BLOCK], by_scattering: [0.0; BLOCK] };
        for lane in 0..BLOCK {
            let (k, s) = (absorption[lane], scattering[lane]);
            let (t, rise) = tanhc(k * (k + 2.0 * s));
            let (above, below) = (s - g * (k + s), k + s - s * g);
            let over = 1.0 / (1.0 + t * below);
            let colour = (g + t * above) * over;
            let (by_k, by_s) = (2.0 * rise * (k + s), 2.0 * rise * k);
            out.colour[lane] = colour;
            out.by_absorption[lane] = (by_k * above - t * g - colour * (by_k * below + t)) * over;
            out.by_scattering[lane] = (by_s * above + t * (1.0 - g) * (1.0 - colour) - colour * by_s * below) * over;
        }
        out
    }
}

/// `tanh √q / √q` by the ninth convergent of Lambert's continued fraction, within 5e-5 of it, and its derivative by `q`.
#[inline(always)]
fn tanhc(q: f32) -> (f32, f32) {
    // Up to here the convergent is good; beyond, the hyperbolic tangent is 1.
    const LAST: f32 = 27.0;
    let c = q.min(LAST);
    let above = (((c + 990.0) * c + 135_135.0) * c + 4_729_725.0) * c + 34_459_425.0;
    let below = (((45.0 * c + 13_860.0) * c + 945_945.0) * c + 16_216_200.0) * c + 34_459_425.0;
    let t = if q > LAST { 1.0 / q.sqrt() } else { above / below };
    let small = -1.0 / 3.0 + c * (4.0 / 15.0 - c * (17.0 / 105.0));
    let large = (1.0 - q * t * t - t) / (2.0 * q.max(0.01));
    (t, if q < 0.05 { small } else { large })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured::{ColourTask, Judge, Picture};
    use crate::image::Image;
    use crate::painter::Task;
    use crate::palette::Paint;
    use crate::procedural::lattice;
    use crate::saturation::Saturation;

    #[test]
    fn cost_and_derivative_are_those_of_the_definition() {
        let palette = Palette::new(
            [0.9, 0.8, 0.7],
            vec![Paint::glaze("blue", [0.1, 0.3, 0.8]), Paint::opaque("white", [0.9; 3], 2.0)],
        )
        .unwrap();
        let (width, height) = (21, 14);
        let of = |k: usize, salt: i64| lattice(11, k as i64, salt);
        let colours = (0..width * height).map(|k| [of(k, 0), of(k, 1), of(k, 2)]).collect();
        let wanted = Picture::new(width, height, colours).unwrap();
        let kernel = SprayKernel::new(2.0, 2.0).unwrap();
        let limits = Limits { along: 2, row_spacing: 3, ..Limits::default() };
        let blank = Image::filled(width, height, 0.0);
        let board = Board::new(&Task::on_bare_wall(&blank), &kernel, &Saturation::Tanh, &limits).unwrap();
        let wall = Wall::new(&ColourTask::new(&wanted), &palette, Judge::Eye, 3.0);
        let mut blend = Blend::new(&wall, &board, &kernel, &limits);
        let cells = board.footprints.cells();
        let depth_per_volume = kernel.mass() / 6.0;
        let paint: Vec<f64> = (0..2 * cells).map(|k| 0.6 * of(k, 3)).collect();
        let exact = |paint: &[f64]| {
            let volumes: Vec<f64> = paint.iter().map(|v| v / depth_per_volume).collect();
            let depths = [board.canvas(&volumes[..cells]), board.canvas(&volumes[cells..])];
            let mut cost = 0.0;
            for k in 0..width * height {
                let colour = palette.colour(&[depths[0].data()[k], depths[1].data()[k]]);
                for row in &wall.measures[k] {
                    let miss: f64 = (0..3).map(|b| row[b] * (colour[b] - wanted.data()[k][b])).sum();
                    cost += 0.5 * miss * miss;
                }
            }
            cost
        };
        let mut gradient = vec![0.0; paint.len()];
        let cost = blend.cost(&paint, &mut gradient);
        assert!((cost / exact(&paint) - 1.0).abs() < 1e-4, "{cost} {}", exact(&paint));
        for k in (0..2 * cells).step_by(7) {
            let shifted = |h: f64| {
                let mut paint = paint.clone();
                paint[k] += h;
                exact(&paint)
            };
            let expected = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
            assert!((gradient[k] - expected).abs() < 2e-3 * expected.abs() + 0.05, "{k}: {} {expected}", gradient[k]);
        }
    }
}
