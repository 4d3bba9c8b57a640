//! One triangle: its shape in space, and the linear map from it to the plane.

use nalgebra::Vector3;

/// Twice the area along the normal.
pub(crate) fn cross(corners: [[f64; 3]; 3]) -> Vector3<f64> {
    let [p0, p1, p2] = corners.map(Vector3::from);
    (p1 - p0).cross(&(p2 - p0))
}

/// Whether the height of the triangle exceeds `flat` times its longest edge.
pub(crate) fn has_shape(corners: [[f64; 3]; 3], flat: f64) -> bool {
    let [p0, p1, p2] = corners.map(Vector3::from);
    let longest = (p1 - p0).norm_squared().max((p2 - p1).norm_squared()).max((p0 - p2).norm_squared());
    cross(corners).norm() > flat * longest
}

/// A triangle laid isometrically into the plane: corner 0 at the origin, corner 1 on the positive x axis. Kept as the
/// gradients `g[k]` (1/m) of the hat functions, so that the Jacobian of a layout is `sum_k uv[k] g[k]^T`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) g: [[f64; 2]; 3],
    pub(crate) area: f64,
}

impl Frame {
    pub(crate) fn new(corners: [[f64; 3]; 3]) -> Self {
        let [p0, p1, p2] = corners.map(Vector3::from);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let length = e1.norm();
        let foot = e1.dot(&e2) / length;
        let height = e1.cross(&e2).norm() / length;
        let g1 = [1.0 / length, -foot / (length * height)];
        let g2 = [0.0, 1.0 / height];
        Self { g: [[-g1[0], -g1[1] - g2[1]], g1, g2], area: 0.5 * length * height }
    }

    /// Jacobian of the layout that puts the corners at `uv`.
    pub(crate) fn jacobian(&self, uv: [[f64; 2]; 3]) -> Jacobian {
        let q1 = [uv[1][0] - uv[0][0], uv[1][1] - uv[0][1]];
        let q2 = [uv[2][0] - uv[0][0], uv[2][1] - uv[0][1]];
        let [_, g1, g2] = self.g;
        Jacobian {
            a: q1[0] * g1[0],
            b: q1[0] * g1[1] + q2[0] * g2[1],
            c: q1[1] * g1[0],
            d: q1[1] * g1[1] + q2[1] * g2[1],
        }
    }
}

/// The 2x2 map `[a b; c d]` from a triangle's own plane to the chart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Jacobian {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
}

impl Jacobian {
    pub(crate) fn det(&self) -> f64 {
        self.a * self.d - self.b * self.c
    }

    /// Signed singular values, `s1 >= |s2|`; `s2` has the sign of the determinant.
    pub(crate) fn stretch(&self) -> [f64; 2] {
        let sum = length(self.a + self.d, self.c - self.b);
        let difference = length(self.a - self.d, self.c + self.b);
        let s1 = 0.5 * (sum + difference);
        // det / s1 keeps the digits of a small s2, which the difference would lose.
        [s1, if s1 > 0.0 { self.det() / s1 } else { 0.0 }]
    }

    /// `max(s1, 1 / s2)`, infinite where the triangle is not positive.
    pub(crate) fn largest_stretch(&self) -> f64 {
        let det = self.det();
        if det <= 0.0 {
            return f64::INFINITY;
        }
        let half = 0.5 * (self.a * self.a + self.b * self.b + self.c * self.c + self.d * self.d);
        let s1 = (half + (half * half - det * det).max(0.0).sqrt()).sqrt();
        s1.max(s1 / det)
    }

    /// Cosine and sine of the nearest rotation; `None` when every rotation is equally near.
    pub(crate) fn nearest_rotation(&self) -> Option<[f64; 2]> {
        let (p, q) = (self.a + self.d, self.c - self.b);
        let length = length(p, q);
        (length > 0.0).then(|| [p / length, q / length])
    }

    /// The nearest map whose singular values lie between `1 / stretch` and `stretch`: never a mirrored one.
    pub(crate) fn bounded(self, stretch: f64) -> Self {
        let [s1, s2] = self.stretch();
        let (low, high) = (1.0 / stretch, stretch);
        if s2 >= low && s1 <= high {
            return self;
        }
        // In the basis of sums and differences a map is a rotation times (s1 + s2) / 2 and a reflection times (s1 - s2) / 2.
        let [t1, t2] = [s1.clamp(low, high), s2.clamp(low, high)];
        let part = |x: f64, y: f64, wanted: f64| {
            let length = length(x, y);
            if length > 0.0 { [x * wanted / length, y * wanted / length] } else { [wanted, 0.0] }
        };
        let [p, q] = part(self.a + self.d, self.c - self.b, t1 + t2);
        let [r, s] = part(self.a - self.d, self.c + self.b, t1 - t2);
        Self { a: 0.5 * (p + r), b: 0.5 * (s - q), c: 0.5 * (s + q), d: 0.5 * (p - r) }
    }

