//! Images for the thesis' network.

use crate::error::Error;
use crate::ideal::ideal;
use crate::image::Image;
use crate::painters::{Deconvolution, Layered};
use crate::problem::PaintProblem;
use crate::procedural::{lattice, scene};
use crate::thesis::Architecture;

/// The `n`th picture for the thesis' network: a procedural scene in place of a photograph, treated as Paper IV, section 3.3
/// treats those. Every second picture is one of its layers between two thresholds of ink, eroded (3 x 3) and blurred with half
/// the spray radius; the others are whole pictures, blurred (ours: so that the network can also paint without layers). The
/// thesis turns every picture four ways; scenes are turned at random anyway.
pub fn thesis_patch(seed: u64, n: u64, architecture: &Architecture) -> Result<Image, Error> {
    let picture = scene(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(n), architecture.side, architecture.side);
    let draw = |k: i64| lattice(seed ^ 0x7E515, n as i64, k);
    let part = if draw(0) < 0.5 { picture } else { eroded(&layer(&picture, draw(1))?) };
    ideal(&part, 0.5 * architecture.radius)
}

/// The slice of ink between two thresholds; `which` in `[0, 1)` says which.
fn layer(picture: &Image, which: f64) -> Result<Image, Error> {
    // The painter plays no part in the thresholds.
    let tops = Layered::new(Deconvolution::default()).thresholds(&PaintProblem::new(picture))?;
    let k = (which * tops.len() as f64) as usize;
    let (from, to) = (if k == 0 { 0.0 } else { tops[k - 1] }, tops[k]);
    Ok(picture.map(|ink| ink.clamp(from, to) - from))
}

/// The least ink of the 3 x 3 pixels around each, inside the picture.
fn eroded(picture: &Image) -> Image {
    let (width, height) = picture.size();
    let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    Image::from_fn(width, height, |x, y| {
        let rows = around(y, height).flat_map(|j| around(x, width).map(move |i| (i, j)));
        rows.map(|(i, j)| picture.at(i, j)).fold(f64::INFINITY, f64::min)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_add_up_to_the_picture_and_are_all_reached() {
        let picture = scene(3, 32, 32);
        let (mut sum, mut last) = (picture.map(|_| 0.0), -1.0);
        for k in 0..1000 {
            let one = layer(&picture, f64::from(k) / 1000.0).unwrap();
            let total: f64 = one.data().iter().sum();
            if total != last {
                sum = Image::from_fn(32, 32, |x, y| sum.at(x, y) + one.at(x, y));
                last = total;
            }
        }
        for (a, b) in sum.data().iter().zip(picture.data()) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn erosion_leaves_what_is_flat_and_takes_what_is_narrow() {
        let flat = Image::filled(9, 9, 0.4);
        assert_eq!(eroded(&flat), flat);
        let dot = Image::from_fn(9, 9, |x, y| f64::from(u8::from(x == 4 && y == 4)));
        assert!(eroded(&dot).data().iter().all(|&v| v == 0.0));
    }
}
