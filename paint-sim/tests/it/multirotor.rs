//! The motor-level vehicle against closed forms, and its sensors against what they measure.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use paint_sim::Error;
use paint_sim::flight::GRAVITY;
use paint_sim::flight::multirotor::*;

const DT: f64 = 1e-3;

fn without_drag() -> MultirotorSettings {
    MultirotorSettings { rotor_drag: [0.0; 3], body_drag: 0.0, ..MultirotorSettings::default() }
}

fn at_origin(settings: MultirotorSettings) -> Multirotor {
    Multirotor::new(settings, Point3::origin(), 0.0).unwrap()
}

/// Steps for `time` seconds with the same command for all motors.
fn run(vehicle: &mut Multirotor, command: f64, surroundings: &Surroundings, time: f64) {
    let commands = vec![command; vehicle.motors().len()];
    for _ in 0..(time / DT).round() as usize {
        vehicle.step(&commands, surroundings, DT).unwrap();
    }
}

#[test]
fn it_falls_freely_and_ends_at_terminal_speed() {
    let mut falling = at_origin(without_drag());
    run(&mut falling, 0.0, &Surroundings::default(), 2.0);
    assert!((falling.position().z + 0.5 * GRAVITY * 4.0).abs() < 1e-9, "{}", falling.position());
    assert!((falling.velocity().z + 2.0 * GRAVITY).abs() < 1e-9);
    // Quadratic drag alone: v(t) = v_end tanh(g t / v_end), v_end = sqrt(m g / b).
    let settings = MultirotorSettings { body_drag: 0.1, ..without_drag() };
    let end = (settings.mass * GRAVITY / settings.body_drag).sqrt();
    let mut falling = at_origin(settings);
    run(&mut falling, 0.0, &Surroundings::default(), 1.5);
    assert!((falling.velocity().z + end * (GRAVITY * 1.5 / end).tanh()).abs() < 1e-9);
    run(&mut falling, 0.0, &Surroundings::default(), 30.0);
    assert!((falling.velocity().z + end).abs() < 1e-6);
}

#[test]
fn four_and_six_rotors_hover_at_their_weight() {
    let [four, six] = [MultirotorSettings::default(), MultirotorSettings::hexarotor()].map(|settings| settings.rotors);
    assert_eq!((four.len(), six.len()), (4, 6));
    let [of_four, of_six] = [four, six].map(|rotors| rotors.iter().map(|r| r.max_thrust).sum::<f64>());
    assert!((of_four - of_six).abs() < 1e-9);
    for settings in
        [without_drag(), MultirotorSettings { rotor_drag: [0.0; 3], body_drag: 0.0, ..MultirotorSettings::hexarotor() }]
    {
        for thrust_curve in [0.0, 0.4, 1.0] {
            let settings = MultirotorSettings { thrust_curve, ..settings.clone() };
            let hover = at_origin(settings.clone()).hover_command();
            let most: f64 = settings.rotors.iter().map(|r| r.max_thrust).sum();
            assert!((most * settings.thrust_of(hover) - settings.mass * GRAVITY).abs() < 1e-9);
            let mut vehicle = at_origin(settings).with_motors(hover);
            run(&mut vehicle, hover, &Surroundings::default(), 2.0);
            assert!(vehicle.position().coords.norm() < 1e-9 && vehicle.angular_velocity().norm() < 1e-12);
        }
    }
}

#[test]
fn each_rotor_turns_the_vehicle_as_its_arm_and_spin_say() {
    let (arm, moment) = (0.35, 0.02);
    for settings in [without_drag(), MultirotorSettings::hexarotor()] {
        for (k, rotor) in settings.rotors.clone().iter().enumerate() {
            let mut commands = vec![0.0; settings.rotors.len()];
            commands[k] = 1.0;
            let mut vehicle = at_origin(settings.clone());
            vehicle.step(&commands, &Surroundings::default(), 1e-5).unwrap();
            let place = rotor.position;
            assert!((place.coords.norm() - arm).abs() < 1e-12);
            // Torque of a force upwards at (x, y): (y, -x); counter-clockwise blades push the body clockwise.
            let direction = vehicle.angular_velocity().component_mul(&Vector3::from(settings.inertia)).normalize();
            let expected = Vector3::new(place.y, -place.x, -rotor.spin * moment).normalize();
            assert!((direction - expected).norm() < 1e-9, "rotor {k}");
        }
        assert_eq!(settings.rotors.iter().map(|r| r.spin).sum::<f64>(), 0.0);
    }
}

