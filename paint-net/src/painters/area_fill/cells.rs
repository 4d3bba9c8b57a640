//! Rows through regions, joined to cells, and what they leave.

/// Directions of rows that are tried, over half a turn.
const DIRECTIONS: usize = 12;
/// Step along a row at which its runs are looked for, pixels.
const LOOK: f64 = 0.25;

/// Part of a row inside the region, from one end to the other along it; its places are those of sprays.
#[derive(Debug, Clone)]
struct Run {
    start: f64,
    end: f64,
    places: Vec<f64>,
}

/// Consecutive runs without a branch, each with the offset of its row.
type Cell = Vec<(f64, Run)>;

/// Places of sprays in every cell, pixels, in the order in which they are flown: to and fro in the direction that gives the fewest
/// runs and cells. Rows lie no more than `across` apart, sprays about `along`. Gaps of a row up to `max_gap` are flown over.
pub(super) fn cells(region: &[bool], width: usize, across: f64, along: f64, max_gap: f64) -> Vec<Vec<[f64; 2]>> {
    let inside: Vec<[f64; 2]> =
        (0..region.len()).filter(|&k| region[k]).map(|k| [(k % width) as f64, (k / width) as f64]).collect();
    let decomposed = |direction: usize| {
        let angle = std::f64::consts::PI * direction as f64 / DIRECTIONS as f64;
        let frame = Frame { sin: angle.sin(), cos: angle.cos() };
        let cells = decompose(&frame, &inside, region, width, [across, along, max_gap]);
        let turns = cells.len() + cells.iter().map(Vec::len).sum::<usize>();
        (turns, frame, cells)
    };
    let best = (0..DIRECTIONS).map(decomposed).min_by_key(|(turns, ..)| *turns);
    best.map_or(Vec::new(), |(_, frame, cells)| cells.iter().map(|cell| to_and_fro(&frame, cell)).collect())
}

/// Pixels of the region that no spray comes near enough to: farther off than the middle between two rows.
pub(super) fn uncovered(lines: &[Vec<[f64; 2]>], region: &[bool], width: usize, across: f64, along: f64) -> Vec<bool> {
    let near = (0.5 * across).hypot(0.5 * along) + 0.1;
    let mut left = region.to_vec();
    let height = region.len() / width;
    let span = |centre: f64, size: usize| {
        (centre - near).ceil().max(0.0) as usize..((centre + near).floor() + 1.0).clamp(0.0, size as f64) as usize
    };
    for &[x, y] in lines.iter().flatten() {
        for row in span(y, height) {
            for column in span(x, width) {
                if (column as f64 - x).hypot(row as f64 - y) <= near {
                    left[row * width + column] = false;
                }
            }
        }
    }
    left
}

/// Rows in a direction: coordinates along and across it.
struct Frame {
    sin: f64,
    cos: f64,
}

impl Frame {
    fn coordinates(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x]
    }

    fn place(&self, [along, across]: [f64; 2]) -> [f64; 2] {
        [self.cos * along - self.sin * across, self.sin * along + self.cos * across]
    }
}

fn decompose(
    frame: &Frame,
    inside: &[[f64; 2]],
    region: &[bool],
    width: usize,
    [across, along, max_gap]: [f64; 3],
) -> Vec<Cell> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &pixel in inside {
        let at = frame.coordinates(pixel);
        for c in 0..2 {
            (low[c], high[c]) = (low[c].min(at[c] - 0.5), high[c].max(at[c] + 0.5));
        }
    }
    if inside.is_empty() {
        return Vec::new();
    }
    let rows = ((high[1] - low[1]) / across).ceil().max(1.0);
    let spacing = (high[1] - low[1]) / rows;
    let (mut done, mut open): (Vec<Cell>, Vec<Cell>) = (Vec::new(), Vec::new());
    for row in 0..rows as usize {
        let offset = low[1] + (row as f64 + 0.5) * spacing;
        let holds = |at: f64| {
            let [x, y] = frame.place([at, offset]).map(f64::round);
            x >= 0.0 && y >= 0.0 && (x as usize) < width && region.get(y as usize * width + x as usize) == Some(&true)
        };
        let runs = runs([low[0], high[0]], along, max_gap, holds);
        (done, open) = joined(done, open, runs, offset, max_gap);
    }
    done.extend(open);
    done
}

/// The runs of a row. `holds` tells whether a place along it lies in the region.
fn runs([low, high]: [f64; 2], along: f64, max_gap: f64, holds: impl Fn(f64) -> bool) -> Vec<Run> {
    let steps = ((high - low) / LOOK).ceil() as usize;
    let places = (0..=steps).map(|k| low + k as f64 * LOOK).filter(|&at| holds(at));
    let mut pieces: Vec<[f64; 2]> = Vec::new();
    for at in places {
        match pieces.last_mut() {
            Some(piece) if at - piece[1] < 1.5 * LOOK => piece[1] = at,
            _ => pieces.push([at, at]),
        }
    }
    let mut runs: Vec<Run> = Vec::new();
    for [start, end] in pieces {
        let parts = ((end - start) / along).round().max(1.0);
        let sprays = (0..parts as usize).map(|k| start + (k as f64 + 0.5) / parts * (end - start));
        match runs.last_mut() {
            Some(run) if start - run.end + along <= max_gap => {
                run.end = end;
                run.places.extend(sprays);
            }
            _ => runs.push(Run { start, end, places: sprays.collect() }),
        }
    }
    runs
}

