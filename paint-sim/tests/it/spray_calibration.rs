//! Sprays from bursts: the truth is known, the readings are made from it by formulas of their own.

use Parameter::{Aspect, Delay, Flow, Pitch, Sigma, Turn, Yaw};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use paint_sim::colour::{BANDS, spectrum_linear_srgb};
use paint_sim::spray::calibration::{
    Burst, Calibration, CalibrationSettings, Coating, Explanation, Parameter, Response, calibrate,
};
use paint_sim::{Error, Paint, SprayModel, Substrate};

use crate::chart::normals;

const COLUMNS: usize = 97;
const PIXEL: f64 = 1.25e-3;
const CARD: f64 = 0.85;

/// What is to be found.
#[derive(Clone, Copy)]
struct Truth {
    spray: SprayModel,
    flow: f64,
    delay: f64,
    /// Two jets this many deviations to each side along the ellipse, instead of one.
    split: f64,
}

impl Truth {
    fn of(seed: u64) -> Self {
        let mut normal = normals(1000 + seed);
        let mut near = |middle: f64, spread: f64| middle + spread * normal().clamp(-2.0, 2.0);
        let spray = SprayModel {
            sigma: near(8.0, 0.8).to_radians(),
            cut: 5.0,
            aspect: near(1.4, 0.1),
            turn: near(0.4, 0.3),
            yaw: near(0.0, 0.02),
            pitch: near(0.0, 0.02),
            ..SprayModel::default()
        };
        Self { spray, flow: near(10e-9, 1e-9), delay: 0.0, split: 0.0 }
    }

    /// Thickness at a place of the card.
    fn thickness(&self, card_from_nozzle: &Isometry3<f64>, duration: f64, place: &Point3<f64>) -> f64 {
        let ray = card_from_nozzle.inverse_transform_point(place);
        let r = ray.coords.norm();
        let incidence = (card_from_nozzle.rotation * ray.coords).z / r;
        let spray = &self.spray;
        let (y, z) = (ray.y / ray.x - spray.yaw.tan(), ray.z / ray.x - spray.pitch.tan());
        let (s, c) = spray.turn.sin_cos();
        let (long, short) = (spray.sigma.tan() * spray.aspect.sqrt(), spray.sigma.tan() / spray.aspect.sqrt());
        let (along, across) = ((c * y + s * z) / long, (c * z - s * y) / short);
        let peak = |at: f64| (-0.5 * ((along - at).powi(2) + across.powi(2))).exp();
        let gaussian = 0.5 * (peak(self.split) + peak(-self.split)) / (std::f64::consts::TAU * long * short);
        self.flow * (duration - self.delay) * gaussian * (r / ray.x).powi(3) * incidence / (r * r)
    }
}

fn paint() -> Paint {
    Paint::blue(8e-6).unwrap()
}

fn coating() -> Coating {
    Coating { paint: paint(), card: Substrate::grey(CARD).unwrap(), response: Response::LinearSrgb }
}

/// Linear sRGB of a film by the textbook form.
fn colour(thickness: f64) -> [f64; 3] {
    let paint = paint();
    let band = |band: usize| {
        let (k, s) = (paint.absorption()[band], paint.scattering()[band]);
        let a = (k + s) / s;
        let b = (a * a - 1.0).sqrt();
        let c = b / (b * s * thickness.max(1e-15)).tanh();
        (1.0 - CARD * (a - c)) / (a - CARD + c)
    };
    spectrum_linear_srgb(&std::array::from_fn::<_, BANDS, _>(band))
}

/// A nozzle at a distance from the card's middle, the card tilted about its two axes.
fn pose(distance: f64, tilt: [f64; 2]) -> Isometry3<f64> {
    // The nozzle's forward is into the card, its left is the picture's left, its up the picture's up.
    let facing = Rotation3::from_matrix_unchecked(Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0));
    let before =
        Isometry3::from_parts(Translation3::new(0.0, 0.0, -distance), UnitQuaternion::from_rotation_matrix(&facing));
    Isometry3::rotation(Vector3::new(tilt[0], tilt[1], 0.0)) * before
}

/// Five distances, three of them with a tilted card.
fn poses() -> [(Isometry3<f64>, f64); 5] {
    let at = |distance: f64, tilt: [f64; 2]| (pose(distance, tilt), 100.0 * distance * distance);
    [at(0.06, [0.0, 0.0]), at(0.08, [0.4, 0.0]), at(0.10, [0.0, -0.5]), at(0.12, [0.0, 0.0]), at(0.15, [-0.3, 0.3])]
}

