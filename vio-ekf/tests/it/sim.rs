//! The simulator against closed forms: what a sensor reads, where a corner of the room lands, how much noise there is.

use nalgebra::{Isometry3, Matrix2, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use vio_ekf::sim::{
    Cuboid, Gain, ImuModel, Occluder, Photometry, Room, RoomSettings, Scenario, SimulatedCamera, Simulation, Surface,
    Texture, Vibration,
};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Error, ImuNoise, Stamp};

const KNOT_NS: i64 = 50_000_000;

/// A motion with rotation about all axes and changing speed, three seconds.
fn wild() -> Spline {
    let knots = (0..64).map(|i| {
        let t = 0.05 * f64::from(i);
        let position = Translation3::new((1.3 * t).sin(), 0.7 * (0.9 * t).cos(), 1.0 + 0.2 * (2.1 * t).sin());
        let turn = UnitQuaternion::from_euler_angles(0.3 * (1.7 * t).sin(), 0.25 * (1.1 * t).cos(), 0.8 * t);
        Isometry3::from_parts(position, turn)
    });
    Spline::new(Stamp::from_nanos(0), KNOT_NS, knots.collect()).unwrap()
}

/// A camera at rest that looks along the world's x, a little down and aside.
fn at_rest() -> Spline {
    let turn = UnitQuaternion::from_euler_angles(0.1, 0.15, 0.2);
    let pose = Isometry3::from_parts(Translation3::new(0.1, -0.2, 0.15), turn);
    Spline::new(Stamp::from_nanos(0), KNOT_NS, vec![pose; 12]).unwrap()
}

/// The EuRoC lens, with its axis along the body's x and the image's y down.
fn forward_camera(photometry: Photometry) -> SimulatedCamera {
    let mut model = SimulatedCamera { photometry, ..SimulatedCamera::default() };
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    model.camera.body_from_camera = Isometry3::from_parts(Translation3::new(0.05, 0.02, -0.03), turn);
    model
}

fn small_room() -> RoomSettings {
    RoomSettings { texture_size: 256, ..RoomSettings::default() }
}

#[test]
fn ideal_readings_integrate_to_the_motion() {
    let spline = wild();
    let scenario = Scenario { imus: vec![ImuModel::ideal(1000.0)], room: small_room(), ..Scenario::default() };
    let simulation = Simulation::new(spline.clone(), scenario).unwrap();
    let samples = simulation.imu(0).unwrap().samples;
    let start = spline.sample(samples[0].stamp).unwrap();
    let mut turn = start.world_from_body.rotation;
    let mut position = start.world_from_body.translation.vector;
    let mut velocity = start.velocity_in_world;
    // Midpoint rule, written here from the definition of the readings: acceleration = R f - g.
    let world = |turn: &UnitQuaternion<f64>, force: &Vector3<f64>| turn * force - 9.81 * Vector3::z();
    for pair in samples.windows(2).take(2000) {
        let dt = pair[1].stamp.secs_since(pair[0].stamp);
        let rate = 0.5 * (pair[0].gyro + pair[1].gyro);
        let next = turn * UnitQuaternion::from_scaled_axis(rate * dt);
        let acceleration = 0.5 * (world(&turn, &pair[0].accel) + world(&next, &pair[1].accel));
        position += velocity * dt + 0.5 * acceleration * dt * dt;
        velocity += acceleration * dt;
        turn = next;
    }
    let end = spline.sample(samples[2000].stamp).unwrap();
    assert!((position - end.world_from_body.translation.vector).norm() < 1e-5);
    assert!((velocity - end.velocity_in_world).norm() < 1e-5);
    assert!(turn.angle_to(&end.world_from_body.rotation) < 1e-5);
}

#[test]
fn a_second_sensor_feels_its_lever_arm() {
    // Turning about z at a constant rate: centripetal acceleration -w^2 r, nothing else but gravity.
    let rate = 1.5;
    let turning = |i: i32| {
        Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rate * 0.05 * f64::from(i)),
        )
    };
    let spline = Spline::new(Stamp::from_nanos(0), KNOT_NS, (0..20).map(turning).collect()).unwrap();
    let model = ImuModel {
        body_from_imu: Isometry3::from_parts(
            Translation3::new(0.3, 0.0, 0.1),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2),
        ),
        ..ImuModel::ideal(100.0)
    };
    let motion = spline.sample(Stamp::from_nanos(300_000_000)).unwrap();
    let (gyro, accel) = model.ideal_reading(&motion, 9.81);
    assert!((gyro - Vector3::new(0.0, 0.0, rate)).norm() < 1e-9);
    // The sensor's -y is the body's x.
    assert!((accel - Vector3::new(0.0, 0.3 * rate * rate, 9.81)).norm() < 1e-9, "{accel}");
}

