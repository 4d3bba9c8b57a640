//! An image measures so many landmarks and no more, and all of them in turn.

use std::collections::BTreeMap;

use crate::support::sequences::drawn_start;
use vio_ekf::filter::LandmarkSettings;
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
use vio_ekf::{Camera, ImuNoise, Settings, Vio};

#[test]
fn an_image_measures_no_more_landmarks_than_it_may() {
    let camera = Camera { width: 376, height: 240, fx: 229.3, fy: 228.6, cx: 183.4, cy: 123.9, ..camera_ahead() };
    let scenario = Scenario {
        seed: 4,
        cameras: vec![SimulatedCamera { camera, ..SimulatedCamera::default() }],
        room: RoomSettings { texture_size: 512, ..RoomSettings::default() },
        ..Scenario::default()
    };
    let simulation = Simulation::new(painting_flight(2, 5.0).unwrap(), scenario).unwrap();
    let samples = simulation.imu(0).unwrap().samples;
    for most in [6, 12] {
        let landmarks = LandmarkSettings { max_count: 30, max_measured: most, ..LandmarkSettings::default() };
        let settings = Settings { landmarks, ..Settings::default() };
        let mut vio = Vio::new(camera, ImuNoise::default(), settings).unwrap();
        let mut frames = simulation.frames(0).map(Result::unwrap).peekable();
        let (mut full, mut crowded, mut images) = (0, 0, 0);
        // Deviation of the inverse distance of each landmark in the first image that has it, and in the last.
        let mut first_and_last: BTreeMap<u64, (f64, f64, u32)> = BTreeMap::new();
        for (k, sample) in samples.iter().enumerate() {
            vio.imu(sample).unwrap();
            if k == 0 {
                vio.initialize(&drawn_start(&simulation, sample.stamp, 3)).unwrap();
            }
            while let Some(frame) = frames.next_if(|frame| frame.stamp <= sample.stamp) {
                let report = vio.image(frame.stamp, &frame.view()).unwrap();
                let measured = report.used + report.rejected;
                assert!(measured <= most, "{measured} landmarks measured, {most} allowed");
                images += 1;
                full += usize::from(measured == most);
                crowded += usize::from(vio.landmarks().count() > most);
                for landmark in vio.landmarks() {
                    let sigma = landmark.inverse_distance_sigma;
                    let entry = first_and_last.entry(landmark.id).or_insert((sigma, sigma, 0));
                    (entry.1, entry.2) = (sigma, entry.2 + 1);
                }
            }
        }
        // There was more to measure nearly always, and what is measured is not always the same.
        assert!(crowded > images * 8 / 10 && full > images * 6 / 10, "{crowded} {full} of {images}");
        let old: Vec<_> = first_and_last.values().filter(|(_, _, age)| *age > 40).collect();
        let known = old.iter().filter(|(first, last, _)| *last < 0.7 * first).count();
        assert!(old.len() > most && known * 10 > old.len() * 9, "{known} of {} are better known", old.len());
    }
}
