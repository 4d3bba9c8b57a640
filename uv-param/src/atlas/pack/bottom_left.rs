//! Charts onto pages in a given order, each at the lowest place that is free.

use super::shape::{Shape, Shapes};
use crate::atlas::pack::bitmap::Bitmap;

/// Where a chart lies: page, number of the turn, column and row.
pub(super) type Place = (usize, usize, [usize; 2]);

/// A chart and the turn it is placed in; `None`: that with the lowest upper edge.
pub(super) type Step = (usize, Option<usize>);

/// Pages while they are being filled.
#[derive(Clone)]
pub(super) struct Pages {
    size: [usize; 2],
    maps: Vec<Bitmap>,
    /// Columns and rows that are used of every page.
    pub(super) used: Vec<[usize; 2]>,
    /// Words that were looked at: the measure of work.
    pub(super) work: u64,
}

impl Pages {
    /// No pages yet; each will have this size, cells.
    pub(super) fn new(size: [usize; 2]) -> Self {
        Self { size, maps: Vec::new(), used: Vec::new(), work: 0 }
    }

    /// Places the next chart; `None` where it fits on none of at most `most` pages below row `top`.
    pub(super) fn add(&mut self, shapes: &Shapes, (chart, turn): Step, most: usize, top: usize) -> Option<Place> {
        let turns = &shapes.turned[chart];
        let mut page = 0;
        let (turn, at) = loop {
            let fresh = page == self.maps.len();
            if page == most {
                return None;
            }
            if fresh {
                self.maps.push(Bitmap::new(self.size[0], self.size[1]));
                self.used.push([0; 2]);
            }
            if let Some(place) = self.best(page, turns, turn, top) {
                break place;
            }
            if fresh {
                return None;
            }
            page += 1;
        };
        let (shape, gutter) = (&turns[turn], shapes.gutter as isize);
        self.maps[page].stamp(&shape.wide, at[0] as isize - gutter, at[1] as isize - gutter);
        let used = &mut self.used[page];
        *used = [used[0].max(at[0] + shape.size[0]), used[1].max(at[1] + shape.size[1])];
        Some((page, turn, at))
    }

    /// The turn and place with the lowest upper edge; of equals the lowest, then the leftmost.
    fn best(&mut self, page: usize, turns: &[Shape], wanted: Option<usize>, top: usize) -> Option<(usize, [usize; 2])> {
        let mut best: Option<([usize; 3], usize, [usize; 2])> = None;
        let tried = wanted.map_or(0..turns.len(), |turn| turn..turn + 1);
        for turn in tried {
            let shape = &turns[turn];
            let Some(below) = best.map_or(top, |(key, ..)| key[0].min(top)).checked_sub(shape.size[1]) else {
                continue;
            };
            let (place, work) = self.maps[page].lowest_place(&shape.outline, shape.size, below);
            self.work += work;
            if let Some(place) = place {
                let key = [place[1] + shape.size[1], place[1], place[0]];
                if best.is_none_or(|(least, ..)| key < least) {
                    best = Some((key, turn, place));
                }
            }
        }
        best.map(|(_, turn, place)| (turn, place))
    }
}
