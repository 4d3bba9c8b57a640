//! The odometry's protocol: what starts and ends a segment, what is taken back, skipped and refused.

use vio_ekf::inertial::DivergenceCause;
use vio_ekf::run::{
    Event, Loss, LossReason, RecordedFrame, Run, Runner, RunnerSettings, SkipReason, pair_by_stamp, run_recording,
};
use vio_ekf::sim::{Frame, RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
use vio_ekf::{Camera, Error, ImageView, Imu, ImuNoise, Settings, Stamp, Vio};

/// A flight along a wall, seen by a camera.
pub(crate) fn flight(seconds: f64) -> Simulation {
    let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    let scenario = Scenario { cameras, room, ..Scenario::default() };
    Simulation::new(painting_flight(1, seconds).unwrap(), scenario).unwrap()
}

const SIZE: (usize, usize) = (160, 120);

fn at(millis: i64) -> Stamp {
    Stamp::from_nanos(millis * 1_000_000)
}

fn still(millis: i64) -> Imu {
    Imu { stamp: at(millis), gyro: [0.0; 3].into(), accel: [0.0, 0.0, 9.81].into() }
}

fn tiles() -> Vec<u8> {
    let bright = |k: usize| k % SIZE.0 % 24 < 12 && k / SIZE.0 % 24 < 12;
    (0..SIZE.0 * SIZE.1).map(|k| if bright(k) { 180 } else { 60 }).collect()
}

fn small() -> Vio {
    let camera = Camera { width: SIZE.0, height: SIZE.1, fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, ..Camera::euroc() };
    Vio::new(camera, ImuNoise::default(), Settings::default()).unwrap()
}

/// At rest, with a pause of the inertial samples from 3.0 to 3.6 s, and images every 50 ms, until 6 s.
fn pause(settings: RunnerSettings) -> (Vec<Event>, Run) {
    let (mut runner, mut events, picture) = (Runner::new(small(), settings), Vec::new(), tiles());
    for millis in (0..6000).step_by(5) {
        if !(3000..3600).contains(&millis) {
            events.extend(runner.imu(&still(millis)).unwrap());
        }
        if millis % 50 == 0 {
            let view = ImageView::new(SIZE.0, SIZE.1, &picture).unwrap();
            events.extend(runner.image(at(millis), &view).unwrap().events);
        }
    }
    (events, runner.finish().unwrap())
}

#[test]
fn a_gap_ends_a_segment_and_a_new_one_begins() {
    let (events, run) = pause(RunnerSettings::default());
    let loss = Loss { stamp: at(3600), reason: LossReason::ImuGap { gap_s: 0.605 } };
    let kept = |event: &&Event| !matches!(event, Event::Skipped(_));
    let others: Vec<_> = events.iter().filter(kept).cloned().collect();
    assert_eq!(others, [Event::Started, Event::Lost(loss), Event::Started]);
    assert_eq!((run.segments.len(), &run.lost[..], run.withdrawn), (2, &[loss][..], 0));
    let span = |segment: usize| run.segments[segment].trajectory().unwrap().span().unwrap();
    assert!(span(0).1 <= at(3000) && span(1).0 >= at(3600), "{:?} {:?}", span(0), span(1));
    // Images of the pause are further ahead of the samples than a tenth of a second, but for the first two.
    assert!(run.skipped.iter().all(|image| matches!(image.reason, SkipReason::Refused(Error::OutOfRange { .. }))));
    assert!((8..=11).contains(&run.skipped.len()), "{}", run.skipped.len());
    // A gap that is allowed interrupts nothing.
    let (events, run) = pause(RunnerSettings { max_imu_gap_s: 0.7, ..RunnerSettings::default() });
    assert_eq!((events[0].clone(), run.segments.len(), run.lost.len()), (Event::Started, 1, 0));
}

#[test]
fn a_broken_sample_after_a_gap_ends_no_segment() {
    let (mut runner, picture) = (Runner::new(small(), RunnerSettings::default()), tiles());
    for millis in (0..3000).step_by(5) {
        runner.imu(&still(millis)).unwrap();
        if millis % 50 == 0 {
            runner.image(at(millis), &ImageView::new(SIZE.0, SIZE.1, &picture).unwrap()).unwrap();
        }
    }
    assert!(runner.output().is_some());
    let broken = Imu { accel: [f64::NAN; 3].into(), ..still(4000) };
    assert!(matches!(runner.imu(&broken), Err(Error::NonFinite { .. })));
    assert!(runner.output().is_some(), "a sample that is left out has no gap before it");
}

#[test]
fn without_a_history_the_events_and_counts_are_the_same() {
    let (events, run) = pause(RunnerSettings::default());
    let (told, bare) = pause(RunnerSettings { keep_history: false, ..RunnerSettings::default() });
    assert_eq!(told, events);
    let counts = |run: &Run| (run.frames, run.imu_samples, run.initialization_time_s, run.calibration);
    assert_eq!(counts(&bare), counts(&run));
    assert!(bare.segments.is_empty() && bare.lost.is_empty() && bare.skipped.is_empty());
}

/// The flight, of which the images from one on are those of the way there, backwards.
fn contradicted(seconds: f64, wrong: usize) -> (Vec<Stamp>, Result<Run, Error>) {
    let driver = flight(seconds);
    let frames: Vec<Frame> = driver.frames(0).map(Result::unwrap).collect();
    let shown = frames.iter().enumerate().map(|(k, frame)| {
        let data = &frames[if k < wrong { k } else { (2 * wrong).saturating_sub(k + 12) }].data;
        RecordedFrame::single(frame.stamp, Frame { data: data.clone(), ..frame.clone() })
    });
    let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default()).unwrap();
    let run = run_recording(vio, driver.imu(0).unwrap().samples, shown);
    (frames.iter().map(|frame| frame.stamp).collect(), run)
}

