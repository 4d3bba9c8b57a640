//! Bitmaps of cells: what a chart covers, what of a page is taken.

const BITS: usize = 64;

/// Runs of cells with their rows: what of a shape can touch something first.
pub(in crate::atlas) type Outline = Vec<(u32, [usize; 2])>;

/// Rows of bits; row 0 is the lowest.
#[derive(Debug, Clone)]
pub(in crate::atlas) struct Bitmap {
    pub(in crate::atlas) columns: usize,
    pub(in crate::atlas) rows: usize,
    words: usize,
    bits: Vec<u64>,
}

impl Bitmap {
    pub(in crate::atlas) fn new(columns: usize, rows: usize) -> Self {
        let words = columns.div_ceil(BITS);
        Self { columns, rows, words, bits: vec![0; words * rows] }
    }

    #[cfg(test)]
    fn get(&self, column: usize, row: usize) -> bool {
        self.bits[row * self.words + column / BITS] >> (column % BITS) & 1 == 1
    }

    fn row(&self, row: usize) -> &[u64] {
        &self.bits[row * self.words..(row + 1) * self.words]
    }

    /// Sets the columns `from..=to` of a row.
    pub(in crate::atlas) fn set(&mut self, from: usize, to: usize, row: usize) {
        let start = row * self.words;
        for word in from / BITS..=to / BITS {
            let mut mask = u64::MAX;
            if word == from / BITS {
                mask &= u64::MAX << (from % BITS);
            }
            if word == to / BITS {
                mask &= u64::MAX >> (BITS - 1 - to % BITS);
            }
            self.bits[start + word] |= mask;
        }
    }

    /// The cells that a shape touches, each side `cell` long, from the lower left corner of the coordinates. The edges run around it, in any order;
    /// parts that they run around more than once, or the other way round, count as well.
    pub(in crate::atlas) fn within(edges: impl Iterator<Item = [[f64; 2]; 2]>, size: [f64; 2], cell: f64) -> Self {
        let count = |length: f64| ((length / cell).ceil() as usize).max(1);
        let mut map = Self::new(count(size[0]), count(size[1]));
        // Where edges cross the middles of the rows: row, column, and whether upwards.
        let mut crossings: Vec<(usize, f64, i32)> = Vec::new();
        for [p, q] in edges.map(|edge| edge.map(|p| p.map(|x| x / cell))) {
            map.add_edge(p, q);
            let (low, high, way) = if p[1] < q[1] { (p, q, 1) } else { (q, p, -1) };
            let from = (low[1] - 0.5).ceil().max(0.0) as usize;
            let rows = (from..map.rows).take_while(|&row| row as f64 + 0.5 < high[1]);
            crossings.extend(rows.map(|row| {
                let along = (row as f64 + 0.5 - low[1]) / (high[1] - low[1]);
                (row, low[0] + along * (high[0] - low[0]), way)
            }));
        }
        crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut around = 0;
        for pair in crossings.windows(2) {
            around += pair[0].2;
            if around != 0 && pair[0].0 == pair[1].0 {
                let [from, to] = [pair[0].1, pair[1].1].map(|x| last(map.columns, x));
                map.set(from, to, pair[0].0);
            }
        }
        map
    }

    /// Marks the cells that an edge touches.
    fn add_edge(&mut self, p: [f64; 2], q: [f64; 2]) {
        for row in last(self.rows, p[1].min(q[1]))..=last(self.rows, p[1].max(q[1])) {
            let (bottom, top) = (row as f64, row as f64 + 1.0);
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            let mut reach = |x: f64| (left, right) = (left.min(x), right.max(x));
            for end in [p, q] {
                if (bottom..=top).contains(&end[1]) {
                    reach(end[0]);
                }
            }
            for line in [bottom, top] {
                if (p[1] < line) != (q[1] < line) {
                    reach(p[0] + (line - p[1]) / (q[1] - p[1]) * (q[0] - p[0]));
                }
            }
            if left <= right {
                self.set(last(self.columns, left), last(self.columns, right), row);
            }
        }
    }

    /// Whether a cell is marked on both maps, which have the same size.
    pub(in crate::atlas) fn meets(&self, other: &Self) -> bool {
        self.bits.iter().zip(&other.bits).any(|(a, b)| a & b != 0)
    }