/// The cells after one row more: a run goes on with the only cell that it touches if that touches no other run, and if the way
/// around the turn is short.
fn joined(
    mut done: Vec<Cell>,
    mut open: Vec<Cell>,
    runs: Vec<Run>,
    offset: f64,
    max_turn: f64,
) -> (Vec<Cell>, Vec<Cell>) {
    let touch =
        |cell: &Cell, run: &Run| cell.last().is_some_and(|(_, last)| last.start <= run.end && run.start <= last.end);
    let goes_on = |run: &Run| {
        let mut before = (0..open.len()).filter(|&c| touch(&open[c], run));
        let cell = before.next().filter(|_| before.next().is_none())?;
        let alone = runs.iter().filter(|other| touch(&open[cell], other)).count() == 1;
        (alone && turn(&open[cell], run, offset) <= max_turn).then_some(cell)
    };
    let cells: Vec<Option<usize>> = runs.iter().map(goes_on).collect();
    let mut next: Vec<Cell> = Vec::with_capacity(runs.len());
    for (run, cell) in runs.into_iter().zip(cells) {
        let mut cell = cell.map_or(Vec::new(), |cell| std::mem::take(&mut open[cell]));
        cell.push((offset, run));
        next.push(cell);
    }
    done.extend(open.into_iter().filter(|cell| !cell.is_empty()));
    (done, next)
}

/// Way from the end of a cell to the next run: even runs are flown along the direction, odd ones against it.
fn turn(cell: &Cell, run: &Run, offset: f64) -> f64 {
    let Some((before, last)) = cell.last() else { return 0.0 };
    let ahead = cell.len() % 2 == 1;
    let (from, to) =
        if ahead { (last.places.last(), run.places.last()) } else { (last.places.first(), run.places.first()) };
    from.zip(to).map_or(0.0, |(from, to)| (to - from).hypot(offset - before))
}

fn to_and_fro(frame: &Frame, cell: &Cell) -> Vec<[f64; 2]> {
    let row = |(k, (offset, run)): (usize, &(f64, Run))| {
        let mut places: Vec<[f64; 2]> = run.places.iter().map(|&at| frame.place([at, *offset])).collect();
        if k % 2 == 1 {
            places.reverse();
        }
        places
    };
    cell.iter().enumerate().flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(width: usize, height: usize, inside: impl Fn(f64, f64) -> bool) -> Vec<bool> {
        (0..width * height).map(|k| inside((k % width) as f64, (k / width) as f64)).collect()
    }

    #[test]
    fn a_run_goes_on_over_a_gap_that_is_short_enough() {
        let with_gap = |gap: f64| runs([0.0, 20.0], 1.0, 4.0, |at| at <= 5.0 || at >= 5.0 + gap);
        // The sprays beside the gap lie half a spacing inside: it counts as longer by one.
        assert_eq!([2.0, 3.0, 3.5, 6.0].map(|gap| with_gap(gap).len()), [1, 1, 2, 2]);
        let ends: Vec<[f64; 2]> = with_gap(6.0).iter().map(|run| [run.start, run.end]).collect();
        assert_eq!(ends, [[0.0, 5.0], [11.0, 20.0]]);
    }

    #[test]
    fn a_rectangle_is_one_cell_along_its_long_side() {
        let region = mask(40, 90, |x, y| (5.0..35.0).contains(&x) && (5.0..85.0).contains(&y));
        let found = cells(&region, 40, 4.0, 2.0, 8.0);
        assert_eq!(found.len(), 1);
        // 30 pixels across in 8 rows of 80 pixels.
        let length: f64 = found[0].windows(2).map(|p| (p[0][0] - p[1][0]).hypot(p[0][1] - p[1][1])).sum();
        assert!((length - (8.0 * 78.0 + 7.0 * 3.75)).abs() < 12.0, "{length}");
        assert!(uncovered(&found, &region, 40, 4.0, 2.0).iter().all(|left| !left));
    }

    #[test]
    fn a_hole_parts_cells_and_no_spray_lies_in_it() {
        let in_hole = |x: f64, y: f64| (x - 50.0).hypot(y - 30.0) < 14.0;
        let region = mask(100, 60, |x, y| !in_hole(x, y));
        let found = cells(&region, 100, 4.0, 2.0, 8.0);
        assert!((3..=6).contains(&found.len()), "{} cells", found.len());
        assert!(found.iter().flatten().all(|[x, y]| !in_hole(x.round(), y.round())));
        let steps = found.iter().flat_map(|cell| cell.windows(2)).map(|p| (p[0][0] - p[1][0]).hypot(p[0][1] - p[1][1]));
        assert!(steps.fold(0.0, f64::max) <= 8.0);
    }

    #[test]
    fn what_a_slanted_rim_leaves_is_told() {
        let region = mask(80, 80, |x, y| x + 0.3 * y < 60.0 && y > 10.0 && y < 70.0);
        let found = cells(&region, 80, 4.0, 2.0, 8.0);
        let left = uncovered(&found, &region, 80, 4.0, 2.0);
        let share = left.iter().filter(|l| **l).count() as f64 / region.iter().filter(|r| **r).count() as f64;
        assert!(share > 0.0 && share < 0.04, "{share}");
        // One row less leaves its strip.
        let fewer = found.iter().map(|cell| cell[..cell.len() - 30].to_vec()).collect::<Vec<_>>();
        let more = uncovered(&fewer, &region, 80, 4.0, 2.0).iter().filter(|l| **l).count();
        assert!(more > left.iter().filter(|l| **l).count() + 80);
    }
}