fn place(k: usize, pixel: f64) -> Point3<f64> {
    let middle = 0.5 * (COLUMNS as f64 - 1.0);
    Point3::new((k % COLUMNS) as f64 - middle, (k / COLUMNS) as f64 - middle, 0.0) * pixel
}

/// Bursts of a truth, in reflectances with noise.
fn bursts(truth: &Truth, seed: u64, noise: f64) -> Vec<Burst> {
    let mut normal = normals(seed);
    let burst = |(card_from_nozzle, duration): (Isometry3<f64>, f64)| {
        let one = |k: usize| colour(truth.thickness(&card_from_nozzle, duration, &place(k, PIXEL)));
        let mut readings: Vec<f64> = (0..COLUMNS * COLUMNS).flat_map(one).collect();
        for reading in &mut readings {
            *reading += noise * normal();
        }
        Burst { card_from_nozzle, duration, columns: COLUMNS, pixel: PIXEL, readings }
    };
    poses().map(burst).to_vec()
}

fn found(bursts: &[Burst]) -> Calibration {
    calibrate(bursts, Some(&coating()), &CalibrationSettings::default()).unwrap()
}

/// Errors of all that was sought.
fn errors(found: &Calibration, truth: &Truth) -> Vec<(Parameter, f64, f64)> {
    let error = |parameter: Parameter, value: f64| {
        let s = &truth.spray;
        match parameter {
            Parameter::Sigma => value - s.sigma,
            Parameter::Flow => value - truth.flow,
            Parameter::Aspect => value - s.aspect,
            // Half a revolution is the same ellipse.
            Parameter::Turn => (value - s.turn).sin().asin(),
            Parameter::Yaw => value - s.yaw,
            Parameter::Pitch => value - s.pitch,
            Parameter::Delay => value - truth.delay,
        }
    };
    found.estimates.iter().map(|e| (e.parameter, error(e.parameter, e.value), e.deviation)).collect()
}

#[test]
fn sigma_and_flow_are_within_half_a_per_cent_from_noisy_bursts_at_five_distances() {
    let (mut worst, mut within, mut count, mut squares) = ([0.0_f64; 2], 0, 0, 0.0);
    for seed in 1..=20 {
        let truth = Truth::of(seed);
        let found = found(&bursts(&truth, seed, 0.01));
        assert!(found.agrees() && !found.round, "{seed}: {found:?}");
        let relative = [found.spray.sigma / truth.spray.sigma - 1.0, found.flow / truth.flow - 1.0];
        worst = [0, 1].map(|k| worst[k].max(relative[k].abs()));
        for (_, error, deviation) in errors(&found, &truth) {
            within += i32::from(error.abs() < 2.0 * deviation);
            squares += (error / deviation).powi(2);
            count += 1;
        }
    }
    println!("worst: sigma {:.2e}, flow {:.2e}; {within} of {count} within two deviations", worst[0], worst[1]);
    assert!(worst[0] < 5e-3 && worst[1] < 5e-3, "{worst:?}");
    // 120 errors: 95 % within two deviations, and a mean square of one, within what chance allows.
    assert!(within * 100 >= count * 90, "{within} of {count}");
    assert!((squares / f64::from(count) - 1.0).abs() < 0.45, "{squares} {count}");
}

#[test]
fn readings_that_are_means_over_their_pixels_change_little() {
    let truth = Truth::of(3);
    let mut all = bursts(&truth, 3, 0.0);
    for (burst, (pose, duration)) in all.iter_mut().zip(poses()) {
        for k in 0..COLUMNS * COLUMNS {
            let mut sum = [0.0; 3];
            for i in 0..9 {
                let shift = Vector3::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0, 0.0) * (PIXEL / 3.0);
                let one = colour(truth.thickness(&pose, duration, &(place(k, PIXEL) + shift)));
                (0..3).for_each(|c| sum[c] += one[c] / 9.0);
            }
            burst.readings[3 * k..3 * k + 3].copy_from_slice(&sum);
        }
    }
    let found = found(&all);
    let off = [found.spray.sigma / truth.spray.sigma - 1.0, found.flow / truth.flow - 1.0];
    assert!(off.iter().all(|off| off.abs() < 5e-3), "{off:?}");
}

