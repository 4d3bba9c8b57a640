//! Whether the claimed covariance is the true one: squared errors in its units, averaged over runs, and how much of the time
//! their mean lies where it does 95 % of the time if the claim is right.

use crate::support::flight::nees;
use crate::support::sequences::{RACES, SEQUENCES, Sequence, drawn_start};
use vio_ekf::eval::chi2;
use vio_ekf::filter::LandmarkSettings;
use vio_ekf::{ImuNoise, Settings, Stamp, Vio};

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
fn consistency(name: &str, runs: u64, seconds: f64, images: bool, settings: &Settings) -> Option<[(f64, f64); 5]> {
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

/// For each of [`NAMES`] the share of the time in the band, percent, and the mean.
type Figures = [(f64, f64); 5];

/// A ratchet: what was measured, for a consistent filter (95, 3). It may come nearer to that, not go away from it.
fn assert_no_worse(name: &str, found: &[(f64, f64); 5], measured: &Figures, (percent, mean): (f64, f64)) {
    for (what, (found, measured)) in NAMES.iter().zip(found.iter().zip(measured)) {
        let text =
            format!("{name} {what}: {:.1} %, {:.2}; was {} %, {}", 100.0 * found.0, found.1, measured.0, measured.1);
        assert!(100.0 * found.0 >= measured.0 - percent, "{text}");
        assert!((measured.1.min(3.0) - mean..=measured.1.max(3.0) + mean).contains(&found.1), "{text}");
    }
}

/// Prints the figures, and compares those that were measured with the numbers of runs and seconds in question.
fn report(images: bool, settings: &Settings, (runs, seconds): (u64, u64), measured: &[(&str, Figures)]) {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let asked = (number("RUNS", runs), number("SECONDS", seconds));
    let wanted = std::env::var("SEQUENCE").ok();
    for name in SEQUENCES.iter().filter(|name| wanted.as_ref().is_none_or(|wanted| wanted == **name)) {
        let Some(found) = consistency(name, asked.0, asked.1 as f64, images, settings) else { continue };
        for (what, (inside, mean)) in NAMES.iter().zip(found) {
            eprintln!("{name} {what}: {:.0} % of the time in the band, mean {mean:.2}", 100.0 * inside);
        }
        if let Some((_, measured)) = measured.iter().find(|(of, _)| of == name && asked == (runs, seconds)) {
            assert_no_worse(name, &found, measured, (2.0, 0.15));
        }
    }
}

fn on_points() -> Settings {
    Settings { landmarks: LandmarkSettings { pixel_sigma: 0.5, ..LandmarkSettings::default() }, ..Settings::default() }
}

/// A guard for every day, over the first ten seconds, which are the hardest: the suites below say how consistent the filter is.
/// Of eight runs the band is from 1.6 to 4.9.
#[test]
fn claims_are_as_near_the_truth_as_they_were_while_painting() {
    let found = consistency("paint_1", 8, 10.0, false, &on_points()).unwrap();
    let measured = [(100.0, 3.36), (96.0, 3.94), (95.0, 3.24), (92.0, 3.44), (100.0, 3.90)];
    assert_no_worse("paint_1", &found, &measured, (5.0, 0.2));
}

/// Measured by [`all_sequences_on_points`]. Of fifty runs the band is from 2.4 to 3.7.
#[allow(clippy::approx_constant, reason = "one of the figures looks like π")]
const ON_POINTS: [(&str, Figures); 6] = [
    ("MH_01", [(35.0, 2.82), (64.0, 2.9), (59.0, 2.69), (67.0, 3.73), (92.0, 3.23)]),
    ("MH_03", [(11.0, 3.37), (76.0, 3.0), (65.0, 3.51), (89.0, 3.38), (63.0, 3.81)]),
    ("MH_04", [(47.0, 11.65), (64.0, 3.25), (58.0, 4.69), (7.0, 4.44), (82.0, 4.24)]),
    ("V1_02", [(18.0, 1.96), (82.0, 2.73), (71.0, 3.13), (89.0, 3.05), (91.0, 2.96)]),
    ("paint_1", [(95.0, 2.97), (100.0, 2.74), (95.0, 3.1), (92.0, 3.01), (96.0, 2.77)]),
    ("paint_2", [(100.0, 3.18), (100.0, 2.99), (94.0, 3.14), (96.0, 3.13), (99.0, 3.0)]),
];

/// Fifty runs of 30 s of each sequence on points: `cargo test --release -p vio-ekf --test it filter_consistency::all_sequences_on_points
/// -- --ignored --nocapture`. `RUNS`, `SECONDS` and `SEQUENCE` ask for others, which are printed only; `VIO_TRACE` shows the mean
/// of each second.
#[test]
#[ignore = "four minutes"]
fn all_sequences_on_points() {
    report(false, &on_points(), (50, 30), &ON_POINTS);
}

/// Measured by [`all_sequences_on_images`]. Of ten runs the band is from 1.7 to 4.7.
const ON_IMAGES: [(&str, Figures); 6] = [
    ("MH_01", [(8.0, 1.29), (100.0, 2.51), (34.0, 1.65), (41.0, 1.64), (96.0, 3.63)]),
    ("MH_03", [(97.0, 2.81), (100.0, 3.28), (46.0, 1.65), (43.0, 1.6), (84.0, 4.32)]),
    ("MH_04", [(34.0, 10.8), (100.0, 2.95), (66.0, 3.3), (24.0, 5.97), (100.0, 3.51)]),
    ("V1_02", [(2.0, 0.67), (86.0, 1.96), (24.0, 1.18), (62.0, 2.16), (100.0, 3.06)]),
    ("paint_1", [(15.0, 1.27), (35.0, 1.65), (50.0, 1.67), (54.0, 1.58), (98.0, 2.95)]),
    ("paint_2", [(53.0, 1.9), (96.0, 2.18), (59.0, 1.84), (63.0, 2.11), (99.0, 3.31)]),
];

/// Ten runs of 8 s on rendered images: `... filter_consistency::all_sequences_on_images -- --ignored --nocapture`.
#[test]
#[ignore = "renders 9,600 images"]
fn all_sequences_on_images() {
    report(true, &Settings::default(), (10, 8), &ON_IMAGES);
}

/// Patches that are blurred in a turn, or seen from elsewhere, contradict nothing, and drift by the angle from which they are seen: a race
/// is followed to its end, with a velocity that is nearly as uncertain as is said: 3 is right, and 11 was measured without either.
/// `PAINTCOPTER_DATA=... cargo test --release -p vio-ekf --test it races -- --ignored --nocapture`.
#[test]
#[ignore = "renders 1,200 images"]
fn races_are_followed_to_their_end() {
    for name in RACES {
        let Some(squares) = run(name, 1, 20.0, true, &Settings::default()) else { return };
        let mean = |k: usize| squares.iter().map(|square| square[k]).sum::<f64>() / squares.len() as f64;
        let found: [f64; 5] = std::array::from_fn(mean);
        eprintln!("{name}: {found:.2?}");
        assert!(squares.len() > 300 && found[2] < 8.0, "{name}: {found:?}");
    }
}
