//! From pixels of thin lines to smooth polylines.

use super::distance::{distance, distances};
use super::skeleton_graph::SkeletonGraph;
use super::skeleton_lines::{JoinedLine, joined};
use super::thinning::thin;

/// Rounds of averaging with both neighbours: the steps of pixels go, what is wider than a nozzle stays.
const SMOOTHING: usize = 2;

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

/// The middles of what is no wider than twice `reach` in a mask, straight on through its junctions. Every line that ends at another one goes on
/// to the middle of their junction.
pub(super) fn trace(mask: &[bool], width: usize, reach: f64) -> Vec<Line> {
    let outside: Vec<bool> = mask.iter().map(|m| !m).collect();
    // The border of a mask lies half a pixel before the first one outside.
    let half_width: Vec<f64> = distances(&outside, width).iter().map(|d| d - 0.5).collect();
    let graph = SkeletonGraph::new(&thin(mask, width), width);
    let lines = joined(&graph, &half_width, width, reach);
    let whole = |line: JoinedLine| {
        let points = extended(smoothed(line.points), line.loose, &Ends { half_width: &half_width, width, reach });
        Line { points }
    };
    lines.into_iter().map(whole).collect()
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

/// Pixels back from the end of a line that its direction and its half-width are taken from.
const LOOK_BACK: usize = 6;

/// Share of the widest half-width that the end of a line keeps from what is outside, and the least in pixels.
const END: f64 = 0.65;
const LEAST_END: f64 = 0.5;

struct Ends<'a> {
    half_width: &'a [f64],
    width: usize,
    reach: f64,
}

impl Ends<'_> {
    fn half_width(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let inside = x >= -0.5 && y >= -0.5 && x.round() < self.width as f64;
        inside.then(|| self.half_width.get(y.round() as usize * self.width + x.round() as usize).copied()).flatten()
    }
}

/// Loose ends go on straight towards the end of what is dark, from which thinning keeps off by half a width: the first and last spray can
/// reach it then without more paint than the others.
fn extended(mut points: Vec<[f64; 2]>, loose: [bool; 2], ends: &Ends) -> Vec<[f64; 2]> {
    let n = points.len();
    if n < 2 || points[0] == points[n - 1] {
        return points;
    }
    for loose in loose {
        points.reverse();
        let n = points.len();
        let (end, back) = (points[n - 1], points[n - 1 - LOOK_BACK.min(n - 1)]);
        let length = distance(end, back);
        let usual =
            points[n - 1 - LOOK_BACK.min(n - 1)..].iter().filter_map(|&p| ends.half_width(p)).fold(0.0, f64::max);
        if !loose || length < 1e-9 || !usual.is_finite() {
            continue;
        }
        let ahead = |k: f64| [0, 1].map(|c| end[c] + k * (end[c] - back[c]) / length);
        let least = (usual - END * ends.reach).max(LEAST_END);
        let steps = (1..).map(|k| 0.5 * f64::from(k)).take_while(|&k| k <= 2.0 * usual);
        points.extend(steps.map(ahead).take_while(|&p| ends.half_width(p).is_some_and(|half| half >= least)));
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
            // Up to the round ends of 2 pixels.
            let over = long[0] - whole;
            assert!((0.0..4.5).contains(&over), "{shift:?}: {} of {whole}", long[0]);
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