#[test]
fn noise_biases_saturation_and_vibration_are_what_was_asked_for() {
    let base = ImuModel { rate_hz: 1000.0, ..ImuModel::default() };
    let record = |model: &ImuModel, seed| model.record(&wild(), 9.81, seed).unwrap();
    let recording = record(&base, 3);
    let truth = wild();
    let errors: Vec<Vector3<f64>> = recording
        .samples
        .iter()
        .map(|s| s.gyro - recording.biases_at(s.stamp).0 - truth.sample(s.stamp).unwrap().rate_in_body)
        .collect();
    let variance = errors.iter().map(Vector3::norm_squared).sum::<f64>() / (3.0 * errors.len() as f64);
    let expected = base.noise.gyro_density * 1000.0_f64.sqrt();
    // 9000 numbers: one standard deviation of the estimate is 0.75 %.
    assert!((variance.sqrt() / expected - 1.0).abs() < 0.03, "{} against {expected}", variance.sqrt());

    let mut limited = base.clone();
    limited.limits.gyro_range = 0.5;
    let samples = record(&limited, 3).samples;
    assert!(samples.iter().all(|s| s.gyro.amax() <= 0.5) && samples.iter().any(|s| s.gyro.amax() == 0.5));

    let line = Vibration { frequency_hz: 120.0, gyro_amplitude: 0.0, accel_amplitude: 4.0 };
    let shaken = record(&ImuModel { vibrations: vec![line], ..base.clone() }, 3);
    let power = |axis: usize| {
        let pairs = shaken.samples.iter().zip(&recording.samples);
        pairs.map(|(a, b)| (a.accel[axis] - b.accel[axis]).powi(2)).sum::<f64>() / recording.samples.len() as f64
    };
    for axis in 0..3 {
        assert!((power(axis) - 8.0).abs() < 0.2, "axis {axis}: {}", power(axis));
    }

    let mut lossy = base.clone();
    (lossy.limits.drop_probability, lossy.limits.stamp_jitter_s) = (0.3, 5e-3);
    let samples = record(&lossy, 3).samples;
    let share = samples.len() as f64 / recording.samples.len() as f64;
    assert!((share - 0.7).abs() < 0.03, "{share}");
    assert!(samples.windows(2).all(|w| w[0].stamp < w[1].stamp));
    assert_eq!(record(&lossy, 3), record(&lossy, 3));
    assert_ne!(record(&lossy, 3).samples, record(&lossy, 4).samples);
}

/// Without biases, the white noise is all that a seed can change.
#[test]
fn the_seed_makes_the_white_noise() {
    let noise = ImuNoise { gyro_walk: 0.0, accel_walk: 0.0, ..ImuNoise::default() };
    let model = ImuModel { noise, gyro_bias_sigma: 0.0, accel_bias_sigma: 0.0, ..ImuModel::default() };
    let [first, second] = [3, 4].map(|seed| model.record(&wild(), 9.81, seed).unwrap().samples);
    for (a, b) in first.iter().zip(&second) {
        assert!(a.stamp == b.stamp && a.gyro != b.gyro && a.accel != b.accel, "{a:?} {b:?}");
    }
}

/// Kalibr's `timeshift_cam_imu`: what is added to a stamp of the camera to get the inertial sensor's time.
#[test]
fn the_cameras_clock_is_behind_by_its_offset() {
    let model = SimulatedCamera { time_offset_s: 0.007, ..forward_camera(Photometry::default()) };
    let scenario = Scenario { cameras: vec![model], room: small_room(), ..Scenario::default() };
    let frame = Simulation::new(wild(), scenario).unwrap().frame(0, 5).unwrap().unwrap();
    assert_eq!(frame.true_stamp.nanos() - frame.stamp.nanos(), 7_000_000);
}

