//! Rays as points of a plane, and triangles as what they cover of it: half planes of edges (Pineda 1988) and a depth, in single precision.
//!
//! Rounding may only add: a ray that is not found to meet a triangle does not meet it by the exact test either, within the margins here.

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

/// From the world to a square of cells.
pub(super) struct Projection {
    /// Which becomes the middle of the coordinates.
    pub(super) origin: Vector3<f64>,
    /// Rows: column and row (times the depth of a perspective), the depth or what is along the rays.
    rows: [Vector3<f64>; 3],
    offset: [f64; 2],
    /// Cells per unit of slope or length.
    scale: [f64; 2],
    /// Whether the rays leave the origin; if not, they are parallel.
    perspective: bool,
    /// Cells along a side.
    side: f64,
    /// Largest absolute value of the rays' limits.
    limits: f64,
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
    /// Of rays from `origin` whose slopes along `across` over the depth along `axis` lie from `low` to `high`.
    pub(super) fn perspective(
        origin: Vector3<f64>,
        [left, up, axis]: [Vector3<f64>; 3],
        [low, high]: [[f64; 2]; 2],
        side: usize,
    ) -> Self {
        let scale = [0, 1].map(|k| side as f64 / (high[k] - low[k]).max(LEAST_WIDTH));
        let offset = [-low[0] * scale[0], -low[1] * scale[1]];
        let rows = [left * scale[0] + axis * offset[0], up * scale[1] + axis * offset[1], axis];
        Self { origin, rows, offset, scale, perspective: true, side: side as f64, limits: 0.0 }
    }

    /// Of rays along `axis` whose starts, seen from `origin`, lie between these corners of a box along the three directions.
    pub(super) fn parallel(
        origin: Vector3<f64>,
        [left, up, axis]: [Vector3<f64>; 3],
        [low, high]: [[f64; 3]; 2],
        side: usize,
    ) -> Self {
        let least = LEAST_WIDTH * (0..3).map(|k| high[k] - low[k]).fold(f64::MIN_POSITIVE, f64::max);
        let scale = [0, 1].map(|k| side as f64 / (high[k] - low[k]).max(least));
        let offset = [-low[0] * scale[0], -low[1] * scale[1]];
        let limits = low[2].abs().max(high[2].abs());
        let rows = [left * scale[0], up * scale[1], axis];
        Self { origin, rows, offset, scale, perspective: false, side: side as f64, limits }
    }

    /// The place, in cells, of what is seen under these slopes, or at these lengths across.
    pub(super) fn place(&self, across: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| across[k] * self.scale[k] + self.offset[k])
    }

    /// What a triangle covers; `None` where that is nothing.
    pub(super) fn cover(&self, corners: &[Vector3<f64>; 3]) -> Option<Covered> {
        let seen = corners.map(|corner| corner - self.origin);
        let farthest = seen.iter().map(Vector3::norm_squared).fold(0.0, greater).sqrt();
        let coordinates = seen.map(|p| Vector3::from(self.rows.map(|row| row.dot(&p))));
        let rounding = ROUNDING * self.scale[0] * self.scale[1] * farthest * farthest;
        let (homogeneous, depths, rounding_of_sum) = if self.perspective {
            (coordinates, [1.0; 3], rounding * farthest)
        } else {
            let flat = coordinates.map(|p| Vector3::new(p.x + self.offset[0], p.y + self.offset[1], 1.0));
            (flat, coordinates.map(|p| p.z), rounding)
        };
        let cells = self.cells(&homogeneous, farthest)?;
        let [a, b, c] = &homogeneous;
        let edges = [b.cross(c), c.cross(a), a.cross(b)];
        let sum = a.dot(&edges[0]);
        let largest = |form: &Vector3<f64>| self.side * (form.x.abs() + form.y.abs()) + form.z.abs();
        let narrow = |form: &Vector3<f64>, factor: f64, margin: f64| {
            [(form.x * factor) as f32, (form.y * factor) as f32, (form.z * factor + margin) as f32]
        };
        let always = [0.0, 0.0, 1e30];
        let largest_edge = edges.iter().map(largest).fold(0.0, greater);
        let inverse = 1.0 / (largest_edge + rounding + f64::MIN_POSITIVE);
        let margin = MARGIN + rounding * inverse;
        // Seen edge-on, its sides are not certain.
        let sides = sum.abs() > rounding_of_sum;
        let edge = |form: &Vector3<f64>| if sides { narrow(form, inverse.copysign(sum), margin) } else { always };
        let plane = edges[0] * depths[0] + edges[1] * depths[1] + edges[2] * depths[2];
        let factor = 1.0 / sum;
        let margin = MARGIN * (largest(&plane) * factor.abs() + self.limits);
        let certain = sum.abs() > CERTAIN * rounding_of_sum && margin < 1e20;
        let plane = if certain { narrow(&plane, factor, margin) } else { always };
        Some(Covered { cells, edges: [edge(&edges[0]), edge(&edges[1]), edge(&edges[2])], plane })
    }

    /// The cells around a triangle.
    fn cells(&self, corners: &[Vector3<f64>; 3], farthest: f64) -> Option<[[usize; 2]; 2]> {
        let last = self.side as usize - 1;
        if self.perspective && corners.iter().any(|p| p.z <= LEAST_DEPTH * farthest) {
            return Some([[0, last]; 2]);
        }
        let places = corners.map(|p| if self.perspective { [p.x / p.z, p.y / p.z] } else { [p.x, p.y] });
        let mut cells = [[0, last]; 2];
        for (k, range) in cells.iter_mut().enumerate() {
            let [a, b, c] = places.map(|place| place[k]);
            let high = greater(greater(a, b), c) + CELL_MARGIN;
            let low = -greater(greater(-a, -b), -c) - CELL_MARGIN;
            if high < 0.0 || low > self.side {
                return None;
            }
            *range = [low as usize, (high as usize).min(last)];
            range[0] = range[0].min(last);
        }
        Some(cells)
    }
}

/// Without the care for what is not a number that `max` takes.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
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
