//! Convex polygons cut by straight lines.

/// A triangle cut by at most four lines has at most seven corners.
const MAX_CORNERS: usize = 8;

/// A convex polygon on the stack.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Polygon {
    corners: [[f64; 2]; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    pub(crate) fn triangle([a, b, c]: [[f64; 2]; 3]) -> Self {
        let mut corners = [[0.0; 2]; MAX_CORNERS];
        corners[..3].copy_from_slice(&[a, b, c]);
        Self { corners, count: 3 }
    }

    /// The part with `low <= coordinate k <= high`.
    pub(crate) fn between(&self, k: usize, low: f64, high: f64) -> Self {
        self.half(k, low, 1.0).half(k, high, -1.0)
    }

    /// The part with `sign * (coordinate k - bound) >= 0`.
    fn half(&self, k: usize, bound: f64, sign: f64) -> Self {
        let on_the_line = |mut crossing: [f64; 2]| {
            crossing[k] = bound;
            crossing
        };
        self.positive(|p| sign * (p[k] - bound), on_the_line)
    }

    /// The part to the left of the line from `a` to `b`.
    pub(crate) fn left_of(&self, a: [f64; 2], b: [f64; 2]) -> Self {
        self.positive(|p| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]), |crossing| crossing)
    }

    /// The part where `depth`, linear in the point, is not negative; `polish` may move a crossing onto the line.
    fn positive(&self, depth: impl Fn(&[f64; 2]) -> f64, polish: impl Fn([f64; 2]) -> [f64; 2]) -> Self {
        let corners = &self.corners[..self.count];
        if corners.iter().all(|p| depth(p) >= 0.0) {
            return *self;
        }
        let mut out = Self { corners: [[0.0; 2]; MAX_CORNERS], count: 0 };
        for (i, p) in corners.iter().enumerate() {
            let q = &corners[(i + 1) % self.count];
            let (from, to) = (depth(p), depth(q));
            if from >= 0.0 {
                out.push(*p);
            }
            if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
                let t = from / (from - to);
                out.push(polish([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]));
            }
        }
        out
    }

    fn push(&mut self, p: [f64; 2]) {
        // Rounding can make a polygon minutely non-convex; a corner beyond the last changes nothing measurable.
        if self.count < MAX_CORNERS {
            self.corners[self.count] = p;
            self.count += 1;
        }
    }

    /// Area, regardless of the orientation.
    pub(crate) fn area(&self) -> f64 {
        let base = self.corners[0];
        let fan = self.corners[..self.count].windows(2).skip(1);
        let doubled: f64 = fan
            .map(|pair| {
                let [p, q] = [pair[0], pair[1]].map(|p| [p[0] - base[0], p[1] - base[1]]);
                p[0] * q[1] - p[1] * q[0]
            })
            .sum();
        0.5 * doubled.abs()
    }

    /// Mean of the corners: a point inside.
    pub(crate) fn middle(&self) -> [f64; 2] {
        let corners = &self.corners[..self.count];
        let mean = |k: usize| corners.iter().map(|p| p[k]).sum::<f64>() / self.count as f64;
        [mean(0), mean(1)]
    }
}