#[test]
fn thicknesses_and_a_delay_are_fitted_too() {
    let truth = Truth { delay: 0.04, ..Truth::of(4) };
    let mut normal = normals(9);
    let burst = |(card_from_nozzle, duration): (Isometry3<f64>, f64)| {
        let one = |k: usize| truth.thickness(&card_from_nozzle, duration, &place(k, PIXEL)) + 1e-7 * normal();
        let readings = (0..COLUMNS * COLUMNS).map(one).collect();
        Burst { card_from_nozzle, duration, columns: COLUMNS, pixel: PIXEL, readings }
    };
    let all: Vec<Burst> = poses().into_iter().map(burst).collect();
    let free = CalibrationSettings { noise: 1e-7, held: vec![], ..CalibrationSettings::default() };
    let fit = calibrate(&all, None, &free).unwrap();
    for (parameter, error, deviation) in errors(&fit, &truth) {
        assert!(error.abs() < 4.0 * deviation, "{parameter:?}: {error} {deviation}");
    }
    assert!(fit.agrees() && fit.estimates.len() == 7 && fit.estimate(Parameter::Delay).unwrap().deviation < 2e-3);
    // Held at zero, the delay is what the residuals ask for first.
    let held = calibrate(&all, None, &CalibrationSettings { noise: 1e-7, ..CalibrationSettings::default() }).unwrap();
    assert!(!held.agrees());
    let doubt = held.doubts.iter().find(|d| d.explanation == Explanation::Delay).unwrap();
    assert!((doubt.size - 0.04).abs() < 0.02, "{:?}", held.doubts);
}

#[test]
fn what_is_held_stays_and_the_rest_is_found() {
    let truth = Truth::of(5);
    let all = bursts(&truth, 5, 0.01);
    for held in [vec![Aspect], vec![Turn], vec![Sigma, Yaw], vec![Flow, Pitch], vec![Aspect, Turn, Yaw, Pitch, Flow]] {
        let held: Vec<Parameter> = held.into_iter().chain([Delay]).collect();
        let settings =
            CalibrationSettings { spray: truth.spray, flow: truth.flow, held: held.clone(), ..Default::default() };
        let fit = calibrate(&all, Some(&coating()), &settings).unwrap();
        assert_eq!(fit.estimates.len(), 7 - held.len());
        assert!(fit.agrees() && fit.estimates.iter().all(|e| !held.contains(&e.parameter)), "{held:?}");
        for (parameter, error, deviation) in errors(&fit, &truth) {
            assert!(error.abs() < 4.0 * deviation, "{held:?} {parameter:?}: {error} {deviation}");
        }
    }
}

#[test]
fn a_round_spray_has_no_turn() {
    let mut truth = Truth::of(6);
    truth.spray.aspect = 1.0;
    let fit = found(&bursts(&truth, 6, 0.01));
    assert!(fit.round && fit.agrees() && fit.estimate(Parameter::Turn).unwrap().deviation > 0.2, "{fit:?}");
    assert!((fit.spray.sigma / truth.spray.sigma - 1.0).abs() < 5e-3);
}

#[test]
fn data_that_do_not_fit_are_seen_and_the_cause_is_named() {
    let (truth, first) = (Truth::of(7), |fit: &Calibration| fit.doubts.first().copied());
    let good = bursts(&truth, 7, 0.01);
    // Pixels are 2 % smaller than was told.
    let mut scaled = good.clone();
    for burst in &mut scaled {
        burst.pixel *= 1.02;
    }
    let fit = found(&scaled);
    let told = fit.doubts.iter().find(|d| d.explanation == Explanation::PictureScale);
    assert!(!fit.agrees() && told.is_some_and(|d| (d.size + 0.02).abs() < 0.01), "{:?}", fit.doubts);
    // All nozzles stood 3 mm nearer than was told.
    let mut nearer = good.clone();
    let back = |burst: &mut Burst, by: f64| {
        burst.card_from_nozzle.translation.vector -= burst.card_from_nozzle.rotation * Vector3::x() * by;
    };
    for burst in &mut nearer {
        back(burst, 3e-3);
    }
    let fit = found(&nearer);
    let told = fit.doubts.iter().find(|d| d.explanation == Explanation::Distance);
    assert!(!fit.agrees() && told.is_some_and(|d| (d.size + 3e-3).abs() < 1e-3), "{:?}", fit.doubts);
    // One of them did.
    let mut one = good.clone();
    back(&mut one[3], 4e-3);
    let fit = found(&one);
    assert!(!fit.agrees());
    assert_eq!(first(&fit).unwrap().explanation, Explanation::BurstDistance(3), "{:?}", fit.doubts);
    // One burst was longer.
    let mut long = good.clone();
    long[1].duration *= 0.9;
    let fit = found(&long);
    let told = first(&fit).unwrap();
    assert_eq!(told.explanation, Explanation::BurstDose(1), "{:?}", fit.doubts);
    assert!(!fit.agrees() && (told.size - 0.11).abs() < 0.05, "{told:?}");
    // A fan with two peaks.
    let fit = found(&bursts(&Truth { split: 1.2, ..truth }, 7, 0.01));
    let told = fit.doubts.iter().find(|d| d.explanation == Explanation::DoublePeak).unwrap();
    assert!(!fit.agrees() && fit.correlation > 10.0 && told.size < 0.0, "{:?}", fit.doubts);
    // Noise of which the half was told: the deviations are of the noise that is there.
    let fit = found(&bursts(&truth, 7, 0.02));
    let told = calibrate(&good, Some(&coating()), &CalibrationSettings { noise: 0.02, ..Default::default() }).unwrap();
    assert!((fit.estimates[0].deviation / told.estimates[0].deviation - 1.0).abs() < 0.02);
    assert!(!fit.agrees() && fit.doubts.is_empty() && fit.correlation < 5.0);
}

