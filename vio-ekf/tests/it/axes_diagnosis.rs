//! Samples whose axes are read otherwise than they lie: the images tell how they lie.

use crate::run::flight;
use vio_ekf::imu_check::{AxesDiagnosis, MisreadSensor, diagnose_axes};
use vio_ekf::nalgebra::{Matrix3, Vector3};
use vio_ekf::run::RecordedFrame;
use vio_ekf::sim::{Frame, camera_ahead};
use vio_ekf::{Imu, ImuNoise, Settings, Vio};

fn diagnosis(samples: &[Imu], frames: &[Frame]) -> Option<AxesDiagnosis> {
    let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default()).unwrap();
    let frames = frames.iter().map(|frame| RecordedFrame::single(frame.stamp, frame.clone()));
    diagnose_axes(&vio, samples, frames, 2)
}

#[test]
fn a_gyroscope_with_exchanged_axes_is_found_and_sound_samples_are_left_alone() {
    let simulation = flight(6.0);
    let frames: Vec<Frame> =
        (0..simulation.frame_count(0)).filter_map(|index| simulation.frame(0, index).unwrap()).collect();
    let sound = simulation.imu(0).unwrap().samples;
    assert_eq!(diagnosis(&sound, &frames), None);
    let exchanged: Vec<Imu> =
        sound.iter().map(|imu| Imu { gyro: Vector3::new(imu.gyro.y, imu.gyro.x, imu.gyro.z), ..*imu }).collect();
    let found = diagnosis(&exchanged, &frames).expect("x and y are exchanged");
    assert_eq!(found.sensor, MisreadSensor::Gyroscope);
    // Exchanged once more they are what they were.
    assert_eq!(found.axes, Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0));
    assert!(found.followed > 0.5 && found.followed_as_given < 0.5 * found.followed, "{found}");
}
