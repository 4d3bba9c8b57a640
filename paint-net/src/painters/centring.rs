//! Lines moved into the middle between their borders: a skeleton keeps to whole pixels, and cuts curves short.

use super::distance::distance;
use super::trace::Line;

/// Rounds of moving and smoothing.
const ROUNDS: usize = 3;
/// Step along the normal, pixels.
const STEP: f64 = 0.25;
/// Neighbours on each side that the direction is taken from.
const SPAN: usize = 3;
/// Points at each end that stay: there the normals meet the round end.
const ENDS: usize = 2;

/// Fall of ink within two pixels about a border, of the threshold, from which it is one.
const CRISP: f64 = 0.5;

/// A picture in which a line is what lies above a threshold.
pub(super) struct Ground<'a> {
    pub(super) values: &'a [f64],
    pub(super) width: usize,
    pub(super) threshold: f64,
    /// Half-width of the widest line.
    pub(super) reach: f64,
}

impl Ground<'_> {
    /// Moves the points of a line into the middle.
    pub(super) fn centre(&self, line: &mut Line) {
        let n = line.points.len();
        if n < 2 * ENDS + 2 {
            return;
        }
        let closed = line.points[0] == line.points[n - 1];
        for _ in 0..ROUNDS {
            let points = &line.points;
            let at = |k: isize| {
                if closed {
                    points[k.rem_euclid(n as isize - 1) as usize]
                } else {
                    points[k.clamp(0, n as isize - 1) as usize]
                }
            };
            let shift = |k: usize| {
                let (a, b) = (at(k as isize - SPAN as isize), at(k as isize + SPAN as isize));
                let length = distance(a, b);
                if length < 1e-9 || !closed && (k < ENDS || k + ENDS >= n) {
                    return [0.0; 2];
                }
                let normal = [(a[1] - b[1]) / length, (b[0] - a[0]) / length];
                // Where a side is open, as at junctions, there is no middle.
                let sides = self.border(points[k], normal).zip(self.border(points[k], normal.map(|c| -c)));
                let off = sides.map_or(0.0, |(left, right)| 0.5 * (left - right));
                normal.map(|c| off.clamp(-1.0, 1.0) * c)
            };
            let shifts: Vec<[f64; 2]> = (0..n).map(shift).collect();
            // What a junction or a rough border does to one point, its neighbours do not follow.
            let mean = |k: usize| {
                let near = |d: isize| {
                    let k = k as isize + d;
                    if closed {
                        shifts[k.rem_euclid(n as isize - 1) as usize]
                    } else {
                        shifts[k.clamp(0, n as isize - 1) as usize]
                    }
                };
                [0, 1].map(|c| (near(-2)[c] + near(-1)[c] + near(0)[c] + near(1)[c] + near(2)[c]) / 5.0)
            };
            let last = [self.width, self.values.len() / self.width].map(|side| side as f64 - 1.0);
            let moved = |k: usize| {
                let shift = mean(k);
                [0, 1].map(|c| (line.points[k][c] + shift[c]).clamp(0.0, last[c]))
            };
            line.points = (0..n).map(moved).collect();
            if closed {
                line.points[n - 1] = line.points[0];
            }
        }
    }

    /// Whether the picture falls off steeply on both sides of nearly all of a line: what is dark between soft flanks is none.
    pub(super) fn is_crisp(&self, line: &Line) -> bool {
        let n = line.points.len();
        let (mut crisp, mut soft) = (0, 0);
        for k in ENDS..n.saturating_sub(ENDS) {
            let (a, b) = (line.points[k - ENDS], line.points[k + ENDS]);
            let length = distance(a, b).max(1e-9);
            let normal = [(a[1] - b[1]) / length, (b[0] - a[0]) / length];
            for side in [normal, normal.map(|c| -c)] {
                let at =
                    |along: f64| self.value(line.points[k][0] + along * side[0], line.points[k][1] + along * side[1]);
                match self.border(line.points[k], side) {
                    Some(border) if at(border - 1.0) - at(border + 1.0) < CRISP * self.threshold => soft += 1,
                    Some(_) => crisp += 1,
                    None => {}
                }
            }
        }
        crisp >= 4 * soft
    }

    /// Way to the border of the line; `None` where it is farther than a line is wide.
    fn border(&self, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> Option<f64> {
        let mut before = self.value(x, y);
        let steps = (1.3 * (self.reach + 0.5) / STEP).ceil() as usize;
        for k in 1..=steps {
            let along = k as f64 * STEP;
            let value = self.value(x + along * dx, y + along * dy);
            if value <= self.threshold && before > self.threshold {
                return Some(along - STEP * (self.threshold - value) / (before - value));
            }
            before = value;
        }
        None
    }

    /// Bilinear, 0 beside the picture.
    fn value(&self, x: f64, y: f64) -> f64 {
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let at = |x: f64, y: f64| {
            let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64;
            if inside { self.values.get(y as usize * self.width + x as usize).copied().unwrap_or(0.0) } else { 0.0 }
        };
        let row = |y: f64| (1.0 - fx) * at(left, y) + fx * at(left + 1.0, y);
        (1.0 - fy) * row(top) + fy * row(top + 1.0)
    }
}
