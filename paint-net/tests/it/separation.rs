//! Separation by a model of one's own, paints chosen and ordered, volumes of all paints at once.

use std::convert::Infallible;

use paint_net::colour::{
    ColourFit, FootprintSet, MixingModel, Separated, SparseColourFit, TexelSeparation, best_order, choose_paints,
};
use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_net::procedural::lattice;
use paint_net::{Error, Spray};

/// Glazes by Beer and Lambert: `Lab = base · exp(-K d)`, band by band.
struct Glazes {
    base: [f64; 3],
    absorption: Vec<[f64; 3]>,
}

impl MixingModel for Glazes {
    fn paints(&self) -> usize {
        self.absorption.len()
    }

    fn lab(&self, _: usize, depths: &[f64], slopes: &mut [[f64; 3]]) -> [f64; 3] {
        let lab: [f64; 3] = std::array::from_fn(|c| {
            let k: f64 = self.absorption.iter().zip(depths).map(|(a, d)| a[c] * d).sum();
            self.base[c] * (-k).exp()
        });
        for (slope, a) in slopes.iter_mut().zip(&self.absorption) {
            *slope = std::array::from_fn(|c| -a[c] * lab[c]);
        }
        lab
    }
}

fn three() -> Glazes {
    Glazes { base: [90.0, 40.0, 50.0], absorption: vec![[1.0, 0.1, 0.2], [0.15, 1.2, 0.1], [0.1, 0.2, 0.9]] }
}

fn free() -> TexelSeparation {
    TexelSeparation { paint_weight: 0.0, spread_weight: 0.0, iterations: 100, ..TexelSeparation::default() }
}

#[test]
fn depths_that_made_a_colour_are_found_again() {
    let model = three();
    let depths = |k: i64| [0, 1, 2].map(|p| 1.5 * lattice(5, k, p));
    let wanted: Vec<Option<[f64; 3]>> = (0..300).map(|k| Some(model.lab(0, &depths(k), &mut []))).collect();
    let found = free().separate(&wanted, &model).unwrap();
    for k in 0..300 {
        for p in 0..3 {
            let (is, was) = (found.depths[p][k], depths(k as i64)[p]);
            assert!((is - was).abs() < 2e-3, "pixel {k}, paint {p}: {is}, it was {was}");
        }
    }
    let threads = TexelSeparation { threads: 3, ..free() }.separate(&wanted, &model).unwrap();
    assert_eq!(found, threads);
    // Nothing wanted, nothing painted.
    let Separated { depths, lab } = free().separate(&[None], &model).unwrap();
    assert_eq!((depths, lab), (vec![vec![0.0]; 3], vec![model.base]));
}

/// With two paints that look alike the weights decide: the same of both where their squares count.
#[test]
fn weights_save_paint_and_spread_it() {
    let twins = Glazes { base: [80.0, 0.0, 0.0], absorption: vec![[1.0, 0.0, 0.0]; 2] };
    let wanted = [Some([80.0 * (-1.0_f64).exp(), 0.0, 0.0])];
    let spread = TexelSeparation { paint_weight: 0.0, spread_weight: 0.05, ..TexelSeparation::default() };
    let found = spread.separate(&wanted, &twins).unwrap();
    assert!((found.depths[0][0] - 0.5).abs() < 0.01 && (found.depths[1][0] - 0.5).abs() < 0.01, "{:?}", found.depths);
    let dear = TexelSeparation { paint_weight: 60.0, spread_weight: 0.0, ..TexelSeparation::default() };
    let sum = |separated: Separated| separated.depths.iter().map(|d| d[0]).sum::<f64>();
    assert!(sum(dear.separate(&wanted, &twins).unwrap()) < 0.97 * sum(found));
}

#[test]
fn bad_input_is_refused() {
    let none = Glazes { base: [50.0; 3], absorption: Vec::new() };
    assert!(matches!(free().separate(&[], &none), Err(Error::InvalidSetting { name: "paints", .. })));
    let infinite = [Some([50.0, f64::NAN, 0.0])];
    assert!(matches!(free().separate(&infinite, &three()), Err(Error::Pixel { .. })));
    for bad in [TexelSeparation { deepest: 0.0, ..free() }, TexelSeparation { threads: 0, ..free() }] {
        assert!(matches!(bad.separate(&[], &three()), Err(Error::InvalidSetting { .. })));
    }
}