#[test]
fn poses_that_the_images_contradict_are_taken_back() {
    let (stamps, run) = contradicted(8.0, 120);
    let run = run.unwrap();
    let diverged = LossReason::Diverged(DivergenceCause::ConsecutiveOutliers);
    assert!(run.withdrawn > 0 && run.lost[0].reason == diverged, "{} {:?}", run.withdrawn, run.lost);
    let last = run.segments[0].estimates.last().unwrap().odometry.stamp;
    assert!(last <= stamps[121], "a pose at {last}, the images are wrong from {} on", stamps[120]);
    // So soon after a start in motion it is the start that was wrong: nothing of it is left.
    let (_, never) = contradicted(3.0, 40);
    assert!(matches!(never, Err(Error::NeverStarted { .. })), "{never:?}");
}

#[test]
fn images_that_cannot_be_are_skipped_and_said() {
    let picture = tiles();
    let (right, wrong) = (ImageView::new(160, 120, &picture).unwrap(), ImageView::new(120, 160, &picture).unwrap());
    let mut runner = Runner::new(small(), RunnerSettings::default());
    runner.imu(&still(0)).unwrap();
    // The first image decides whether it is the calibration that is wrong.
    assert!(matches!(runner.image(at(0), &wrong), Err(Error::ImageSize { .. })));
    runner.image(at(0), &right).unwrap();
    let reasons = |runner: &mut Runner, frame: RecordedFrame<ImageFrame>| -> Vec<SkipReason> {
        let events = runner.frame(&frame).unwrap().events;
        events
            .into_iter()
            .filter_map(|e| if let Event::Skipped(image) = e { Some(image.reason) } else { None })
            .collect()
    };
    let frame = |millis, picture| RecordedFrame { stamp: at(millis), picture, second: None };
    let found = reasons(&mut runner, frame(50, Ok(ImageFrame(120, 160, picture.clone()))));
    assert!(matches!(found[..], [SkipReason::Refused(Error::ImageSize { .. })]));
    let found = reasons(&mut runner, frame(0, Ok(ImageFrame(160, 120, picture.clone()))));
    assert_eq!(found, [SkipReason::NotIncreasing]);
    assert_eq!(reasons(&mut runner, frame(60, Err("gone".into()))), [SkipReason::Unreadable("gone".into())]);
    assert_eq!(
        runner.finish().unwrap_err().to_string(),
        "the odometry never started: there was no second of rest to start from, and no motion that tells the scale"
    );
    let empty = Runner::new(small(), RunnerSettings::default()).finish();
    assert_eq!(empty.unwrap_err(), Error::NoImage { given: 0, first: "there is none".into() });
}

#[derive(Debug)]
struct ImageFrame(usize, usize, Vec<u8>);

impl vio_ekf::run::Picture for ImageFrame {
    fn view(&self) -> ImageView<'_> {
        ImageView { width: self.0, height: self.1, data: &self.2 }
    }
}

#[test]
fn images_of_two_cameras_are_paired_by_their_stamps() {
    let first = [0, 50, 100, 150].map(|millis| (at(millis), millis));
    // Early by less and by more than a millisecond, one between two of the first, one missing.
    let second = [(0, "a"), (49, "b"), (70, "c"), (98, "d"), (151, "e")].map(|(millis, name)| (at(millis), name));
    let pairs: Vec<_> = pair_by_stamp(first.into_iter(), second.into_iter(), 1e-3)
        .map(|(stamp, millis, second)| (stamp == at(millis), second.map(|(_, name)| name)))
        .collect();
    assert_eq!(pairs, [(true, Some("a")), (true, Some("b")), (true, None), (true, Some("e"))]);
}

/// An image is a tenth of a second later by the clock of the inertial sensor: samples are taken until then.
#[test]
fn samples_are_taken_until_an_image_by_their_own_clock() {
    let mut settings = Settings::default();
    settings.calibration.time_offset_s = 0.1;
    let camera = Camera { width: SIZE.0, height: SIZE.1, fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, ..Camera::euroc() };
    let mut runner = Runner::new(Vio::new(camera, ImuNoise::default(), settings).unwrap(), RunnerSettings::default());
    let mut samples = (0..3000).step_by(5).map(still);
    runner.imu_until(at(1000), &mut samples).unwrap();
    assert_eq!((runner.imu_time(at(1000)), runner.latest_sample()), (at(1100), Some(at(1100))));
    assert_eq!(samples.next().unwrap().stamp, at(1105));
}
