//! From pixels of thin lines to smooth polylines.

use super::distance::distances;
use super::thinning::{AROUND, neighbour, thin};

/// Rounds of averaging with both neighbours: the steps of pixels go, what is wider than a nozzle stays.
const SMOOTHING: usize = 4;
/// Pixels back from the end of a line that its direction is taken from.
const LOOK_BACK: usize = 4;

/// Pixels at the end of a line that it cannot meet: its own last ones.
const RECENT: usize = 6;

/// The middle of a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    /// Column and row, pixels; at least one. A closed line ends where it begins.
    pub(super) points: Vec<[f64; 2]>,
}

impl Line {
    /// The middles of equal parts of about the given length.
    pub(super) fn sampled(&self, spacing: f64) -> Vec<[f64; 2]> {
        let lengths: Vec<f64> = self.points.windows(2).map(|p| distance(p[0], p[1])).collect();
        let total: f64 = lengths.iter().sum();
        let parts = (total / spacing).round().max(1.0);
        let (mut segment, mut before) = (0, 0.0);
        let at = |k: usize| {
            let along = (k as f64 + 0.5) / parts * total;
            while segment + 1 < lengths.len() && before + lengths[segment] < along {
                before += lengths[segment];
                segment += 1;
            }
            let Some(&length) = lengths.get(segment).filter(|&&length| length > 0.0) else { return self.points[0] };
            let share = ((along - before) / length).clamp(0.0, 1.0);
            let (a, b) = (self.points[segment], self.points[segment + 1]);
            [0, 1].map(|c| a[c] + share * (b[c] - a[c]))
        };
        (0..parts as usize).map(at).collect()
    }
}

/// The middles of what is no wider than twice `reach` in a mask. Lines that are not twice as long as half their width are the
/// corners of something wide or spurs, unless they stand alone.
pub(super) fn trace(mask: &[bool], width: usize, reach: f64) -> Vec<Line> {
    let outside: Vec<bool> = mask.iter().map(|m| !m).collect();
    let half_width = distances(&outside, width);
    let skeleton = thin(mask, width);
    let narrow: Vec<bool> = skeleton.iter().zip(&half_width).map(|(&s, &half)| s && half <= reach).collect();
    let mut walker = Walker { narrow: &narrow, width, visited: vec![false; mask.len()] };
    let mut lines = Vec::new();
    for path in walker.paths() {
        let stands_alone = || path.iter().all(|&k| walker.around(k, &skeleton).all(|n| path.contains(&n)));
        let widest = path.iter().fold(0.0_f64, |most, &k| most.max(half_width[k]));
        let points: Vec<[f64; 2]> = path.iter().map(|&k| [(k % width) as f64, (k / width) as f64]).collect();
        let length: f64 = points.windows(2).map(|p| distance(p[0], p[1])).sum();
        if length >= 2.0 * widest || stands_alone() {
            lines.push(Line { points: smoothed(points) });
        }
    }
    lines
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Walks along lines of one pixel's width, straight on at crossings.
struct Walker<'a> {
    narrow: &'a [bool],
    width: usize,
    visited: Vec<bool>,
}

impl Walker<'_> {
    /// The pixels of every line in order. A line that ends at another begins or ends with a pixel of that one; a closed one
    /// with its first.
    fn paths(&mut self) -> Vec<Vec<usize>> {
        let all: Vec<usize> = (0..self.narrow.len()).filter(|&k| self.narrow[k]).collect();
        let ends = |walker: &Self, k: usize| walker.around(k, walker.narrow).count() <= 1;
        let mut paths = Vec::new();
        // From loose ends first, then between crossings, then what is closed.
        for start in all.iter().copied().filter(|&k| ends(self, k)).collect::<Vec<_>>() {
            paths.extend(self.walk(start));
        }
        while let Some(start) = all.iter().copied().find(|&k| !self.visited[k] && self.visited_around(k).is_some()) {
            paths.extend(self.walk(start));
        }
        for start in all {
            paths.extend(self.walk(start));
        }
        paths
    }

    /// Both ways from a pixel, or away from the line that it touches.
    fn walk(&mut self, start: usize) -> Option<Vec<usize>> {
        if self.visited[start] {
            return None;
        }
        let touched = self.visited_around(start);
        self.visited[start] = true;
        let mut path: Vec<usize> = touched.into_iter().chain([start]).collect();
        self.go_on(&mut path);
        if touched.is_none() {
            path.reverse();
            self.go_on(&mut path);
        }
        let last = path[path.len() - 1];
        if touched.is_none() && path.len() > RECENT && self.around(last, self.narrow).any(|n| n == path[0]) {
            path.push(path[0]);
            return Some(path);
        }
        path.extend(self.met(&path));
        if touched.is_none() {
            path.reverse();
            path.extend(self.met(&path));
        }
        Some(path)
    }

    fn go_on(&mut self, path: &mut Vec<usize>) {
        while let Some(next) = self.straight_on(path, path[path.len() - 1]) {
            self.visited[next] = true;
            path.push(next);
        }
    }

    /// The pixel of another line, or of an earlier part of the same, that a path ends at.
    fn met(&self, path: &[usize]) -> Option<usize> {
        let recent = &path[path.len().saturating_sub(RECENT)..];
        self.around(path[path.len() - 1], self.narrow).find(|n| !recent.contains(n))
    }

    /// The neighbour that was not visited and turns least.
    fn straight_on(&self, path: &[usize], last: usize) -> Option<usize> {
        let at = |k: usize| [(k % self.width) as f64, (k / self.width) as f64];
        let back = at(path[path.len().saturating_sub(LOOK_BACK)]);
        let here = at(last);
        let ahead = [here[0] - back[0], here[1] - back[1]];
        let turn = |k: usize| {
            let step = [at(k)[0] - here[0], at(k)[1] - here[1]];
            -(step[0] * ahead[0] + step[1] * ahead[1]) / step[0].hypot(step[1])
        };
        self.around(last, self.narrow).filter(|&n| !self.visited[n]).min_by(|&a, &b| turn(a).total_cmp(&turn(b)))
    }

    fn visited_around(&self, k: usize) -> Option<usize> {
        self.around(k, self.narrow).find(|&n| self.visited[n])
    }

    fn around<'s>(&'s self, k: usize, set: &'s [bool]) -> impl Iterator<Item = usize> + 's {
        AROUND.iter().filter_map(move |&at| neighbour(k, at, self.width, set.len())).filter(|&n| set[n])
    }
}