/// A room of chequered walls: fields of 32 texels, 4 mm each.
fn chequered_room() -> Room {
    let surface = |k: usize| Surface {
        texture: 0,
        texels_per_m: 250.0,
        offset: [10.0 + 7.0 * k as f64, 5.0 + 3.0 * k as f64],
        shade: 1.0,
    };
    let walls = Cuboid {
        min: Vector3::new(-2.0, -1.8, -1.5),
        max: Vector3::new(2.0, 1.9, 1.6),
        faces: std::array::from_fn(surface),
    };
    let texture = Texture::chequered(256, 8).unwrap();
    Room { walls, furniture: Vec::new(), textures: vec![texture], occluder: None }
}

/// Sub-pixel place of a corner: where all image gradients around it are perpendicular to the way there (Förstner).
fn corner_near(image: &[u8], width: usize, guess: Vector2<f64>) -> Option<Vector2<f64>> {
    let at = |x: i64, y: i64| f64::from(image[y as usize * width + x as usize]);
    let mut place = guess;
    for _ in 0..6 {
        let (cx, cy) = (place.x.round() as i64, place.y.round() as i64);
        let (mut a, mut b) = (Matrix2::zeros(), Vector2::zeros());
        for (x, y) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (cx + dx, cy + dy))) {
            let g = Vector2::new(at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1)) * 0.5;
            let here = Vector2::new(x as f64, y as f64);
            let weight = (-(here - place).norm_squared() / 12.0).exp();
            a += weight * g * g.transpose();
            b += weight * g * g.dot(&here);
        }
        place = a.try_inverse()? * b;
    }
    Some(place)
}

#[test]
fn corners_of_the_room_land_where_the_camera_projects_them() {
    let photometry = Photometry { poses: 16, ..Photometry::ideal() };
    let scenario = Scenario { cameras: vec![forward_camera(photometry)], ..Scenario::default() };
    let room = chequered_room();
    let simulation = Simulation::in_room(at_rest(), room.clone(), scenario.clone()).unwrap();
    let frame = simulation.frame(0, 0).unwrap().unwrap();
    let camera = &scenario.cameras[0].camera;
    let motion = simulation.motion(frame.true_stamp).unwrap();
    let camera_from_world = (motion.world_from_body * camera.body_from_camera).inverse();
    // Wall +x: its texture runs along y and z.
    let surface = room.walls.faces[1];
    let line = |k: i32, axis: usize| {
        room.walls.min[axis + 1] + (32.0 * f64::from(k) - surface.offset[axis]) / surface.texels_per_m
    };
    let mut errors = Vec::new();
    for (i, j) in (1..28).flat_map(|i| (1..24).map(move |j| (i, j))) {
        let corner = Vector3::new(room.walls.max.x, line(i, 0), line(j, 1));
        if corner.y > room.walls.max.y - 0.05 || corner.z > room.walls.max.z - 0.05 {
            continue;
        }
        let in_camera = camera_from_world * nalgebra::Point3::from(corner);
        let Some(pixel) = camera.project(&in_camera.coords).filter(|p| camera.contains(p, 12.0)) else { continue };
        let found = corner_near(&frame.data, frame.width, pixel).unwrap();
        errors.push((found - pixel).norm());
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors.len() > 100, "{} corners in view", errors.len());
    let (median, high) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    assert!(median < 0.05 && high < 0.15, "median {median}, 95 % {high} pixels");
}

