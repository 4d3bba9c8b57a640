//! The smallest rectangle against brute force.

use crate::common::Rng;
use uv_param::Error;
use uv_param::min_area_rectangle::{convex_hull, min_area_rectangle};

/// Smallest area over all pairs of points that have every other point on one side: O(n^3), no hull, no calipers.
fn brute_force(points: &[[f64; 2]]) -> f64 {
    let mut least = f64::INFINITY;
    for a in points {
        for b in points {
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let length = dx.hypot(dy);
            if length == 0.0 {
                continue;
            }
            let along: Vec<f64> = points.iter().map(|p| (dx * (p[0] - a[0]) + dy * (p[1] - a[1])) / length).collect();
            let above: Vec<f64> = points.iter().map(|p| (dx * (p[1] - a[1]) - dy * (p[0] - a[0])) / length).collect();
            if above.iter().all(|&h| h >= -1e-12) {
                let extent = |x: &[f64]| {
                    x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                        - x.iter().copied().fold(f64::INFINITY, f64::min)
                };
                least = least.min(extent(&along) * extent(&above));
            }
        }
    }
    least
}

#[test]
fn the_area_is_that_of_brute_force_and_the_rectangle_holds_all() {
    let mut rng = Rng(11);
    for round in 0..400 {
        let n = 3 + rng.below(30);
        let squash = if round % 3 == 0 { 1.0 } else { rng.unit() };
        let points: Vec<[f64; 2]> = (0..n)
            .map(|_| {
                let (a, r) = (std::f64::consts::TAU * rng.unit(), if round % 2 == 0 { 1.0 } else { rng.unit() });
                [r * a.cos(), squash * r * a.sin() + 0.5 * r * a.cos()]
            })
            .collect();
        let rectangle = min_area_rectangle(&points).unwrap();
        let expected = brute_force(&points);
        assert!((rectangle.area() - expected).abs() < 1e-12, "{} instead of {expected}", rectangle.area());
        let (sin, cos) = rectangle.angle.sin_cos();
        for p in &points {
            let (x, y) = (p[0] - rectangle.corner[0], p[1] - rectangle.corner[1]);
            let (x, y) = (cos * x + sin * y, cos * y - sin * x);
            assert!(x > -1e-12 && x < rectangle.width + 1e-12 && y > -1e-12 && y < rectangle.height + 1e-12);
        }
    }
}

#[test]
fn a_turned_rectangle_is_found_again() {
    for degrees in [-44.0_f64, -20.0, 0.0, 13.0, 45.0] {
        let angle = degrees.to_radians();
        let (sin, cos) = angle.sin_cos();
        let points: Vec<[f64; 2]> = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0], [1.0, 0.0], [1.5, 0.5]]
            .iter()
            .map(|[x, y]| [7.0 + cos * x - sin * y, -2.0 + sin * x + cos * y])
            .collect();
        let found = min_area_rectangle(&points).unwrap();
        assert!((found.area() - 3.0).abs() < 1e-12);
        assert!((found.width.max(found.height) - 3.0).abs() < 1e-12);
        // At 45 degrees rounding may name the other side; everywhere else the angle is the one that was put in.
        assert!((found.angle.abs() - angle.abs()).abs() < 1e-12);
        assert!(degrees == 45.0 || (found.angle - angle).abs() < 1e-12 && (found.width - 3.0).abs() < 1e-12);
    }
}

#[test]
fn the_hull_has_no_superfluous_corner() {
    let points: Vec<[f64; 2]> = (0..121).map(|i| [f64::from(i % 11), f64::from(i / 11)]).collect();
    let hull = convex_hull(&points);
    assert_eq!(hull, [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]);
}

#[test]
fn points_without_area_are_refused() {
    assert_eq!(min_area_rectangle(&[]), Err(Error::FlatPoints { points: 0 }));
    let line: Vec<[f64; 2]> = (0..5).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
    assert_eq!(min_area_rectangle(&line), Err(Error::FlatPoints { points: 5 }));
    let broken = [[0.0, 0.0], [1.0, f64::NAN], [0.0, 1.0]];
    assert_eq!(min_area_rectangle(&broken), Err(Error::NonFiniteValue { what: "points", index: 1 }));
}
