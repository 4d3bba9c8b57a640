//! From the graph of a skeleton to lines: what is wide and what is only a corner goes, what meets is joined.

use super::distance::distance;
use super::skeleton_graph::{Edge, SkeletonGraph};

/// Pixels that an end may stand out of a junction and still be a corner of it.
const CORNER: f64 = 1.5;
/// A line goes on through a junction if it turns no more than this there: 60 degrees, as a cosine.
const STRAIGHT: f64 = 0.5;
/// Pixels beyond a junction's border from where the direction of a line is taken: within, its skeleton is bent.
const BEYOND: f64 = 4.0;

/// A line of a skeleton.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JoinedLine {
    /// Pixels. A closed line ends where it begins.
    pub(super) points: Vec<[f64; 2]>,
    /// Whether its first and its last point are loose ends, and not in a junction.
    pub(super) loose: [bool; 2],
}

/// The lines of a skeleton.
pub(super) fn joined(graph: &SkeletonGraph, half_width: &[f64], width: usize, reach: f64) -> Vec<JoinedLine> {
    let mut lines = Lines::new(graph, half_width, width);
    lines.merge_near_junctions();
    lines.drop_corners();
    lines.drop_wide(reach);
    lines.join()
}

/// One way of the graph.
#[derive(Debug, Clone)]
struct Way {
    points: Vec<[f64; 2]>,
    half_widths: Vec<f64>,
    junctions: [Option<usize>; 2],
    closed: bool,
}

#[derive(Debug, Clone, Copy)]
struct Meeting {
    middle: [f64; 2],
    half_width: f64,
}

struct Lines {
    ways: Vec<Way>,
    junctions: Vec<Meeting>,
}

impl Lines {
    fn new(graph: &SkeletonGraph, half_width: &[f64], width: usize) -> Self {
        let at = |k: usize| [(k % width) as f64, (k / width) as f64];
        let way = |edge: &Edge| Way {
            points: edge.pixels.iter().map(|&k| at(k)).collect(),
            half_widths: edge.pixels.iter().map(|&k| half_width[k]).collect(),
            junctions: edge.junctions,
            closed: edge.closed,
        };
        let junction = |pixels: &[usize]| Meeting {
            middle: [0, 1].map(|c| pixels.iter().map(|&k| at(k)[c]).sum::<f64>() / pixels.len() as f64),
            half_width: pixels.iter().map(|&k| half_width[k]).fold(0.0, f64::max),
        };
        Self {
            ways: graph.edges.iter().map(way).collect(),
            junctions: graph.junctions.iter().map(|j| junction(&j.pixels)).collect(),
        }
    }

    /// Two junctions, each of which lies within the other's disc, are one: where two lines cross, thinning leaves two with a bridge.
    fn merge_near_junctions(&mut self) {
        while let Some((bridge, a, b)) = self.bridge() {
            self.ways.swap_remove(bridge);
            let (one, other) = (self.junctions[a], self.junctions[b]);
            self.junctions[a] = Meeting {
                middle: [0, 1].map(|c| 0.5 * (one.middle[c] + other.middle[c])),
                half_width: one.half_width.max(other.half_width),
            };
            for slot in self.ways.iter_mut().flat_map(|way| &mut way.junctions) {
                if *slot == Some(b) {
                    *slot = Some(a);
                }
            }
        }
    }

    fn bridge(&self) -> Option<(usize, usize, usize)> {
        self.ways.iter().enumerate().find_map(|(k, way)| {
            let [Some(a), Some(b)] = way.junctions else { return None };
            let near = |j: usize| way.points.len() as f64 <= self.junctions[j].half_width;
            (a != b && near(a) && near(b)).then_some((k, a, b))
        })
    }

    /// Free ends that hardly stand out of the junction they begin at.
    fn drop_corners(&mut self) {
        let junctions = &self.junctions;
        self.ways.retain(|way| {
            let (junction, end) = match way.junctions {
                [Some(j), None] => (j, way.points.len() - 1),
                [None, Some(j)] => (j, 0),
                _ => return true,
            };
            let stands_out = distance(way.points[end], junctions[junction].middle) + way.half_widths[end];
            stands_out > junctions[junction].half_width + CORNER
        });
    }

    /// Ways through what is wider than twice `reach`, where they are longer than that is wide.
    fn drop_wide(&mut self, reach: f64) {
        let ways = std::mem::take(&mut self.ways);
        for way in ways {
            let n = way.points.len();
            let mut narrow = vec![true; n];
            let mut first = 0;
            for run in way.half_widths.chunk_by(|a, b| (*a > reach) == (*b > reach)) {
                let (end, most) = (first + run.len(), run.iter().copied().fold(0.0, f64::max));
                let alone = run.len() == n && way.junctions.iter().any(Option::is_none);
                if run[0] > reach && (alone || run.len() as f64 > 2.0 * reach || most > 1.5 * reach) {
                    narrow[first..end].fill(false);
                }
                first = end;
            }
            if narrow.iter().all(|&n| n) {
                self.ways.push(way);
                continue;
            }
            let mut first = 0;
            for run in narrow.chunk_by(|a, b| a == b) {
                let end = first + run.len();
                if run[0] {
                    self.ways.push(Way {
                        points: way.points[first..end].to_vec(),
                        half_widths: way.half_widths[first..end].to_vec(),
                        junctions: [way.junctions[0].filter(|_| first == 0), way.junctions[1].filter(|_| end == n)],
                        closed: false,
                    });
                }
                first = end;
            }
        }
    }

