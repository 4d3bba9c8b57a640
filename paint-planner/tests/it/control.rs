//! Tracking control.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use nalgebra::{Matrix2, Point3, Rotation3, Vector2, Vector3};
use paint_planner::Error;
use paint_planner::control::*;

const GRAVITY: f64 = 9.80665;

/// An ellipse before a wall, the gun half a metre ahead and below the centre.
fn ellipse(t: f64) -> ControlReference {
    let (a, b, rate) = (0.6, 0.3, 0.7);
    let (s, c) = (rate * t).sin_cos();
    ControlReference {
        position: Point3::new(0.1 * s, a * s, 2.0 + b * c),
        velocity: Vector3::new(0.1 * rate * c, a * rate * c, -b * rate * s),
        acceleration: Vector3::new(-0.1 * rate * rate * s, -a * rate * rate * s, -b * rate * rate * c),
        heading: 0.3 * s,
        heading_rate: 0.3 * rate * c,
        lever: Vector3::new(0.5, 0.1, -0.15),
    }
}

/// The vehicle of the model, in steps of a millisecond, and the lever's end in the world.
struct Flown {
    state: ControlState,
    yaw_rate: f64,
}

impl Flown {
    fn step(&mut self, vehicle: &VehicleModel, command: &ControlCommand, disturbance: &Vector3<f64>) {
        let dt = 1e-3;
        let ControlState { position, velocity, attitude, .. } = &mut self.state;
        let follow =
            |x: &mut f64, r: &AttitudeResponse, u: f64| *x += (r.gain * u - *x) * (1.0 - (-dt / r.time_constant).exp());
        follow(&mut attitude[0], &vehicle.roll, command.roll);
        follow(&mut attitude[1], &vehicle.pitch, command.pitch);
        self.yaw_rate += (command.yaw_rate - self.yaw_rate) * (1.0 - (-dt / 0.15_f64).exp());
        attitude[2] += self.yaw_rate * dt;
        let rotation = Rotation3::from_euler_angles(attitude[0], attitude[1], attitude[2]);
        let drag = rotation
            * Vector3::new(vehicle.drag[0], vehicle.drag[0], vehicle.drag[1])
                .component_mul(&(rotation.inverse() * *velocity));
        let acceleration =
            rotation * Vector3::new(0.0, 0.0, command.thrust) - Vector3::new(0.0, 0.0, GRAVITY) - drag + disturbance;
        *velocity += acceleration * dt;
        *position += *velocity * dt;
    }

    fn lever_error(&self, wanted: &ControlReference) -> f64 {
        let [roll, pitch, yaw] = self.state.attitude;
        let level = Rotation3::from_euler_angles(0.0, 0.0, yaw);
        let lever = level.inverse() * wanted.lever;
        let end = self.state.position + Rotation3::from_euler_angles(roll, pitch, yaw) * lever;
        (end - (wanted.position + wanted.lever)).norm()
    }
}

/// Flies the ellipse under a disturbance that is known: largest error of the lever's end and largest command since a time.
fn fly(since: f64, settings: MpcSettings, disturbance: impl Fn(f64) -> Vector3<f64>) -> (f64, f64, TrackingMpc) {
    let vehicle = VehicleModel::default();
    let mut mpc = TrackingMpc::new(vehicle, settings).unwrap();
    let begin = ellipse(0.0);
    let still = Vector3::zeros();
    let state =
        ControlState { position: begin.position, velocity: begin.velocity, attitude: [0.0; 3], disturbance: still };
    let mut flown = Flown { state, yaw_rate: begin.heading_rate };
    let (mut worst, mut most) = (0.0_f64, 0.0_f64);
    for k in 0..1200 {
        let time = 0.01 * f64::from(k);
        flown.state.disturbance = disturbance(time);
        let command = mpc.command(time, &flown.state, &ellipse);
        if time > since {
            most = most.max(command.roll.abs()).max(command.pitch.abs());
        }
        for _ in 0..10 {
            flown.step(&vehicle, &command, &disturbance(time));
        }
        if time > since {
            worst = worst.max(flown.lever_error(&ellipse(time + 0.01)));
        }
    }
    (worst, most, mpc)
}

#[test]
fn the_end_of_the_lever_stays_on_its_trajectory_in_a_steady_wind() {
    // Leaning against 1.5 m/s² moves the end of the lever by 8 cm; a controller of the body's centre leaves it there.
    let (worst, most, mpc) = fly(2.0, MpcSettings::default(), |_| Vector3::new(-1.5, 0.8, -0.3));
    assert!(worst < 0.006, "{worst} m");
    assert!(most > 0.1 && most < 25.0_f64.to_radians());
    // The start from a level body saturates.
    assert!(mpc.unsettled() <= 1, "{}", mpc.unsettled());
}

