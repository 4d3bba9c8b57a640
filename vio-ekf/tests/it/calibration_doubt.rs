//! A calibration that the images contradict is named, a sound one is not.

use vio_ekf::imu_check::validate_samples;
use vio_ekf::nalgebra::Vector3;
use vio_ekf::run::{CalibrationPart, RecordedFrame, Run, Runner, RunnerSettings, check_calibration};
use vio_ekf::sim::{
    Frame, RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, camera_ahead_right, painting_flight,
    swaying_flight,
};
use vio_ekf::{Camera, Imu, ImuNoise, Settings, Vio};

/// A flight along a wall, seen by two cameras.
fn flight(seed: u64) -> Simulation {
    let cameras = [camera_ahead(), camera_ahead_right()];
    let cameras = cameras.map(|camera| SimulatedCamera { camera, ..SimulatedCamera::default() }).to_vec();
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    Simulation::new(painting_flight(seed, 16.0).unwrap(), Scenario { seed, cameras, room, ..Scenario::default() })
        .unwrap()
}

/// All frames of one camera: what takes longest is done once.
fn frames(simulation: &Simulation, camera: usize, count: usize) -> Vec<Frame> {
    (0..count).filter_map(|index| simulation.frame(camera, index).unwrap()).collect()
}

/// The first camera alone, taken for another one.
fn run(simulation: &Simulation, seen: &[Frame], camera: Camera, settings: RunnerSettings) -> Run {
    let mut runner = Runner::new(Vio::new(camera, ImuNoise::default(), Settings::default()).unwrap(), settings);
    let mut samples = simulation.imu(0).unwrap().samples.into_iter();
    for frame in seen {
        runner.imu_until(frame.stamp, &mut samples).unwrap();
        runner.image(frame.stamp, &frame.view()).unwrap();
    }
    runner.finish().unwrap()
}

#[test]
fn a_wrong_focal_length_is_named_with_the_right_one_and_a_sound_one_is_not() {
    let (simulation, sound) = (flight(3), camera_ahead());
    let seen = frames(&simulation, 0, simulation.frame_count(0));
    assert_eq!(run(&simulation, &seen, sound, RunnerSettings::default()).doubt, None);
    let wrong = Camera { fx: 1.04 * sound.fx, fy: 1.04 * sound.fy, ..sound };
    let doubt = run(&simulation, &seen, wrong, RunnerSettings::default()).doubt.expect("4 % of focal length");
    assert_eq!(doubt.parts, [CalibrationPart::FocalLength], "{doubt}");
    let found = doubt.found.and_then(|found| found.camera).unwrap();
    assert!((found.fx / sound.fx - 1.0).abs() < 0.01 && (found.fy / sound.fy - 1.0).abs() < 0.01, "{doubt}");
    let unwatched = RunnerSettings { watch_calibration: false, ..RunnerSettings::default() };
    assert_eq!(run(&simulation, &seen, wrong, unwatched).doubt, None);
}

/// A flight that turns about all axes, with a gyroscope that reads each rate as it is, and then 2 % too much of it.
#[test]
fn a_gyroscope_out_of_scale_is_named_and_put_right() {
    let phases = [0.3, 1.7, 2.9, 4.4].map(|phase| Vector3::new(phase, phase + 1.1, phase + 2.3));
    let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    let scenario = Scenario { seed: 8, cameras, room, ..Scenario::default() };
    let simulation = Simulation::new(swaying_flight(&phases, 22.0).unwrap(), scenario).unwrap();
    let seen = frames(&simulation, 0, simulation.frame_count(0));
    let sound = simulation.imu(0).unwrap().samples;
    let checked = |samples: &[Imu]| {
        let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default()).unwrap();
        check_calibration(&vio, samples, || seen.iter().map(|frame| RecordedFrame::single(frame.stamp, frame.clone())))
    };
    assert_eq!(checked(&sound), None);

    let mut scaled: Vec<Imu> = sound.iter().map(|imu| Imu { gyro: 1.02 * imu.gyro, ..*imu }).collect();
    let doubt = checked(&scaled).expect("2 % of the gyroscope");
    assert!(doubt.parts.contains(&CalibrationPart::Gyroscope), "{doubt}");
    for _ in 0..3 {
        if let Some(doubt) = checked(&scaled) {
            doubt.correct_samples(&mut scaled);
        }
    }
    let most = sound.iter().zip(&scaled).map(|(a, b)| (a.gyro - b.gyro).norm() / a.gyro.norm()).fold(0.0, f64::max);
    assert!(most < 0.006, "{most}");
}

/// What is found of a pair's first camera is found without the second.
#[test]
fn the_first_of_two_cameras_is_put_right_first() {
    let (simulation, sound) = (flight(3), camera_ahead());
    let [left, right] = [0, 1].map(|camera| frames(&simulation, camera, simulation.frame_count(camera)));
    let samples = simulation.imu(0).unwrap().samples;
    let checked = |first: Camera| {
        let vio = Vio::stereo(first, camera_ahead_right(), ImuNoise::default(), Settings::default()).unwrap();
        let pair = |(left, right): (&Frame, &Frame)| RecordedFrame {
            stamp: left.stamp,
            picture: Ok(left.clone()),
            second: Some(Ok(right.clone())),
        };
        check_calibration(&vio, &samples, || left.iter().zip(&right).map(pair))
    };
    assert_eq!(checked(sound), None);
    let doubt = checked(Camera { fx: 1.04 * sound.fx, fy: 1.04 * sound.fy, ..sound }).expect("4 % of focal length");
    assert_eq!(doubt.parts, [CalibrationPart::FocalLength], "{doubt}");
    assert!(doubt.found.is_some_and(|found| found.second_camera.is_none()), "{doubt}");
}

#[test]
fn exchanged_images_of_two_cameras_are_named() {
    let simulation = flight(4);
    let [left, right] = [0, 1].map(|camera| frames(&simulation, camera, 120));
    let doubt = |[first, second]: [&[Frame]; 2]| {
        let vio = Vio::stereo(camera_ahead(), camera_ahead_right(), ImuNoise::default(), Settings::default()).unwrap();
        let mut runner = Runner::new(vio, RunnerSettings::default());
        let mut samples = simulation.imu(0).unwrap().samples.into_iter();
        for ((first, second), frame) in first.iter().zip(second).zip(&left) {
            runner.imu_until(frame.stamp, &mut samples).unwrap();
            runner.image_pair(frame.stamp, &first.view(), &second.view()).unwrap();
        }
        runner.finish().ok().and_then(|run| run.doubt)
    };
    assert_eq!(doubt([&right, &left]).expect("exchanged").parts, [CalibrationPart::CameraOrder]);
    assert_eq!(doubt([&left, &right]), None);
}

#[test]
fn an_accelerometer_that_is_cut_off_is_named_with_its_range() {
    let mut samples = flight(5).imu(0).unwrap().samples;
    let said = |samples: &[vio_ekf::Imu]| {
        let found = validate_samples(samples, 200.0, 9.81).unwrap();
        found.warnings.iter().map(ToString::to_string).filter(|warning| warning.contains("clipped")).collect::<Vec<_>>()
    };
    assert_eq!(said(&samples), Vec::<String>::new());
    for sample in &mut samples {
        sample.accel.z = sample.accel.z.min(9.9);
    }
    let said = said(&samples);
    assert!(said.len() == 1 && said[0].contains("9.90"), "{said:?}");
}
