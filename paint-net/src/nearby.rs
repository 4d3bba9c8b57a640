//! The least of values about places, through space: pixels on both sides of a seam are neighbours.

use std::collections::HashMap;

/// How near, metres.
const NEAR: f64 = 0.03;

/// The least of `values` within 3 cm of every point.
pub(crate) fn least_near(points: &[[f64; 3]], values: &[f64]) -> Vec<f64> {
    let cell = |p: &[f64; 3]| p.map(|c| (c / NEAR).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (k, point) in points.iter().enumerate() {
        cells.entry(cell(point)).or_default().push(k);
    }
    let around: Vec<[i64; 3]> = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]).collect();
    let least = |point: &[f64; 3]| {
        let [x, y, z] = cell(point);
        let near = around.iter().filter_map(|[dx, dy, dz]| cells.get(&[x + dx, y + dy, z + dz])).flatten();
        let near = near.filter(|&&n| distance(&points[n], point) <= NEAR);
        near.fold(f64::INFINITY, |least, &n| least.min(values[n]))
    };
    points.iter().map(least).collect()
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
