//! The regular grid of cells on which a problem is solved.

use super::paint_problem::PaintProblem;
use crate::error::Error;
use crate::image::Image;
use crate::model::{FootprintMatrix, Spray};

/// A checked problem on its grid of cells: what all painters on a grid start from.
pub(crate) struct PaintGrid {
    pub(crate) footprints: FootprintMatrix,
    /// Largest volume per cell; 0 where the nozzle may not spray.
    pub(crate) upper_bounds: Vec<f64>,
    /// Paint depth before painting.
    pub(crate) initial: Image,
    /// Standard deviation of every spray.
    sigma: f64,
}

impl PaintGrid {
    pub(crate) fn new(problem: &PaintProblem) -> Result<Self, Error> {
        problem.check()?;
        let (kernel, limits) = (problem.kernel, problem.limits);
        let footprints =
            FootprintMatrix::new(kernel, problem.reference.size(), limits.spray_spacing, limits.row_spacing);
        let width = problem.reference.width();
        // A spray that reaches no pixel of positive weight would only waste paint, and nothing would hold it down.
        let mut seen = vec![1.0; footprints.cells()];
        if let Some(weight) = problem.weight {
            let mut weight = weight.data().to_vec();
            problem.settle_adjoint(&mut weight);
            footprints.adjoint(&weight, &mut seen);
        }
        let allowed = |x: usize, y: usize| problem.paintable.is_none_or(|mask| mask[y * width + x]);
        let upper_bounds = footprints
            .rows
            .iter()
            .flat_map(|&y| footprints.columns.iter().map(move |&x| (x, y)))
            .zip(seen)
            .map(|((x, y), seen)| if seen > 0.0 && allowed(x, y) { limits.max_volume } else { 0.0 })
            .collect();
        Ok(Self { footprints, upper_bounds, initial: problem.initial_canvas(), sigma: kernel.sigma() })
    }

    /// The canvas after spraying `volumes`.
    pub(crate) fn canvas(&self, problem: &PaintProblem, volumes: &[f64]) -> Image {
        let mut canvas = self.initial.clone();
        self.footprints.deposit(volumes, canvas.data_mut());
        problem.settle(self.initial.data(), canvas.data_mut());
        canvas
    }

    /// The sprays of all cells whose valve opens, row by row.
    pub(crate) fn sprays(&self, volumes: &[f64]) -> Vec<Spray> {
        (0..volumes.len()).filter(|&k| volumes[k] > 0.0).map(|k| self.spray(k, volumes[k])).collect()
    }

    /// The volume of every cell; sprays that lie on none are left out.
    pub(crate) fn volumes(&self, sprays: &[Spray]) -> Vec<f64> {
        let (columns, rows) = (&self.footprints.columns, &self.footprints.rows);
        let mut volumes = vec![0.0; self.footprints.cells()];
        for s in sprays {
            let (i, j) = (columns.binary_search(&(s.x as usize)), rows.binary_search(&(s.y as usize)));
            if let (Ok(i), Ok(j)) = (i, j) {
                volumes[j * columns.len() + i] += s.volume;
            }
        }
        volumes
    }

    /// The spray of a cell.
    pub(crate) fn spray(&self, cell: usize, volume: f64) -> Spray {
        let (columns, rows) = (&self.footprints.columns, &self.footprints.rows);
        let (x, y) = (columns[cell % columns.len()] as f64, rows[cell / columns.len()] as f64);
        Spray { x, y, volume, sigma: self.sigma }
    }
}
