//! Images of a driver's own type: one method. The one-call form and the streaming one are the same run.

use vio_ekf::run::{Picture, RecordedFrame, Runner, RunnerSettings, run_recording};
use vio_ekf::sim::camera_ahead;
use vio_ekf::{ImageView, ImuNoise, Settings, Vio};

use crate::run::flight;

/// What a driver gives: a header, then the pixels.
struct Message {
    bytes: Vec<u8>,
}

const HEADER: usize = 16;

impl Picture for Message {
    fn view(&self) -> ImageView<'_> {
        ImageView { width: 752, height: 480, data: &self.bytes[HEADER..] }
    }
}

#[test]
fn images_of_any_type_are_run() {
    let driver = flight(2.0);
    let samples = driver.imu(0).unwrap().samples;
    let vio = || Vio::new(camera_ahead(), ImuNoise::default(), Settings::default()).unwrap();
    let message = |data: &[u8]| Message { bytes: [&[0; HEADER], data].concat() };
    let frames = driver.frames(0).map(|frame| {
        let frame = frame.unwrap();
        RecordedFrame::single(frame.stamp, message(&frame.data))
    });
    let recorded = run_recording(vio(), samples.iter().copied(), frames).unwrap();

    let mut runner = Runner::new(vio(), RunnerSettings::default());
    let mut next = samples.iter();
    for frame in driver.frames(0) {
        let frame = frame.unwrap();
        while runner.latest_sample().is_none_or(|latest| latest < runner.imu_time(frame.stamp)) {
            runner.imu(next.next().unwrap()).unwrap();
        }
        runner.image(frame.stamp, &frame.view()).unwrap();
    }
    assert_eq!(runner.finish().unwrap(), recorded);
    assert!(recorded.poses() > 10, "{}", recorded.poses());
}
