//! A tip that wears: the law of its area, the readings that were published, and no change without wear.

use nalgebra::{Point3, Vector3};
use paint_sim::spray::TipWear;
use paint_sim::{Shot, SprayModel};

fn shots(count: usize, volume: f64) -> Vec<Shot> {
    vec![Shot { origin: Point3::origin(), axis: Vector3::x_axis(), volume }; count]
}

#[test]
fn a_tip_has_the_flow_and_the_fan_that_were_read() {
    let wear = TipWear { growth: 2.0 };
    for (litres_per_minute, centimetres) in [(0.91, 30.0), (1.17, 28.0), (1.47, 21.0), (1.79, 14.0)] {
        let sprayed = (litres_per_minute / 0.91 - 1.0) / 2.0;
        assert!((wear.flow(sprayed) * 0.91 - litres_per_minute).abs() < 1e-12);
        assert!((wear.fan(sprayed) * 30.0 - centimetres).abs() < 1e-9, "{sprayed}");
    }
    // The default has lost a quarter of its fan between 300 and 600 litres.
    assert!(TipWear::default().fan(0.3) > 0.75 && TipWear::default().fan(0.6) < 0.75);
    assert!((wear.fan(9.0) * 30.0 - 14.0).abs() < 1e-9);
}

/// In slopes the fan's long side narrows as the fan does, its short one stays.
#[test]
fn a_fan_narrows_until_it_is_round() {
    let wear = TipWear::default();
    for (aspect, turn) in [(3.0, 0.2), (1.0 / 3.0, 0.2), (1.3, 0.0), (1.0, 0.0)] {
        let new = SprayModel { aspect, turn, ..SprayModel::default() };
        let sides = |spray: &SprayModel| {
            let (t, stretch) = (spray.sigma.tan(), spray.aspect.sqrt());
            let [a, b] = [t * stretch, t / stretch];
            [a.max(b), a.min(b)]
        };
        let (before, mut last) = (sides(&new), sides(&new)[0]);
        for k in 0..100 {
            let sprayed = 0.01 * f64::from(k);
            let worn = wear.spray(&new, sprayed);
            let [long, short] = sides(&worn);
            let expected = (before[0] * wear.fan(sprayed)).max(before[1]);
            assert!((long / expected - 1.0).abs() < 1e-12 && (short / before[1] - 1.0).abs() < 1e-12, "{aspect} {k}");
            assert!(long <= last && (aspect >= 1.0) == (worn.aspect >= 1.0) && worn.turn == turn);
            last = long;
        }
        assert_eq!(wear.spray(&new, 0.0), new);
        assert_eq!(TipWear { growth: 0.0 }.spray(&new, 5.0), new);
    }
}

/// `dV/dV_0 = 1 + k V` from `V` on: however the paint is divided into shots, the same comes out, and more with every litre.
#[test]
fn more_comes_out_of_a_worn_tip() {
    let wear = TipWear::default();
    let (sprayed, commanded, k) = (0.2_f64, 0.5_f64, 1.2_f64);
    let closed = (sprayed + 1.0 / k) * (k * commanded).exp() - 1.0 / k - sprayed;
    for count in [1_usize, 7, 1000] {
        let worn = wear.shots(&shots(count, commanded / count as f64), sprayed).unwrap();
        let total: f64 = worn.iter().map(|shot| shot.volume).sum();
        assert!((total / closed - 1.0).abs() < 1e-12, "{count}: {total} {closed}");
        assert!(worn.is_sorted_by(|a, b| a.volume < b.volume));
    }
    let new = shots(9, 1.234e-9);
    assert_eq!(TipWear { growth: 0.0 }.shots(&new, 3.0).unwrap(), new);
    assert!(TipWear { growth: f64::NAN }.shots(&new, 0.0).is_err() && wear.shots(&new, -1.0).is_err());
    assert!(wear.shots(&shots(1, f64::INFINITY), 0.0).is_err());
}
