//! The flight and the cameras of a robot that paints a wall.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::rng::{Rng, derive};
use crate::camera::Camera;
use crate::error::Error;
use crate::error::invalid;
use crate::lie::so3;
use crate::stamp::Stamp;
use crate::trajectory::spline::Spline;

const KNOT_NS: i64 = 50_000_000;
/// Half the length of a row, m, and the time of a row, s: 0.8 m/s in its middle.
const ROW: (f64, f64) = (2.0, 8.0);
/// Rise, m/s: rows 0.4 m apart.
const RISE: f64 = 0.05;

/// The flight of a robot that paints a wall in front of it (along +x): rows to and fro along y, each higher than the one
/// before, blown about by gusts, leaning into its acceleration. The seed draws the gusts.
pub fn painting_flight(seed: u64, seconds: f64) -> Result<Spline, Error> {
    if !(seconds > 0.0 && seconds <= 1e5) {
        return Err(invalid("seconds", seconds, "must be above 0 and at most 100000"));
    }
    let mut rng = Rng::new(derive(seed, 40));
    let mut phases = || Vector3::from_fn(|_, _| rng.between(0.0, std::f64::consts::TAU));
    let phases = [phases(), phases(), phases()];
    let knot = |k: usize| {
        let t = k as f64 * KNOT_NS as f64 * 1e-9;
        let wave = |amplitude: f64, hertz: f64, phase: &Vector3<f64>| {
            let frequencies = Vector3::new(1.0, 1.17, 1.34) * (std::f64::consts::TAU * hertz);
            Vector3::from_fn(|axis, _| amplitude * (frequencies[axis] * t + phase[axis]).sin())
        };
        let (half, row_s) = ROW;
        let frequency = std::f64::consts::PI / row_s;
        let along = half * (frequency * t).cos();
        let gusts = wave(0.03, 0.7, &phases[0]) + wave(0.12, 0.21, &phases[1]);
        let sway = wave(0.05, 0.6, &phases[2]);
        // To accelerate along y a multirotor leans about x, the other way round.
        let lean = along * frequency * frequency / 9.81;
        let rotation = so3::exp(&Vector3::new(sway.x + lean, sway.y, 2.0 * sway.z));
        Isometry3::from_parts(Translation3::from(Vector3::new(0.0, along, RISE * t) + gusts), rotation)
    };
    let knots = (seconds * 1e9 / KNOT_NS as f64) as usize + 3;
    Spline::new(Stamp::from_nanos(1_000_000_000), KNOT_NS, (0..knots).map(knot).collect())
}

/// The camera of that robot: the left one of the EuRoC vehicle, mounted so that it looks along +x.
pub fn camera_ahead() -> Camera {
    let ahead = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0));
    let rotation = UnitQuaternion::from_rotation_matrix(&ahead);
    Camera { body_from_camera: Isometry3::from_parts(Translation3::new(0.1, 0.0, 0.05), rotation), ..Camera::euroc() }
}

/// A second camera of that robot, mounted beside the first as the right one of the EuRoC vehicle is beside the left.
pub fn camera_ahead_right() -> Camera {
    let right = Camera::euroc_right();
    let left_from_right = Camera::euroc().body_from_camera.inverse() * right.body_from_camera;
    Camera { body_from_camera: camera_ahead().body_from_camera * left_from_right, ..right }
}
