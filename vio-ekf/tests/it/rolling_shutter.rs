//! A shutter that exposes row after row: the simulator's images, and the filter that knows of it or does not.

use crate::support::sequences::drawn_start;
use vio_ekf::eval::{Alignment, ate};
use vio_ekf::filter::CalibrationSettings;
use vio_ekf::format::calibration::CameraCalibration;
use vio_ekf::run::{CalibrationPart, RecordedFrame, check_calibration};
use vio_ekf::sim::{
    Frame, Photometry, RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight,
};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Error, ImuNoise, Settings, Trajectory, Vio};

const READOUT: f64 = 0.03;
const HEIGHT: usize = 240;

fn lens() -> Camera {
    Camera { width: 376, height: HEIGHT, fx: 229.3, fy: 228.6, cx: 183.4, cy: 123.9, ..camera_ahead() }
}

fn simulation(spline: Spline, readout: f64, photometry: Photometry, rate_hz: f64) -> Simulation {
    let camera = lens();
    let model = SimulatedCamera {
        camera,
        photometry,
        rate_hz,
        row_time_s: readout / HEIGHT as f64,
        ..SimulatedCamera::default()
    };
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    Simulation::new(spline, Scenario { seed: 4, cameras: vec![model], room, ..Scenario::default() }).unwrap()
}

/// The first row of an image is that of a global shutter at its start, the last row that of one at its end.
#[test]
fn each_row_is_seen_at_its_own_time() {
    // Without exposure and noise, so that images of the same time are the same; in flight, where it turns.
    let still = Photometry { exposure_s: 0.0, read_noise: 0.0, shot_noise: 0.0, poses: 1, ..Photometry::default() };
    let spline = || painting_flight(3, 12.0).unwrap();
    let rolling = simulation(spline(), READOUT, still.clone(), 1.0 / READOUT);
    let global = simulation(spline(), 0.0, still, 1.0 / READOUT);
    let row = |frame: &Frame, row: usize| -> Vec<f64> {
        frame.data[row * frame.width..][..frame.width].iter().map(|&value| f64::from(value)).collect()
    };
    let (mut right, mut wrong) = (0.0, 0.0);
    // The middle of the rolling image k is between the global images k and k + 1.
    for k in 150..200 {
        let frame = rolling.frame(0, k).unwrap().unwrap();
        let [before, after] = [k, k + 1].map(|k| global.frame(0, k).unwrap().unwrap());
        assert!((frame.true_stamp.secs_since(before.true_stamp) - 0.5 * READOUT).abs() < 1e-6);
        let difference = |at: usize, other: &Frame| -> f64 {
            row(&frame, at).iter().zip(row(other, at)).map(|(a, b)| (a - b).abs()).sum::<f64>()
        };
        right += difference(0, &before) + difference(HEIGHT - 1, &after);
        wrong += difference(0, &after) + difference(HEIGHT - 1, &before);
    }
    assert!(right < 0.1 * wrong, "{right} {wrong}");
}

/// Absolute trajectory error of a flight, m, and its filter in the end.
fn fly(readout: f64, calibration: CalibrationSettings) -> (f64, Vio) {
    let simulation = simulation(painting_flight(2, 12.0).unwrap(), readout, Photometry::default(), 20.0);
    let mut vio = Vio::new(lens(), ImuNoise::default(), Settings { calibration, ..Settings::default() }).unwrap();
    let mut frames = simulation.frames(0).map(Result::unwrap).peekable();
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    for (k, sample) in simulation.imu(0).unwrap().samples.iter().enumerate() {
        vio.imu(sample).unwrap();
        if k == 0 {
            vio.initialize(&drawn_start(&simulation, sample.stamp, 3)).unwrap();
        }
        while let Some(frame) = frames.next_if(|frame| frame.stamp <= sample.stamp) {
            vio.image(frame.stamp, &frame.view()).unwrap();
            let Some(odometry) = vio.output().filter(|o| o.stamp <= simulation.spline().span().1) else { continue };
            if estimate.span().is_none_or(|(_, last)| odometry.stamp > last) {
                estimate.push(odometry.stamp, odometry.world_from_body).unwrap();
                truth.push(odometry.stamp, simulation.motion(odometry.stamp).unwrap().world_from_body).unwrap();
            }
        }
    }
    (ate(truth.poses(), estimate.poses(), Alignment::Se3).unwrap().position.rmse, vio)
}

fn told(readout: f64) -> CalibrationSettings {
    CalibrationSettings { row_time_s: readout / HEIGHT as f64, ..CalibrationSettings::default() }
}