#[test]
fn image_noise_is_two_grey_levels_and_gains_apply() {
    let dark = Gain { from_s: 0.2, until_s: 0.3, factor: 0.0, offset: 0.0 };
    let photometry = Photometry { vignetting: 0.0, gains: vec![dark], ..Photometry::default() };
    let scenario = Scenario { cameras: vec![forward_camera(photometry)], ..Scenario::default() };
    let simulation = Simulation::in_room(at_rest(), chequered_room(), scenario).unwrap();
    let frames: Vec<_> = simulation.frames(0).map(Result::unwrap).collect();
    let (a, b) = (&frames[0].data, &frames[1].data);
    // Light fields only (grey 200): variance 1.6^2 + 0.015 * 200, and 1/12 from rounding.
    let pairs = a.iter().zip(b).filter(|(x, y)| **x > 185 && **y > 185);
    let (sum, count) = pairs.fold((0.0, 0.0), |(s, n), (x, y)| (s + (f64::from(*x) - f64::from(*y)).powi(2), n + 1.0));
    let sigma = (sum / count / 2.0_f64).sqrt();
    let expected = (1.6_f64 * 1.6 + 0.015 * 200.0 + 1.0 / 12.0).sqrt();
    assert!((sigma / expected - 1.0).abs() < 0.03, "{sigma} against {expected}");
    for frame in &frames {
        let black = (0.2..0.3).contains(&frame.true_stamp.secs_since(simulation.spline().span().0));
        let mean = frame.data.iter().map(|&v| f64::from(v)).sum::<f64>() / frame.data.len() as f64;
        assert_eq!(black, mean < 5.0, "{}: mean {mean}", frame.true_stamp.as_secs());
    }
}

#[test]
fn frames_can_be_made_in_any_order_and_blank_walls_are_blank() {
    let scenario = |blank: bool| Scenario {
        cameras: vec![forward_camera(Photometry { read_noise: 0.0, shot_noise: 0.0, ..Photometry::default() })],
        room: RoomSettings { blank: [blank; 6], furniture: 0, ..small_room() },
        ..Scenario::default()
    };
    let simulation = Simulation::new(wild(), scenario(false)).unwrap();
    let third = simulation.frame(0, 3).unwrap();
    let _ = simulation.frame(0, 40).unwrap();
    assert_eq!(simulation.frame(0, 3).unwrap(), third);
    assert_eq!(Simulation::new(wild(), scenario(false)).unwrap().frame(0, 3).unwrap(), third);
    let steps = |data: &[u8]| data.windows(2).filter(|w| w[0].abs_diff(w[1]) > 8).count();
    let bare = Simulation::new(wild(), scenario(true)).unwrap().frame(0, 3).unwrap().unwrap();
    assert!(steps(&third.unwrap().data) > 2000);
    // What is left are the six lines where differently lit walls meet.
    assert!(steps(&bare.data) < 1500, "{}", steps(&bare.data));
}

#[test]
fn an_occluder_moves_and_the_room_does_not() {
    let occluder = Occluder {
        centre_in_world: Vector3::new(1.0, 0.0, 0.1),
        size: Vector3::new(0.3, 0.3, 0.3),
        amplitude: Vector3::new(0.0, 0.5, 0.0),
        period_s: 1.0,
    };
    let scenario = Scenario { cameras: vec![forward_camera(Photometry::ideal())], ..Scenario::default() };
    let mut room = chequered_room();
    room.occluder = Some((occluder, room.walls.faces));
    let simulation = Simulation::in_room(at_rest(), room, scenario).unwrap();
    let frames: Vec<_> = simulation.frames(0).map(Result::unwrap).collect();
    let changed = frames[0].data.iter().zip(&frames[4].data).filter(|(a, b)| a.abs_diff(**b) > 30).count();
    let share = changed as f64 / frames[0].data.len() as f64;
    assert!((0.005..0.3).contains(&share), "{share} of the pixels changed");
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let refused = |scenario: Scenario, name: &str| {
        let error = Simulation::new(wild(), scenario).err().unwrap_or_else(|| panic!("{name} was accepted"));
        assert!(error.to_string().contains(name), "{error}");
    };
    let imu = |change: &dyn Fn(&mut ImuModel)| {
        let mut model = ImuModel::default();
        change(&mut model);
        Scenario { imus: vec![model], room: small_room(), ..Scenario::default() }
    };
    refused(imu(&|m| m.rate_hz = 0.0), "rate_hz");
    refused(imu(&|m| m.rate_hz = f64::NAN), "rate_hz");
    refused(imu(&|m| m.limits.drop_probability = 1.0), "drop_probability");
    refused(imu(&|m| m.gyro_matrix[(0, 0)] = f64::NAN), "gyro_matrix");
    let camera = |change: &dyn Fn(&mut SimulatedCamera)| {
        let mut model = SimulatedCamera::default();
        change(&mut model);
        Scenario { cameras: vec![model], room: small_room(), ..Scenario::default() }
    };
    refused(camera(&|m| m.photometry.poses = 0), "poses");
    refused(camera(&|m| m.photometry.exposure_s = 0.2), "exposure_s");
    refused(camera(&|m| m.camera.fx = 0.0), "fx");
    refused(
        Scenario { room: RoomSettings { texture_size: 100, ..RoomSettings::default() }, ..Scenario::default() },
        "texture_size",
    );
    refused(Scenario { gravity: f64::NAN, room: small_room(), ..Scenario::default() }, "gravity");
    let simulation = Simulation::new(wild(), Scenario { room: small_room(), ..Scenario::default() }).unwrap();
    assert!(matches!(simulation.imu(1), Err(Error::NoSuch { index: 1, .. })));
    assert!(matches!(simulation.frame(0, 100_000), Err(Error::NoSuch { .. })));
    assert!(matches!(simulation.frame(2, 0), Err(Error::NoSuch { index: 2, .. })));
}

