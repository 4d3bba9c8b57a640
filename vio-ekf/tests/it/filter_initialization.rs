//! Starts in motion: everywhere along the sequences, without any help.

use crate::support::sequences::{SEQUENCES, Sequence};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vio_ekf::eval::{Alignment, align, ate};
use vio_ekf::filter::{DynamicInitializationSettings, LandmarkSettings};
use vio_ekf::sim::{Scenario, SimulatedCamera, Simulation, camera_ahead};
use vio_ekf::trajectory::Spline;
use vio_ekf::{ImuNoise, Settings, Stamp, Status, Vio, nalgebra};

/// Seconds in which a start must come, and after which it is judged.
const PATIENCE: f64 = 8.0;
const FOLLOWED: f64 = 5.0;

#[derive(Debug, Default, Clone, Copy)]
struct MeasurementCounts {
    tried: usize,
    started: usize,
    /// The scale of the five seconds right to 5 %, or all of them to a centimetre.
    good: usize,
    /// The scale wrong by more than a fifth, and not told.
    wrong: usize,
    restarts: usize,
    waited: f64,
}

/// Tries to start `count` times, evenly along the sequence.
fn starts(
    sequence: &Sequence,
    images: bool,
    settings: &Settings,
    count: usize,
    name: &str,
    counts: &mut MeasurementCounts,
) {
    let (first, last) = sequence.span();
    let whole = last.secs_since(first) - PATIENCE - FOLLOWED - 0.5;
    for k in 0..count {
        let from = whole * (k as f64 + 0.5) / count as f64;
        counts.tried += 1;
        let (line, began) = start(sequence, images, settings, from, counts);
        if let Some(began) = began {
            counts.waited += began;
        }
        eprintln!("{name} {from:6.1} s: {line}");
    }
}

fn start(
    sequence: &Sequence,
    images: bool,
    settings: &Settings,
    from: f64,
    counts: &mut MeasurementCounts,
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
            let truth = sequence.simulation.motion(odometry.stamp).unwrap();
            path.push((truth.world_from_body, odometry.world_from_body));
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
    let (truth, ours): (Vec<_>, Vec<_>) = path.into_iter().unzip();
    let lost = matches!(vio.status(), Status::Diverged(_));
    let error = ate(&truth, &ours, Alignment::PosYaw).map_or(f64::NAN, |error| error.position.rmse);
    // Where nothing moves there is no scale.
    let spread = spread(&truth);
    let off =
        if spread > 0.05 { align(&truth, &ours, Alignment::Sim3).map_or(0.0, |fit| fit.scaling() - 1.0) } else { 0.0 };
    let small = if error.is_nan() { (self::spread(&ours) - spread).abs() } else { error };
    let good = (off.abs() < 0.05 || error < 0.01) && small < 0.1_f64.max(0.1 * spread) && !lost;
    let wrong = (off.abs() > 0.2 && error > 0.05 || small > 0.2_f64.max(0.2 * spread)) && !lost;
    counts.started += 1;
    counts.good += usize::from(good);
    counts.wrong += usize::from(wrong);
    counts.restarts += restarts;
    let verdict = if wrong {
        "FALSE"
    } else if good {
        "good"
    } else {
        "off"
    };
    let line = format!(
        "after {:.2} s, {restarts} restarts, spread {spread:.2} m, error {error:.3} m, scale {:+.1} %, lost {lost}: {verdict}",
        began.unwrap(),
        100.0 * off
    );
    (line, began)
}

/// Root mean square distance from the middle.
fn spread(poses: &[Isometry3<f64>]) -> f64 {
    let count = poses.len() as f64;
    let middle = poses.iter().map(|pose| pose.translation.vector).sum::<Vector3<f64>>() / count;
    (poses.iter().map(|pose| (pose.translation.vector - middle).norm_squared()).sum::<f64>() / count).sqrt()
}

fn settings() -> Settings {
    Settings {
        landmarks: LandmarkSettings { pixel_sigma: 0.5, ..LandmarkSettings::default() },
        dynamic_initialization: DynamicInitializationSettings {
            pixel_sigma: 0.5,
            ..DynamicInitializationSettings::default()
        },
        ..Settings::default()
    }
}

#[test]
fn starts_wherever_the_robot_paints() {
    let sequence = Sequence::new("paint_1", 1, false, |_| ()).unwrap();
    let mut counts = MeasurementCounts::default();
    starts(&sequence, false, &settings(), 4, "paint_1", &mut counts);
    assert_eq!((counts.good, counts.wrong), (4, 0), "{counts:?}");
}

