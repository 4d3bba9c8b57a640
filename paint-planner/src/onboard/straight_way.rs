//! From rest to rest with the least jerk (Flash and Hogan 1985).

use nalgebra::{Point3, Vector3};

use crate::control::ControlReference;

/// Share of the way at a share `s` of the time, cut to 0..=1, with its first and second derivative by `s`: `10 s³ - 15 s⁴ + 6 s⁵`.
pub fn minimum_jerk(s: f64) -> [f64; 3] {
    let s = s.clamp(0.0, 1.0);
    let left = 1.0 - s;
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * left * left, 60.0 * s * left * (1.0 - 2.0 * s)]
}

/// A straight way of a vehicle, at rest at both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StraightWay {
    /// Both ends in the world, m.
    pub ends: [Point3<f64>; 2],
    /// Headings there, rad; the second within half a turn of the first.
    pub heading: [f64; 2],
    /// How long it takes, s.
    pub duration: f64,
}

impl StraightWay {
    /// The state `t` seconds after it began. `lever`: see [`ControlReference::lever`].
    pub fn at(&self, t: f64, lever: Vector3<f64>) -> ControlReference {
        let Self { ends: [from, to], heading: [first, last], duration } = *self;
        let [share, speed, acceleration] = minimum_jerk(t / duration);
        let (speed, acceleration) = (speed / duration, acceleration / (duration * duration));
        let way = to - from;
        ControlReference {
            position: from + way * share,
            velocity: way * speed,
            acceleration: way * acceleration,
            heading: first + (last - first) * share,
            heading_rate: (last - first) * speed,
            lever,
        }
    }
}
