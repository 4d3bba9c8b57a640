//! Starts in motion: everywhere along the sequences, without any help.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

mod support;

use support::sequences::{SEQUENCES, Sequence};
use vio_ekf::{ImuNoise, LandmarkSettings, MovingSettings, Settings, Stamp, Status, Vio};

/// Seconds in which a start must come, and after which it is judged.
const PATIENCE: f64 = 8.0;
const FOLLOWED: f64 = 5.0;

#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    tried: usize,
    started: usize,
    /// Length of the path right to 5 %, or to a centimetre where nothing moves.
    good: usize,
    /// Wrong by more than a fifth, and not told.
    wrong: usize,
    restarts: usize,
    waited: f64,
}

/// Tries to start `count` times, evenly along the sequence.
fn starts(sequence: &Sequence, images: bool, settings: &Settings, count: usize, name: &str, tally: &mut Tally) {
    let (first, last) = sequence.span();
    let whole = last.secs_since(first) - PATIENCE - FOLLOWED - 0.5;
    for k in 0..count {
        let from = whole * (k as f64 + 0.5) / count as f64;
        tally.tried += 1;
        let (line, began) = start(sequence, images, settings, from, tally);
        if let Some(began) = began {
            tally.waited += began;
        }
        eprintln!("{name} {from:6.1} s: {line}");
    }
}

fn start(
    sequence: &Sequence,
    images: bool,
    settings: &Settings,
    from: f64,
    tally: &mut Tally,
) -> (String, Option<f64>) {
    let (first, _) = sequence.span();
    let mut vio = Vio::new(sequence.camera, ImuNoise::default(), *settings).unwrap();
    let mut samples = sequence.imu.samples.iter().skip_while(|s| s.stamp.secs_since(first) < from);
    let (mut began, mut path, mut restarts) = (None::<f64>, Vec::new(), 0);
    for frame in 0.. {
        let index = (from * 20.0).ceil() as usize + frame;
        let stamp = Stamp::from_nanos(first.nanos() + 4_000_000 + index as i64 * 50_000_000);
        for sample in samples.by_ref() {
            vio.imu(sample).unwrap();
            if sample.stamp >= stamp {
                break;
            }
        }
        let report = if images {
            let Some(picture) = sequence.simulation.frame(0, index).unwrap() else { continue };
            assert_eq!(picture.true_stamp, stamp);
            vio.image(picture.stamp, &picture.view()).unwrap()
        } else {
            vio.points(stamp, &sequence.see(stamp)).unwrap()
        };
        let after = stamp.secs_since(first) - from;
        if let Some(odometry) = vio.output() {
            let began = *began.get_or_insert(after);
            path.push((sequence.simulation.motion(odometry.stamp).unwrap().world_from_body, odometry));
            if after > began + FOLLOWED {
                break;
            }
        } else {
            if began.take().is_some() {
                restarts += 1;
                path.clear();
            }
            if after > PATIENCE {
                return (format!("not started, {restarts} restarts, {:?}", report.status), None);
            }
        }
    }
    let length = |of: &dyn Fn(usize) -> vio_ekf::nalgebra::Vector3<f64>| {
        (1..path.len()).map(|k| (of(k) - of(k - 1)).norm()).sum::<f64>()
    };
    let truth = length(&|k| path[k].0.translation.vector);
    let ours = length(&|k| path[k].1.world_from_body.translation.vector);
    let (off, lost) = ((ours - truth).abs(), matches!(vio.status(), Status::Diverged(_)));
    let good = off < 0.05 * truth || off < 0.01;
    let wrong = off > 0.2 * truth && off > 0.05 && !lost;
    tally.started += 1;
    tally.good += usize::from(good && !lost);
    tally.wrong += usize::from(wrong);
    tally.restarts += restarts;
    let verdict = if wrong {
        "FALSE"
    } else if good {
        "good"
    } else {
        "off"
    };
    let line = format!(
        "after {:.2} s, {restarts} restarts, path {truth:.2} m, ours {ours:.2} m ({:+.1} %), lost {lost}: {verdict}",
        began.unwrap(),
        100.0 * (ours / truth - 1.0)
    );
    (line, began)
}

fn settings() -> Settings {
    Settings {
        landmarks: LandmarkSettings { pixel_sigma: 0.5, ..LandmarkSettings::default() },
        moving: MovingSettings { pixel_sigma: 0.5, ..MovingSettings::default() },
        ..Settings::default()
    }
}

#[test]
fn starts_wherever_the_robot_paints() {
    let sequence = Sequence::new("paint_1", 1, false, |_| ()).unwrap();
    let mut tally = Tally::default();
    starts(&sequence, false, &settings(), 4, "paint_1", &mut tally);
    assert_eq!((tally.good, tally.wrong), (4, 0), "{tally:?}");
}

/// Starts over all sequences on points: `cargo test --release -p vio-ekf --test filter_starts -- --ignored --nocapture
/// points`. `STARTS` is how many per sequence (34).
#[test]
#[ignore = "two minutes"]
fn all_sequences_on_points() {
    all(false, &settings());
}

/// The same on rendered images, which takes half an hour for all: `... -- --ignored --nocapture images`.
#[test]
#[ignore = "renders thousands of images"]
fn all_sequences_on_images() {
    all(true, &Settings::default());
}

fn all(images: bool, settings: &Settings) {
    let count = std::env::var("STARTS").map_or(34, |text| text.parse().unwrap());
    let mut sum = Tally::default();
    for name in SEQUENCES {
        let Some(sequence) = Sequence::new(name, 1, images, |_| ()) else { continue };
        let mut tally = Tally::default();
        starts(&sequence, images, settings, count, name, &mut tally);
        eprintln!("{name}: {tally:?}");
        sum.tried += tally.tried;
        sum.started += tally.started;
        sum.good += tally.good;
        sum.wrong += tally.wrong;
        sum.restarts += tally.restarts;
        sum.waited += tally.waited;
    }
    eprintln!("all: {sum:?}, {:.2} s to a start", sum.waited / sum.started as f64);
    assert!(sum.good as f64 >= 0.97 * sum.tried as f64 && sum.wrong == 0, "{sum:?}");
}
