//! Pictures in several paints.

mod blend;
mod mixture;
mod unmix;

use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Board, Limits, Spray, Task};
use crate::palette::{MOST_PAINTS, Palette};
use crate::projected_lbfgs::{Stop, minimise};
use crate::saturation::Saturation;
use blend::Blend;

/// A picture of three bands, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    data: Vec<[f64; 3]>,
}

impl Picture {
    /// From its values, all of them in `[0, 1]`; as many as `width * height > 0`.
    pub fn new(width: usize, height: usize, data: Vec<[f64; 3]>) -> Result<Self, Error> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(data.len()) {
            return Err(Error::Shape { what: "picture", width, height, values: data.len() });
        }
        for (k, value) in data.iter().enumerate() {
            if let Some(&value) = value.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                let (x, y) = (k % width, k / width);
                return Err(Error::Pixel { what: "picture", x, y, value, range: "three values in [0, 1]" });
            }
        }
        Ok(Self { width, height, data })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[[f64; 3]] {
        &self.data
    }
}

/// By what the difference of two colours is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Judge {
    /// By the eye: CIEDE2000 for small differences around the wanted colour; bands are the stored values of sRGB.
    #[default]
    Eye,
    /// By the sum of squares over the bands.
    Bands,
}

/// What is wanted, in colour, on a bare wall.
#[derive(Debug, Clone, Copy)]
pub struct ColourTask<'a> {
    /// Wanted colours.
    pub wanted: &'a Picture,
    /// How much each pixel matters, same size, as in [`Task`]; `None`: all alike.
    pub weight: Option<&'a Image>,
    /// Pixels over which the nozzle may spray, row by row; `None`: everywhere.
    pub paintable: Option<&'a [bool]>,
}

impl<'a> ColourTask<'a> {
    /// The whole picture.
    pub fn new(wanted: &'a Picture) -> Self {
        Self { wanted, weight: None, paintable: None }
    }
}

/// Paints a picture in several colours: the volumes of all paints on all cells at once. Ours.
///
/// Minimises `½ Σ w |B (I(d) - T)|²` over volumes `0 ≤ v ≤ v_max`, where `d_p = G v_p` are the depths of the paints, `I` the
/// colour of the mixed film, `T` the wanted colour and `B` the measure of differences at it ([`Judge`]). Every pixel is unmixed
/// first, as if it could be painted alone; the mean depth under each footprint is the start. Each volume is measured by the root
/// of its own curvature there, `Σ g² |B ∂I/∂d_p|²`, which makes weak and strong paints, and light and dark places, alike:
/// without it projected L-BFGS needs several times as many iterations.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Coloured {
    /// Largest number of iterations. Default 60, ours.
    pub iterations: usize,
    /// What differences are measured by. Default the eye.
    pub judge: Judge,
}

impl Default for Coloured {
    fn default() -> Self {
        Self { iterations: 60, judge: Judge::Eye }
    }
}

/// What is painted in several colours.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourPainting {
    /// The sprays of each paint.
    pub sprays: Vec<Vec<Spray>>,
    /// Depth of each paint.
    pub canvases: Vec<Image>,
    /// What it looks like; values in `[0, 1]`.
    pub picture: Picture,
}

impl Coloured {
    /// Decides the sprays of every paint. The limits hold for each paint.
    pub fn paint(
        &self,
        task: &ColourTask,
        palette: &Palette,
        kernel: &SprayKernel,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<ColourPainting, Error> {
        require("iterations", self.iterations as f64, self.iterations <= 100_000, "it must be at most 100,000")?;
        let (width, height) = (task.wanted.width, task.wanted.height);
        let blank = Image::filled(width, height, 0.0);
        let cells = Task { weight: task.weight, paintable: task.paintable, ..Task::on_bare_wall(&blank) };
        // The law does not matter for where the cells are.
        let board = Board::new(&cells, kernel, &Saturation::Tanh, limits)?;
        let depth_per_volume = kernel.mass() / (limits.along * limits.row_spacing) as f64;
        let mut blend = Blend::new(task, palette, self.judge, kernel, limits);
        let (depths, bends) = blend.start(limits.max_volume, kernel.squared().mass());
        let mut volumes: Vec<f64> = depths.iter().map(|depth| depth / depth_per_volume).collect();
        // Values of the fit are alike in curvature: `unit` of depth each, where all cells have the same.
        let unit: Vec<f64> = bends.iter().map(|bend| depth_per_volume / bend.sqrt()).collect();
        let paints = palette.paints().len();
        let mut fit = |volumes: &mut Vec<f64>, ceiling: &[f64], progress: &mut dyn FnMut(f64)| {
            let values_of = |v: &[f64]| v.iter().zip(&unit).map(|(v, unit)| v * depth_per_volume / unit).collect();
            let (mut values, top): (Vec<f64>, Vec<f64>) = (values_of(volumes), values_of(ceiling));
            let mut cost = |values: &[f64], gradient: &mut [f64]| blend.cost(values, &unit, gradient);
            let stop = Stop { iterations: self.iterations, relative_decrease: 1e-5 };
            minimise(&mut values, &top, &stop, &mut cost, progress);
            let back = values.iter().zip(&unit).zip(ceiling);
            volumes.clear();
            volumes.extend(back.map(|((v, unit), &top)| (v * unit / depth_per_volume).min(top)));
        };
        let mut ceiling = board.ceiling.repeat(paints);
        fit(&mut volumes, &ceiling, progress);
        if keep_most(&volumes, &mut ceiling, paints, limits) {
            fit(&mut volumes, &ceiling, &mut |_| ());
        }
        volumes.iter_mut().filter(|v| **v < limits.min_volume).for_each(|v| *v = 0.0);
        let each = volumes.chunks_exact(board.footprints.cells());
        let paintings: Vec<_> = each.map(|volumes| board.painting(volumes, &Saturation::Tanh)).collect();
        let colour_at = |k: usize| {
            let mut depths = [0.0; MOST_PAINTS];
            depths.iter_mut().zip(&paintings).for_each(|(depth, painting)| *depth = painting.canvas.data()[k]);
            palette.colour(&depths).map(|v| v.clamp(0.0, 1.0))
        };
        let data = (0..width * height).map(colour_at).collect();
        progress(1.0);
        Ok(ColourPainting {
            picture: Picture { width, height, data },
            canvases: paintings.iter().map(|p| p.canvas.clone()).collect(),
            sprays: paintings.into_iter().map(|p| p.sprays).collect(),
        })
    }
}

/// Takes the ceiling from what is smaller than the smallest volume or beyond the largest number; whether there was any.
fn keep_most(volumes: &[f64], ceiling: &mut [f64], paints: usize, limits: &Limits) -> bool {
    let cells = volumes.len() / paints;
    let mut dropped = false;
    for (volumes, ceiling) in volumes.chunks_exact(cells).zip(ceiling.chunks_exact_mut(cells)) {
        let mut order: Vec<usize> = (0..cells).filter(|&k| volumes[k] > 0.0).collect();
        order.sort_by(|&a, &b| volumes[b].total_cmp(&volumes[a]).then(a.cmp(&b)));
        let mut keep = vec![false; cells];
        let large = order.iter().take_while(|&&k| volumes[k] >= limits.min_volume);
        large.take(limits.max_sprays.unwrap_or(cells)).for_each(|&k| keep[k] = true);
        if order.iter().any(|&k| !keep[k]) {
            dropped = true;
            ceiling.iter_mut().zip(keep).filter(|(_, kept)| !kept).for_each(|(top, _)| *top = 0.0);
        }
    }
    dropped
}