#[test]
fn a_shutter_that_is_known_costs_nothing_and_one_that_is_not_does() {
    let [global, known, ignored] =
        [(0.0, 0.0), (READOUT, READOUT), (READOUT, 0.0)].map(|(readout, said)| fly(readout, told(said)).0);
    eprintln!("ATE {:.1} mm, rolling {:.1} mm, not told {:.1} mm", 1e3 * global, 1e3 * known, 1e3 * ignored);
    assert!(known < 1.5 * global + 1e-3, "{known} {global}");
    assert!(ignored > 3.0 * known, "{ignored} {known}");
}

/// From a global shutter, and from one that reads upwards, two deviations away.
#[test]
fn a_read_out_that_is_not_told_is_found() {
    let right = READOUT / HEIGHT as f64;
    let known = fly(READOUT, told(READOUT)).0;
    for given in [0.0, -READOUT] {
        let (error, vio) = fly(READOUT, CalibrationSettings { row_time_sigma_s: right, ..told(given) });
        let found = vio.calibration().unwrap();
        let off = found.row_time_s - right;
        let (all, sigma) = (READOUT / right, found.row_time_sigma_s);
        eprintln!("off by {:.2} ms, sigma {:.2} ms, ATE {error:.4} m", 1e3 * off * all, 1e3 * sigma * all);
        // Of 30 ms; a deviation that shrinks as it has to.
        assert!(off.abs() < 0.05 * right && sigma < 0.02 * right, "{off} {sigma}");
        assert!(error < 1.5 * known + 1e-3, "{error} {known}");
    }
}

/// By the second filter, and put right by what it says: then there is nothing to say.
#[test]
fn a_rolling_shutter_that_is_taken_for_a_global_one_is_named() {
    let seen = simulation(painting_flight(3, 22.0).unwrap(), READOUT, Photometry::default(), 20.0);
    let frames: Vec<Frame> = seen.frames(0).map(Result::unwrap).collect();
    let samples = seen.imu(0).unwrap().samples;
    let checked = |camera: &CameraCalibration| {
        let calibration = CalibrationSettings { row_time_s: camera.row_time_s, ..CalibrationSettings::default() };
        let settings = Settings { calibration, ..Settings::default() };
        let vio = Vio::new(camera.camera, ImuNoise::default(), settings).unwrap();
        check_calibration(&vio, &samples, || {
            frames.iter().map(|frame| RecordedFrame::single(frame.stamp, frame.clone()))
        })
    };
    let mut camera = CameraCalibration { camera: lens(), rate_hz: None, time_offset_s: 0.0, row_time_s: 0.0 };
    let doubt = checked(&camera).expect("30 ms of read-out");
    assert_eq!(doubt.parts, [CalibrationPart::RollingShutter], "{doubt}");
    doubt.correct(std::slice::from_mut(&mut camera));
    assert!((camera.row_time_s * HEIGHT as f64 - READOUT).abs() < 2e-3, "{doubt}");
    assert_eq!(checked(&camera), None);
}

#[test]
fn what_a_shutter_cannot_be_is_refused() {
    let with = |row_time_s: f64| Settings {
        calibration: CalibrationSettings { row_time_s, ..CalibrationSettings::default() },
        ..Settings::default()
    };
    let name = |result: Result<Vio, Error>| match result {
        Err(Error::InvalidSetting { name, .. }) => name,
        other => panic!("{:?}", other.err()),
    };
    let noise = ImuNoise::default();
    for bad in [0.01, f64::NAN, f64::INFINITY] {
        assert_eq!(name(Vio::new(Camera::euroc(), noise, with(bad))), "row_time_s");
    }
    assert!(Vio::new(Camera::euroc(), noise, with(-6e-5)).is_ok(), "a camera that hangs upside down");
    assert_eq!(name(Vio::stereo(Camera::euroc(), Camera::euroc_right(), noise, with(6e-5))), "row_time_s");
}

/// Kalibr's name of it, and back.
#[cfg(feature = "yaml")]
#[test]
fn files_say_how_long_a_row_takes() {
    use vio_ekf::format::calibration::{ImuCalibration, read_asl_camera, write_asl_camera};

    let global = CameraCalibration { camera: Camera::euroc(), rate_hz: None, time_offset_s: 0.0, row_time_s: 0.0 };
    assert!(!write_asl_camera(&global).contains("line_delay"));
    let rolling = CameraCalibration { row_time_s: 2.5e-5, ..global };
    let read = read_asl_camera(&write_asl_camera(&rolling)).unwrap();
    assert_eq!(read.row_time_s, 2.5e-5);
    let imu = ImuCalibration {
        noise: ImuNoise::default(),
        rate_hz: 200.0,
        body_from_imu: vio_ekf::nalgebra::Isometry3::identity(),
    };
    assert!(Vio::from_calibration(&[read], &imu, Settings::default()).is_ok());
    let slow = CameraCalibration { row_time_s: 0.5, ..read };
    assert!(matches!(
        Vio::from_calibration(&[slow], &imu, Settings::default()),
        Err(Error::InvalidSetting { name: "row_time_s", .. })
    ));
}
