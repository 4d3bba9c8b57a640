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
fn quantised_commands_stay_within_limits_that_no_step_hits() {
    // Seven steps of 0.03 from -0.1 lead to 0.11, beyond the limit.
    let settings = ServoSettings {
        resolution: 0.03,
        limits: Range::symmetric(0.1),
        time_constant: 0.0,
        dead_time: 0.0,
        max_rate: 1e6,
    };
    let mut servo = Servo::new(settings, 0.0).unwrap();
    assert_eq!(servo.quantise(0.5), 0.1);
    assert_eq!(servo.step(0.1, 1.0), 0.1);
    assert!((servo.quantise(0.06) - 0.05).abs() < 1e-12);
    assert_eq!(servo.quantise(-0.5), -0.1);
}

#[test]
fn the_delay_is_dead_time_and_time_constant() {
    let servo = Servo::new(ServoSettings { dead_time: 0.02, ..plain() }, 0.1).unwrap();
    assert!((servo.delay() - 0.07).abs() < 1e-15);
    assert_eq!(servo.angle(), 0.1);
    assert_eq!(servo.settings().dead_time, 0.02);
    // Beyond the limits the servo starts at them.
    assert_eq!(Servo::new(plain(), 5.0).unwrap().angle(), 2.0);
}

#[test]
fn commands_in_one_step_take_effect_one_after_the_other() {
    // A command at t = 0 is due at 0.02, one at 0.01 at 0.03; the step from 0.01 to 0.06 holds both.
    let mut servo = Servo::new(ServoSettings { dead_time: 0.02, max_rate: 1e6, ..plain() }, 0.0).unwrap();
    servo.step(1.0, 0.01);
    let angle = servo.step(-1.0, 0.05);
    let first = 1.0 - (-0.01_f64 / 0.05).exp();
    let expected = -1.0 + (first + 1.0) * (-0.03_f64 / 0.05).exp();
    assert!((angle - expected).abs() < 1e-12, "{angle} {expected}");
}

#[test]
fn bad_settings_are_named() {
    for (name, settings) in [
        ("resolution", ServoSettings { resolution: -1e-3, ..plain() }),
        ("time_constant", ServoSettings { time_constant: f64::NAN, ..plain() }),
        ("dead_time", ServoSettings { dead_time: -0.1, ..plain() }),
        ("max_rate", ServoSettings { max_rate: f64::INFINITY, ..plain() }),
    ] {
        assert!(
            matches!(Servo::new(settings, 0.0), Err(Error::InvalidSetting { name: found, .. }) if found == name),
            "{name}"
        );
    }
    let limits = Range { min: f64::NAN, max: 1.0 };
    assert!(matches!(Servo::new(ServoSettings { limits, ..plain() }, 0.0), Err(Error::NonFinite { .. })));
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

#[test]
fn a_servo_never_leaves_its_limits_and_never_outruns_its_rate() {
    // Any settings, any commands, any steps (splitmix64).
    let mut state = 3_u64;
    let mut uniform = move |low: f64, high: f64| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..500 {
        let limits = Range { min: uniform(-2.0, 0.0), max: uniform(0.0, 2.0) };
        let settings = ServoSettings {
            resolution: uniform(-0.05, 0.1).max(0.0),
            max_rate: uniform(0.1, 10.0),
            time_constant: uniform(-0.02, 0.1).max(0.0),
            dead_time: uniform(-0.02, 0.1).max(0.0),
            limits,
        };
        let mut servo = Servo::new(settings, uniform(-3.0, 3.0)).unwrap();
        for _ in 0..50 {
            let (command, dt) = (uniform(-3.0, 3.0), uniform(0.0, 0.05));
            let before = servo.angle();
            let angle = servo.step(command, dt);
            assert!(limits.contains(angle), "{angle} outside {limits:?} with {settings:?}");
            assert!((angle - before).abs() <= settings.max_rate * dt + 1e-12, "{settings:?}");
            let goal = servo.quantise(command);
            assert!(limits.contains(goal) && servo.quantise(goal) == goal, "{settings:?}");
        }
    }
}
