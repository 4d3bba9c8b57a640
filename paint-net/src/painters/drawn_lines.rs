//! What a picture has of lines: their middles, their cores, and what is left beside them.

use super::centring::Ground;
use super::distance::distances;
use super::fitting::missing_ink;
use super::thinning::neighbour;
use super::trace::{Line, trace};
use crate::problem::{PaintGrid, PaintProblem};

/// Share of the darkest ink below which nothing is worth a row of its own beside lines.
const LEFT_OVER: f64 = 0.02;
/// Ink of the core of a line, of what is wanted there, below which it is bare.
const BARE: f64 = 0.74;
/// Pixels up to which something beside a line is a corner of it.
const CORNER: f64 = 2.0;

/// What a picture has of lines.
pub(super) struct DrawnLines {
    pub(super) lines: Vec<Line>,
    /// Pixels from which cells of the grid may spray.
    pub(super) rest: Vec<bool>,
    /// Pixels in the cores of lines.
    core: Vec<bool>,
}

impl DrawnLines {
    /// The lines of a picture that are no wider than twice `reach`, and what is left for rows.
    pub(super) fn find(problem: &PaintProblem, grid: &PaintGrid, reach: f64) -> Self {
        let width = problem.reference.width();
        let missing = missing_ink(problem, grid);
        let darkest = missing.iter().fold(0.0_f64, |most, &m| most.max(m));
        let darker_than = |share: f64| missing.iter().map(|&m| m > share * darkest).collect::<Vec<_>>();
        let dark = darker_than(0.5);
        let mut lines = trace(&dark, width, reach);
        let ground = Ground { values: &missing, width, threshold: 0.5 * darkest, reach };
        for line in &mut lines {
            ground.centre(line);
        }
        lines.retain(|line| ground.is_crisp(line));
        let rest = left_over(&lines, &darker_than(LEFT_OVER), problem, reach);
        let shares: Vec<f64> = missing.iter().map(|m| (m / darkest.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)).collect();
        let core = cores(&lines, &from_border(&shares, width), problem);
        Self { lines, rest, core }
    }

    /// Cores of lines that a canvas leaves bare, with the pixels about them.
    pub(super) fn bare(&self, problem: &PaintProblem, canvas: &[f64]) -> Vec<bool> {
        let wanted = problem.reference.data();
        let missing = |k: usize| problem.saturation.forward(canvas[k]) < BARE * wanted[k];
        // What cannot be sprayed must not pull paint from its neighbours.
        let may = |k: usize| problem.paintable.is_none_or(|mask| mask[k]) && problem.weight(k) > 0.0;
        let bare: Vec<bool> = (0..canvas.len()).map(|k| self.core[k] && missing(k) && may(k)).collect();
        distances(&bare, problem.reference.width()).iter().map(|&from| from <= 1.0).collect()
    }
}

/// The cores of lines: what is farther from the border than half the deviation of a spray, and all of what is too thin for that.
fn cores(lines: &[Line], inside: &[f64], problem: &PaintProblem) -> Vec<bool> {
    let (width, sigma) = (problem.reference.width(), problem.kernel.sigma());
    let mut core = vec![false; inside.len()];
    for &[x, y] in lines.iter().flat_map(|line| &line.points) {
        let middle = y.round() as usize * width + x.round() as usize;
        let Some(&half_width) = inside.get(middle) else { continue };
        let reach = half_width.ceil() as isize + 2;
        for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))) {
            if let Some(k) = neighbour(middle, (dx, dy), width, inside.len()) {
                let least = if half_width < 1.25 * sigma { 0.0 } else { 0.5 * sigma - 0.25 };
                core[k] |= inside[k] > 0.0 && inside[k] >= least;
            }
        }
    }
    core
}

