//! A skeleton as a graph: what runs between its junctions and ends.

use super::thinning::{AROUND, neighbour};

/// Neighbouring pixels at which at least three ways meet.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Junction {
    pub(super) pixels: Vec<usize>,
}

/// A way of pixels without junctions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Edge {
    /// In order, without those of the junctions.
    pub(super) pixels: Vec<usize>,
    /// The junctions at its beginning and at its end; `None` where it ends freely.
    pub(super) junctions: [Option<usize>; 2],
    /// Whether it closes on itself.
    pub(super) closed: bool,
}

/// Junctions and the edges between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SkeletonGraph {
    pub(super) junctions: Vec<Junction>,
    pub(super) edges: Vec<Edge>,
}

impl SkeletonGraph {
    /// Of a skeleton one pixel wide. Every pixel lies in one junction or edge, but for loops of up to three pixels at one junction.
    pub(super) fn new(skeleton: &[bool], width: usize) -> Self {
        Reader::new(skeleton, width).read()
    }
}

/// Follows a skeleton from pixel to pixel.
struct Reader<'a> {
    skeleton: &'a [bool],
    width: usize,
    /// The junction of a pixel.
    junction: Vec<Option<usize>>,
    visited: Vec<bool>,
}

impl<'a> Reader<'a> {
    fn new(skeleton: &'a [bool], width: usize) -> Self {
        Self { skeleton, width, junction: vec![None; skeleton.len()], visited: vec![false; skeleton.len()] }
    }

    fn around(&self, k: usize) -> impl Iterator<Item = usize> + use<'a> {
        let (skeleton, width) = (self.skeleton, self.width);
        AROUND.iter().filter_map(move |&at| neighbour(k, at, width, skeleton.len())).filter(|&n| skeleton[n])
    }

    fn read(mut self) -> SkeletonGraph {
        let set: Vec<usize> = (0..self.skeleton.len()).filter(|&k| self.skeleton[k]).collect();
        let junctions = self.junctions(&set);
        let mut edges = Vec::new();
        for (at, junction) in junctions.iter().enumerate() {
            for &pixel in &junction.pixels {
                for start in self.around(pixel).collect::<Vec<_>>() {
                    if self.junction[start].is_none() && !self.visited[start] {
                        edges.extend(self.edge(start, Some(at)));
                    }
                }
            }
        }
        // What has no junction: from its ends, then what is closed.
        for from_ends in [true, false] {
            for &start in &set {
                let free = self.junction[start].is_none() && !self.visited[start];
                if free && (!from_ends || self.around(start).count() <= 1) {
                    edges.extend(self.edge(start, None));
                }
            }
        }
        SkeletonGraph { junctions, edges }
    }

    /// Neighbouring pixels with three neighbours and more are one junction.
    fn junctions(&mut self, set: &[usize]) -> Vec<Junction> {
        let branches = |reader: &Self, k: usize| reader.around(k).count() >= 3;
        let mut junctions = Vec::new();
        for &start in set {
            if self.junction[start].is_some() || !branches(self, start) {
                continue;
            }
            let mut pixels = vec![start];
            self.junction[start] = Some(junctions.len());
            let mut next = 0;
            while let Some(&pixel) = pixels.get(next) {
                next += 1;
                for n in self.around(pixel).collect::<Vec<_>>() {
                    if self.junction[n].is_none() && branches(self, n) {
                        self.junction[n] = Some(junctions.len());
                        pixels.push(n);
                    }
                }
            }
            junctions.push(Junction { pixels });
        }
        junctions
    }

    fn edge(&mut self, start: usize, from: Option<usize>) -> Option<Edge> {
        let mut pixels = vec![start];
        self.visited[start] = true;
        let to = loop {
            let last = pixels[pixels.len() - 1];
            // The first pixel touches the junction that it comes from.
            let met = self.around(last).filter_map(|n| self.junction[n]).find(|&j| pixels.len() > 1 || Some(j) != from);
            let next = self.around(last).find(|&n| self.junction[n].is_none() && !self.visited[n]);
            match (met, next) {
                (Some(met), _) => break Some(met),
                (None, Some(next)) => {
                    self.visited[next] = true;
                    pixels.push(next);
                }
                (None, None) => break None,
            }
        };
        // One pixel beside a junction, touching it twice.
        let loops_back = pixels.len() == 1 && from.is_some() && to.is_none() && self.around(start).count() > 1;
        let closed = from.is_none() && to.is_none() && pixels.len() > 3 && {
            let last = pixels[pixels.len() - 1];
            self.around(last).any(|n| n == start)
        };
        let short_loop = from.is_some() && from == to && pixels.len() <= 3;
        (!loops_back && !short_loop).then_some(Edge { pixels, junctions: [from, to], closed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(rows: &[&str]) -> SkeletonGraph {
        let skeleton: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        SkeletonGraph::new(&skeleton, rows[0].len())
    }

    #[test]
    fn a_t_has_one_junction_and_three_free_ends() {
        let t = graph(&["#########", "....#....", "....#....", "....#...."]);
        assert_eq!(t.junctions.len(), 1);
        let free = t.edges.iter().filter(|edge| edge.junctions == [Some(0), None]).count();
        assert_eq!((t.edges.len(), free), (3, 3));
        let pixels: usize = t.edges.iter().map(|e| e.pixels.len()).sum::<usize>() + t.junctions[0].pixels.len();
        assert_eq!(pixels, 12, "every pixel once");
    }

    #[test]
    fn a_ring_is_closed_and_a_line_and_a_dot_are_not() {
        let ring = graph(&["..###..", ".#...#.", "#.....#", ".#...#.", "..###.."]);
        assert!(ring.junctions.is_empty());
        assert!(ring.edges.len() == 1 && ring.edges[0].closed && ring.edges[0].pixels.len() == 12);
        let rest = graph(&["####...", "......#"]);
        assert_eq!(rest.edges.iter().map(|e| (e.pixels.len(), e.closed)).collect::<Vec<_>>(), [(4, false), (1, false)]);
    }

    #[test]
    fn an_edge_between_two_junctions_knows_both() {
        let h = graph(&["#.....#", "#.....#", "#######", "#.....#", "#.....#"]);
        assert_eq!(h.junctions.len(), 2);
        assert_eq!(h.edges.len(), 5);
        assert_eq!(h.edges.iter().filter(|edge| edge.junctions.iter().all(Option::is_some)).count(), 1);
    }
}
