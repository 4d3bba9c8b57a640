//! Charts onto pages that are filled already: what lies there stays.

use super::settings::{PackSettings, Page, Placement};
use super::shape::{Piece, Shape, Shapes};
use crate::atlas::pack::bitmap::Bitmap;
use crate::error::Error;

/// Cells along the side of the first page while a place is searched for.
const CELLS: usize = 256;

/// A place for every piece that has none, the largest first: the lowest that is free. The first page grows to the right where there is none, by
/// default; pages of a given size get another one.
///
/// # Errors
/// [`Error::TooManyTexels`] where a piece is larger than a page.
pub(in crate::atlas) fn add_to(
    pieces: &[Piece],
    places: &[Option<Placement>],
    pages: &[Page],
    settings: &PackSettings,
) -> Result<(Vec<Placement>, Vec<Page>), Error> {
    let side = pages.iter().flatten().copied().max().unwrap_or(1);
    // The cells of the search may be too large for what just fits.
    add(pieces, places, pages, settings, side.div_ceil(CELLS)).or_else(|_| add(pieces, places, pages, settings, 1))
}

fn add(
    pieces: &[Piece],
    places: &[Option<Placement>],
    pages: &[Page],
    settings: &PackSettings,
    texels_per_cell: usize,
) -> Result<(Vec<Placement>, Vec<Page>), Error> {
    let wanted = |k: usize| if places[k].is_some() { Vec::new() } else { (0..settings.turns.count()).collect() };
    let shapes = Shapes::new(pieces, settings, texels_per_cell, wanted);
    let cell = settings.texel_m * texels_per_cell as f64;
    let mut filled: Vec<Filled> = (0..pages.len())
        .map(|page| {
            let there =
                pieces.iter().zip(places).filter_map(|(piece, place)| Some((piece, place.filter(|p| p.page == page)?)));
            let rims = there.flat_map(|(piece, place)| {
                piece.rim.iter().map(move |edge| edge.map(|at| place.apply(at).map(|x| x / cell)))
            });
            Filled::new(pages[page].map(|texels| texels / texels_per_cell), rims, shapes.gutter)
        })
        .collect();
    let mut pages: Vec<Page> = pages.to_vec();
    let mut placements = places.to_vec();
    let mut missing: Vec<usize> = (0..pieces.len()).filter(|&k| places[k].is_none()).collect();
    let cells = |k: usize| shapes.turned[k].first().map_or(0, |shape| shape.wide.count());
    missing.sort_by(|&a, &b| cells(b).cmp(&cells(a)).then(a.cmp(&b)));
    for k in missing {
        let turns = &shapes.turned[k];
        let mut found = (0..filled.len()).find_map(|page| filled[page].lowest(turns).map(|found| (page, found)));
        if found.is_none() {
            let page = if let Some(size) = settings.page {
                filled.push(Filled::new(
                    size.map(|texels| texels / texels_per_cell),
                    std::iter::empty(),
                    shapes.gutter,
                ));
                pages.push(size);
                pages.len() - 1
            } else {
                let rows = filled[0].map.rows;
                // The turn that takes the fewest columns of those that need no more rows, or else the fewest rows.
                let size = turns.iter().map(|shape| shape.size).min_by_key(|[w, h]| ((*h).max(rows), *w));
                let [width, height] = size.unwrap_or([1; 2]);
                let grown = [filled[0].map.columns + shapes.gutter + width, rows.max(height)];
                filled[0].grow(grown);
                pages[0] = [0, 1].map(|c| pages[0][c].max(grown[c] * texels_per_cell));
                0
            };
            found = filled[page].lowest(turns).map(|found| (page, found));
        }
        let Some((page, (turn, at))) = found else {
            let [width, height] = turns.first().map_or([0; 2], |shape| shape.size).map(|cells| cells as f64);
            let limit = settings.page.map_or(0, |page| page[0] * page[1]);
            return Err(Error::TooManyTexels { texel_m: settings.texel_m, width, height, limit });
        };
        let shape = &turns[turn];
        filled[page].stamp(&shape.wide, at);
        let shift = [0, 1].map(|c| at[c] as f64 * cell - shape.corner[c]);
        placements[k] = Some(Placement { page, turn: shape.turn, shift });
    }
    Ok((placements.into_iter().flatten().collect(), pages))
}

/// A page while charts are added.
struct Filled {
    gutter: isize,
    map: Bitmap,
    /// What lies on it, with its gutter, and where.
    stamps: Vec<(Bitmap, [isize; 2])>,
}

impl Filled {
    /// A page of some cells on which shapes lie that these edges (in cells) run around.
    fn new(size: [usize; 2], rims: impl Iterator<Item = [[f64; 2]; 2]>, gutter: usize) -> Self {
        let there = Bitmap::within(rims, size.map(|cells| cells as f64), 1.0).dilated(gutter);
        let gutter = gutter as isize;
        let mut filled = Self { gutter, map: Bitmap::new(size[0], size[1]), stamps: vec![(there, [-gutter; 2])] };
        filled.grow(size);
        filled
    }

    /// The same page of another size.
    fn grow(&mut self, [columns, rows]: [usize; 2]) {
        self.map = Bitmap::new(columns, rows);
        for (shape, [column, row]) in &self.stamps {
            self.map.stamp(shape, *column, *row);
        }
    }

    fn stamp(&mut self, wide: &Bitmap, at: [usize; 2]) {
        let [column, row] = at.map(|x| x as isize - self.gutter);
        self.map.stamp(wide, column, row);
        self.stamps.push((wide.clone(), [column, row]));
    }

    /// The turn and place with the lowest upper edge.
    fn lowest(&self, turns: &[Shape]) -> Option<(usize, [usize; 2])> {
        let place = |(turn, shape): (usize, &Shape)| {
            let at = self.map.lowest_place(&shape.outline, shape.size, usize::MAX).0?;
            Some(([at[1] + shape.size[1], at[1], at[0]], turn, at))
        };
        turns.iter().enumerate().filter_map(place).min().map(|(_, turn, at)| (turn, at))
    }
}
