//! How dark a texel may become: not much darker than what is wanted near it, through space and across seams.

use std::collections::HashMap;

use nalgebra::Point3;
use paint_net::Image;

use crate::surface::PaintSurface;

/// How near, metres.
const NEAR: f64 = 0.03;
/// Ink that is allowed above the darkest that is wanted near a texel: a fifth of 15 grey levels, the rest is left to the flight.
const MARGIN: f64 = 0.02;

/// The least of `values` within [`NEAR`] of every point.
pub(super) fn least_near(points: &[Point3<f64>], values: &[f64]) -> Vec<f64> {
    let cell = |p: &Point3<f64>| [p.x, p.y, p.z].map(|c| (c / NEAR).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (k, point) in points.iter().enumerate() {
        cells.entry(cell(point)).or_default().push(k);
    }
    let around: Vec<[i64; 3]> = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]).collect();
    let least = |point: &Point3<f64>| {
        let [x, y, z] = cell(point);
        let near = around.iter().filter_map(|[dx, dy, dz]| cells.get(&[x + dx, y + dy, z + dz])).flatten();
        let near = near.filter(|&&n| (points[n] - point).norm() <= NEAR);
        near.fold(f64::INFINITY, |least, &n| least.min(values[n]))
    };
    points.iter().map(least).collect()
}

/// Ink that no texel shall exceed: little more than the darkest that is wanted near it, through space. 1 beside the surface.
pub(super) fn ceiling(wanted: &Image, surface: &PaintSurface) -> Image {
    let (texels, pixels) = surface.film_texels();
    let points: Vec<Point3<f64>> = texels.iter().map(|texel| texel.point).collect();
    let bare: Vec<f64> = pixels.iter().map(|&pixel| -wanted.data()[pixel]).collect();
    let mut ceiling = wanted.map(|_| 1.0);
    for (&pixel, least) in pixels.iter().zip(least_near(&points, &bare)) {
        ceiling.data_mut()[pixel] = (MARGIN - least).min(1.0);
    }
    ceiling
}
