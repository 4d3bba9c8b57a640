//! Orders against brute force, bounds against orders.

use super::*;
use nalgebra::{Point3, Vector3};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Uniform numbers in [0, 1).
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = SplitMix64::seed_from_u64(seed);
    move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn target(y: f64, z: f64) -> Target {
    Target { point: Point3::new(0.0, y, z), normal: -Vector3::x_axis(), dose: 0.0, time: None, stand_off: None }
}

/// Strokes of up to `length` metres at random on a wall of `size` metres.
fn scattered(count: usize, size: f64, length: f64, seed: u64) -> Vec<StrokeEnds> {
    let mut next = uniform(seed);
    (0..count)
        .map(|_| {
            let (y, z) = (size * next(), size * next());
            StrokeEnds { first: target(y, z), last: target(y + length * next(), z + length * (next() - 0.5)) }
        })
        .collect()
}

/// Duration of an order, counted from its definition.
fn duration(strokes: &[StrokeEnds], order: &[OrderedStroke], from: Option<&Target>, settings: &Settings) -> f64 {
    let cost = TransitCost::new(strokes, from, settings);
    let entry = |o: &OrderedStroke| 2 * o.index + usize::from(o.reversed);
    let exit = |o: &OrderedStroke| 2 * o.index + usize::from(!o.reversed);
    let first = order.first().map_or(0.0, |o| cost.first(entry(o)));
    first + order.windows(2).map(|pair| cost.between(exit(&pair[0]), entry(&pair[1]))).sum::<f64>()
}

/// The least duration over all orders and directions.
fn best_of_all(strokes: &[StrokeEnds], from: Option<&Target>, settings: &Settings) -> f64 {
    fn extend(order: &mut Vec<OrderedStroke>, of: &dyn Fn(&[OrderedStroke]) -> f64, count: usize, best: &mut f64) {
        if order.len() == count {
            *best = best.min(of(order));
            return;
        }
        for index in (0..count).filter(|&k| order.iter().all(|o| o.index != k)).collect::<Vec<_>>() {
            for reversed in [false, true] {
                order.push(OrderedStroke { index, reversed });
                extend(order, of, count, best);
                order.pop();
            }
        }
    }
    let mut best = f64::INFINITY;
    let of = |order: &[OrderedStroke]| duration(strokes, order, from, settings);
    extend(&mut Vec::new(), &of, strokes.len(), &mut best);
    best
}

#[test]
fn few_strokes_are_ordered_as_well_as_by_trying_all_orders() {
    let settings = Settings::default();
    let start = target(0.0, 0.0);
    let (mut worst, mut exact) = (1.0_f64, 0);
    for seed in 0..40 {
        let strokes = scattered(5, 4.0, 1.0, seed);
        let from = (seed % 2 == 0).then_some(&start);
        let found = order_strokes(&strokes, from, &settings).unwrap();
        assert!((found.transit_time - duration(&strokes, &found.strokes, from, &settings)).abs() < 1e-9);
        let best = best_of_all(&strokes, from, &settings);
        let bound = transit_lower_bound(&strokes, from, &settings, 200).unwrap();
        assert!(found.transit_time >= best - 1e-9 && bound <= best + 1e-9, "{bound} {best} {}", found.transit_time);
        assert!(bound > 0.6 * best, "seed {seed}: the bound {bound} says nothing about {best}");
        worst = worst.max(found.transit_time / best);
        exact += usize::from(found.transit_time < best + 1e-9);
    }
    assert!(exact >= 34 && worst < 1.1, "{exact} of 40 are best, the worst takes {worst} of the best");
}

#[test]
fn many_strokes_lie_near_the_bound_and_each_is_flown_once() {
    let settings = Settings::default();
    let strokes = scattered(120, 5.0, 0.5, 7);
    let order = order_strokes(&strokes, None, &settings).unwrap();
    let mut seen: Vec<usize> = order.strokes.iter().map(|o| o.index).collect();
    seen.sort_unstable();
    assert!(seen.iter().copied().eq(0..120));
    let bound = transit_lower_bound(&strokes, None, &settings, 200).unwrap();
    assert!(order.transit_time < 1.08 * bound, "{} s against {bound} s", order.transit_time);
    assert_eq!(order, order_strokes(&strokes, None, &settings).unwrap());
}

/// Rows of a raster, given in a shuffled order, are flown to and fro.
#[test]
fn rows_are_flown_as_a_boustrophedon() {
    let rows: Vec<StrokeEnds> = (0..30)
        .map(|k| {
            let z = 0.0375 * f64::from((7 * k) % 30);
            StrokeEnds { first: target(0.0, z), last: target(2.0, z) }
        })
        .collect();
    let settings = Settings::default();
    let order = order_strokes(&rows, None, &settings).unwrap();
    let speed = 0.4;
    assert!((order.transit_time - 29.0 * 0.0375 / speed).abs() < 1e-9, "{}", order.transit_time);
    assert!(order.strokes.windows(2).all(|pair| pair[0].reversed != pair[1].reversed));
}

/// A turn of the vehicle costs what its heading rate allows, even where the way is short.
#[test]
fn strokes_that_face_another_way_wait() {
    let side = |z: f64, normal: Vector3<f64>| {
        let at = |y: f64| Target {
            point: Point3::new(0.0, y, z),
            normal: nalgebra::UnitVector3::new_normalize(normal),
            dose: 0.0,
            time: None,
            stand_off: None,
        };
        StrokeEnds { first: at(0.0), last: at(0.01) }
    };
    let (front, back) = (Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0));
    let strokes = [side(1.0, front), side(1.3, back), side(1.6, front), side(1.9, back)];
    let order = order_strokes(&strokes, None, &Settings::default()).unwrap();
    let sides: Vec<bool> = order.strokes.iter().map(|o| o.index % 2 == 0).collect();
    assert_eq!(sides.windows(2).filter(|pair| pair[0] != pair[1]).count(), 1, "{sides:?}");
}

#[test]
fn nothing_one_and_nonsense() {
    let settings = Settings::default();
    let none = order_strokes(&[], None, &settings).unwrap();
    assert!(none.strokes.is_empty() && none.transit_time == 0.0);
    let stroke = StrokeEnds { first: target(0.0, 1.0), last: target(1.0, 1.0) };
    let only = order_strokes(&[stroke], Some(&target(1.0, 1.0)), &settings).unwrap();
    assert_eq!(only.strokes, [OrderedStroke { index: 0, reversed: true }]);
    let bad = StrokeEnds { last: target(f64::NAN, 1.0), ..stroke };
    assert!(matches!(order_strokes(&[stroke, bad], None, &settings), Err(Error::Target { index: 1, .. })));
}