/// Against all combinations; what two paints are good for together is not what each is good for.
#[test]
fn the_chosen_paints_are_the_best_of_all_combinations() {
    for seed in 0..20 {
        let of = |a: usize, b: usize| lattice(seed, a as i64, b as i64);
        let cost_of = |paints: &[usize]| {
            let pairs = paints.iter().flat_map(|&a| paints.iter().map(move |&b| 0.15 * of(a.min(b), a.max(b))));
            10.0 - paints.iter().map(|&a| 1.0 + of(a, 50)).sum::<f64>() + pairs.sum::<f64>()
        };
        let mut exhaustive = f64::INFINITY;
        for a in 0..8 {
            for b in a + 1..8 {
                for c in b + 1..8 {
                    exhaustive = f64::min(exhaustive, cost_of(&[a, b, c]));
                }
            }
        }
        let mut cost = |paints: &[usize]| Ok::<f64, Error>(cost_of(paints));
        let chosen = choose_paints(8, 3, &mut cost).unwrap();
        assert!(cost_of(&chosen) <= 1.01 * exhaustive, "{seed}: {chosen:?} {} {exhaustive}", cost_of(&chosen));
    }
    // The best paint alone is none of the best two.
    let mut pairs = |paints: &[usize]| {
        let cost = match paints {
            [0] => 1.0,
            [_] => 2.0,
            [1, 2] => 0.1,
            _ => 0.9,
        };
        Ok::<f64, Error>(cost)
    };
    assert_eq!(choose_paints(3, 2, &mut pairs).unwrap(), [1, 2]);
    assert!(choose_paints(2, 3, &mut |_: &[usize]| Ok::<f64, Error>(0.0)).is_err());
}

#[test]
fn an_order_is_sorted_by_what_it_costs() {
    let mut inversions = |order: &[usize]| {
        let pairs = (0..order.len()).flat_map(|i| (i + 1..order.len()).map(move |j| (i, j)));
        Ok::<f64, Infallible>(1.0 + pairs.filter(|&(i, j)| order[i] > order[j]).count() as f64)
    };
    assert_eq!(best_order(&[4, 1, 3, 0, 2], &mut inversions).unwrap(), [0, 1, 2, 3, 4]);
}

/// Overlapping spots in a row of pixels.
fn lists(count: usize) -> Vec<SurfaceFootprint> {
    let spot = |k: usize| {
        let share = |x: usize| (-0.5 * ((x as f64 - 2.0 * k as f64) / 2.0).powi(2)).exp() as f32;
        (0..2 * count).filter(|x| share(*x) > 1e-3).map(|x| (x as u32, share(x))).collect()
    };
    (0..count).map(spot).collect()
}

fn fit<'a>(
    model: &'a Glazes,
    wanted: &'a [[f64; 3]],
    weight: &'a [f64],
    footprints: &'a [&'a FootprintSet],
) -> ColourFit<'a> {
    ColourFit {
        wanted,
        weight,
        model,
        footprints,
        min_volume: 0.0,
        max_volume: 2.0,
        paint_weight: 0.0,
        prices: &[],
        iterations: 400,
        tolerance: 1e-9,
        threads: 1,
    }
}

#[test]
fn volumes_that_made_a_picture_are_found_again() {
    let (model, lists, spots) = (three(), lists(40), spots(40));
    let made: Vec<Vec<f64>> = (0..3).map(|p| (0..40).map(|k| 0.1 + 0.4 * lattice(9, p, k)).collect()).collect();
    let depths = |volumes: &[Vec<f64>], x: usize| -> Vec<f64> {
        let of = |paint: &Vec<f64>| {
            let shares = lists.iter().zip(paint);
            shares
                .map(|(spot, v)| spot.iter().filter(|s| s.0 as usize == x).map(|s| v * f64::from(s.1)).sum::<f64>())
                .sum()
        };
        volumes.iter().map(of).collect()
    };
    let wanted: Vec<[f64; 3]> = (0..80).map(|x| model.lab(0, &depths(&made, x), &mut [])).collect();
    let (weight, footprints) = ([1.0; 80], [&spots; 3]);
    let fit = fit(&model, &wanted, &weight, &footprints);
    let mut volumes = vec![vec![0.3; 40]; 3];
    let found = fit.solve(&mut volumes, &mut |_| ()).unwrap();
    for x in 0..80 {
        let expected = depths(&volumes, x);
        assert!((0..3).all(|p| (found[p][x] - expected[p]).abs() < 1e-4), "the canvas is not that of the volumes");
        let lab = model.lab(0, &expected, &mut []);
        assert!((0..3).all(|c| (lab[c] - wanted[x][c]).abs() < 0.2), "pixel {x}: {lab:?} {:?}", wanted[x]);
    }
    let mut threaded = vec![vec![0.3; 40]; 3];
    ColourFit { threads: 3, ..fit }.solve(&mut threaded, &mut |_| ()).unwrap();
    assert_eq!(volumes, threaded);
}