#[test]
fn a_motor_follows_a_step_with_its_lag() {
    let settings = MultirotorSettings { thrust_curve: 1.0, ..without_drag() };
    let lag = settings.rotors[0].time_constant;
    let mut vehicle = at_origin(settings.clone());
    run(&mut vehicle, 0.8, &Surroundings::default(), 0.045);
    let expected = 0.8 * (1.0 - (-0.045_f64 / lag).exp());
    assert!((vehicle.motors()[2] - expected).abs() < 1e-12);
    // The integral of the thrust k x^2 over the step response, in closed form.
    let (t, decay) = (0.045, (-0.045_f64 / lag).exp());
    let impulse = 4.0 * 21.0 * 0.64 * (t - 2.0 * lag * (1.0 - decay) + 0.5 * lag * (1.0 - decay * decay));
    assert!((vehicle.velocity().z - (impulse / settings.mass - GRAVITY * t)).abs() < 1e-8);
}

#[test]
fn torque_free_rotation_keeps_energy_and_momentum_and_precesses() {
    let inertia = [0.08, 0.08, 0.14];
    let settings = MultirotorSettings { inertia, ..without_drag() };
    let rate = Vector3::new(2.0, 0.0, 5.0);
    let attitude = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
    let mut vehicle = at_origin(settings).with_motion(attitude, Vector3::zeros(), rate);
    let j = Vector3::from(inertia);
    let momentum = |v: &Multirotor| v.rotation() * v.angular_velocity().component_mul(&j);
    let energy = |v: &Multirotor| 0.5 * v.angular_velocity().dot(&v.angular_velocity().component_mul(&j));
    let (start, worked) = (momentum(&vehicle), energy(&vehicle));
    run(&mut vehicle, 0.0, &Surroundings::default(), 10.0);
    assert!((momentum(&vehicle) - start).norm() < 1e-8 && (energy(&vehicle) / worked - 1.0).abs() < 1e-9);
    // An axisymmetric body precesses by (J3 - J1)/J1 w3.
    let phase = (inertia[2] - inertia[0]) / inertia[0] * rate.z * 10.0;
    let expected = Vector3::new(2.0 * phase.cos(), 2.0 * phase.sin(), 5.0);
    assert!((vehicle.angular_velocity() - expected).norm() < 1e-7);
}

#[test]
fn it_leans_against_steady_wind_by_its_drag() {
    let settings = MultirotorSettings { body_drag: 0.05, ..MultirotorSettings::default() };
    let (drag, speed) = (1.26_f64, 3.0_f64);
    // In the body's axes the wind blows along -x cos, z sin of the lean: the balance of forces there.
    let (mut lean, most) = (0.1_f64, 4.0 * 21.0);
    for _ in 0..50 {
        let push = (drag + 0.05 * speed) * speed * lean.cos();
        lean = (push / (settings.mass * GRAVITY)).asin();
    }
    // Along the body's z: thrust + drag = m g cos(lean); wind from the front rises along the leaning body's z.
    let rise = (0.42 + 0.05 * speed) * speed * -lean.sin();
    let thrust = settings.mass * GRAVITY * lean.cos() - rise;
    let attitude = UnitQuaternion::from_euler_angles(0.0, lean, 0.0);
    let mut vehicle =
        at_origin(settings).with_motors(thrust / most).with_motion(attitude, Vector3::zeros(), Vector3::zeros());
    let wind = Surroundings { wind: Vector3::new(-speed, 0.0, 0.0), ..Surroundings::default() };
    vehicle.step(&[thrust / most; 4], &wind, DT).unwrap();
    assert!(vehicle.acceleration().norm() < 1e-3, "{}", vehicle.acceleration());
}

/// Motors off and hung from a frictionless pivot by a load that balances the weight at a point above: a physical pendulum.
#[test]
fn hung_from_a_point_it_swings_as_a_pendulum() {
    let settings = without_drag();
    let (mass, length, inertia) = (settings.mass, 0.2, settings.inertia[1]);
    let angle = 0.02_f64;
    let attitude = UnitQuaternion::from_euler_angles(0.0, angle, 0.0);
    let mut vehicle = at_origin(settings).with_motion(attitude, Vector3::zeros(), Vector3::zeros());
    // A force equal to the weight through a point above the centre gives J a'' = -m g l sin(a).
    let load = Load { force: Vector3::z() * (mass * GRAVITY), point: Point3::new(0.0, 0.0, length) };
    let loads = [load];
    let hung = Surroundings { loads: &loads, ..Surroundings::default() };
    let swing = |v: &Multirotor| v.rotation().euler_angles().1;
    let energy =
        |v: &Multirotor| 0.5 * inertia * v.angular_velocity().y.powi(2) - mass * GRAVITY * length * swing(v).cos();
    let start = energy(&vehicle);
    let omega = (mass * GRAVITY * length / inertia).sqrt();
    // The elliptic integral's first correction of the period.
    let period = std::f64::consts::TAU / omega * (1.0 + angle * angle / 16.0);
    let steps = 1000;
    // Five periods and a half: on the other side.
    for _ in 0..11 * steps / 2 {
        vehicle.step(&[0.0; 4], &hung, period / f64::from(steps)).unwrap();
    }
    assert!((swing(&vehicle) + angle).abs() < 1e-6, "{}", swing(&vehicle));
    assert!((energy(&vehicle) - start).abs() < 1e-10);
    // What holds it takes its whole weight.
    assert!(vehicle.position().coords.norm() < 1e-9);
}

