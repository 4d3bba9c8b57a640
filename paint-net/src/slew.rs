use crate::deconvolution::ink_cost;
use crate::error::{Error, require};
use crate::footprints::cells;
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Board, Limits, Painter, Painting, Spray, Task};
use crate::projected_lbfgs::{Stop, minimise};
use crate::saturation::Saturation;

/// Volumes that a valve of limited speed can follow: along the path over all cells, row by row and every other row
/// backwards, the volume changes by at most `largest_change` from one cell to the next. Ours.
///
/// Starts from a painter's plan and minimises
///
/// ```text
/// ½ Σ w (f(c₀ + G v) - y)²  +  ρ/2 Σ_k max(0, |v_k - v_{k-1}| - L)²,    0 ≤ v ≤ v_max
/// ```
///
/// for rising `ρ`; what still changes too fast in the end is cut down to the largest sequence below it that does not. A
/// finer grid along the rows gives the valve more time per pixel: half the distance between cells, twice the slope.
#[derive(Debug, Clone, PartialEq)]
pub struct SlewLimited<P> {
    /// Who plans without the limit.
    pub painter: P,
    /// Largest change of volume from one cell of the path to the next.
    pub largest_change: f64,
    /// Iterations for each `ρ`.
    pub iterations: usize,
}

/// Rising weights of the limit, for inks in `[0, 1]` and volumes of that order.
const WEIGHTS: [f64; 5] = [0.1, 1.0, 10.0, 100.0, 1000.0];

impl<P: Painter> SlewLimited<P> {
    /// 60 iterations for each of the five weights (ours).
    pub fn new(painter: P, largest_change: f64) -> Self {
        Self { painter, largest_change, iterations: 60 }
    }
}

/// How often the volume changes by more than `largest_change` from one cell of the path to the next, cells without a spray
/// included. `size`: columns and rows of the picture. Sprays that lie on no cell of the grid of `limits` are left out.
pub fn slew_violations(sprays: &[Spray], size: (usize, usize), limits: &Limits, largest_change: f64) -> usize {
    let (columns, rows) = (cells(size.0, limits.along), cells(size.1, limits.row_spacing));
    let volumes = volumes_on(&columns, &rows, sprays);
    let path = raster(columns.len(), rows.len());
    path.windows(2).filter(|p| (volumes[p[1]] - volumes[p[0]]).abs() > largest_change).count()
}

impl<P: Painter> Painter for SlewLimited<P> {
    fn name(&self) -> &'static str {
        "slew limited"
    }

    /// The sprays in the order of the path; `min_volume` and `max_sprays` are left to the painter, as a valve that must not
    /// jump cannot skip small volumes.
    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        let limit = self.largest_change;
        require("largest_change", limit, limit > 0.0 && limit.is_finite(), "it must be positive and finite")?;
        let board = Board::new(task, kernel, saturation, limits)?;
        let plan = self.painter.paint(task, kernel, saturation, limits, &mut |share| progress(0.3 * share))?;
        let columns = board.footprints.columns.len();
        let path = raster(columns, board.footprints.rows.len());
        let mut volumes = volumes_on(&board.footprints.columns, &board.footprints.rows, &plan.sprays);
        let mut canvas = board.bare.data().to_vec();
        for (round, weight) in WEIGHTS.into_iter().enumerate() {
            let mut cost = |v: &[f64], gradient: &mut [f64]| {
                canvas.copy_from_slice(board.bare.data());
                board.footprints.add(v, &mut canvas);
                let value = ink_cost(task, task.reference, saturation, &mut canvas);
                board.footprints.gather(&canvas, gradient);
                value + excess_cost(&path, v, limit, weight, gradient)
            };
            let stop = Stop { iterations: self.iterations, relative_decrease: 1e-6 };
            minimise(&mut volumes, &board.ceiling, &stop, &mut cost, &mut |share| {
                progress(0.3 + 0.7 * (round as f64 + share) / WEIGHTS.len() as f64);
            });
        }
        envelope(&path, &mut volumes, limit);
        progress(1.0);
        let canvas = board.canvas(&volumes);
        let ink: Image = canvas.map(|c| saturation.forward(c));
        let sprays = path.iter().filter(|&&c| volumes[c] > 0.0).map(|&c| board.spray(c, volumes[c])).collect();
        Ok(Painting { sprays, canvas, ink })
    }
}

/// The volume of every cell.
fn volumes_on(columns: &[usize], rows: &[usize], sprays: &[Spray]) -> Vec<f64> {
    let mut volumes = vec![0.0; columns.len() * rows.len()];
    for s in sprays {
        let (i, j) = (columns.binary_search(&(s.x as usize)), rows.binary_search(&(s.y as usize)));
        if let (Ok(i), Ok(j)) = (i, j) {
            volumes[j * columns.len() + i] += s.volume;
        }
    }
    volumes
}

/// Cells in the order of the path.
fn raster(columns: usize, rows: usize) -> Vec<usize> {
    (0..rows)
        .flat_map(|j| (0..columns).map(move |i| j * columns + if j % 2 == 0 { i } else { columns - 1 - i }))
        .collect()
}

/// `ρ/2 Σ max(0, |Δv| - L)²`; adds its derivative.
fn excess_cost(path: &[usize], volumes: &[f64], limit: f64, weight: f64, gradient: &mut [f64]) -> f64 {
    let mut value = 0.0;
    for pair in path.windows(2) {
        let change = volumes[pair[1]] - volumes[pair[0]];
        let excess = (change.abs() - limit).max(0.0) * change.signum();
        value += 0.5 * weight * excess * excess;
        gradient[pair[1]] += weight * excess;
        gradient[pair[0]] -= weight * excess;
    }
    value
}

/// The largest sequence below `volumes` that changes by no more than `limit`: once forwards, once back.
fn envelope(path: &[usize], volumes: &mut [f64], limit: f64) {
    // The sum may round up: stay below the limit by more than that.
    let limit = limit * (1.0 - 1e-12);
    for pair in path.windows(2) {
        volumes[pair[1]] = volumes[pair[1]].min(volumes[pair[0]] + limit);
    }
    for pair in path.windows(2).rev() {
        volumes[pair[0]] = volumes[pair[0]].min(volumes[pair[1]] + limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    #[test]
    fn the_envelope_is_the_largest_slow_sequence_below() {
        // In closed form: min_j v_j + L |k - j| along the path.
        let path = raster(5, 4);
        assert_eq!(path[..8], [0, 1, 2, 3, 4, 9, 8, 7]);
        let volumes: Vec<f64> = (0..20).map(|k| lattice(1, k, 0)).collect();
        let mut found = volumes.clone();
        envelope(&path, &mut found, 0.1);
        for (k, &cell) in path.iter().enumerate() {
            let expected = path.iter().enumerate().map(|(j, &c)| volumes[c] + 0.1 * k.abs_diff(j) as f64);
            let expected = expected.fold(f64::INFINITY, f64::min);
            assert!((found[cell] - expected).abs() < 1e-9, "place {k}: {} is not {expected}", found[cell]);
        }
    }
}