#[test]
fn bounds_hold_and_what_does_not_count_pulls_at_nothing() {
    let (model, spots) = (three(), spots(10));
    // Black is out of reach: everything goes to the upper bound; then the bare wall, and everything to the lower one.
    for (lab, expected) in [([1.0, 0.0, 0.0], 2.0), (model.base, 0.25)] {
        let (wanted, weight, footprints) = ([lab; 20], [1.0; 20], [&spots; 3]);
        let fit = ColourFit { min_volume: 0.25, ..fit(&model, &wanted, &weight, &footprints) };
        let mut volumes = vec![vec![1.0; 10]; 3];
        fit.solve(&mut volumes, &mut |_| ()).unwrap();
        assert!(volumes.iter().flatten().all(|v| (0.25..=2.0 + 1e-12).contains(v)), "{volumes:?}");
        assert!((volumes[0][5] - expected).abs() < 0.05, "{lab:?}: {volumes:?}");
    }
    let (wanted, footprints) = ([[50.0, 0.0, 0.0]; 20], [&spots; 3]);
    for [min_volume, max_volume] in [[-0.1, 2.0], [2.0, 2.0], [0.0, f64::INFINITY], [f64::NAN, 2.0]] {
        let fit = ColourFit { min_volume, max_volume, ..fit(&model, &wanted, &[1.0; 20], &footprints) };
        assert!(fit.solve(&mut vec![vec![1.0; 10]; 3], &mut |_| ()).is_err(), "{min_volume} to {max_volume}");
    }
    let mut volumes = vec![vec![1.0; 10]; 3];
    fit(&model, &wanted, &[0.0; 20], &footprints).solve(&mut volumes, &mut |_| ()).unwrap();
    assert_eq!(volumes, vec![vec![1.0; 10]; 3]);
    let short = fit(&model, &wanted, &[1.0; 19], &footprints).solve(&mut volumes, &mut |_| ());
    assert!(matches!(short, Err(Error::Mismatch { what: "weight", .. })), "{short:?}");
}

/// A dearer spray leaves less: near the aim, where the cost is a parabola, in proportion to the price. An infinite price leaves a spray out, whatever the least volume is.
#[test]
fn prices_of_volumes_count_beside_the_colours() {
    let model = Glazes { base: [90.0, 40.0, 50.0], absorption: vec![[1.0, 0.1, 0.2]] };
    let wanted = [model.lab(0, &[0.8], &mut [])];
    let spot = FootprintSet::of([vec![(0, 1.0)]]).unwrap();
    let footprints = [&spot];
    let solved = |price: f64, min_volume: f64| {
        let prices = [vec![price]];
        let mut volumes = vec![vec![0.3]];
        let fit = ColourFit { prices: &prices, min_volume, ..fit(&model, &wanted, &[1.0], &footprints) };
        fit.solve(&mut volumes, &mut |_| ()).map(|_| volumes[0][0])
    };
    let free = solved(0.0, 0.0).unwrap();
    assert!((free - 0.8).abs() < 1e-3, "{free}");
    let falls: Vec<f64> = [1.0, 4.0, 16.0, 64.0].map(|price| solved(price, 0.0).unwrap()).to_vec();
    assert!(falls.windows(2).all(|pair| pair[1] < pair[0]) && falls[0] < free, "{falls:?}");
    let [by_one, by_four] = [1.0, 4.0].map(|price| free - solved(0.1 * price, 0.0).unwrap());
    assert!((by_four / by_one - 4.0).abs() < 0.1, "{by_one} {by_four}");
    assert_eq!(solved(f64::INFINITY, 0.25).unwrap(), 0.0);
    for price in [-1.0, f64::NAN] {
        assert!(matches!(solved(price, 0.0), Err(Error::InvalidSetting { name: "prices", .. })));
    }
}

fn spots(count: usize) -> FootprintSet {
    FootprintSet::of(lists(count)).unwrap()
}

/// A row of sprays, one for each of the spots.
fn row(count: usize) -> Vec<Stroke> {
    let spray = |k: usize| Spray { x: 2.0 * k as f64, y: 0.0, volume: 0.3, sigma: 2.0 };
    vec![Stroke { sprays: (0..count).map(spray).collect() }]
}