#[test]
fn paint_that_leaves_makes_it_lighter_and_pushes_it_back() {
    let settings = MultirotorSettings { paint: 0.5, ..without_drag() };
    let (empty, hover) = (settings.mass, at_origin(settings.clone()).hover_command());
    let (flow, speed, time) = (0.1, 40.0, 3.0);
    let mut vehicle = at_origin(settings.clone()).with_motors(hover);
    let loads = [Load::recoil(flow, speed, &Vector3::x(), Point3::origin())];
    let spraying = Surroundings { loads: &loads, outflow: flow, ..Surroundings::default() };
    run(&mut vehicle, hover, &spraying, time);
    assert!((vehicle.mass() - (empty + 0.5 - flow * time)).abs() < 1e-12);
    // The rocket equation, and the constant thrust over a mass that falls.
    let ratio = ((empty + 0.5) / (empty + 0.2)).ln();
    assert!((vehicle.velocity().x + speed * ratio).abs() < 1e-9);
    let lift = (empty + 0.5) * GRAVITY / flow * ratio - GRAVITY * time;
    assert!((vehicle.velocity().z - lift).abs() < 1e-9);
    run(&mut vehicle, hover, &spraying, 4.0);
    assert_eq!((vehicle.paint(), vehicle.mass()), (0.0, empty));
    // A recoil beside the centre turns it.
    let loads = [Load::recoil(flow, speed, &Vector3::x(), Point3::new(0.6, 0.1, 0.0))];
    let mut vehicle = at_origin(settings);
    vehicle.step(&[0.0; 4], &Surroundings { loads: &loads, ..Surroundings::default() }, 1e-4).unwrap();
    assert!((vehicle.angular_velocity().z - 0.1 * 4.0 / 0.14 * 1e-4).abs() < 1e-10);
}

#[test]
fn it_stands_on_the_ground_until_the_thrust_carries_it() {
    let mut vehicle = at_origin(MultirotorSettings::default());
    let ground = Surroundings { ground: Some(0.0), wind: Vector3::new(3.0, 1.0, 0.0), ..Surroundings::default() };
    let hover = vehicle.hover_command();
    run(&mut vehicle, 0.9 * hover, &ground, 1.0);
    assert!(vehicle.on_ground() && vehicle.position() == Point3::origin() && vehicle.impact_speed() < 0.02);
    run(&mut vehicle, 1.2 * hover, &ground, 1.0);
    assert!(!vehicle.on_ground() && vehicle.position().z > 0.5);
    run(&mut vehicle, 0.0, &ground, 3.0);
    assert!(vehicle.on_ground() && vehicle.velocity().norm() == 0.0 && vehicle.impact_speed() > 2.0);
}

#[test]
fn bad_vehicles_and_commands_are_refused() {
    let refused = |settings: MultirotorSettings| Multirotor::new(settings, Point3::origin(), 0.0).unwrap_err();
    let usual = MultirotorSettings::default;
    let three = MultirotorSettings { rotors: usual().rotors[..3].to_vec(), ..usual() };
    assert_eq!(refused(three), Error::Uncontrollable { rotors: 3 });
    let mut same_spin = usual();
    same_spin.rotors.iter_mut().for_each(|rotor| rotor.spin = 1.0);
    assert_eq!(refused(same_spin), Error::Uncontrollable { rotors: 4 });
    let thin = MultirotorSettings { inertia: [0.1, 0.1, 0.3], ..usual() };
    assert!(matches!(refused(thin), Error::OutOfRange { what: "multirotor.inertia", .. }));
    let light = MultirotorSettings { mass: f64::NAN, ..usual() };
    assert!(matches!(refused(light), Error::OutOfRange { what: "multirotor.mass", .. }));
    let mut vehicle = at_origin(usual());
    let none = Surroundings::default();
    assert!(matches!(vehicle.step(&[0.5; 6], &none, DT), Err(Error::WrongLength { expected: 4, found: 6, .. })));
    assert!(matches!(vehicle.step(&[0.5, f64::NAN, 0.5, 0.5], &none, DT), Err(Error::NotFinite { index: 1, .. })));
    assert!(vehicle.step(&[0.5; 4], &none, 0.0).is_err());
    assert_eq!(vehicle, at_origin(usual()), "a refused step changes nothing");
}

