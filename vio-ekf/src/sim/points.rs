//! A scene of points: a motion, a camera and a tracker that cost next to nothing, for tests and measurements without images.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

use crate::camera::model::CameraModel;
use crate::camera::{Camera, Distortion};
use crate::error::Error;
use crate::filter::point_observation::PointObservation;
use crate::lie::so3;
use crate::stamp::Stamp;
use crate::trajectory::spline::Spline;

/// Time between two knots, ns.
const KNOT_NS: i64 = 100_000_000;

/// A pinhole of 752x480 pixels that looks along the body's x axis.
pub fn forward_pinhole() -> Camera {
    let forward = Rotation3::from_matrix_unchecked(Matrix3::new(
        0.0, 0.0, 1.0, //
        -1.0, 0.0, 0.0, //
        0.0, -1.0, 0.0,
    ));
    let (fx, fy, cx, cy) = (460.0, 460.0, 376.0, 240.0);
    let body_from_camera =
        Isometry3::from_parts(Translation3::new(0.08, -0.03, 0.02), UnitQuaternion::from_rotation_matrix(&forward));
    Camera { width: 752, height: 480, fx, fy, cx, cy, distortion: Distortion::None, body_from_camera }
}

/// A motion that sways and turns through about 8 m, from four phases: of two waves of the position, of the tilt and (its x) of the
/// yaw, rad.
pub fn swaying_flight(phases: &[Vector3<f64>; 4], seconds: f64) -> Result<Spline, Error> {
    let knots = (0..(seconds / 0.1) as usize + 4).map(|k| {
        let t = k as f64 * 0.1;
        let wave = |amplitude: f64, hertz: f64, phase: &Vector3<f64>| {
            Vector3::from_fn(|i, _| {
                amplitude * (std::f64::consts::TAU * hertz * (1.0 + 0.13 * i as f64) * t + phase[i]).sin()
            })
        };
        let position = wave(1.4, 0.11, &phases[0]) + wave(0.4, 0.31, &phases[1]);
        let tilt = wave(0.25, 0.23, &phases[2]);
        let yaw = 0.9 * (0.5 * t + phases[3].x).sin() + 0.4 * (0.21 * t).sin();
        let rotation = so3::exp(&Vector3::new(0.0, 0.0, yaw)) * so3::exp(&Vector3::new(tilt.x, tilt.y, 0.0));
        Isometry3::from_parts(position.into(), rotation)
    });
    Spline::new(Stamp::from_nanos(1_000_000_000), KNOT_NS, knots.collect())
}

/// The pixels of the points (in world axes) that a camera on the body sees at least `border` pixels inside its image; ids are
/// their indices. `noise` is called once for each point, seen or not, and added to its pixel.
pub fn observe_points<'a>(
    points: impl IntoIterator<Item = &'a Point3<f64>>,
    camera: &dyn CameraModel,
    world_from_body: &Isometry3<f64>,
    border: f64,
    mut noise: impl FnMut() -> Vector2<f64>,
) -> Vec<PointObservation> {
    let camera_from_world = (world_from_body * camera.body_from_camera()).inverse();
    let (width, height) = camera.image_size();
    let inside = |x: f64, side: usize| x >= border && x <= side as f64 - 1.0 - border;
    let mut observed = Vec::new();
    for (id, point) in (0..).zip(points) {
        let noise = noise();
        let pixel = camera.project(&(camera_from_world * point).coords);
        let pixel = pixel.filter(|pixel| inside(pixel.x, width) && inside(pixel.y, height));
        observed.extend(pixel.map(|pixel| PointObservation { id, pixel: pixel + noise }));
    }
    observed
}
