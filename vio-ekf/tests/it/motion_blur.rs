//! A moving edge is as blurred ahead of its place at the middle of the exposure as behind it.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use vio_ekf::camera::Distortion;
use vio_ekf::sim::{Cuboid, Photometry, Room, Scenario, SimulatedCamera, Simulation, Surface, Texture};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Stamp};

const WALL_M: f64 = 3.0;
const TEXELS_PER_M: f64 = 250.0;
/// Texels along the side of a field of the chequerboard.
const FIELD: f64 = 32.0;

/// A camera whose pixels lie in pairs about its axis, which is the world's x.
fn camera() -> Camera {
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let body_from_camera = Isometry3::from_parts(Translation3::identity(), turn);
    let distortion = Distortion::RadTan([0.0; 4]);
    Camera { fx: 450.0, fy: 450.0, cx: 319.5, cy: 199.5, width: 640, height: 400, distortion, body_from_camera }
}

/// Before a chequered wall that is the same turned by half a turn about the camera's axis, in the middle of frame 8.
fn passing(velocity: Vector3<f64>, poses: usize) -> Vec<u8> {
    let pose = |i: i32| Isometry3::from_parts((velocity * (0.05 * f64::from(i))).into(), UnitQuaternion::identity());
    let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, (0..20).map(pose).collect()).unwrap();
    let photometry = Photometry { poses, read_noise: 0.0, shot_noise: 0.0, vignetting: 0.0, ..Photometry::default() };
    let middle = spline.span().0.plus_secs(8.0 * 0.05 + 0.5 * photometry.exposure_s);
    let eye = spline.sample(middle).unwrap().world_from_body.translation.vector;
    let min = eye - Vector3::new(WALL_M, 50.0 * FIELD / TEXELS_PER_M, 50.0 * FIELD / TEXELS_PER_M);
    let surface = Surface { texture: 0, texels_per_m: TEXELS_PER_M, offset: [0.0; 2], shade: 1.0 };
    let walls = Cuboid { min, max: eye * 2.0 - min, faces: [surface; 6] };
    let room =
        Room { walls, furniture: Vec::new(), textures: vec![Texture::chequered(256, 8).unwrap()], occluder: None };
    let cameras = vec![SimulatedCamera { camera: camera(), photometry, ..SimulatedCamera::default() }];
    let simulation = Simulation::in_room(spline, room, Scenario { cameras, ..Scenario::default() }).unwrap();
    let frame = simulation.frame(0, 8).unwrap().unwrap();
    assert_eq!((frame.true_stamp, frame.stamp), (middle, middle));
    frame.data
}

/// How much later than its stamp the picture is, s: the shift against its own half turn that fits best is twice that.
fn age(picture: &[u8], velocity: &Vector3<f64>) -> f64 {
    let Camera { width, height, fx, .. } = camera();
    let flow = Vector2::new(velocity.y, velocity.z) * (fx / WALL_M);
    let at = |x: usize, y: usize| f64::from(picture[y * width + x]);
    let (mut shifted, mut steep) = (0.0, 0.0);
    for (x, y) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y))) {
        let gradient = Vector2::new(at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1)) * 0.5;
        let change = -gradient.dot(&flow);
        shifted += change * 0.5 * (at(x, y) - at(width - 1 - x, height - 1 - y));
        steep += change * change;
    }
    shifted / steep
}

#[test]
fn a_frame_shows_the_middle_of_its_exposure() {
    let directions = [Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z(), Vector3::new(0.0, 0.6, 0.8)];
    for (poses, speed) in [(1, 8.0), (2, 8.0), (3, 2.0), (3, 8.0), (4, 8.0), (5, 8.0), (8, 8.0)] {
        for direction in directions {
            let velocity = direction * speed;
            let age = age(&passing(velocity, poses), &velocity);
            assert!(age.abs() < 1e-5, "{poses} poses at {:?} m/s: {:.3} ms", velocity.as_slice(), 1e3 * age);
        }
    }
}
