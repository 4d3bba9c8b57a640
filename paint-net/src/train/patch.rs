//! Images for the thesis' network.

use crate::error::Error;
use crate::ideal::ideal;
use crate::image::Image;
use crate::painters::{Deconvolution, Layered};
use crate::problem::PaintProblem;
use crate::procedural::{lattice, scene};
use crate::thesis::Architecture;

/// The `n`th picture for the thesis' network, ink of `side` x `side` pixels: a procedural scene in place of a photograph, treated as Paper IV,
/// section 3.3 treats photographs. Every second picture is one of its layers between two thresholds of ink, eroded (3 x 3) and blurred with
/// half the spray radius; the others are whole pictures, blurred (ours: so that the network can also paint without layers). The thesis turns
/// every picture four ways; scenes are turned at random anyway.
pub fn thesis_patch(seed: u64, n: u64, architecture: &Architecture) -> Result<Image, Error> {
    let picture = scene(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(n), architecture.side, architecture.side);
    part_of(&picture, seed, n, architecture)
}

/// What the `n`th sample shows of a picture.
fn part_of(picture: &Image, seed: u64, n: u64, architecture: &Architecture) -> Result<Image, Error> {
    let draw = |k: i64| lattice(seed ^ 0x7E515, n as i64, k);
    let part = if draw(0) < 0.5 { picture.clone() } else { eroded(&layer(picture, draw(1))?) };
    ideal(&part, 0.5 * architecture.radius)
}

/// The same of one of these photographs (ink in `[0, 1]`, of any size): a square of it, shrunk to `side` x `side` pixels and turned one of four
/// ways, is treated as a scene by [`thesis_patch`]. The thesis shrinks its photographs whole; of few, squares of any size and place tell more
/// (ours): the shorter side is one to four of them.
pub fn thesis_patch_of(photographs: &[Image], seed: u64, n: u64, architecture: &Architecture) -> Result<Image, Error> {
    let draw = |k: i64| lattice(seed ^ 0xF0706, n as i64, k);
    let below = |k: i64, most: usize| ((draw(k) * most as f64) as usize).min(most.saturating_sub(1));
    let photograph = photographs.get(below(0, photographs.len())).ok_or(Error::EmptyProblem("there is no picture"))?;
    let (width, height) = photograph.size();
    let square = (width.min(height) as f64 / 4.0_f64.powf(draw(1))).round().max(1.0) as usize;
    let corner = (below(2, width - square + 1), below(3, height - square + 1));
    let picture = turned(&shrunk(photograph, corner, square, architecture.side), below(4, 4));
    part_of(&picture, seed, n, architecture)
}

/// A square of a picture as `side` x `side` means over its area.
fn shrunk(picture: &Image, (left, top): (usize, usize), square: usize, side: usize) -> Image {
    let scale = square as f64 / side as f64;
    // Pixels that a cell of the new picture meets, with the share of each.
    let along = |k: usize| {
        let (from, to) = (k as f64 * scale, (k + 1) as f64 * scale);
        let last = (to.ceil() as usize).min(square);
        (from as usize..last).map(move |i| (i, (to.min(i as f64 + 1.0) - from.max(i as f64)).max(0.0) / scale))
    };
    Image::from_fn(side, side, |x, y| {
        let row = |(j, share): (usize, f64)| {
            share * along(x).map(|(i, share)| share * picture.at(left + i, top + j)).sum::<f64>()
        };
        along(y).map(row).sum::<f64>().clamp(0.0, 1.0)
    })
}

/// A square picture turned by so many quarters.
fn turned(picture: &Image, quarters: usize) -> Image {
    let last = picture.width() - 1;
    Image::from_fn(picture.width(), picture.height(), |x, y| match quarters {
        0 => picture.at(x, y),
        1 => picture.at(y, last - x),
        2 => picture.at(last - x, last - y),
        _ => picture.at(last - y, x),
    })
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

    /// Means of whole and of cut pixels by hand; a turn moves the corner round, four are none.
    #[test]
    fn squares_are_shrunk_by_area_and_turned() {
        let picture = Image::from_fn(5, 4, |x, y| (x + 5 * y) as f64 / 20.0);
        let half = shrunk(&picture, (1, 0), 4, 2);
        assert!((half.at(0, 0) - (1.0 + 2.0 + 6.0 + 7.0) / 80.0).abs() < 1e-12);
        assert!((half.at(1, 1) - (13.0 + 14.0 + 18.0 + 19.0) / 80.0).abs() < 1e-12);
        // Three pixels into two: one and a half each.
        let cut = shrunk(&picture, (0, 0), 3, 2);
        let row = |y: f64| [(0.0 + 0.5) / 1.5 + 5.0 * y, (0.5 + 2.0) / 1.5 + 5.0 * y].map(|v| v / 20.0);
        assert!((cut.at(1, 0) - (row(0.0)[1] + 0.5 * row(1.0)[1]) / 1.5).abs() < 1e-12);
        // Larger than it is: every pixel twice.
        let grown = shrunk(&picture, (0, 0), 2, 4);
        assert!((grown.at(1, 0) - picture.at(0, 0)).abs() < 1e-12 && (grown.at(2, 3) - picture.at(1, 1)).abs() < 1e-12);
        let once = turned(&half, 1);
        assert_eq!((once.at(1, 0), turned(&once, 3)), (half.at(0, 0), half.clone()));
        assert_eq!(turned(&once, 1), turned(&half, 2));
        assert!(once != half && turned(&half, 2) != half);
    }

    /// Of photographs of one ink each, all turn up, whatever their shape; the same number gives the same picture.
    #[test]
    fn every_photograph_is_shown() {
        let architecture = Architecture { side: 8, ..Architecture::PAINT };
        let photographs = [Image::filled(3, 50, 0.9), Image::filled(40, 20, 0.2), Image::filled(1, 1, 0.5)];
        let patch = |n| thesis_patch_of(&photographs, 1, n, &architecture).unwrap();
        let mut seen = [0; 3];
        for n in 0..60 {
            let most = patch(n).data().iter().copied().fold(0.0, f64::max);
            // A layer above all of its ink is empty.
            let of = [0.9, 0.2, 0.5].iter().position(|ink| (ink - most).abs() < 1e-9);
            assert!(of.is_some() || most < 1e-12, "{most}");
            if let Some(k) = of {
                seen[k] += 1;
            }
        }
        assert!(seen.iter().all(|&times| times > 5), "{seen:?}");
        assert_eq!(patch(5), patch(5));
        // Of two halves, small squares show one.
        let halves = [Image::from_fn(64, 64, |x, _| if x < 32 { 0.5 } else { 0.2 })];
        let one = (0..60).filter(|&n| {
            let shown = thesis_patch_of(&halves, 1, n, &architecture).unwrap();
            let [least, most] = [f64::min, f64::max].map(|of| shown.data().iter().copied().reduce(of).unwrap());
            // A layer of both is never as dark.
            most > 0.45 && most - least < 1e-9
        });
        assert!((2..30).contains(&one.count()));
        assert!(thesis_patch_of(&[], 1, 0, &architecture).is_err());
    }

    #[test]
    fn erosion_leaves_what_is_flat_and_takes_what_is_narrow() {
        let flat = Image::filled(9, 9, 0.4);
        assert_eq!(eroded(&flat), flat);
        let dot = Image::from_fn(9, 9, |x, y| f64::from(u8::from(x == 4 && y == 4)));
        assert!(eroded(&dot).data().iter().all(|&v| v == 0.0));
    }
}