/// Points averaged with their neighbours; the ends of an open line stay.
fn smoothed(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let n = points.len();
    let closed = n > 3 && points[0] == points[n - 1];
    for _ in 0..SMOOTHING {
        let mean = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| [0, 1].map(|k| 0.25 * (a[k] + 2.0 * b[k] + c[k]));
        let mut next = points.clone();
        (1..n.saturating_sub(1)).for_each(|k| next[k] = mean(points[k - 1], points[k], points[k + 1]));
        if closed {
            next[0] = mean(points[n - 2], points[0], points[1]);
            next[n - 1] = next[0];
        }
        points = next;
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(width: usize, height: usize, inside: impl Fn(f64, f64) -> bool) -> Vec<bool> {
        (0..width * height).map(|k| inside((k % width) as f64, (k / width) as f64)).collect()
    }

    fn length(line: &Line) -> f64 {
        line.points.windows(2).map(|p| distance(p[0], p[1])).sum()
    }

    #[test]
    fn a_ring_is_one_closed_line_and_a_cross_two_straight_ones() {
        let ring = drawn(61, 61, |x, y| ((x - 30.0).hypot(y - 30.0) - 20.0).abs() < 2.0);
        let lines = trace(&ring, 61, 4.0);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].points.first(), lines[0].points.last());
        let around = std::f64::consts::TAU * 20.0;
        assert!((length(&lines[0]) / around - 1.0).abs() < 0.06, "{} for {around}", length(&lines[0]));

        let cross = drawn(61, 61, |x, y| {
            ((x - 30.0).abs() < 2.0 && (y - 30.0).abs() < 25.0) || ((y - 30.0).abs() < 2.0 && (x - 30.0).abs() < 25.0)
        });
        let lines = trace(&cross, 61, 4.0);
        assert!(lines.len() <= 3, "{} lines", lines.len());
        let total: f64 = lines.iter().map(length).sum();
        assert!((85.0..104.0).contains(&total), "{total}");
        // Straight on at the crossing: one of them goes from end to end.
        assert!(lines.iter().any(|line| length(line) > 40.0));
    }

    #[test]
    fn a_curve_is_one_line_wherever_it_lies_between_the_pixels() {
        for k in 0..64 {
            let shift = [f64::from(k % 8) / 8.0, f64::from(k / 8) / 8.0];
            let middle = |t: f64| [16.0 + 36.0 * t + shift[0], 30.0 + 3.0 * (6.0 * t).sin() + shift[1]];
            let curve: Vec<[f64; 2]> = (0..=300).map(|i| middle(f64::from(i) / 300.0)).collect();
            let mask = drawn(70, 60, |x, y| curve.iter().any(|&p| distance(p, [x, y]) < 2.0));
            let lines = trace(&mask, 70, 4.0);
            let long: Vec<f64> = lines.iter().map(length).filter(|&l| l > 4.0).collect();
            assert_eq!(long.len(), 1, "{shift:?}: {long:?}");
            let whole: f64 = curve.windows(2).map(|p| distance(p[0], p[1])).sum();
            assert!((whole - long[0]).abs() < 4.0, "{shift:?}: {} of {whole}", long[0]);
        }
    }

    #[test]
    fn what_is_wide_is_no_line_and_a_dot_is_one_place() {
        let square = drawn(60, 60, |x, y| (10.0..50.0).contains(&x) && (10.0..50.0).contains(&y));
        assert!(trace(&square, 60, 4.0).is_empty());
        let dot = drawn(20, 20, |x, y| (x - 9.0).hypot(y - 11.0) < 2.5);
        let lines = trace(&dot, 20, 4.0);
        assert_eq!(lines.len(), 1);
        let places = lines[0].sampled(2.0);
        assert!(places.len() <= 2 && distance(places[0], [9.0, 11.0]) < 1.5, "{places:?}");
    }

    #[test]
    fn samples_are_the_middles_of_equal_parts() {
        let line = Line { points: vec![[0.0, 0.0], [3.0, 0.0], [3.0, 5.0]] };
        let expected = [[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [3.0, 4.0]];
        for (found, expected) in line.sampled(2.0).iter().zip(expected) {
            assert!(distance(*found, expected) < 1e-12, "{found:?} for {expected:?}");
        }
        assert_eq!(line.sampled(2.0).len(), 4);
    }
}
