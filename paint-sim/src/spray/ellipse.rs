//! The jet's cross-section in slope space: an ellipse that may be turned, and need not lie on the nozzle's axis.

use nalgebra::Vector3;

/// Horizontal part of an axis below which it counts as vertical.
const VERTICAL: f64 = 1e-9;

/// An ellipse over the slopes to the nozzle's left and upwards, one deviation large.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SlopeEllipse {
    /// Slopes of its middle.
    pub(crate) center: [f64; 2],
    /// Unit vector of its long side; the short side is a quarter turn ahead.
    pub(crate) long: [f64; 2],
    /// Deviations along both.
    pub(crate) deviations: [f64; 2],
    /// Root of the aspect.
    stretch: f64,
}

impl SlopeEllipse {
    /// `deviation` is the geometric mean of the two deviations, `aspect` their ratio.
    pub(crate) fn new(deviation: f64, aspect: f64, turn: f64, [yaw, pitch]: [f64; 2]) -> Self {
        let (sine, cosine) = turn.sin_cos();
        let stretch = aspect.sqrt();
        Self {
            center: [yaw.tan(), pitch.tan()],
            long: [cosine, sine],
            deviations: [deviation * stretch, deviation / stretch],
            stretch,
        }
    }

    /// Whether it is a circle around the axis.
    pub(crate) fn is_plain(&self) -> bool {
        self.center == [0.0; 2] && self.deviations[0] == self.deviations[1]
    }

    /// Where the slopes of a plain spray of the same mean deviation come to lie; a plain one leaves them alone, to the last bit.
    pub(crate) fn shaped(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let ([c, s], [a, b]) = (self.long, [a * self.stretch, b / self.stretch]);
        [self.center[0] + (c * a - s * b), self.center[1] + (s * a + c * b)]
    }

    /// The steepest slope within `cut` deviations, or a little more.
    pub(crate) fn steepest(&self, cut: f64) -> f64 {
        self.center[0].hypot(self.center[1]) + cut * self.deviations[0].max(self.deviations[1])
    }

    /// The same in the world, of a nozzle whose left and up are these.
    pub(crate) fn around(&self, left: &Vector3<f64>, up: &Vector3<f64>, cut: f64) -> EllipticCone {
        let [c, s] = self.long;
        let side = |[l, u]: [f64; 2], deviation: f64| Side {
            direction: left * l + up * u,
            center: l * self.center[0] + u * self.center[1],
            deviation,
            reach: cut * deviation,
        };
        EllipticCone { sides: [side([c, s], self.deviations[0]), side([-s, c], self.deviations[1])], cut }
    }
}

/// An elliptic cone in the world.
pub(crate) struct EllipticCone {
    sides: [Side; 2],
    /// Deviations from the middle beyond which there is no paint.
    pub(crate) cut: f64,
}

struct Side {
    /// Unit vector across the nozzle's axis.
    direction: Vector3<f64>,
    /// Slope of the middle along it.
    center: f64,
    deviation: f64,
    /// Half opening along it, in slope.
    reach: f64,
}

impl EllipticCone {
    /// Unit vectors of the sides over their deviations.
    pub(super) fn directions_in_deviations(&self) -> [Vector3<f64>; 2] {
        self.sides.each_ref().map(|side| side.direction / side.deviation)
    }

    /// Slopes of the middle along the sides, in deviations.
    pub(super) fn center_in_deviations(&self) -> [f64; 2] {
        self.sides.each_ref().map(|side| side.center / side.deviation)
    }

    /// Of each side: direction, centre, reach, and the lengths of the normals of both planes that bound it.
    #[cfg(feature = "gpu")]
    pub(super) fn sides(&self) -> [[f64; 7]; 2] {
        self.sides.each_ref().map(|side| {
            let [above, below] = [side.center + side.reach, side.center - side.reach].map(|slope| slope.hypot(1.0));
            let direction = side.direction;
            [direction.x, direction.y, direction.z, side.center, side.reach, above, below]
        })
    }

    /// Square of the distance from the middle in deviations, at a slope (ray over depth).
    pub(crate) fn squared(&self, slope: &Vector3<f64>) -> f64 {
        self.sides.iter().map(|side| ((slope.dot(&side.direction) - side.center) / side.deviation).powi(2)).sum()
    }

    /// Whether a ball may touch the pyramid around the cone; never false when it touches the cone.
    pub(crate) fn may_intersect(&self, ray: &Vector3<f64>, depth: f64, radius: f64) -> bool {
        self.sides.iter().all(|side| {
            let sideways = ray.dot(&side.direction) - side.center * depth;
            let (above, below) = (side.center + side.reach, side.center - side.reach);
            // Distances from two planes through the nozzle, positive outside.
            (sideways - side.reach * depth) <= radius * above.hypot(1.0)
                && (-sideways - side.reach * depth) <= radius * below.hypot(1.0)
        })
    }
}

/// The horizontal left of a nozzle that sprays along `axis` and does not roll, the world's z axis pointing up. A vertical axis has no
/// horizontal: it counts as tilted up or down from the world's x axis, whose left is y.
pub(crate) fn left_of(axis: &Vector3<f64>) -> Vector3<f64> {
    let (left, length) = (Vector3::new(-axis.y, axis.x, 0.0), axis.x.hypot(axis.y));
    if length < VERTICAL { Vector3::y() } else { left / length }
}
