//! Pieces on cells: searched for on coarse ones, carried out again on fine ones.

use super::search::{Goal, Packed, Plan, Stages, carry_out, carry_out_unlimited, search};
use super::settings::PackSettings;
use super::shape::{Piece, Shapes};

/// Cells along the side of a page whose area is that of the charts while the arrangement is searched for.
pub(super) const COARSE_CELLS: f64 = 110.0;
/// Cells along the longest piece, relative to those along the side of a page, at most.
pub(super) const LONGEST: f64 = 8.0;
/// Widths that are tried for the final places, relative to that of the search.
const FINE_WIDTHS: [f64; 5] = [0.98, 0.99, 1.0, 1.01, 1.02];

/// Pieces on cells.
pub(super) struct Arrangement {
    pub(super) shapes: Shapes,
    pub(super) plan: Plan,
    pub(super) packed: Packed,
    /// Texels along a cell.
    pub(super) texels_per_cell: usize,
}

impl Arrangement {
    /// Searched for on coarse cells in one of `skip` turns, as long as the budget lasts, and carried out on so many cells along a page; `None` where a
    /// piece is larger than a page.
    pub(super) fn new(pieces: &[Piece], settings: &PackSettings, cells: f64, skip: usize, budget: u64) -> Option<Self> {
        let areas: Vec<f64> = pieces.iter().map(area).collect();
        let mut order: Vec<usize> = (0..pieces.len()).collect();
        order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
        let square = areas.iter().sum::<f64>().sqrt() / settings.texel_m;
        let side = settings.page.map_or(square, |page| square.min(page[0].min(page[1]) as f64));
        let longest = pieces.iter().map(extent).fold(0.0, f64::max) / settings.texel_m;
        let (coarse, fine) = (texels_per_cell(side, longest, COARSE_CELLS), texels_per_cell(side, longest, cells));
        let goal = |per_cell: usize| {
            settings.page.map_or(Goal::Smallest, |page| Goal::Pages(page.map(|texels| texels / per_cell)))
        };

        let tried: Vec<usize> = (0..settings.turns.count()).step_by(skip).collect();
        let all = |_| tried.clone();
        let mut shapes = Shapes::new(pieces, settings, coarse, all);
        if budget == 0 {
            shapes = shapes.quicker();
        }
        let found = search(&shapes, &order, goal(coarse), budget).and_then(|(plan, _)| {
            let mut turns = vec![0; pieces.len()];
            for &(chart, turn) in &plan.steps {
                turns[chart] = tried[turn.unwrap_or(0)];
            }
            let shapes = Shapes::new(pieces, settings, fine, |chart| vec![turns[chart]]).quicker();
            let (plan, packed) = finer(&shapes, &plan, goal(fine), coarse as f64 / fine as f64)?;
            Some(Self { shapes, plan, packed, texels_per_cell: fine })
        });
        found.or_else(|| {
            // The cells of the search may be too large for what just fits.
            let shapes = Shapes::new(pieces, settings, fine, all);
            let (plan, packed) = search(&shapes, &order, goal(fine), 0)?;
            Some(Self { shapes, plan, packed, texels_per_cell: fine })
        })
    }
}

/// The plan of the search carried out on finer cells, `scale` of which make a cell of the search; each chart has one turn left.
fn finer(shapes: &Shapes, plan: &Plan, goal: Goal, scale: f64) -> Option<(Plan, Packed)> {
    let steps: Vec<_> = plan.steps.iter().map(|&(chart, _)| (chart, Some(0))).collect();
    let mut best: Option<(Plan, Packed)> = None;
    for factor in FINE_WIDTHS {
        let width = (plan.width as f64 * scale * factor).round() as usize;
        let plan = Plan { steps: steps.clone(), width: width.max(shapes.narrowest()) };
        let packed = match &best {
            None => carry_out_unlimited(shapes, &plan, goal, Stages::Drop),
            Some((_, least)) => carry_out(shapes, &plan, goal, least.cost - 1, Stages::Drop, &mut 0),
        };
        if let Some(packed) = packed {
            best = Some((plan, packed));
        }
        if matches!(goal, Goal::Pages(_)) {
            break;
        }
    }
    best
}

/// Texels along a cell, so that a page of this side has about so many cells, and the longest piece, however thin, not many times more: its bitmap
/// is as large as its box in every turn.
pub(super) fn texels_per_cell(side: f64, longest: f64, cells: f64) -> usize {
    (side / cells).max(longest / (LONGEST * cells)).ceil().max(1.0) as usize
}

/// Diagonal of the box around a piece, metres.
fn extent(piece: &Piece) -> f64 {
    let size = [0, 1].map(|k| {
        let along = || piece.rim.iter().map(|[from, _]| from[k]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    });
    size[0].hypot(size[1])
}

/// Area of a piece in the plane, m^2.
pub(super) fn area(piece: &Piece) -> f64 {
    let origin = piece.rim.first().map_or([0.0; 2], |edge| edge[0]);
    let of = |edge: &[[f64; 2]; 2]| {
        let [p, q] = edge.map(|at| [0, 1].map(|k| at[k] - origin[k]));
        0.5 * (p[0] * q[1] - p[1] * q[0])
    };
    piece.rim.iter().map(of).sum::<f64>().abs()
}
