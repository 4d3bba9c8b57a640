//! The search for noise settings: on a function whose least point is known, and on flights whose noise is known.

use crate::support::flight::{GRAVITY, camera, spline};
use vio_ekf::sim::ImuModel;
use vio_ekf::tune::{
    HeldOut, NoisePoint, PointRecording, Score, Trial, TuneSettings, cost, penalty, tune, with_factors,
};
use vio_ekf::{Error, ImuNoise, Settings};

/// A bent valley with its floor at (1, -1, 0.5, -0.5, 0).
fn valley(x: &NoisePoint) -> f64 {
    let at = [1.0, -1.0, 0.5, -0.5, 0.0];
    let d: Vec<f64> = x.iter().zip(at).map(|(x, at)| x - at).collect();
    d.iter().map(|d| d * d).sum::<f64>() + 2.0 * (d[0] + d[1]).powi(2) + d[2].powi(4) + (d[3] * d[4]).powi(2)
}

#[test]
fn the_floor_of_a_valley_is_found_within_the_bounds() {
    let found = tune(&[0.0; 5], &TuneSettings::default(), &[], valley).unwrap();
    assert!(found.best.cost < 1e-3, "{:?}", found.best);
    assert!(found.trials.len() <= 200);
    // With a range of half a decade the floor is out of reach, and nothing outside is asked for.
    let near = TuneSettings { range: 0.5, step: 0.25, ..TuneSettings::default() };
    let bounded = tune(&[0.0; 5], &near, &[], valley).unwrap();
    assert!(bounded.trials.iter().all(|trial| trial.point.iter().all(|x| x.abs() <= 0.5 + 1e-12)));
    assert!((bounded.best.point[0] - 0.5).abs() < 1e-6 && (bounded.best.point[1] + 0.5).abs() < 1e-6);
}

#[test]
fn an_interrupted_search_goes_on_where_it_stopped() {
    let whole = tune(&[0.0; 5], &TuneSettings::default(), &[], valley).unwrap();
    let known: Vec<Trial> = whole.trials[..40].to_vec();
    let mut computed = 0;
    let resumed = tune(&[0.0; 5], &TuneSettings::default(), &known, |x| {
        computed += 1;
        valley(x)
    })
    .unwrap();
    assert_eq!(resumed, whole);
    assert!(computed <= whole.trials.len() - 40, "{computed} of {}", whole.trials.len());
}

#[test]
fn the_cost_is_an_error_and_a_consistency_in_logarithms() {
    let consistent = Score { ate: 0.1, nees: [3.0; 3], lost: 0.0 };
    assert!((cost(&[consistent], 0.7) - 0.1_f64.ln()).abs() < 1e-12);
    // Twice the error in one of two recordings: a factor of the root of two.
    let worse = Score { ate: 0.2, ..consistent };
    assert!((cost(&[consistent, worse], 0.7) - (0.1_f64.ln() + 0.5 * 2_f64.ln())).abs() < 1e-12);
    // Overconfident and conservative by the same factor cost the same.
    let (overconfident, conservative) =
        (Score { nees: [12.0; 3], ..consistent }, Score { nees: [0.75; 3], ..consistent });
    assert!((cost(&[overconfident], 0.5) - cost(&[conservative], 0.5)).abs() < 1e-12);
    assert!((cost(&[overconfident], 0.5) - (0.1_f64.ln() + 0.5 * 4_f64.ln())).abs() < 1e-12);
    assert!(cost(&[Score { lost: 0.5, ..consistent }], 0.5) > cost(&[Score { lost: 0.25, ..consistent }], 0.5));
    assert!(cost(&[Score { ate: f64::MAX, nees: [f64::MAX; 3], lost: 1.0 }], 0.5).is_finite());
}

