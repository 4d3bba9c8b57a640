//! Shortest paths on a cubic lattice: A* (Hart, Nilsson and Raphael 1968) over the 26 neighbours of every cell.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashMap};

/// A cell by its three numbers.
pub(crate) type Cell = [i32; 3];

/// A cell to look at, the most promising first; equal ones in the order of their numbers, so that a search has one result.
#[derive(PartialEq)]
struct Open {
    estimate: f64,
    cell: Cell,
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        self.estimate.total_cmp(&other.estimate).then(self.cell.cmp(&other.cell))
    }
}

/// What is known of a cell that was come to.
struct Reached {
    length: f64,
    from: Cell,
    done: bool,
}

/// Where a way is looked for.
pub(crate) trait Space {
    /// Bounds the way that is left from a cell from below, in cells; 0 or less at a goal, and only there.
    fn left(&mut self, cell: Cell) -> f64;

    /// Whether a step between two neighbours can be taken.
    fn passable(&mut self, from: Cell, to: Cell) -> bool;
}

/// The cells of the shortest way from `start` to a goal, both included. `None` where no way leads to one, or none is found before `most` cells
/// were looked at.
pub(crate) fn shortest_way(start: Cell, most: usize, space: &mut dyn Space) -> Option<Vec<Cell>> {
    let mut reached = HashMap::from([(start, Reached { length: 0.0, from: start, done: false })]);
    let mut open = BinaryHeap::from([Reverse(Open { estimate: space.left(start), cell: start })]);
    let mut looked_at = 0;
    while let Some(Reverse(Open { cell, .. })) = open.pop() {
        let Some(here) = reached.get_mut(&cell).filter(|here| !here.done) else { continue };
        here.done = true;
        let length = here.length;
        if space.left(cell) <= 0.0 {
            return Some(way_to(cell, &reached));
        }
        looked_at += 1;
        if looked_at == most {
            return None;
        }
        for step in steps() {
            let next = [cell[0] + step[0], cell[1] + step[1], cell[2] + step[2]];
            let longer = length + f64::from(step.iter().map(|d| d * d).sum::<i32>()).sqrt();
            if reached.get(&next).is_some_and(|known| known.length <= longer) || !space.passable(cell, next) {
                continue;
            }
            reached.insert(next, Reached { length: longer, from: cell, done: false });
            open.push(Reverse(Open { estimate: longer + space.left(next), cell: next }));
        }
    }
    None
}

fn steps() -> impl Iterator<Item = Cell> {
    (0..27).filter(|k| *k != 13).map(|k| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1])
}

fn way_to(goal: Cell, reached: &HashMap<Cell, Reached>) -> Vec<Cell> {
    let mut way = vec![goal];
    let mut cell = goal;
    while let Some(known) = reached.get(&cell).filter(|known| known.from != cell) {
        cell = known.from;
        way.push(cell);
    }
    way.reverse();
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length(way: &[Cell]) -> f64 {
        let step = |pair: &[Cell]| f64::from((0..3).map(|k| (pair[1][k] - pair[0][k]).pow(2)).sum::<i32>()).sqrt();
        way.windows(2).map(step).sum()
    }

    /// A space of two functions.
    struct Functions<L, P>(L, P);

    impl<L: Fn(Cell) -> f64, P: Fn(Cell) -> bool> Space for Functions<L, P> {
        fn left(&mut self, cell: Cell) -> f64 {
            self.0(cell)
        }

        fn passable(&mut self, _: Cell, to: Cell) -> bool {
            self.1(to)
        }
    }

    /// Against Bellman and Ford in a box with walls at random.
    #[test]
    fn ways_are_the_shortest() {
        const N: i32 = 7;
        let mut state = 11_u64;
        let mut random = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        let mut found = 0;
        for _ in 0..30 {
            let walls: Vec<bool> = (0..N.pow(3)).map(|_| random() < 0.62).collect();
            let index = |c: Cell| ((c[0] * N + c[1]) * N + c[2]) as usize;
            let inside = |c: Cell| c.iter().all(|v| (0..N).contains(v));
            let free = |c: Cell| inside(c) && (index(c) == 0 || !walls[index(c)]);
            let goal = [N - 1; 3];
            let left = |c: Cell| f64::from((0..3).map(|k| (goal[k] - c[k]).pow(2)).sum::<i32>()).sqrt();
            let way = shortest_way([0; 3], 1000, &mut Functions(left, free));
            let mut least = vec![f64::INFINITY; walls.len()];
            least[0] = 0.0;
            for _ in 0..walls.len() {
                for k in 0..walls.len() as i32 {
                    let cell = [k / (N * N), k / N % N, k % N];
                    for step in steps() {
                        let next = [cell[0] + step[0], cell[1] + step[1], cell[2] + step[2]];
                        if free(cell) && free(next) {
                            let through = least[index(cell)] + length(&[cell, next]);
                            least[index(next)] = least[index(next)].min(through);
                        }
                    }
                }
            }
            let expected = least[index(goal)];
            assert_eq!(way.is_some(), expected.is_finite());
            if let Some(way) = way {
                found += 1;
                assert!((length(&way) - expected).abs() < 1e-9, "{} for {expected}", length(&way));
                assert!(way[0] == [0; 3] && way[way.len() - 1] == goal && way.iter().all(|c| free(*c)));
            }
        }
        assert!((5..30).contains(&found), "{found}");
    }

    #[test]
    fn a_search_without_end_is_given_up() {
        assert!(shortest_way([0; 3], 500, &mut Functions(|_| 1.0, |_| true)).is_none());
    }
}
