//! Charts onto pages: bottom-left on bitmaps, holes filled by the small ones, improved by local search.

mod add;
mod arrange;
pub(in crate::atlas) mod bitmap;
mod bottom_left;
mod restore;
mod search;
mod settings;
mod shape;

use crate::error::Error;
pub(super) use add::add_to;
use arrange::{Arrangement, area};
pub(super) use restore::{PageSlot, restore};
pub use settings::{PackSettings, Page, Placement, Turns};
pub(super) use settings::{check, check_pages};
pub(super) use shape::Piece;

/// Cells along the side of a page whose area is that of the charts for the final places: texels up to a page of this side.
const FINE_CELLS: f64 = 1100.0;
/// The same for estimates.
const ESTIMATE_CELLS: f64 = 400.0;
/// One in so many turns is tried for them.
const ESTIMATE_TURNS: usize = 4;
/// Words of bitmaps that the search looks at, a tenth of a second of work, and the same per chart.
const BUDGET: [u64; 2] = [30_000_000, 100_000];

/// A place for every piece, and the pages.
///
/// # Errors
/// [`Error::TooManyTexels`] where a piece is larger than a page.
pub(super) fn pack(pieces: &[Piece], settings: &PackSettings) -> Result<(Vec<Placement>, Vec<Page>), Error> {
    if pieces.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let budget = BUDGET[0] + BUDGET[1] * pieces.len() as u64;
    let Some(Arrangement { shapes, plan, packed, texels_per_cell }) =
        Arrangement::new(pieces, settings, FINE_CELLS, 1, budget)
    else {
        let [width, height] = settings.page.unwrap_or_default();
        return Err(Error::TooManyTexels {
            texel_m: settings.texel_m,
            width: width as f64,
            height: height as f64,
            limit: width * height,
        });
    };

    let cell = settings.texel_m * texels_per_cell as f64;
    let mut placements = vec![Placement { page: 0, turn: [1.0, 0.0], shift: [0.0; 2] }; pieces.len()];
    for (&(chart, _), &(page, turn, [column, row])) in plan.steps.iter().zip(&packed.places) {
        let shape = &shapes.turned[chart][turn];
        let shift = [column as f64 * cell - shape.corner[0], row as f64 * cell - shape.corner[1]];
        placements[chart] = Placement { page, turn: shape.turn, shift };
    }
    let page = |used: &[usize; 2]| settings.page.unwrap_or_else(|| used.map(|cells| cells * texels_per_cell));
    Ok((placements, packed.used.iter().map(page).collect()))
}

/// Share of the page that pieces would fill, found quickly: the largest first, without a search, on cells that are not the finest. Of the last of several
/// pages only the rows that are used count. `None` where a piece is larger than a page.
pub(super) fn estimate(pieces: &[Piece], settings: &PackSettings) -> Option<f64> {
    let found = Arrangement::new(pieces, settings, ESTIMATE_CELLS, ESTIMATE_TURNS, 0)?;
    let cell = settings.texel_m * found.texels_per_cell as f64;
    Some(pieces.iter().map(area).sum::<f64>() / (found.packed.cost as f64 * cell * cell))
}

/// Share of the pages that pieces fill.
pub(super) fn utilisation(pieces: &[Piece], pages: &[Page], settings: &PackSettings) -> f64 {
    let texels: f64 = pages.iter().map(|[width, height]| (width * height) as f64).sum();
    pieces.iter().map(area).sum::<f64>() / (texels * settings.texel_m * settings.texel_m)
}

#[cfg(test)]
mod tests {
    use super::arrange::{COARSE_CELLS, LONGEST, texels_per_cell};
    use super::search::{Goal, search};
    use super::shape::Shapes;
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
        PackSettings { texel_m: 1.0, gutter, turns, ..PackSettings::default() }
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
