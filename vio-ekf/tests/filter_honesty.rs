//! Whether the claimed covariance is the true one: squared errors in its units, averaged over runs, and how much of the time
//! their mean lies where it does 95 % of the time if the claim is right.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

mod support;

use support::flight::nees;
use support::sequences::{SEQUENCES, Sequence, drawn_start};
use vio_ekf::{ImuNoise, LandmarkSettings, Settings, Stamp, Vio, chi2};

const NAMES: [&str; 5] = ["position", "attitude", "velocity", "gyro bias", "accel bias"];

/// Squared errors after each image of one run.
fn run(name: &str, seed: u64, seconds: f64, images: bool, settings: &Settings) -> Option<Vec<[f64; 5]>> {
    let sequence = Sequence::new(name, seed, images, |_| ())?;
    let (first, last) = sequence.span();
    let mut vio = Vio::new(sequence.camera, ImuNoise::default(), *settings).unwrap();
    let mut samples = sequence.imu.samples.iter();
    vio.imu(samples.next().unwrap()).unwrap();
    vio.initialize(&drawn_start(&sequence.simulation, first, seed)).unwrap();
    let mut squares = Vec::new();
    for frame in 0.. {
        let stamp = Stamp::from_nanos(first.nanos() + 4_000_000 + frame as i64 * 50_000_000);
        if stamp.secs_since(first) > seconds || stamp.nanos() + 10_000_000 > last.nanos() {
            break;
        }
        for sample in samples.by_ref() {
            vio.imu(sample).unwrap();
            if sample.stamp >= stamp {
                break;
            }
        }
        if images {
            let Some(picture) = sequence.simulation.frame(0, frame).unwrap() else { continue };
            vio.image(picture.stamp, &picture.view()).unwrap();
        } else {
            vio.points(stamp, &sequence.see(stamp)).unwrap();
        }
        let odometry = vio.output().unwrap();
        let (gyro, accel) = sequence.imu.biases_at(odometry.stamp);
        squares.push(nees(&odometry, &sequence.simulation.motion(odometry.stamp).unwrap(), &[gyro, accel]));
    }
    Some(squares)
}

/// Share of the time in the band, and mean over all, of `runs` runs.
fn honesty(name: &str, runs: u64, seconds: f64, images: bool, settings: &Settings) -> Option<[(f64, f64); 5]> {
    let mut sums: Vec<[f64; 5]> = Vec::new();
    for seed in 1..=runs {
        let squares = run(name, seed, seconds, images, settings)?;
        sums.resize(squares.len(), [0.0; 5]);
        for (sum, square) in sums.iter_mut().zip(squares) {
            (0..5).for_each(|k| sum[k] += square[k] / runs as f64);
        }
    }
    let (low, high) = chi2::mean_band(3, runs as usize, 0.95).unwrap();
    let count = sums.len() as f64;
    if std::env::var_os("VIO_TRACE").is_some() {
        for (second, sums) in sums.chunks(20).enumerate() {
            let mean: [f64; 5] = std::array::from_fn(|k| sums.iter().map(|s| s[k]).sum::<f64>() / sums.len() as f64);
            eprintln!("{name} {second:3} s: {mean:5.2?}");
        }
    }
    Some(std::array::from_fn(|k| {
        let inside = sums.iter().filter(|s| (low..=high).contains(&s[k])).count();
        (inside as f64 / count, sums.iter().map(|s| s[k]).sum::<f64>() / count)
    }))
}

fn report(images: bool, settings: &Settings) {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let (runs, seconds) = (number("RUNS", 50), number("SECONDS", 30) as f64);
    let names = std::env::var("SEQUENCE").map_or(SEQUENCES.map(String::from).to_vec(), |name| vec![name]);
    let mut worst = f64::INFINITY;
    for name in names {
        let Some(found) = honesty(&name, runs, seconds, images, settings) else { continue };
        for (what, (inside, mean)) in NAMES.iter().zip(found) {
            eprintln!("{name} {what}: {:.0} % of the time in the band, mean {mean:.2}", 100.0 * inside);
            worst = worst.min(inside);
        }
    }
    assert!(worst >= 0.85, "{worst}");
}

fn on_points() -> Settings {
    Settings { landmarks: LandmarkSettings { pixel_sigma: 0.5, ..LandmarkSettings::default() }, ..Settings::default() }
}

/// A guard for every day, over the first ten seconds, which are the hardest: the suites below say how honest the filter is.
#[test]
fn claims_are_near_the_truth_while_painting() {
    let found = honesty("paint_1", 8, 10.0, false, &on_points()).unwrap();
    eprintln!("{found:.2?}");
    assert!(found.iter().all(|(inside, mean)| *inside > 0.35 && (1.8..6.0).contains(mean)), "{found:.2?}");
}

/// Fifty runs of 30 s of each sequence on points: `cargo test --release -p vio-ekf --test filter_honesty -- --ignored
/// --nocapture points`. `RUNS`, `SECONDS` and `SEQUENCE` ask for others, `VIO_TRACE` shows the mean of each second.
#[test]
#[ignore = "five minutes"]
fn all_sequences_on_points() {
    report(false, &on_points());
}

/// The same on rendered images: `... -- --ignored --nocapture images`.
#[test]
#[ignore = "renders 180,000 images"]
fn all_sequences_on_images() {
    report(true, &Settings::default());
}