#[test]
fn commands_keep_their_limits_in_a_wind_beyond_them() {
    // 6 m/s² ask for 31 degrees, 25 are permitted (and pitch gives 0.789 of its command): the vehicle is blown away, within its limits.
    let (lost, most, _) =
        fly(0.0, MpcSettings::default(), |t| Vector3::new(if t < 4.0 { -0.5 } else { -6.0 }, 0.0, 0.0));
    assert!(most <= 25.0_f64.to_radians() + 1e-12, "{most}");
    assert!(most > 24.9_f64.to_radians() && lost > 1.0, "{most} {lost}");
    // A gust that passes is survived: eight seconds later nothing of it is left.
    let gust = |t: f64| Vector3::new(if (0.5..1.0).contains(&t) { -6.0 } else { 0.0 }, 0.0, 0.0);
    let (back, _, _) = fly(9.0, MpcSettings::default(), gust);
    assert!(back < 0.006, "{back}");
}

/// Upwards and without bounds it is the regulator of a double integrator with drag: the thrust against an error of place and one of
/// velocity by the gain of the endless Riccati recursion, written out here.
#[test]
fn the_thrust_is_that_of_the_linear_quadratic_regulator() {
    let vehicle = VehicleModel { drag: [0.0; 2], thrust: [0.1, 1000.0], ..VehicleModel::default() };
    for velocity in [0.0, 0.01, 1.0] {
        let settings = MpcSettings { velocity, ..MpcSettings::default() };
        let (h, r) = (settings.step, settings.thrust);
        let (a, b) = (Matrix2::new(1.0, h, 0.0, 1.0), Vector2::new(0.5 * h * h, h));
        let cost = Matrix2::new(1.0, 0.0, 0.0, velocity);
        let gain = |p: &Matrix2<f64>| b.transpose() * p * a / (r + (b.transpose() * p * b).x);
        let mut p = cost;
        for _ in 0..100_000 {
            p = cost + a.transpose() * p * a - a.transpose() * p * b * gain(&p);
        }
        for (high, fast) in [(0.02, 0.0), (0.0, 0.1), (-0.01, -0.2)] {
            let state = ControlState {
                position: Point3::new(0.0, 0.0, 2.0 + high),
                velocity: Vector3::new(0.0, 0.0, fast),
                attitude: [0.0; 3],
                disturbance: Vector3::zeros(),
            };
            let command = TrackingMpc::new(vehicle, settings).unwrap().command(0.0, &state, &|_| standing(0.0));
            let expected = GRAVITY - (gain(&p) * Vector2::new(high, fast)).x;
            assert!((command.thrust - expected).abs() < 1e-6, "{velocity}: {} for {expected}", command.thrust);
        }
    }
}

/// In its place a tilted body gives as much more thrust as keeps its weight.
#[test]
fn a_tilted_body_keeps_its_height() {
    for (roll, pitch) in [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (-0.25, 0.35)] {
        let (position, still) = (Point3::new(0.0, 0.0, 2.0), Vector3::zeros());
        let state = ControlState { position, velocity: still, attitude: [roll, pitch, 0.7], disturbance: still };
        let mut mpc = TrackingMpc::new(VehicleModel::default(), MpcSettings::default()).unwrap();
        let command = mpc.command(0.0, &state, &|_| standing(0.7));
        let lift = (Rotation3::from_euler_angles(roll, pitch, 0.7) * Vector3::z() * command.thrust).z;
        assert!((lift - GRAVITY).abs() < 1e-9, "{roll} {pitch}: {lift}");
    }
}

/// Two metres up, looking along a heading.
fn standing(heading: f64) -> ControlReference {
    let still = Vector3::zeros();
    let position = Point3::new(0.0, 0.0, 2.0);
    ControlReference { position, velocity: still, acceleration: still, heading, heading_rate: 0.0, lever: still }
}

/// From -177 to 177 degrees it is 6 degrees to the right, not 354 to the left; and 3 rad/s for each radian.
#[test]
fn the_body_turns_the_shorter_way() {
    use std::f64::consts::{PI, TAU};
    for (yaw, heading, way) in
        [(0.05 - PI, PI - 0.05, -0.1), (PI - 0.05, 0.05 - PI, 0.1), (0.2, 0.5 - TAU, 0.3), (3.0 * TAU, -0.4, -0.4)]
    {
        let position = Point3::new(0.0, 0.0, 2.0);
        let still = Vector3::zeros();
        let state = ControlState { position, velocity: still, attitude: [0.0, 0.0, yaw], disturbance: still };
        let mut mpc = TrackingMpc::new(VehicleModel::default(), MpcSettings::default()).unwrap();
        let command = mpc.command(0.0, &state, &|_| ControlReference { heading_rate: 0.02, ..standing(heading) });
        assert!((command.yaw_rate - 0.02 - 3.0 * way).abs() < 1e-9, "{} for {way} rad", command.yaw_rate);
    }
}

#[test]
fn a_controller_out_of_range_is_refused() {
    let refused = |vehicle, settings| matches!(TrackingMpc::new(vehicle, settings), Err(Error::Setting { .. }));
    let (vehicle, settings) = (VehicleModel::default(), MpcSettings::default());
    assert!(refused(VehicleModel { tilt_limit: 2.0, ..vehicle }, settings));
    assert!(refused(VehicleModel { thrust: [5.0, 4.0], ..vehicle }, settings));
    assert!(refused(VehicleModel { drag: [f64::NAN, 0.0], ..vehicle }, settings));
    assert!(refused(vehicle, MpcSettings { steps: 1, ..settings }));
    assert!(refused(vehicle, MpcSettings { tilt: 0.0, ..settings }));
}
