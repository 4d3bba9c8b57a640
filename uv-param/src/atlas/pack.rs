//! Charts onto pages: bottom-left on bitmaps, holes filled by the small ones, improved by local search.

mod add;
mod back;
mod bottom_left;
mod search;
mod settings;
mod shape;

use crate::error::Error;
pub(super) use add::add_to;
pub(super) use back::{Home, back};
use search::{Goal, Packed, Plan, Stages, carry_out, carry_out_unlimited, search};
pub use settings::{PackSettings, Page, Placement, Turns};
pub(super) use settings::{check, check_pages};
pub(super) use shape::Piece;
use shape::Shapes;

/// Cells along the side of a page whose area is that of the charts while the arrangement is searched for.
const COARSE_CELLS: f64 = 110.0;
/// The same for the final places: texels up to a page of this side.
const FINE_CELLS: f64 = 1100.0;
/// Cells along the longest piece, relative to those along the side of a page, at most.
const LONGEST: f64 = 8.0;
/// Words of bitmaps that the search looks at, a tenth of a second of work, and the same per chart.
const BUDGET: [u64; 2] = [30_000_000, 100_000];
/// Widths that are tried for the final places, relative to that of the search.
const FINE_WIDTHS: [f64; 5] = [0.98, 0.99, 1.0, 1.01, 1.02];