    /// What lies in the direction of another map, `factor` times as far away.
    pub(crate) fn beyond(&self, factor: f64, other: &Self) -> Self {
        let along = |from: f64, to: f64| from + factor * (to - from);
        Self {
            a: along(self.a, other.a),
            b: along(self.b, other.b),
            c: along(self.c, other.c),
            d: along(self.d, other.d),
        }
    }

    /// `|J - R|^2`; `(s1 - 1)^2 + (s2 - 1)^2` for the nearest rotation (cosine, sine).
    pub(crate) fn rigidity(&self, [p, q]: [f64; 2]) -> f64 {
        (self.a - p).powi(2) + (self.b + q).powi(2) + (self.c - q).powi(2) + (self.d - p).powi(2)
    }

    /// `W = |J|^2 (1 + 1 / det^2) = s1^2 + s2^2 + s1^-2 + s2^-2`, infinite where the triangle is not positive.
    pub(crate) fn symmetric_dirichlet(&self) -> f64 {
        let det = self.det();
        if det <= 0.0 {
            return f64::INFINITY;
        }
        let square = self.a * self.a + self.b * self.b + self.c * self.c + self.d * self.d;
        square * (1.0 + 1.0 / (det * det))
    }
}

/// Length of a vector whose square neither overflows nor vanishes; `hypot` guards against both and takes ten times as long.
pub(crate) fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Relative error of the plain determinant below which its sign is not certain (Shewchuk 1997, `ccwerrboundA`).
const ORIENTATION_FILTER: f64 = 3.330_669_073_875_471_6e-16;

/// Exact sign of the orientation of a triangle in the plane: positive when counter-clockwise.
pub(crate) fn orientation(uv: [[f64; 2]; 3]) -> f64 {
    let [a, b, c] = uv;
    let (left, right) = ((a[0] - c[0]) * (b[1] - c[1]), (a[1] - c[1]) * (b[0] - c[0]));
    // Nearly all triangles are decided here, without a call.
    if (left - right).abs() > ORIENTATION_FILTER * (left.abs() + right.abs()) {
        return left - right;
    }
    let [a, b, c] = uv.map(|[x, y]| robust::Coord { x, y });
    robust::orient2d(a, b, c)
}

/// Number of triangles that are not strictly counter-clockwise, by the exact predicate.
pub(crate) fn flips(uv: &[[f64; 2]], faces: &[[u32; 3]]) -> usize {
    faces.iter().filter(|face| orientation(face.map(|v| uv[v as usize])) <= 0.0).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(angle: f64) -> [[f64; 2]; 2] {
        [[angle.cos(), -angle.sin()], [angle.sin(), angle.cos()]]
    }

    /// Two turns around a stretch.
    fn map(left: f64, [s1, s2]: [f64; 2], right: f64) -> Jacobian {
        let (u, v) = (turned(left), turned(right));
        let entry = |i: usize, j: usize| u[i][0] * s1 * v[0][j] + u[i][1] * s2 * v[1][j];
        Jacobian { a: entry(0, 0), b: entry(0, 1), c: entry(1, 0), d: entry(1, 1) }
    }

    #[test]
    fn a_bounded_map_keeps_its_directions() {
        // Singular values, and what becomes of them within a factor of 1.25; the last map is mirrored.
        let cases = [
            ([1.1, 0.9], [1.1, 0.9]),
            ([1.7, 0.9], [1.25, 0.9]),
            ([1.1, 0.3], [1.1, 0.8]),
            ([0.5, 0.2], [0.8, 0.8]),
            ([1.4, -0.2], [1.25, 0.8]),
        ];
        for (found, expected) in cases {
            for (left, right) in [(0.3, -1.2), (2.0, 0.7), (-2.9, 3.0)] {
                let [got, wanted] = [map(left, found, right).bounded(1.25), map(left, expected, right)];
                for (x, y) in [(got.a, wanted.a), (got.b, wanted.b), (got.c, wanted.c), (got.d, wanted.d)] {
                    assert!((x - y).abs() < 1e-12, "{got:?} {wanted:?}");
                }
            }
        }
    }
}