/// Three recordings and three points, all consistent: the logarithms of the errors are the costs.
#[test]
fn what_a_search_is_worth_is_judged_on_what_it_has_not_seen() {
    let scores = |errors: [f64; 3]| errors.map(|ate| Score { ate, nees: [3.0; 3], lost: 0.0 }).to_vec();
    let (sheet, one) = ([0.0; 5], [1.0, 0.0, 0.0, 0.0, 0.0]);
    // Best for each pair, and worse for the third by more: what is learnt does not carry over.
    let overfit = vec![
        (sheet, scores([0.1, 0.1, 0.1])),
        (one, scores([0.05, 0.05, 0.4])),
        ([2.0, 0.0, 0.0, 0.0, 0.0], scores([0.4, 0.05, 0.05])),
        ([0.0, 1.0, 0.0, 0.0, 0.0], scores([0.05, 0.4, 0.05])),
    ];
    let found = HeldOut::of(&overfit, 0.5, 0.0).unwrap();
    assert!((found.data_sheet - 0.1_f64.ln()).abs() < 1e-12 && (found.tuned - 0.4_f64.ln()).abs() < 1e-12, "{found:?}");
    // A penalty of more than ln 2 per power of ten keeps the data sheet.
    let kept = HeldOut::of(&overfit, 0.5, 0.7).unwrap();
    assert_eq!(kept.tuned, kept.data_sheet);
    // Better for all by a factor of two: a gain on each.
    let sound = [(sheet, scores([0.1, 0.2, 0.3])), (one, scores([0.05, 0.1, 0.15]))];
    let found = HeldOut::of(&sound, 0.5, 0.03).unwrap();
    assert!((found.tuned - found.data_sheet - 0.5_f64.ln()).abs() < 1e-12, "{found:?}");
    assert!(found.is_gain());
    // More consistent by more than positions are worse: a gain of the cost, and none that is handed on.
    let score = |ate, nees| vec![Score { ate, nees: [nees; 3], lost: 0.0 }; 3];
    let sold = HeldOut::of(&[(sheet, score(0.1, 0.75)), (one, score(0.11, 3.0))], 0.5, 0.0).unwrap();
    assert!((sold.tuned_position - sold.data_sheet_position - 1.1_f64.ln()).abs() < 1e-12, "{sold:?}");
    assert!(sold.tuned < sold.data_sheet && !sold.is_gain(), "{sold:?}");
    assert_eq!(HeldOut::of(&sound[1..], 0.5, 0.0), None);
    assert_eq!(HeldOut::of(&[(sheet, scores([0.1; 3])[..1].to_vec())], 0.5, 0.0), None);
    assert!((penalty(&[2.0, 0.0, -1.0, 0.0, 0.0], 0.03) - 0.15).abs() < 1e-12);
}

#[test]
fn known_noise_costs_less_than_wrong_noise() {
    let record =
        |seed| PointRecording::simulate(&spline(seed, 8.0), &camera(), &ImuModel::default(), 1.0, GRAVITY, seed);
    let recordings: Vec<PointRecording> = (1..4).map(|seed| record(seed).unwrap()).collect();
    let cost_of = |point: NoisePoint| {
        let score = |r: &PointRecording| r.score(&ImuNoise::default(), &Settings::default(), &point).unwrap();
        cost(&recordings.iter().map(score).collect::<Vec<_>>(), 0.5)
    };
    let right = cost_of([0.0; 5]);
    assert_eq!(right, cost_of([0.0; 5]), "the same flight twice");
    for wrong in [[1.0; 5], [-1.0; 5], [0.0, 0.0, 0.0, 0.0, 1.0], [1.5, 0.0, 1.5, 0.0, -0.5]] {
        assert!(cost_of(wrong) > right + 0.2, "{wrong:?}: {} against {right}", cost_of(wrong));
    }
    let (noise, settings) =
        with_factors(&ImuNoise::default(), &Settings::default(), &[1.0, 0.0, -1.0, 0.0, 2_f64.log10()]);
    assert!((noise.gyro_density / ImuNoise::default().gyro_density - 10.0).abs() < 1e-9);
    assert!((noise.accel_density / ImuNoise::default().accel_density - 0.1).abs() < 1e-9);
    assert!(
        (settings.landmarks.pixel_sigma - 2.0).abs() < 1e-4 && (settings.patches.intensity_sigma - 4.0).abs() < 1e-4
    );
}

/// A frame or a sign that is wrong in one of the errors costs hundreds.
#[test]
fn the_score_of_the_right_noise_is_consistent() {
    let recording =
        PointRecording::simulate(&spline(5, 8.0), &camera(), &ImuModel::default(), 1.0, GRAVITY, 5).unwrap();
    let score = recording.score(&ImuNoise::default(), &Settings::default(), &[0.0; 5]).unwrap();
    assert!(score.lost == 0.0 && score.nees.iter().all(|nees| (0.1..12.0).contains(nees)), "{score:?}");
}

#[test]
fn searches_that_cannot_be_are_refused() {
    let refused = |settings: TuneSettings| match tune(&[0.0; 5], &settings, &[], valley) {
        Err(Error::InvalidSetting { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    let usual = TuneSettings::default();
    assert_eq!(refused(TuneSettings { evaluations: 3, ..usual }), "evaluations");
    assert_eq!(refused(TuneSettings { range: f64::NAN, ..usual }), "range");
    assert_eq!(refused(TuneSettings { step: 4.0, ..usual }), "step");
    assert_eq!(refused(TuneSettings { precision: 0.0, ..usual }), "precision");
    assert!(matches!(tune(&[f64::NAN; 5], &usual, &[], valley), Err(Error::NonFinite { .. })));
    assert!(matches!(tune(&[0.0; 5], &usual, &[], |_| f64::NAN), Err(Error::NonFinite { .. })));
}