/// A place for every piece, and the pages.
///
/// # Errors
/// [`Error::TooManyTexels`] where a piece is larger than a page.
pub(super) fn pack(pieces: &[Piece], settings: &PackSettings) -> Result<(Vec<Placement>, Vec<Page>), Error> {
    if pieces.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let areas: Vec<f64> = pieces.iter().map(area).collect();
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
    let square = areas.iter().sum::<f64>().sqrt() / settings.texel_m;
    let side = settings.page.map_or(square, |page| square.min(page[0].min(page[1]) as f64));
    let longest = pieces.iter().map(extent).fold(0.0, f64::max) / settings.texel_m;
    let (coarse, fine) = (texels_per_cell(side, longest, COARSE_CELLS), texels_per_cell(side, longest, FINE_CELLS));
    let goal = |per_cell: usize| {
        settings.page.map_or(Goal::Smallest, |page| Goal::Pages(page.map(|texels| texels / per_cell)))
    };

    let all = |_| (0..settings.turns.count()).collect();
    let shapes = Shapes::new(pieces, settings, coarse, all);
    let budget = BUDGET[0] + BUDGET[1] * pieces.len() as u64;
    let found = search(&shapes, &order, goal(coarse), budget).and_then(|(plan, _)| {
        let mut turns = vec![0; pieces.len()];
        for &(chart, turn) in &plan.steps {
            turns[chart] = turn.unwrap_or(0);
        }
        let shapes = Shapes::new(pieces, settings, fine, |chart| vec![turns[chart]]);
        let (plan, packed) = finer(&shapes, &plan, goal(fine), coarse as f64 / fine as f64)?;
        Some((shapes, plan, packed))
    });
    let found = found.or_else(|| {
        // The cells of the search may be too large for what just fits.
        let shapes = Shapes::new(pieces, settings, fine, all);
        let (plan, packed) = search(&shapes, &order, goal(fine), 0)?;
        Some((shapes, plan, packed))
    });
    let Some((shapes, plan, packed)) = found else {
        let [width, height] = settings.page.unwrap_or_default();
        return Err(Error::TooManyTexels {
            texel_m: settings.texel_m,
            width: width as f64,
            height: height as f64,
            limit: width * height,
        });
    };

    let cell = settings.texel_m * fine as f64;
    let mut placements = vec![Placement { page: 0, turn: [1.0, 0.0], shift: [0.0; 2] }; pieces.len()];
    for (&(chart, _), &(page, turn, [column, row])) in plan.steps.iter().zip(&packed.places) {
        let shape = &shapes.turned[chart][turn];
        let shift = [column as f64 * cell - shape.corner[0], row as f64 * cell - shape.corner[1]];
        placements[chart] = Placement { page, turn: shape.turn, shift };
    }
    let page = |used: &[usize; 2]| settings.page.unwrap_or_else(|| used.map(|cells| cells * fine));
    Ok((placements, packed.used.iter().map(page).collect()))
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
fn texels_per_cell(side: f64, longest: f64, cells: f64) -> usize {
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
fn area(piece: &Piece) -> f64 {
    let origin = piece.rim.first().map_or([0.0; 2], |edge| edge[0]);
    let of = |edge: &[[f64; 2]; 2]| {
        let [p, q] = edge.map(|at| [0, 1].map(|k| at[k] - origin[k]));
        0.5 * (p[0] * q[1] - p[1] * q[0])
    };
    piece.rim.iter().map(of).sum::<f64>().abs()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    type Mesh = (Vec<[f64; 2]>, Vec<[u32; 3]>);

    /// Rectangles: lower left corner and size, texels.
    fn piece_of(rectangles: &[[f64; 4]]) -> Mesh {
        let mut mesh = (Vec::new(), Vec::new());
        for &[x, y, width, height] in rectangles {
            let n = mesh.0.len() as u32;
            mesh.0.extend([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]);
            mesh.1.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        }
        mesh
    }

    fn packed(meshes: &[Mesh], settings: &PackSettings) -> Result<(Vec<Placement>, Vec<Page>), Error> {
        let pieces: Vec<Piece> = meshes.iter().map(|(uv, faces)| Piece::new(uv, faces)).collect();
        let result = pack(&pieces, settings)?;
        assert_eq!(result, pack(&pieces, settings)?, "packed otherwise the second time");
        // Texels of every chart by points on a grid that is finer than they are.
        let (gutter, mut owners) = (settings.gutter as isize, std::collections::HashMap::new());
        for (number, ((uv, faces), placement)) in meshes.iter().zip(&result.0).enumerate() {
            for corners in faces.iter().map(|face| face.map(|v| placement.apply(uv[v as usize]))) {
                let longest = (0..3).map(|k| {
                    let (p, q) = (corners[k], corners[(k + 1) % 3]);
                    (p[0] - q[0]).abs().max((p[1] - q[1]).abs())
                });
                let steps = (2.5 * longest.fold(1.0, f64::max)) as usize;
                for (i, j) in (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j))) {
                    // Just inside, so that lines between texels belong to one of them.
                    let [s, t] = [i, j].map(|x| 1e-7 + (1.0 - 3e-7) * x as f64 / steps as f64);
                    let at = [0, 1].map(|k| {
                        corners[0][k] + s * (corners[1][k] - corners[0][k]) + t * (corners[2][k] - corners[0][k])
                    });
                    let size = result.1[placement.page];
                    assert!((0..2).all(|k| at[k] > -1e-9 && at[k] < size[k] as f64 + 1e-9), "{at:?} off {size:?}");
                    owners.insert((placement.page, at.map(|x| x as isize)), number);
                }
            }
        }
        for (&(page, [x, y]), &owner) in &owners {
            for (dx, dy) in (-gutter..=gutter).flat_map(|dx| (-gutter..=gutter).map(move |dy| (dx, dy))) {
                let other = owners.get(&(page, [x + dx, y + dy]));
                assert!(other.is_none_or(|&other| other == owner), "{owner} and {other:?} are too near");
            }
        }
        Ok(result)
    }

    fn settings(turns: Turns, gutter: usize) -> PackSettings {
        PackSettings { texel_m: 1.0, gutter, page: None, turns }
    }

    /// A frame with a hole of 60 x 60: what fits into it needs no page of its own.
    #[test]
    fn a_long_needle_takes_no_more_cells_than_other_charts() {
        // Cells of one texel would take 30,000 x 30,000 of them in the slanting turns.
        let settings = PackSettings { texel_m: 1.0, gutter: 2, ..PackSettings::default() };
        let meshes = [[30_000.0, 0.5], [100.0, 100.0]].map(|[width, height]| piece_of(&[[0.0, 0.0, width, height]]));
        let pieces: Vec<Piece> = meshes.iter().map(|(uv, faces)| Piece::new(uv, faces)).collect();
        let (placements, pages) = pack(&pieces, &settings).unwrap();
        assert_eq!(placements.len(), 2);
        assert!(pages.len() == 1 && pages[0].iter().any(|&texels| texels >= 30_000), "{pages:?}");
        for cells in [COARSE_CELLS, FINE_CELLS] {
            let longest = 30_000.0 / texels_per_cell(123.0, 30_000.0, cells) as f64;
            assert!(longest <= LONGEST * cells, "{longest}");
        }
    }

    #[test]
    fn small_charts_go_into_the_hole_of_a_large_one() {
        let frame =
            [[0.0, 0.0, 100.0, 20.0], [0.0, 80.0, 100.0, 20.0], [0.0, 20.0, 20.0, 60.0], [80.0, 20.0, 20.0, 60.0]];
        let mut meshes = vec![piece_of(&frame)];
        meshes.extend((0..16).map(|_| piece_of(&[[0.0, 0.0, 12.0, 12.0]])));
        for turns in [Turns::None, Turns::Quarter, Turns::Any] {
            let (_, pages) = packed(&meshes, &settings(turns, 2)).unwrap();
            assert_eq!(pages, [[100, 100]], "{turns:?}");
        }
    }

    #[test]
    fn tiny_charts_fill_the_page() {
        let meshes: Vec<_> = (0..500).map(|k| piece_of(&[[0.0, 0.0, f64::from(2 + k % 3), 3.0]])).collect();
        let (_, pages) = packed(&meshes, &settings(Turns::Quarter, 0)).unwrap();
        let share = 500.0 * 9.0 / (pages[0][0] * pages[0][1]) as f64;
        assert!(share > 0.9, "{share} of {pages:?}");
    }

    #[test]
    fn needles_and_charts_without_area_are_packed() {
        let needle = (vec![[0.0, 0.0], [90.0, 0.001], [90.0, 0.002]], vec![[0, 1, 2]]);
        let point = (vec![[3.0, 3.0]; 3], vec![[0, 1, 2]]);
        let meshes = vec![needle.clone(), point.clone(), piece_of(&[[0.0, 0.0, 30.0, 10.0]]), needle, point];
        packed(&meshes, &settings(Turns::Any, 1)).unwrap();
        packed(&meshes[1..2], &settings(Turns::Any, 1)).unwrap();
    }

    /// Two charts of 50 x 50 fit on a page of 110 x 60 and three do not; one of 70 x 70 never does.
    #[test]
    fn pages_are_filled_one_after_the_other() {
        let pages = PackSettings { page: Some([110, 60]), ..settings(Turns::None, 3) };
        let squares = |side: f64| vec![piece_of(&[[0.0, 0.0, side, side]]); 5];
        let (placements, sizes) = packed(&squares(50.0), &pages).unwrap();
        assert_eq!(sizes, [[110, 60]; 3]);
        for page in 0..3 {
            assert_eq!(placements.iter().filter(|p| p.page == page).count(), [2, 2, 1][page]);
        }
        assert!(matches!(packed(&squares(70.0), &pages), Err(Error::TooManyTexels { .. })));
    }

    /// Ls of 60 x 60 with arms of 20: two of them nest into 60 x 80, while their boxes take 60 x 120. Inner edges that lie on a
    /// line between texels count for both.
    #[test]
    fn concave_charts_nest() {
        let l = piece_of(&[[0.0, 0.0, 60.0, 20.0], [0.0, 20.0, 20.0, 40.0]]);
        let (_, pages) = packed(&[l.clone(), l], &settings(Turns::Quarter, 0)).unwrap();
        assert!(pages[0][0] * pages[0][1] <= 62 * 82, "{pages:?}");
    }

    /// What the local search is for: it does better than the largest first.
    #[test]
    fn the_search_improves_on_the_largest_first() {
        let meshes: Vec<_> = (0..12)
            .map(|k| 8.0 + f64::from(k * 5 % 12))
            .map(|size| piece_of(&[[0.0, 0.0, 2.0 * size, size / 2.0], [0.0, size / 2.0, size / 2.0, size]]))
            .collect();
        let pieces: Vec<Piece> = meshes.iter().map(|(uv, faces)| Piece::new(uv, faces)).collect();
        let shapes = Shapes::new(&pieces, &settings(Turns::Quarter, 1), 1, |_| (0..4).collect());
        let order: Vec<usize> = (0..12).collect();
        let [start, found] = [0, 10_000_000]
            .map(|budget| search(&shapes, &order, Goal::Smallest, budget).map(|(_, packed)| packed.cost).unwrap());
        assert!(found < start, "{found} after {start}");
    }
}