    /// Ways that go straight on at a junction become one line; those that end there, end in its middle.
    fn join(&self) -> Vec<JoinedLine> {
        // What follows at each end of a way: the way, and the end at which it goes on.
        let mut next: Vec<[Option<(usize, usize)>; 2]> = vec![[None; 2]; self.ways.len()];
        for junction in 0..self.junctions.len() {
            for (a, b) in self.pairs(junction) {
                next[a.0][a.1] = Some(b);
                next[b.0][b.1] = Some(a);
            }
        }
        let mut used = vec![false; self.ways.len()];
        let mut lines = Vec::new();
        // From ends first, then what is closed.
        for closed in [false, true] {
            for way in 0..self.ways.len() {
                let end = (0..2).find(|&end| next[way][end].is_none()).or(closed.then_some(0));
                if let (false, Some(end)) = (used[way], end) {
                    lines.push(self.line((way, end), &next, &mut used));
                }
            }
        }
        lines
    }

    /// The line that begins at an end of a way.
    fn line(
        &self,
        (mut way, mut from): (usize, usize),
        next: &[[Option<(usize, usize)>; 2]],
        used: &mut [bool],
    ) -> JoinedLine {
        let first = self.ways[way].junctions[from].is_none();
        let middle = |way: &Way, end: usize| way.junctions[end].map(|j| self.junctions[j].middle);
        let mut points: Vec<[f64; 2]> = middle(&self.ways[way], from).into_iter().collect();
        loop {
            used[way] = true;
            let here = &self.ways[way];
            if from == 0 {
                points.extend(&here.points);
            } else {
                points.extend(here.points.iter().rev());
            }
            points.extend(middle(here, 1 - from));
            if here.closed {
                points.push(points[0]);
            }
            match next[way][1 - from] {
                Some((on, end)) if !used[on] => (way, from) = (on, end),
                _ => return JoinedLine { points, loose: [first, here.junctions[1 - from].is_none()] },
            }
        }
    }

    /// Ends of ways at a junction that go on in each other: the straightest first. Two that are alone there go on whatever their angle.
    fn pairs(&self, junction: usize) -> Vec<((usize, usize), (usize, usize))> {
        let ends: Vec<(usize, usize)> = (0..self.ways.len())
            .flat_map(|way| [(way, 0), (way, 1)])
            .filter(|&(way, end)| self.ways[way].junctions[end] == Some(junction))
            .collect();
        if let [a, b] = ends[..] {
            return vec![(a, b)];
        }
        let directions: Vec<[f64; 2]> = ends.iter().map(|&end| self.direction(junction, end)).collect();
        let straight = |a: usize, b: usize| -(0..2).map(|c| directions[a][c] * directions[b][c]).sum::<f64>();
        let mut candidates: Vec<(f64, usize, usize)> = (0..ends.len())
            .flat_map(|b| (0..b).map(move |a| (a, b)))
            .map(|(a, b)| (straight(a, b), a, b))
            .filter(|(straight, ..)| *straight >= STRAIGHT)
            .collect();
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut taken = vec![false; ends.len()];
        let mut pairs = Vec::new();
        for (_, a, b) in candidates {
            if !taken[a] && !taken[b] {
                (taken[a], taken[b]) = (true, true);
                pairs.push((ends[a], ends[b]));
            }
        }
        pairs
    }

    /// Unit vector along a way, away from a junction.
    fn direction(&self, junction: usize, (way, end): (usize, usize)) -> [f64; 2] {
        let Meeting { middle, half_width } = self.junctions[junction];
        let points = &self.ways[way].points;
        let far = |p: &&[f64; 2]| distance(**p, middle) >= half_width + BEYOND;
        let found = if end == 0 {
            points.iter().find(far).or(points.last())
        } else {
            points.iter().rev().find(far).or(points.first())
        };
        let [x, y] = found.map_or([0.0; 2], |p| [p[0] - middle[0], p[1] - middle[1]]);
        let length = x.hypot(y).max(1e-9);
        [x / length, y / length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level way of so many pixels from `x` on, between two meetings.
    fn way(x: f64, count: usize, junctions: [Option<usize>; 2]) -> Way {
        let points = (0..count).map(|k| [x + k as f64, 0.0]).collect();
        Way { points, half_widths: vec![1.0; count], junctions, closed: false }
    }

    /// Two meetings with half-widths of 3, and between them so many pixels; a loop of one pixel at the first, a way out of the second.
    fn with_bridge(count: usize) -> Lines {
        let meeting = |x: f64| Meeting { middle: [x, 0.0], half_width: 3.0 };
        let ways = vec![
            way(0.0, 1, [Some(0), Some(0)]),
            way(1.0, count, [Some(0), Some(1)]),
            way(2.0 + count as f64, 30, [Some(1), None]),
        ];
        Lines { ways, junctions: vec![meeting(0.0), meeting(1.0 + count as f64)] }
    }

    #[test]
    fn meetings_within_each_others_discs_become_one() {
        let mut near = with_bridge(3);
        near.merge_near_junctions();
        let mut left: Vec<_> = near.ways.iter().map(|way| (way.points.len(), way.junctions)).collect();
        left.sort_unstable();
        assert_eq!(left, [(1, [Some(0), Some(0)]), (30, [Some(0), None])]);
        assert_eq!(near.junctions[0].middle, [2.0, 0.0]);

        let mut apart = with_bridge(4);
        apart.merge_near_junctions();
        assert_eq!(apart.ways.len(), 3);
    }
}