/// How far every pixel lies from the border of what is dark, where borders are smooth over a pixel; 0 or less outside.
fn from_border(shares: &[f64], width: usize) -> Vec<f64> {
    let outside: Vec<bool> = shares.iter().map(|&share| share <= 0.5).collect();
    let coarse = distances(&outside, width);
    let near = |k: usize| {
        let around = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy)));
        let beyond =
            around.filter_map(|at| Some((neighbour(k, at, width, shares.len())?, at))).filter(|&(n, _)| outside[n]);
        // A pixel of half the ink has the border in its middle.
        let way = |(n, (dx, dy)): (usize, (isize, isize))| (dx as f64).hypot(dy as f64) - 0.5 + shares[n];
        beyond.map(way).fold(coarse[k], f64::min)
    };
    (0..shares.len()).map(|k| if coarse[k] <= 2.0 && coarse[k] > 0.0 { near(k) } else { coarse[k] - 0.5 }).collect()
}

/// The pixels from which cells of the grid may spray: those beside something dark that is farther from every line than half the
/// widest. All of them where there is no line.
fn left_over(lines: &[Line], dark: &[bool], problem: &PaintProblem, reach: f64) -> Vec<bool> {
    if lines.is_empty() {
        return vec![true; dark.len()];
    }
    let width = problem.reference.width();
    let mut on_line = vec![false; dark.len()];
    for [x, y] in lines.iter().flat_map(|line| &line.points) {
        on_line[y.round() as usize * width + x.round() as usize] = true;
    }
    let from_line = distances(&on_line, width);
    let mut rest: Vec<bool> = dark.iter().zip(&from_line).map(|(&dark, &from)| dark && from > reach + 0.5).collect();
    // Beside a line, only what is wider than a corner of it.
    let deep = distances(&rest.iter().map(|rest| !rest).collect::<Vec<_>>(), width);
    let from_deep = distances(&deep.iter().map(|&deep| deep >= CORNER).collect::<Vec<_>>(), width);
    let beside = reach + 0.5 + problem.kernel.sigma();
    for ((rest, from), deep) in rest.iter_mut().zip(&from_line).zip(from_deep) {
        *rest &= *from > beside || deep <= CORNER;
    }
    let cell = problem.limits.spray_spacing.max(problem.limits.row_spacing) as f64;
    distances(&rest, width).iter().zip(&from_line).map(|(&to, &from)| to <= cell && from > reach + 0.5).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;
    use crate::image::Image;

    /// A level line at row 20 of 80 by 60 pixels, 4 pixels to its border: what is dark at rows that are given.
    fn rest_with(dark: impl Fn(usize, usize) -> bool) -> Vec<usize> {
        let (width, height) = (80, 60);
        let reference = Image::new(width, height, vec![0.0; width * height]).unwrap();
        let limits = Limits { spray_spacing: 1, row_spacing: 1, ..Limits::default() };
        // Sprays with a deviation of 2 pixels.
        let problem = PaintProblem::new(&reference).with_limits(&limits);
        let dark: Vec<bool> = (0..width * height).map(|k| dark(k % width, k / width)).collect();
        let line = Line { points: (0..width).map(|x| [x as f64, 20.0]).collect() };
        let rest = left_over(&[line], &dark, &problem, 4.0);
        let rows = (0..height).filter(|y| rest[y * width..(y + 1) * width].contains(&true));
        rows.collect()
    }

    /// Rows spray neither what a line covers nor a corner that stands a little out of it, but what is wide beside it, and all that is far.
    #[test]
    fn rows_spray_what_lines_leave() {
        assert_eq!(rest_with(|_, y| (16..=24).contains(&y)), [] as [usize; 0]);
        assert_eq!(rest_with(|_, y| (16..=25).contains(&y)), [] as [usize; 0], "a corner");
        assert_eq!(rest_with(|_, y| (16..=32).contains(&y)), (25..=33).collect::<Vec<_>>(), "wide");
        assert_eq!(rest_with(|_, y| y == 45), [44, 45, 46], "thin, and far");
        assert_eq!(rest_with(|x, y| (25..=26).contains(&y) && x < 40), [] as [usize; 0], "thin, and beside");
    }
}