#[test]
fn a_start_that_is_contradicted_is_taken_back() {
    let sequence = Sequence::new("paint_1", 3, false, |_| ()).unwrap();
    let first = sequence.span().0;
    let mut vio = Vio::new(sequence.camera, ImuNoise::default(), settings()).unwrap();
    let mut samples = sequence.imu.samples.iter();
    let (mut began, mut fooled, mut statuses) = (None, 0, Vec::new());
    for frame in 0..120 {
        let stamp = Stamp::from_nanos(first.nanos() + 4_000_000 + frame * 50_000_000);
        for sample in samples.by_ref() {
            vio.imu(sample).unwrap();
            if sample.stamp >= stamp {
                break;
            }
        }
        let mut seen = sequence.see(stamp);
        // Right after the start everything is taken for its neighbour, for four images.
        if began.is_some() && fooled < 4 {
            fooled += 1;
            let ids: Vec<u64> = seen.iter().map(|point| point.id).collect();
            for (k, point) in seen.iter_mut().enumerate() {
                point.id = ids[(k + 1) % ids.len()];
            }
        }
        vio.points(stamp, &seen).unwrap();
        let status = vio.status();
        if status.has_estimate() {
            began.get_or_insert(frame);
        }
        let same = |last: &Status| std::mem::discriminant(last) == std::mem::discriminant(&status);
        if !statuses.last().is_some_and(same) {
            statuses.push(status);
        }
    }
    // Nothing of the first contradicting image can be used, and the third ends it.
    let [
        Status::Uninitialised(_),
        Status::Tracking,
        Status::DeadReckoning,
        ..,
        Status::Uninitialised(_),
        Status::Tracking,
    ] = statuses[..]
    else {
        panic!("{statuses:?}");
    };
}

/// At 8 m/s what is near moves by 60 pixels from image to image, and scale and distances are a curved valley.
#[test]
fn starts_in_a_race_within_a_second() {
    let knots = (0..80).map(|k| {
        let angle = 0.08 * f64::from(k);
        let position = Vector3::new(5.0 * angle.sin(), -5.0 * angle.cos(), 0.5 * (2.0 * angle).sin());
        // Nose to the outside, leaning into the turn.
        let turn = UnitQuaternion::from_euler_angles(0.9, 0.0, angle - 0.4);
        Isometry3::from_parts(position.into(), turn)
    });
    let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, knots.collect()).unwrap();
    let camera = camera_ahead();
    let cameras = vec![SimulatedCamera { camera, ..SimulatedCamera::default() }];
    let simulation = Simulation::new(spline, Scenario { seed: 3, cameras, ..Scenario::default() }).unwrap();
    let first = simulation.spline().span().0;
    let readings = simulation.imu(0).unwrap().samples;
    for from in [0.0, 1.0, 2.0] {
        let mut vio = Vio::new(camera, ImuNoise::default(), Settings::default()).unwrap();
        let mut samples = readings.iter().skip_while(|s| s.stamp.secs_since(first) < from);
        let mut began = None;
        for image in 0..24 {
            let picture = simulation.frame(0, image + (20.0 * from) as usize).unwrap().unwrap();
            for sample in samples.by_ref() {
                vio.imu(sample).unwrap();
                if sample.stamp >= picture.stamp {
                    break;
                }
            }
            vio.image(picture.stamp, &picture.view()).unwrap();
            if vio.output().is_some() {
                began.get_or_insert(image);
            }
        }
        let odometry = vio.output().expect("not started");
        let truth = simulation.motion(odometry.stamp).unwrap();
        let off = odometry.velocity_in_body.norm() / truth.velocity_in_world.norm() - 1.0;
        assert!(began.unwrap() <= 20 && off.abs() < 0.05, "from {from} s: at image {began:?}, speed off by {off:.3}");
    }
}

/// Starts over all sequences on points: `cargo test --release -p vio-ekf --test it filter_starts -- --ignored --nocapture
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
    let mut sum = MeasurementCounts::default();
    for name in SEQUENCES {
        let Some(sequence) = Sequence::new(name, 1, images, |_| ()) else { continue };
        let mut counts = MeasurementCounts::default();
        starts(&sequence, images, settings, count, name, &mut counts);
        eprintln!("{name}: {counts:?}");
        sum.tried += counts.tried;
        sum.started += counts.started;
        sum.good += counts.good;
        sum.wrong += counts.wrong;
        sum.restarts += counts.restarts;
        sum.waited += counts.waited;
    }
    eprintln!("all: {sum:?}, {:.2} s to a start", sum.waited / sum.started as f64);
    assert!(sum.good as f64 >= 0.97 * sum.tried as f64 && sum.wrong == 0, "{sum:?}");
}