    /// Marked cells.
    pub(in crate::atlas) fn count(&self) -> usize {
        self.bits.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The map with every cell spread by `by` cells to all sides, on a map that is larger by as much on each side.
    pub(in crate::atlas) fn dilated(&self, by: usize) -> Self {
        let mut wide = Self::new(self.columns + 2 * by, self.rows + 2 * by);
        for row in 0..self.rows {
            for [from, to] in runs(self.row(row), self.columns) {
                for r in row..=row + 2 * by {
                    wide.set(from, to + 2 * by, r);
                }
            }
        }
        wide
    }

    /// Runs of cells with an empty neighbour above, below or beside, by row: what can touch something first.
    pub(in crate::atlas) fn outline(&self) -> Outline {
        let mut found = Vec::new();
        for row in 0..self.rows {
            let here = self.row(row);
            let inner: Vec<u64> = (0..self.words)
                .map(|w| {
                    let beside = |words: &[u64]| -> u64 {
                        let left = words[w] << 1 | if w > 0 { words[w - 1] >> (BITS - 1) } else { 0 };
                        let right = words[w] >> 1 | if w + 1 < self.words { words[w + 1] << (BITS - 1) } else { 0 };
                        left & right
                    };
                    let above = if row + 1 < self.rows { self.row(row + 1)[w] } else { 0 };
                    let below = if row > 0 { self.row(row - 1)[w] } else { 0 };
                    here[w] & !(beside(here) & above & below)
                })
                .collect();
            found.extend(runs(&inner, self.columns).map(|run| (row as u32, run)));
        }
        found
    }

    /// Marks every cell of `shape`, moved by `column` and `row`, which may be negative, as far as it lies on this map.
    pub(in crate::atlas) fn stamp(&mut self, shape: &Self, column: isize, row: isize) {
        for r in 0..shape.rows {
            let here = row + r as isize;
            if here < 0 || here >= self.rows as isize {
                continue;
            }
            for [from, to] in runs(shape.row(r), shape.columns) {
                let (from, to) = (from as isize + column, to as isize + column);
                if to >= 0 && from < self.columns as isize {
                    self.set(from.max(0) as usize, (to as usize).min(self.columns - 1), here as usize);
                }
            }
        }
    }

    /// The lowest place, and there the leftmost, at which an outline of this width and height meets no marked cell, and how many
    /// words were looked at.
    pub(in crate::atlas) fn lowest_place(
        &self,
        outline: &[(u32, [usize; 2])],
        [width, height]: [usize; 2],
        below: usize,
    ) -> (Option<[usize; 2]>, u64) {
        if width > self.columns || height > self.rows {
            return (None, 0);
        }
        let mut work = 0;
        let places = self.columns - width + 1;
        let words = places.div_ceil(BITS);
        let mut taken = vec![0u64; words];
        let mut spread = Vec::with_capacity(self.words);
        for row in 0..=(self.rows - height).min(below) {
            taken.fill(0);
            if !places.is_multiple_of(BITS) {
                taken[words - 1] = u64::MAX << (places % BITS);
            }
            let full = |taken: &[u64]| taken.iter().all(|&w| w == u64::MAX);
            for (i, &(r, [from, to])) in outline.iter().enumerate() {
                work += words as u64;
                let marked = self.row(row + r as usize);
                // Most runs are single cells.
                if to == from {
                    add_shifted(&mut taken, marked, from);
                } else {
                    spread_down(marked, to - from, &mut spread);
                    add_shifted(&mut taken, &spread, from);
                }
                if i % 8 == 7 && full(&taken) {
                    break;
                }
            }
            if let Some(w) = taken.iter().position(|&w| w != u64::MAX) {
                return (Some([w * BITS + taken[w].trailing_ones() as usize, row]), work);
            }
        }
        (None, work)
    }
}

/// The cell of a coordinate, the nearest one outside.
fn last(count: usize, x: f64) -> usize {
    (x.max(0.0) as usize).min(count - 1)
}

/// Adds the bits of a row, moved down by `by`.
fn add_shifted(taken: &mut [u64], row: &[u64], by: usize) {
    let (skip, shift) = (by / BITS, by % BITS);
    for (w, slot) in taken.iter_mut().enumerate() {
        let low = row.get(w + skip).copied().unwrap_or(0) >> shift;
        let high = if shift > 0 { row.get(w + skip + 1).copied().unwrap_or(0) << (BITS - shift) } else { 0 };
        *slot |= low | high;
    }
}

/// An outline in another order: what comes next lies far from what came before, so that after a few runs most rows are known to be taken.
pub(in crate::atlas) fn scattered(outline: &Outline) -> Outline {
    let bits = usize::BITS - outline.len().leading_zeros();
    let reversed = |k: usize| k.reverse_bits().checked_shr(usize::BITS - bits).unwrap_or(0);
    (0..1_usize << bits).filter_map(|k| outline.get(reversed(k)).copied()).collect()
}

/// Bit `i` of the result: whether one of the bits `i..=i + by` of the row is set.
fn spread_down(row: &[u64], by: usize, out: &mut Vec<u64>) {
    out.clear();
    out.extend_from_slice(row);
    let mut done = 0;
    while done < by {
        let step = (done + 1).min(by - done);
        let (skip, shift) = (step / BITS, step % BITS);
        for w in 0..out.len() {
            let low = out.get(w + skip).copied().unwrap_or(0) >> shift;
            let high = if shift > 0 { out.get(w + skip + 1).copied().unwrap_or(0) << (BITS - shift) } else { 0 };
            out[w] |= low | high;
        }
        done += step;
    }
}

/// First and last column of every run of set bits.
fn runs(words: &[u64], columns: usize) -> impl Iterator<Item = [usize; 2]> {
    let mut at = 0;
    let next = move |from: usize, wanted: bool| {
        let mut w = from / BITS;
        let mut mask = u64::MAX.checked_shl((from % BITS) as u32).unwrap_or(0);
        while w < words.len() {
            let word = if wanted { words[w] } else { !words[w] } & mask;
            if word != 0 {
                return (w * BITS + word.trailing_zeros() as usize).min(columns);
            }
            w += 1;
            mask = u64::MAX;
        }
        columns
    };
    std::iter::from_fn(move || {
        let from = next(at, true);
        if from >= columns {
            return None;
        }
        at = next(from, false);
        Some([from, at - 1])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cross_words() {
        let mut map = Bitmap::new(200, 1);
        map.set(60, 70, 0);
        map.set(128, 128, 0);
        map.set(190, 199, 0);
        assert_eq!(runs(map.row(0), 200).collect::<Vec<_>>(), [[60, 70], [128, 128], [190, 199]]);
    }

    #[test]
    fn maps_meet_where_both_are_marked() {
        let of = |from: usize, to: usize| {
            let mut map = Bitmap::new(200, 2);
            map.set(from, to, 1);
            map
        };
        assert!(of(60, 70).meets(&of(70, 199)));
        assert!(!of(60, 70).meets(&of(71, 199)) && !of(60, 70).meets(&Bitmap::new(200, 2)));
    }

    /// Against cells looked at one by one.
    #[test]
    fn the_lowest_place_is_that_of_brute_force() {
        let mut state = 7_u64;
        let mut random = |n: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % n
        };
        for _ in 0..200 {
            let mut page = Bitmap::new(20 + random(150), 12 + random(20));
            for _ in 0..random(12) {
                let (column, row) = (random(page.columns), random(page.rows));
                page.set(column, (column + random(30)).min(page.columns - 1), row);
            }
            let mut shape = Bitmap::new(1 + random(80), 1 + random(10));
            for row in 0..shape.rows {
                let from = random(shape.columns);
                shape.set(from, from + random(shape.columns - from), row);
            }
            let fits = |column: usize, row: usize| {
                (0..shape.rows).all(|r| (0..shape.columns).all(|c| !shape.get(c, r) || !page.get(column + c, row + r)))
            };
            let mut expected = None;
            if shape.columns <= page.columns && shape.rows <= page.rows {
                'search: for row in 0..=page.rows - shape.rows {
                    for column in 0..=page.columns - shape.columns {
                        if fits(column, row) {
                            expected = Some([column, row]);
                            break 'search;
                        }
                    }
                }
            }
            let all: Vec<_> = (0..shape.rows)
                .flat_map(|r| runs(shape.row(r), shape.columns).map(move |run| (r as u32, run)).collect::<Vec<_>>())
                .collect();
            assert_eq!(page.lowest_place(&all, [shape.columns, shape.rows], usize::MAX).0, expected);
        }
    }

    #[test]
    fn a_thin_triangle_marks_every_cell_that_it_crosses() {
        let [a, b, c] = [[0.1, 0.1], [9.9, 4.9], [9.8, 4.95]];
        let map = Bitmap::within([[a, b], [b, c], [c, a]].into_iter(), [10.0, 5.0], 1.0);
        for i in 0..1000 {
            let t = f64::from(i) / 999.0;
            let at = [0.1 + t * 9.8, 0.1 + t * 4.8];
            assert!(map.get(at[0] as usize, at[1] as usize), "{at:?}");
        }
        assert!(!map.get(0, 4) && !map.get(9, 0));
    }

    /// A frame, its corners at odd places: every cell by points on a fine grid.
    #[test]
    fn cells_inside_are_marked_and_holes_are_not() {
        let square = |low: f64, high: f64| [[low, low], [high, low], [high, high], [low, high]];
        let around = |corners: [[f64; 2]; 4]| (0..4).map(move |k| [corners[k], corners[(k + 1) % 4]]);
        let mut hole = square(5.3, 12.6);
        hole.reverse();
        let map = Bitmap::within(around(square(0.2, 17.5)).chain(around(hole)), [18.0, 18.0], 1.0);
        for (column, row) in (0..18).flat_map(|column| (0..18).map(move |row| (column, row))) {
            let free = |k: usize| (6..12).contains(&k);
            assert_eq!(map.get(column, row), !(free(column) && free(row)), "{column} {row}");
        }
    }
}