#[test]
fn sensors_without_noise_measure_the_motion() {
    let silent = ImuSettings {
        gyroscope_noise_density: 0.0,
        gyroscope_random_walk: 0.0,
        accelerometer_noise_density: 0.0,
        accelerometer_random_walk: 0.0,
        gyroscope_bias: 0.0,
        accelerometer_bias: 0.0,
    };
    let mut imu = Imu::new(silent, 1).unwrap();
    // On the ground: gravity upwards. In free fall: nothing, however it turns about its axis of symmetry.
    let mut vehicle = at_origin(without_drag());
    imu.measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3);
    run(&mut vehicle, 0.0, &Surroundings { ground: Some(0.0), ..Surroundings::default() }, 4e-3);
    assert!(
        (imu.measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3).specific_force - Vector3::z() * GRAVITY).norm()
            < 1e-12
    );
    let spin = Vector3::new(0.0, 0.0, 2.0);
    let mut vehicle = at_origin(without_drag()).with_motion(UnitQuaternion::identity(), Vector3::zeros(), spin);
    let mut imu = Imu::new(silent, 1).unwrap();
    imu.measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3);
    run(&mut vehicle, 0.0, &Surroundings::default(), 4e-3);
    let reading = imu.measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3);
    assert!(reading.specific_force.norm() < 1e-9 && (reading.angular_velocity - spin).norm() < 1e-9);

    let mut barometer = Barometer::new(BarometerSettings { noise: 0.0, origin_height: 0.0 }, 1).unwrap();
    // ISO 2533's table: 101325 Pa at sea level, 89874.6 Pa at 1000 m.
    assert!((barometer.measure(0.0).pressure - 101_325.0).abs() < 1e-9);
    let high = barometer.measure(1000.0);
    assert!((high.pressure - 89_874.6).abs() < 1.0 && (high.height - 1000.0).abs() < 1e-6);
    // The same table: 8.5 degrees there.
    assert!((high.temperature - 8.5).abs() < 1e-9);

    let mut compass =
        Magnetometer::new(MagnetometerSettings { noise: 0.0, ..MagnetometerSettings::default() }, 1).unwrap();
    // Turned to the left by 90 degrees, north lies to the body's front where its x pointed east.
    let north = compass.measure(&UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2));
    assert!((north - Vector3::new(0.21, -0.01, -0.43)).norm() < 1e-12);

    let quiet =
        GpsSettings { horizontal_noise: 0.0, vertical_noise: 0.0, velocity_noise: 0.0, ..GpsSettings::default() };
    let mut gps = Gps::new(quiet, 1).unwrap();
    let place = gps.measure(&Point3::new(0.0, 111_194.926_644_558_74, 3.0), &Vector3::zeros()).place;
    // One degree of a great circle of 6,371 km.
    assert!((place.latitude - quiet.origin.latitude - 1.0).abs() < 1e-9 && (place.height - 403.0).abs() < 1e-9);
}

#[test]
fn noise_has_its_density_and_follows_the_seed() {
    let vehicle = at_origin(MultirotorSettings::default());
    let still = ImuSettings { accelerometer_random_walk: 0.0, gyroscope_random_walk: 0.0, ..ImuSettings::default() };
    let readings = |seed| {
        let mut imu = Imu::new(still, seed).unwrap();
        (0..20_000).map(move |_| imu.measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3)).collect::<Vec<_>>()
    };
    let first = readings(1);
    let spread = |of: &dyn Fn(&ImuReading) -> f64| {
        let mean = first.iter().map(of).sum::<f64>() / 20_000.0;
        (first.iter().map(|r| (of(r) - mean).powi(2)).sum::<f64>() / 20_000.0).sqrt()
    };
    // sigma = density / sqrt(dt), to four standard errors (0.5 % each).
    assert!((spread(&|r| r.specific_force.x) / (2e-3 / 4e-3_f64.sqrt()) - 1.0).abs() < 0.02);
    assert!((spread(&|r| r.angular_velocity.z) / (1.7e-4 / 4e-3_f64.sqrt()) - 1.0).abs() < 0.02);
    let vehicle = at_origin(MultirotorSettings::default());
    let second = Imu::new(still, 2).unwrap().measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3);
    assert_ne!(first[0], second);
    assert_eq!(first[0], Imu::new(still, 1).unwrap().measure(&vehicle.velocity(), &vehicle.rotation(), 4e-3));
}
