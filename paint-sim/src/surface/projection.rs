//! Rays as points of a plane, and triangles as what they cover of it: half planes of edges (Pineda 1988) and a depth, in single precision.
//!
//! Rounding may only add: a ray that is not found to meet a triangle does not meet it by the exact test either, within the margins here.

use std::array::from_fn;

use nalgebra::Vector3;

/// Of the largest value of a form over the plane: more than single precision rounds.
const MARGIN: f64 = 1e-6;
/// Of lengths, areas and volumes around the rays: more than double precision rounds.
const ROUNDING: f64 = 1e-13;
/// A volume more certain than that, so many times, has a plane whose slope is known to single precision.
const CERTAIN: f64 = 1e4;
/// Depth of a corner relative to its distance below which its place means nothing.
const LEAST_DEPTH: f64 = 1e-5;
/// Of cells: more than the rounding of places.
const CELL_MARGIN: f64 = 0.01;
/// Narrower pictures are not magnified further, relative to the distance at which they are.
const LEAST_WIDTH: f64 = 1e-6;
/// Of inverse depths: more than single precision rounds.
const NEARER: f64 = 1.0 - 1e-6;
/// Largest limit of a ray: at its very start all triangles count.
const MOST: f64 = 1e28;
/// A form that is never negative, and beyond all limits.
const ALWAYS: [f32; 3] = [0.0, 0.0, 1e30];

/// One value for each corner, the first one twice, so that the compiler makes vectors of them.
type Corners = [f64; 4];

/// From the world to a square of cells.
pub(super) struct Projection {
    /// Which becomes the middle of the coordinates.
    origin: Vector3<f64>,
    /// Column and row (times the weight), weight, and depth: products with a point's coordinates, and what is added.
    rows: [(Vector3<f64>, f64); 4],
    offset: [f64; 2],
    /// Cells per unit of slope or length.
    scale: [f64; 2],
    /// Cells along a side.
    side: f64,
    /// Largest absolute value of the rays' limits.
    limits: f64,
    /// Whether the rays leave the origin; if not, they are parallel.
    perspective: bool,
}

/// A triangle as rays may meet it.
pub(super) struct Covered {
    /// First and last column, first and last row.
    pub(super) cells: [[usize; 2]; 2],
    /// Not negative inside, each; within their margins.
    edges: [[f32; 3]; 3],
    /// Inverse depth, or depth along parallel rays, of its plane, and a margin.
    plane: [f32; 3],
}

impl Projection {
    /// Of rays from `origin` whose slopes along two directions across, over the depth along the third, lie from `low` to `high`. The depth of a
    /// triangle is an inverse one.
    pub(super) fn perspective(
        origin: Vector3<f64>,
        [left, up, axis]: [Vector3<f64>; 3],
        [low, high]: [[f64; 2]; 2],
        side: usize,
    ) -> Self {
        let scale = [0, 1].map(|k| side as f64 / (high[k] - low[k]).max(LEAST_WIDTH));
        let offset = [-low[0] * scale[0], -low[1] * scale[1]];
        let rows = [
            (left * scale[0] + axis * offset[0], 0.0),
            (up * scale[1] + axis * offset[1], 0.0),
            (axis, 0.0),
            (Vector3::zeros(), 1.0),
        ];
        Self { origin, rows, offset, scale, side: side as f64, limits: 0.0, perspective: true }
    }

    /// Of rays along the third direction whose starts, seen from `origin`, lie between these corners of a box along the three directions. The
    /// depth of a triangle is that along the rays.
    pub(super) fn parallel(
        origin: Vector3<f64>,
        [left, up, axis]: [Vector3<f64>; 3],
        [low, high]: [[f64; 3]; 2],
        side: usize,
    ) -> Self {
        let least = LEAST_WIDTH * (0..3).map(|k| high[k] - low[k]).fold(f64::MIN_POSITIVE, f64::max);
        let scale = [0, 1].map(|k| side as f64 / (high[k] - low[k]).max(least));
        let offset = [-low[0] * scale[0], -low[1] * scale[1]];
        let rows = [(left * scale[0], offset[0]), (up * scale[1], offset[1]), (Vector3::zeros(), 1.0), (axis, 0.0)];
        let limits = low[2].abs().max(high[2].abs());
        Self { origin, rows, offset, scale, side: side as f64, limits, perspective: false }
    }

