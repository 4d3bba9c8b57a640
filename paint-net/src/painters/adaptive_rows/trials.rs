//! The picture painted with one kind of rows all over: what they cannot resolve shows.

use crate::error::Error;
use crate::image::Image;
use crate::metrics::ssim_windows;
use crate::model::SprayKernel;
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painters::Deconvolution;
use crate::problem::{Limits, PaintProblem};

/// Relative decrease of the cost per iteration at which a fit stops.
pub(super) const CONVERGED: f64 = 1e-5;

/// A kind of rows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct RowWidth {
    /// Distance of the rows, in those of the limits.
    pub spacing: f64,
    /// Spread of the sprays, in deviations of the nozzle.
    pub spread: f64,
}

/// Which way rows run in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// Along its rows of pixels.
    Across,
    /// Along its columns.
    Down,
}

/// A kind of rows, with what it makes of the picture.
pub(super) struct Trial {
    pub(super) direction: Direction,
    /// Distance of the rows, pixels.
    pub(super) spacing: usize,
    /// Deviation of the sprays, pixels.
    pub(super) sigma: f64,
    /// Volume of the spray on each pixel.
    pub(super) volumes: Vec<f32>,
    /// Windows of the structural similarity: the pixel in the middle of each, and what it lacks of 1.
    pub(super) lost: Vec<(u32, f32)>,
}

/// Each kind of rows in both directions; the first is that of the limits.
pub(super) fn trials(
    widths: &[RowWidth],
    iterations: usize,
    problem: &PaintProblem,
    observer: &mut dyn Observer,
) -> Result<Vec<Trial>, Error> {
    let limits = problem.limits;
    let mut kinds = vec![(limits.row_spacing, 1.0)];
    for width in widths {
        let spacing = ((limits.row_spacing as f64 * width.spacing).round() as usize).max(1);
        if !kinds.contains(&(spacing, width.spread)) {
            kinds.push((spacing, width.spread));
        }
    }
    let turned = Turned::new(problem);
    let painter = Deconvolution { iterations, tolerance: CONVERGED };
    let share = 0.5 / kinds.len() as f64;
    let mut trials = Vec::with_capacity(2 * kinds.len());
    for (k, &(spacing, spread)) in kinds.iter().enumerate() {
        let kernel = SprayKernel::new(spread * problem.kernel.sigma(), problem.kernel.cut())?;
        let limits = Limits { row_spacing: spacing, min_volume: 0.0, max_sprays: None, ..limits.clone() };
        for direction in [Direction::Across, Direction::Down] {
            let from = (2 * k + usize::from(direction == Direction::Down)) as f64 * share;
            let mut part = PartialProgress { observer: &mut *observer, from, share };
            let seen = match direction {
                Direction::Across => PaintProblem { ghosts: None, ..*problem },
                Direction::Down => turned.problem(problem),
            };
            let painting = painter.paint_observed(&seen.with_kernel(&kernel).with_limits(&limits), &mut part)?;
            let width = problem.reference.width();
            let (ink, pixel): (_, &dyn Fn(usize, usize) -> usize) = match direction {
                Direction::Across => (painting.ink, &|x, y| y * width + x),
                Direction::Down => (turn(&painting.ink), &|x, y| x * width + y),
            };
            let mut volumes = vec![0.0; ink.data().len()];
            // Sprays lie on pixels.
            painting.sprays.iter().for_each(|s| volumes[pixel(s.x as usize, s.y as usize)] = s.volume as f32);
            let lost = match ssim_windows(&ink, problem.reference, problem.weight) {
                Ok(windows) => {
                    windows.into_iter().map(|(k, similarity)| (k as u32, (1.0 - similarity) as f32)).collect()
                }
                // The picture is smaller than a window.
                Err(_) => Vec::new(),
            };
            trials.push(Trial { direction, spacing, sigma: kernel.sigma(), volumes, lost });
        }
    }
    Ok(trials)
}

/// A problem whose columns are rows. Paint beyond seams is left out: it tells little of which rows resolve what.
struct Turned {
    reference: Image,
    canvas: Option<Image>,
    weight: Option<Image>,
    missing_weight: Option<Image>,
    ceiling: Option<Image>,
    paintable: Option<Vec<bool>>,
}

impl Turned {
    fn new(problem: &PaintProblem) -> Self {
        let (width, height) = problem.reference.size();
        let mask = |mask: &[bool]| (0..mask.len()).map(|k| mask[k % height * width + k / height]).collect();
        Self {
            reference: turn(problem.reference),
            canvas: problem.canvas.map(turn),
            weight: problem.weight.map(turn),
            missing_weight: problem.missing_weight.map(turn),
            ceiling: problem.ceiling.map(turn),
            paintable: problem.paintable.map(mask),
        }
    }

    fn problem<'a>(&'a self, of: &PaintProblem<'a>) -> PaintProblem<'a> {
        PaintProblem {
            reference: &self.reference,
            canvas: self.canvas.as_ref(),
            weight: self.weight.as_ref(),
            missing_weight: self.missing_weight.as_ref(),
            ceiling: self.ceiling.as_ref(),
            paintable: self.paintable.as_deref(),
            ghosts: None,
            ..*of
        }
    }
}

fn turn(image: &Image) -> Image {
    Image::from_fn(image.height(), image.width(), |x, y| image.at(y, x))
}
