//! The servo against closed forms.

use ptu_kinematics::{Error, Range, Servo, ServoSettings};

fn plain() -> ServoSettings {
    ServoSettings {
        resolution: 0.0,
        max_rate: 100.0,
        time_constant: 0.05,
        dead_time: 0.0,
        limits: Range::symmetric(2.0),
    }
}

#[test]
fn step_response_is_exponential_whatever_the_step_size() {
    for n in [1, 3, 50, 1000] {
        let mut servo = Servo::new(plain(), 0.0).unwrap();
        let mut angle = 0.0;
        for _ in 0..n {
            angle = servo.step(0.5, 0.1 / f64::from(n));
        }
        assert!((angle - 0.5 * (1.0 - (-2.0_f64).exp())).abs() < 1e-12, "{n} steps gave {angle}");
    }
}

#[test]
fn rate_limit_gives_a_ramp_and_then_an_exponential() {
    // Error 1 rad, rate 4 rad/s, lag 0.05 s: the ramp lasts until 0.2 rad are left, at t = 0.2 s.
    let mut servo = Servo::new(ServoSettings { max_rate: 4.0, ..plain() }, 0.0).unwrap();
    assert!((servo.step(1.0, 0.1) - 0.4).abs() < 1e-12);
    assert!((servo.step(1.0, 0.1) - 0.8).abs() < 1e-12);
    assert!((servo.step(1.0, 0.05) - (1.0 - 0.2 * (-1.0_f64).exp())).abs() < 1e-12);
}

#[test]
fn dead_time_shifts_the_response() {
    let mut servo = Servo::new(ServoSettings { dead_time: 0.02, ..plain() }, 0.0).unwrap();
    for _ in 0..20 {
        assert!(servo.step(0.5, 0.001).abs() < 1e-12);
    }
    let mut angle = 0.0;
    for _ in 0..50 {
        angle = servo.step(0.5, 0.001);
    }
    assert!((angle - 0.5 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{angle}");
}

#[test]
fn commands_are_quantised_and_clamped() {
    let settings = ServoSettings { time_constant: 0.0, dead_time: 0.0, max_rate: 1e6, ..ServoSettings::default() };
    let mut servo = Servo::new(settings, 0.0).unwrap();
    let step = (300.0_f64 / 1023.0).to_radians();
    for k in -300..300 {
        let command = 0.0013 * f64::from(k);
        let angle = servo.step(command, 1.0);
        assert!((angle - command).abs() <= step / 2.0 + 1e-12);
        let steps = (angle - settings.limits.min) / step;
        assert!((steps - steps.round()).abs() < 1e-6);
    }
    assert!((servo.step(10.0, 1.0) - 150.0_f64.to_radians()).abs() < 1e-12);
}

#[test]
fn bad_numbers_move_nothing() {
    let mut servo = Servo::new(ServoSettings::default(), 0.3).unwrap();
    assert_eq!(servo.step(f64::NAN, 1.0), 0.3);
    assert_eq!(servo.step(1.0, f64::NAN), 0.3);
    assert_eq!(servo.step(1.0, -1.0), 0.3);
    assert!(matches!(Servo::new(ServoSettings::default(), f64::NAN), Err(Error::NonFinite { .. })));
    let stuck = ServoSettings { max_rate: 0.0, ..ServoSettings::default() };
    assert!(matches!(Servo::new(stuck, 0.0), Err(Error::InvalidSetting { name: "max_rate", .. })));
}
