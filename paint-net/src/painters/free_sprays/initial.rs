//! The initial sprays: dense where there is detail.

use std::f32::consts::PI;

use super::free_spray::{FreeSpray, SprayBounds};
use super::plane::{Plane, blur};
use super::rasteriser::Rasteriser;

/// Spread of a spray over the distance to its neighbours: footprints overlap enough to make an even coat.
const OVERLAP: f32 = 0.45;

/// At most `most` sprays, dense where there is detail that the nozzle can paint, none where no paint is missing: the density
/// is turned into points by error diffusion (Floyd and Steinberg 1976), every other row backwards. Each is as wide as its
/// distance to the others asks for, and together they hold the paint that is missing.
pub(super) fn initial(rasteriser: &Rasteriser, most: usize, bounds: &SprayBounds) -> Vec<FreeSpray> {
    let density = density(rasteriser, most, bounds.min_sigma);
    let missing = blur(&rasteriser.missing, bounds.min_sigma);
    let (width, height) = (rasteriser.width, rasteriser.height);
    let mut sprays = Vec::with_capacity(most);
    // What is left over of each pixel of this row and the next, with a margin on both sides.
    let mut row = vec![0.0_f32; width + 2];
    let mut next = row.clone();
    for y in 0..height {
        for i in 0..width {
            // `ahead` and `behind` are the neighbours in the direction of travel.
            let (x, ahead, behind) =
                if y % 2 == 0 { (i, i + 2, i) } else { (width - 1 - i, width - 1 - i, width + 1 - i) };
            let here = density.values[y * width + x];
            let mut rest = here + row[x + 1];
            if rest > 0.5 && here > 0.0 && sprays.len() < most {
                let sigma = bounds.clamp_sigma(OVERLAP / here.sqrt());
                let volume = missing.values[y * width + x] / (here * 2.0 * PI * sigma * sigma);
                sprays.push(FreeSpray { x: x as f32, y: y as f32, volume: volume.min(bounds.max_volume), sigma });
                rest -= 1.0;
            }
            row[ahead] += rest * (7.0 / 16.0);
            next[behind] += rest * (3.0 / 16.0);
            next[x + 1] += rest * (5.0 / 16.0);
            next[ahead] += rest * (1.0 / 16.0);
        }
        std::mem::swap(&mut row, &mut next);
        next.fill(0.0);
    }
    sprays
}

/// Sprays per pixel, `most` in all: half of them everywhere where paint is missing, half by the contrast of what is finer than
/// two and coarser than three quarters of a footprint.
fn density(rasteriser: &Rasteriser, most: usize, sigma: f32) -> Plane {
    let (fine, coarse) = (blur(&rasteriser.ink, 0.75 * sigma), blur(&rasteriser.ink, 2.0 * sigma));
    let mut contrast = fine;
    for (v, c) in contrast.values.iter_mut().zip(&coarse.values) {
        *v = (*v - c) * (*v - c);
    }
    let mut density = blur(&contrast, 1.5 * sigma);
    let mut places = 0.0_f32;
    let mut total = 0.0_f32;
    for (d, &missing) in density.values.iter_mut().zip(&rasteriser.missing.values) {
        *d = if missing > 0.0 { d.sqrt() } else { 0.0 };
        total += *d;
        places += f32::from(u8::from(missing > 0.0));
    }
    let share = |sum: f32| if sum > 0.0 { 0.5 * most as f32 / sum } else { 0.0 };
    let (everywhere, by_contrast) = (share(places), share(total));
    for (d, &missing) in density.values.iter_mut().zip(&rasteriser.missing.values) {
        *d = if missing > 0.0 { everywhere + by_contrast * *d } else { 0.0 };
    }
    density
}