/// Two paints that look alike: in each block the one of which more lies there at first is kept, and the colour stays.
#[test]
fn of_paints_that_look_alike_one_is_left_out() {
    let model = Glazes { base: [90.0, 40.0, 50.0], absorption: vec![[1.0, 0.1, 0.2]; 2] };
    let (spots, rows) = (spots(40), row(40));
    let wanted = [model.lab(0, &[0.8, 0.0], &mut []); 80];
    let (weight, footprints, rows) = ([1.0; 80], [&spots; 2], [rows.as_slice(); 2]);
    let start =
        |p: usize| (0..40).map(|k| if (k / 10 + p).is_multiple_of(2) { 0.2 } else { 0.1 }).collect::<Vec<f64>>();
    let fit = fit(&model, &wanted, &weight, &footprints);
    let sparse = SparseColourFit { fit, rows: &rows, block: 20.0, price: 1.0, coarse: &[] };
    let mut volumes = vec![start(0), start(1)];
    let depths = sparse.solve(&mut volumes, &mut |_| ()).unwrap();
    for block in 0..4 {
        let [kept, left_out] = [block % 2, 1 - block % 2].map(|p| &volumes[p][10 * block..10 * (block + 1)]);
        assert!(
            kept.iter().sum::<f64>() > 1.0 && left_out.iter().all(|volume| *volume == 0.0),
            "{kept:?} {left_out:?}"
        );
    }
    let both = depths[0].iter().zip(&depths[1]).map(|(a, b)| a + b);
    assert!(both.skip(8).take(64).all(|depth| (depth - 0.8).abs() < 0.02), "{depths:?}");
    // Without a price it is the fit alone.
    let [mut free, mut alone] = [vec![start(0), start(1)], vec![start(0), start(1)]];
    SparseColourFit { price: 0.0, ..sparse }.solve(&mut free, &mut |_| ()).unwrap();
    fit.solve(&mut alone, &mut |_| ()).unwrap();
    assert_eq!(free, alone);
    assert!((0..4).all(|block| free.iter().all(|of| of[10 * block..10 * (block + 1)].iter().sum::<f64>() > 0.1)));
    // Told apart on pairs of pixels, the same are left out, and the colours are as near.
    let pairs: Vec<u32> = (0..80).map(|k| k / 2).collect();
    let mut on_pairs = vec![start(0), start(1)];
    let depths = SparseColourFit { coarse: &pairs, ..sparse }.solve(&mut on_pairs, &mut |_| ()).unwrap();
    let left_out = |volumes: &[Vec<f64>]| volumes.iter().flatten().map(|volume| *volume == 0.0).collect::<Vec<bool>>();
    assert_eq!(left_out(&volumes), left_out(&on_pairs));
    let both = depths[0].iter().zip(&depths[1]).map(|(a, b)| a + b);
    assert!(both.skip(8).take(64).all(|depth| (depth - 0.8).abs() < 0.02), "{depths:?}");
    let (gap, far) = ([0, 2].repeat(40), [u32::MAX; 80]);
    for coarse in [&pairs[1..], &gap, &far] {
        assert!(SparseColourFit { coarse, ..sparse }.solve(&mut volumes, &mut |_| ()).is_err());
    }
    let short = SparseColourFit { rows: &rows[..1], ..sparse }.solve(&mut volumes, &mut |_| ());
    assert!(matches!(short, Err(Error::Mismatch { what: "list of rows", .. })), "{short:?}");
    for (price, block) in [(-1.0, 20.0), (f64::NAN, 20.0), (1.0, 0.0), (1.0, f64::INFINITY)] {
        assert!(SparseColourFit { price, block, ..sparse }.solve(&mut volumes, &mut |_| ()).is_err());
    }
}

/// What hardly shows is not worth its way; what shows well is, and so is what hardly shows where way is cheap.
#[test]
fn a_paint_goes_where_it_is_worth_its_way() {
    let model = three();
    let (spots, rows) = (spots(40), row(40));
    let (weight, footprints, rows) = ([1.0; 80], [&spots; 3], [rows.as_slice(); 3]);
    let used = |depth: f64, price: f64| {
        // The second paint in the middle alone, over one of the first everywhere.
        let of = |x: usize| if (32..48).contains(&x) { depth } else { 0.0 };
        let wanted: Vec<[f64; 3]> = (0..80).map(|x| model.lab(0, &[0.5, of(x), 0.0], &mut [])).collect();
        let fit = fit(&model, &wanted, &weight, &footprints);
        let sparse = SparseColourFit { fit, rows: &rows, block: 16.0, price, coarse: &[] };
        let mut volumes = vec![vec![0.1; 40]; 3];
        sparse.solve(&mut volumes, &mut |_| ()).unwrap();
        assert!(volumes[0].chunks(8).all(|of_block| of_block.iter().sum::<f64>() > 0.3), "{volumes:?}");
        volumes[1][16..24].iter().filter(|volume| **volume > 0.0).count()
    };
    assert_eq!([used(0.5, 1.0), used(0.01, 1.0), used(0.01, 1e-6)].map(|count| count > 0), [true, false, true]);
}
