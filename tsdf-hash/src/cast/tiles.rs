//! Which fields each square of pixels may see.

use super::camera::Camera;
use super::fields::Place;

/// Edge of a square, pixels.
pub(crate) const SIDE: usize = 8;

/// Lists of places, front to back, one per square.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    pub(crate) columns: usize,
    /// Where the list of each square starts, and where the last one ends.
    pub(crate) starts: Vec<u32>,
    pub(crate) lists: Vec<u32>,
}

impl Tiles {
    pub(crate) fn fill(&mut self, places: &[Place], camera: &Camera) {
        self.columns = camera.width.div_ceil(SIDE);
        let count = self.columns * camera.height.div_ceil(SIDE);
        let covers: Vec<_> = places.iter().map(|place| camera.cover(&place.low, &place.high)).collect();
        let columns = self.columns;
        let squares = |cover: &Option<[usize; 4]>| {
            let [left, top, right, bottom] = cover.map_or([1, 1, 0, 0], |pixels| pixels.map(|p| p / SIDE));
            (top..=bottom).flat_map(move |row| (left..=right).map(move |column| row * columns + column))
        };
        self.starts.clear();
        self.starts.resize(count + 1, 0);
        for square in covers.iter().flat_map(squares) {
            self.starts[square] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.lists.clear();
        self.lists.resize(end as usize, 0);
        // Backwards, each list from its end: what was an end is then a start.
        for (place, cover) in covers.iter().enumerate().rev() {
            for square in squares(cover) {
                self.starts[square] -= 1;
                self.lists[self.starts[square] as usize] = place as u32;
            }
        }
    }

    /// The list of the square at a column and row of squares.
    pub(crate) fn list(&self, column: usize, row: usize) -> &[u32] {
        let square = row * self.columns + column;
        &self.lists[self.starts[square] as usize..self.starts[square + 1] as usize]
    }
}