#[test]
fn a_second_camera_changes_nothing_for_the_first() {
    let record = |cameras: Vec<Camera>| {
        let model = |camera| SimulatedCamera { camera, stamp_jitter_s: 0.002, ..SimulatedCamera::default() };
        let cameras = cameras.into_iter().map(model).collect();
        Simulation::new(wild(), Scenario { cameras, room: small_room(), ..Scenario::default() }).unwrap()
    };
    let alone = record(vec![Camera::euroc()]);
    let pair = record(vec![Camera::euroc(), Camera::euroc_right()]);
    let frame = |simulation: &Simulation, which| simulation.frame(which, 7).unwrap().unwrap();
    assert_eq!(frame(&alone, 0), frame(&pair, 0));
    assert_eq!(alone.imu(0).unwrap().samples, pair.imu(0).unwrap().samples);
    // The second one has noise of its own.
    let twice = record(vec![Camera::euroc(); 2]);
    let (first, second) = (frame(&twice, 0), frame(&twice, 1));
    assert!(first.data != second.data && first.stamp != second.stamp && first.true_stamp == second.true_stamp);
}

/// Each of the numbers of a surface by itself.
#[test]
fn surfaces_that_cannot_be_rendered_are_refused() {
    chequered_room().check().unwrap();
    let changes: [fn(&mut Surface); 5] = [
        |surface| surface.texels_per_m = 0.0,
        |surface| surface.shade = -0.1,
        |surface| surface.shade = f64::NAN,
        |surface| surface.offset[1] = f64::INFINITY,
        |surface| surface.texture = 1,
    ];
    for (k, change) in changes.iter().enumerate() {
        let mut room = chequered_room();
        change(&mut room.walls.faces[3]);
        assert!(room.check().is_err(), "change {k}");
    }
    let mut flat = chequered_room();
    flat.walls.max.z = flat.walls.min.z;
    assert!(flat.check().is_err());
}

#[test]
fn furniture_stands_in_the_room_apart_and_clear_of_the_path() {
    let spline = wild();
    let settings = RoomSettings { wall_distance_m: (4.0, 5.0), furniture: 5, ..small_room() };
    let room = Room::around(&spline, &settings, 3).unwrap();
    assert_eq!(room.furniture.len(), 5, "there is room for all");
    let (first, last) = spline.span();
    let path: Vec<Vector3<f64>> = (0..=100)
        .map(|k| Stamp::from_nanos(first.nanos() + (last.nanos() - first.nanos()) / 100 * k))
        .map(|stamp| spline.sample(stamp).unwrap().world_from_body.translation.vector)
        .collect();
    for (k, one) in room.furniture.iter().enumerate() {
        assert!((0..3).all(|a| room.walls.min[a] <= one.min[a] && one.max[a] <= room.walls.max[a]));
        let stands = one.min.z == room.walls.min.z;
        assert!(stands || (one.max.z - room.walls.max.z).abs() < 1e-12, "on the floor or under the ceiling");
        // The room looks at the path at other moments: between two of them it comes nearer by less than 2 cm.
        assert!(path.iter().all(|p| (p - p.sup(&one.min).inf(&one.max)).norm() > settings.clearance_m - 0.02));
        let apart = |other: &Cuboid| (0..3).any(|a| one.max[a] < other.min[a] || one.min[a] > other.max[a]);
        assert!(room.furniture[..k].iter().all(apart));
    }
}