#[test]
fn what_the_bursts_cannot_tell_is_named() {
    let all = bursts(&Truth::of(8), 8, 0.01);
    let free = CalibrationSettings { held: vec![], ..CalibrationSettings::default() };
    let refused = calibrate(&all[..1], Some(&coating()), &free).unwrap_err();
    assert_eq!(refused, Error::Undetermined { parameters: "flow, delay".to_owned() });
    // One band of one burst tells everything else.
    let fit = calibrate(&all[..1], Some(&coating()), &CalibrationSettings::default()).unwrap();
    assert!(fit.agrees() && fit.estimates.len() == 6);
}

#[test]
fn bursts_that_are_none_are_refused() {
    let truth = Truth::of(9);
    let good = bursts(&truth, 9, 0.01);
    let (settings, coating) = (CalibrationSettings::default(), coating());
    let refused = |change: &dyn Fn(&mut Vec<Burst>)| {
        let mut bursts = good.clone();
        change(&mut bursts);
        calibrate(&bursts, Some(&coating), &settings).unwrap_err()
    };
    assert!(matches!(refused(&|b| b.clear()), Error::Empty { .. }));
    assert!(matches!(refused(&|b| b[1].readings.clear()), Error::Empty { .. }));
    assert!(matches!(refused(&|b| b[1].readings.truncate(7)), Error::WrongLength { .. }));
    assert!(matches!(refused(&|b| b[1].readings[5] = f64::NAN), Error::NotFinite { index: 5, .. }));
    assert!(matches!(refused(&|b| b[1].duration = 0.0), Error::OutOfRange { .. }));
    assert!(matches!(refused(&|b| b[1].card_from_nozzle.translation.z = 0.1), Error::OutOfRange { .. }));
    assert!(matches!(refused(&|b| b[1].card_from_nozzle.translation.x = f64::NAN), Error::NotFinite { .. }));
    // Every fourth pixel of every fourth row.
    let coarse = |burst: &mut Burst| {
        let kept =
            (0..COLUMNS * COLUMNS).filter(|k| (k % COLUMNS).is_multiple_of(4) && (k / COLUMNS).is_multiple_of(4));
        burst.readings = kept.flat_map(|k| burst.readings[3 * k..3 * k + 3].to_vec()).collect();
        (burst.columns, burst.pixel) = (COLUMNS.div_ceil(4), 4.0 * PIXEL);
    };
    let told = "pixel of a burst over the deviation of its spot";
    assert!(matches!(refused(&|b| coarse(&mut b[0])), Error::OutOfRange { what, .. } if what == told));
    assert_eq!(refused(&|b| b[2].readings.fill(CARD)), Error::Unpainted { burst: 2 });
    // Sprayed for minutes.
    let truth = Truth { flow: 300.0 * truth.flow, ..truth };
    let saturated = bursts(&truth, 9, 0.01);
    assert_eq!(refused(&|b| b[4] = saturated[4].clone()), Error::Saturated { burst: 4 });
    let same =
        Coating { card: Substrate::new(*paint().over(1.0, &coating.card).unwrap().reflectance()).unwrap(), ..coating };
    assert!(matches!(calibrate(&good, Some(&same), &settings), Err(Error::OutOfRange { .. })));
    let band = Coating { response: Response::Band(36), ..coating };
    assert!(calibrate(&good, Some(&band), &settings).is_err());
    let noise = CalibrationSettings { noise: 0.0, ..settings };
    assert!(matches!(calibrate(&good, Some(&coating), &noise), Err(Error::OutOfRange { .. })));
}