    /// The place, in cells, of what is seen under these slopes, or at these lengths across.
    pub(super) fn place(&self, across: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| across[k] * self.scale[k] + self.offset[k])
    }

    /// What a triangle covers; `None` where that is nothing.
    #[inline(always)]
    pub(super) fn cover(&self, corners: &[Vector3<f64>; 3]) -> Option<Covered> {
        let [x, y, z]: [Corners; 3] = from_fn(|axis| from_fn(|k| corners[k % 3][axis] - self.origin[axis]));
        let farthest = greatest(&from_fn(|k| x[k].abs() + y[k].abs() + z[k].abs()));
        let [column, row, weight, depth]: [Corners; 4] = from_fn(|i| {
            let (direction, offset) = &self.rows[i];
            from_fn(|k| direction.x * x[k] + direction.y * y[k] + direction.z * z[k] + offset)
        });
        let cells = self.cells(&column, &row, &weight, farthest)?;
        // Products of the second and third corner, of the third and first, and so on.
        let product = |p: &Corners, q: &Corners| -> Corners {
            let ([_, b, c, a], [_, e, f, d]) = (*p, *q);
            let (p, q) = ([b, c, a, b], [f, d, e, f]);
            let (r, s) = ([c, a, b, c], [e, f, d, e]);
            from_fn(|k| p[k] * q[k] - r[k] * s[k])
        };
        let (u, v, w) = (product(&row, &weight), product(&weight, &column), product(&column, &row));
        let sum = column[0] * u[0] + row[0] * v[0] + weight[0] * w[0];
        let rounding = ROUNDING * self.scale[0] * self.scale[1] * farthest * farthest;
        let rounding_of_sum = if self.perspective { rounding * farthest } else { rounding };
        let largest = |u: f64, v: f64, w: f64| self.side * (u.abs() + v.abs()) + w.abs();
        let inverse = 1.0 / (greatest(&from_fn(|k| largest(u[k], v[k], w[k]))) + rounding + f64::MIN_POSITIVE);
        let margin = MARGIN + rounding * inverse;
        let factor = inverse.copysign(sum);
        let edges = if sum.abs() > rounding_of_sum {
            from_fn(|k| [(u[k] * factor) as f32, (v[k] * factor) as f32, (w[k] * factor + margin) as f32])
        } else {
            // Seen edge-on, its sides are not certain.
            [ALWAYS; 3]
        };
        let total = |form: &Corners| depth[0] * form[0] + depth[1] * form[1] + depth[2] * form[2];
        let (u, v, w, factor) = (total(&u), total(&v), total(&w), 1.0 / sum);
        let margin = MARGIN * (largest(u, v, w) * factor.abs() + self.limits);
        let certain = sum.abs() > CERTAIN * rounding_of_sum && margin < 1e20;
        let plane =
            if certain { [(u * factor) as f32, (v * factor) as f32, (w * factor + margin) as f32] } else { ALWAYS };
        Some(Covered { cells, edges, plane })
    }

    /// The cells around a triangle.
    #[inline(always)]
    fn cells(&self, column: &Corners, row: &Corners, weight: &Corners, farthest: f64) -> Option<[[usize; 2]; 2]> {
        let last = self.side as usize - 1;
        let mut cells = [[0, last]; 2];
        if self.perspective && -greatest(&weight.map(|weight| -weight)) <= LEAST_DEPTH * farthest {
            return Some(cells);
        }
        let inverse = weight.map(|weight| 1.0 / weight);
        for (range, along) in cells.iter_mut().zip([column, row]) {
            let place: Corners = from_fn(|k| along[k] * inverse[k]);
            let (low, high) = (-greatest(&place.map(|v| -v)) - CELL_MARGIN, greatest(&place) + CELL_MARGIN);
            if high < 0.0 || low > self.side {
                return None;
            }
            *range = [(low as usize).min(last), (high as usize).min(last)];
        }
        Some(cells)
    }
}

/// The limit of a ray that ends at a depth, or has met something there.
pub(super) fn inverse_depth(depth: f64) -> f32 {
    (NEARER / depth).min(MOST) as f32
}

/// Without the care for what is not a number that `max` takes.
#[inline(always)]
fn greatest([a, b, c, _]: &Corners) -> f64 {
    let greater = |a: f64, b: f64| if a > b { a } else { b };
    greater(greater(*a, *b), *c)
}

impl Covered {
    /// Not negative where a ray at a place may meet the triangle and that is nearer than its limit.
    #[inline(always)]
    pub(super) fn meets(&self, x: f32, y: f32, limit: f32) -> f32 {
        let at = |form: &[f32; 3]| form[0] * x + form[1] * y + form[2];
        let lesser = |a: f32, b: f32| if a < b { a } else { b };
        let [u, v, w] = &self.edges;
        lesser(lesser(at(u), at(v)), lesser(at(w), at(&self.plane) - limit))
    }
}
