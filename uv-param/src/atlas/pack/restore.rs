//! Charts that were laid out again, back on their old places as far as these still hold them.

use super::settings::{PackSettings, Page, Placement};
use super::shape::Piece;
use crate::atlas::pack::bitmap::Bitmap;

/// Texels by which a chart may move to fit.
const REACH: isize = 3;
/// Charts lie on lines between texels: rounding must not put them beyond.
const ROUNDING: f64 = 1e-6;

/// Where a piece was: there it stays, or there it would go.
#[derive(Debug, Clone, Copy)]
pub(in crate::atlas) enum PageSlot {
    Taken(Placement),
    Wanted(Placement),
}

/// For every piece the place at which it stays: that which it has, or that nearest to the wanted one at which it keeps its distance from all others
/// and lies on the page. `None` where there is none. Pieces that want a place get it in their order.
pub(in crate::atlas) fn restore(
    pieces: &[(Piece, PageSlot)],
    pages: &[Page],
    settings: &PackSettings,
) -> Vec<Option<Placement>> {
    let mut taken: Vec<Bitmap> = pages.iter().map(|&[columns, rows]| Bitmap::new(columns, rows)).collect();
    let mut stamp = |piece: &Piece, place: &Placement, must_fit: bool| {
        let page = &mut taken[place.page];
        let size = [page.columns, page.rows].map(|texels| texels as f64);
        let rim =
            || piece.rim.iter().map(|edge| edge.map(|at| place.apply(at).map(|x| x / settings.texel_m + ROUNDING)));
        let is_on_page = |at: &[f64; 2]| (0..2).all(|k| at[k] >= 0.0 && at[k] <= size[k]);
        if must_fit && !rim().flatten().all(|at| is_on_page(&at)) {
            return false;
        }
        let map = Bitmap::within(rim(), size, 1.0);
        if must_fit && map.meets(page) {
            return false;
        }
        let gutter = settings.gutter;
        page.stamp(&map.dilated(gutter), -(gutter as isize), -(gutter as isize));
        true
    };
    for (piece, slot) in pieces {
        if let PageSlot::Taken(place) = slot {
            stamp(piece, place, false);
        }
    }
    let mut steps: Vec<[isize; 2]> = (-REACH..=REACH).flat_map(|x| (-REACH..=REACH).map(move |y| [x, y])).collect();
    steps.sort_by_key(|[x, y]| (x * x + y * y, *x, *y));
    let mut settled = |(piece, slot): &(Piece, PageSlot)| match slot {
        PageSlot::Taken(place) => Some(*place),
        PageSlot::Wanted(place) => steps.iter().find_map(|step| {
            let shift = [0, 1].map(|k| place.shift[k] + step[k] as f64 * settings.texel_m);
            let moved = Placement { shift, ..*place };
            stamp(piece, &moved, true).then_some(moved)
        }),
    };
    pieces.iter().map(&mut settled).collect()
}
