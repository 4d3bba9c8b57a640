//! Doses of a coat against closed forms and brute force.

use paint_net::Error;
use paint_net::painters::{DoseCorrection, DoseFootprint};

/// `S` dense, for sums written out.
fn dense(footprints: &[DoseFootprint], places: usize) -> Vec<Vec<f64>> {
    let column = |footprint: &DoseFootprint| {
        let mut column = vec![0.0; places];
        for &(k, share) in footprint {
            column[k as usize] += share;
        }
        column
    };
    footprints.iter().map(column).collect()
}

/// Rows of spots, each a tent of five places, some shifted and of other heights.
fn tents(count: usize) -> Vec<DoseFootprint> {
    let tent = |k: usize| {
        let height = [1.0, 0.7, 1.3][k % 3];
        [0.25, 0.75, 1.0, 0.75, 0.25].iter().enumerate().map(|(n, t)| ((2 * k + n) as u32, height * t)).collect()
    };
    (0..count).map(tent).collect()
}

/// Sprays that do not overlap: `v = Σ w s y / Σ w s²`, each alone.
#[test]
fn sprays_apart_take_their_weighted_mean() {
    let footprints = vec![vec![(0, 2.0), (1, 1.0)], vec![(2, 0.5)]];
    let (wanted, weight) = ([4.0, 1.0, 3.0], [1.0, 3.0, 2.0]);
    let mut volumes = [1.0, 1.0];
    let correction = DoseCorrection { footprints: &footprints, wanted: &wanted, weight: &weight, rounds: 50 };
    let thickness = correction.solve(&mut volumes, &[f64::MAX; 2]).unwrap();
    let first = (1.0 * 2.0 * 4.0 + 3.0 * 1.0 * 1.0) / (1.0 * 4.0 + 3.0 * 1.0);
    assert!((volumes[0] - first).abs() < 1e-12 && (volumes[1] - 6.0).abs() < 1e-12, "{volumes:?}");
    assert!((thickness[0] - 2.0 * first).abs() < 1e-12 && (thickness[2] - 3.0).abs() < 1e-12);
}

/// Where the optimum lies, moved sprays cost more (Karush-Kuhn-Tucker): the gradient is zero inside and positive at zero, negative at the top.
#[test]
fn what_it_ends_with_is_the_optimum() {
    let footprints = tents(12);
    let places = 27;
    let wanted: Vec<f64> = (0..places).map(|k| if k < 14 { 3.0 } else { 0.2 }).collect();
    let weight: Vec<f64> = (0..places).map(|k| 1.0 + (k % 4) as f64).collect();
    let (mut volumes, most) = (vec![1.0; 12], vec![1.5; 12]);
    let correction = DoseCorrection { footprints: &footprints, wanted: &wanted, weight: &weight, rounds: 20_000 };
    let thickness = correction.solve(&mut volumes, &most).unwrap();
    let columns = dense(&footprints, places);
    let mut bound = [0, 0, 0];
    for (column, volume) in columns.iter().zip(&volumes) {
        let gradient: f64 = (0..places).map(|k| weight[k] * column[k] * (thickness[k] - wanted[k])).sum();
        let slack = 1e-3 * (0..places).map(|k| weight[k] * column[k] * wanted[k]).sum::<f64>();
        if *volume < 1e-4 {
            bound[0] += 1;
            assert!(gradient > -slack, "at zero, {gradient}");
        } else if *volume > 1.5 - 1e-9 {
            bound[2] += 1;
            assert!(gradient < slack, "at the top, {gradient}");
        } else {
            bound[1] += 1;
            assert!(gradient.abs() < slack, "inside, {gradient} at {volume}");
        }
    }
    assert!(bound.iter().all(|&count| count > 0), "each kind is there: {bound:?}");
}

#[test]
fn what_cannot_be_is_refused() {
    let footprints = vec![vec![(0, 1.0)], vec![(1, 1.0)]];
    let solve = |wanted: &[f64], weight: &[f64], volumes: &[f64], most: &[f64], footprints: &[DoseFootprint]| {
        let correction = DoseCorrection { footprints, wanted, weight, rounds: 1 };
        correction.solve(&mut volumes.to_vec(), most)
    };
    let two = [1.0, 1.0];
    assert!(solve(&two, &two, &two, &two, &footprints).is_ok());
    assert!(matches!(solve(&two, &[1.0], &two, &two, &footprints), Err(Error::Mismatch { .. })));
    assert!(matches!(solve(&two, &two, &[1.0], &two, &footprints), Err(Error::Mismatch { .. })));
    assert!(matches!(solve(&two, &two, &two, &[1.0], &footprints), Err(Error::Mismatch { .. })));
    for wrong in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(solve(&[1.0, wrong], &two, &two, &two, &footprints).is_err());
        assert!(solve(&two, &[wrong, 1.0], &two, &two, &footprints).is_err());
        assert!(solve(&two, &two, &[1.0, wrong], &two, &footprints).is_err());
        assert!(solve(&two, &two, &two, &two, &[vec![(0, wrong)], vec![]]).is_err());
    }
    assert!(solve(&two, &two, &two, &two, &[vec![(2, 1.0)], vec![]]).is_err());
}
