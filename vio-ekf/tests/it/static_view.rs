//! A part of the vehicle in view: it is named, and the sensors are not blamed for it.

use crate::run::flight;
use vio_ekf::imu_check::{ImuWarning, check_axes_with_images};
use vio_ekf::nalgebra::Vector3;
use vio_ekf::run::RecordedFrame;
use vio_ekf::sim::{Frame, camera_ahead};
use vio_ekf::{ImageView, Imu, Stamp};

/// Grey values that have corners and hang on the place alone.
fn painted(x: usize, y: usize) -> u8 {
    let cell = (x / 24).wrapping_mul(7919).wrapping_add((y / 24).wrapping_mul(104_729));
    40 + (cell.wrapping_mul(2_654_435_761) >> 7) as u8 % 170
}

/// Samples and images of a flight.
fn recording(seconds: f64) -> (Vec<Imu>, Vec<Frame>) {
    let simulation = flight(seconds);
    let frames = (0..simulation.frame_count(0)).filter_map(|index| simulation.frame(0, index).unwrap()).collect();
    (simulation.imu(0).unwrap().samples, frames)
}

/// The rows from `first` on covered by what moves with the camera.
fn covered(frames: &[Frame], first: usize) -> Vec<Frame> {
    let mut frames = frames.to_vec();
    for frame in &mut frames {
        for y in first..frame.height {
            for x in 0..frame.width {
                frame.data[y * frame.width + x] = painted(x, y);
            }
        }
    }
    frames
}

fn warnings_beside(mask: Option<&ImageView>, samples: &[Imu], frames: &[Frame]) -> Vec<ImuWarning> {
    let frames = frames.iter().map(|frame| RecordedFrame::single(frame.stamp, frame.clone()));
    check_axes_with_images(samples, frames, (&camera_ahead(), mask), (9.81, 0.0)).unwrap()
}

fn warnings(samples: &[Imu], frames: &[Frame]) -> Vec<ImuWarning> {
    warnings_beside(None, samples, frames)
}

/// Exchanged axes of the gyroscope are still seen in what is left of the image.
#[test]
fn what_moves_with_the_camera_is_named_and_no_sensor_is_blamed_for_it() {
    let (samples, whole) = recording(6.0);
    assert_eq!(warnings(&samples, &whole), []);

    let half = covered(&whole, whole[0].height / 2);
    let found = warnings(&samples, &half);
    let [ImuWarning::StaticView { share, low, high }] = found[..] else { panic!("{found:?}") };
    assert!(share > 0.2 && share < 0.95, "{found:?}");
    assert!(low[1] > 232.0 && high[1] < 480.0, "{found:?}");
    assert!(found[0].to_string().contains("--mask"), "{}", found[0]);

    // With the mask that is asked for there is nothing more to say.
    let (width, height) = (whole[0].width, whole[0].height);
    let mask: Vec<u8> = (0..width * height).map(|k| if k / width < height / 2 { 255 } else { 0 }).collect();
    let mask = ImageView::new(width, height, &mask).unwrap();
    assert_eq!(warnings_beside(Some(&mask), &samples, &half), []);

    let quarter = covered(&whole, 360);
    let exchanged: Vec<Imu> =
        samples.iter().map(|imu| Imu { gyro: Vector3::new(imu.gyro.y, imu.gyro.x, imu.gyro.z), ..*imu }).collect();
    let found = warnings(&exchanged, &quarter);
    assert!(matches!(found[0], ImuWarning::StaticView { .. }), "{found:?}");
    assert!(matches!(found[1], ImuWarning::Images { sensor: "gyroscope", .. }), "{found:?}");
}

/// A sensor that lies still, its bias 1.1 degrees a second to one side and then to the other, sees a scene that stands still, as it should.
#[test]
fn standing_still_is_not_a_static_view() {
    let (_, scene) = recording(0.1);
    let frame = |k: i64| Frame { stamp: Stamp::from_nanos(50_000_000 * k), ..scene[0].clone() };
    let frames: Vec<Frame> = (0..120).map(frame).collect();
    let sample = |k: i64| Imu {
        stamp: Stamp::from_nanos(5_000_000 * k),
        gyro: Vector3::new(if k < 600 { 0.02 } else { -0.02 }, 0.0, 0.0),
        accel: Vector3::new(0.0, 0.0, 9.81),
    };
    let samples: Vec<Imu> = (0..1200).map(sample).collect();
    let found = warnings(&samples, &frames);
    assert!(!found.iter().any(|warning| matches!(warning, ImuWarning::StaticView { .. })), "{found:?}");
}
