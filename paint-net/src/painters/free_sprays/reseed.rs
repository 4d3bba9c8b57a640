//! Reseeding between rounds of the fit: sprays that do little go where one more would do most.

use std::f32::consts::{FRAC_1_SQRT_2, PI};

use super::free_spray::{FreeSpray, SprayBounds};
use super::plane::{Plane, blur};
use super::rasteriser::Rasteriser;

/// Replaces sprays of little worth by new ones at the peaks of what one more would gain, at most `share` of them, and adds
/// new ones while there are fewer than `most`.
///
/// With the ink linearised at the canvas, a spray of volume `v` is worth `½ v² Σ w f'² g²`, and a new one of the nozzle's own
/// spread would gain `½ (Σ w f' r g)² / Σ w f'² g²`: the score of matching pursuit. Both sums are blurs of a picture, as
/// `Σ g = 2πσ²` and `Σ g² = πσ²`.
pub(super) fn reseed(
    rasteriser: &mut Rasteriser,
    sprays: &mut Vec<FreeSpray>,
    bounds: &SprayBounds,
    share: f64,
    most: usize,
) {
    rasteriser.render(sprays);
    let area = PI * bounds.min_sigma * bounds.min_sigma;
    let gradient = blur(&rasteriser.crop(|p| -rasteriser.gradient[p]), bounds.min_sigma);
    let curvature = blur(
        &rasteriser.crop(|p| rasteriser.weight[p] * rasteriser.slope[p] * rasteriser.slope[p]),
        FRAC_1_SQRT_2 * bounds.min_sigma,
    );
    // The volume that is best at each pixel, and its gain.
    let best = |k: usize| {
        let (num, den) = (2.0 * area * gradient.values[k], area * curvature.values[k]);
        if num > 0.0 && den > 0.0 && rasteriser.allowed(k) { (num / den, 0.5 * num * num / den) } else { (0.0, 0.0) }
    };
    let (width, height) = (rasteriser.width, rasteriser.height);
    let gains = Plane { width, values: (0..width * height).map(|k| best(k).1).collect() };
    let mut candidates = peaks(&gains);
    candidates.sort_by(|&a, &b| gains.values[b].total_cmp(&gains.values[a]).then(a.cmp(&b)));

    let worth = |s: &FreeSpray| {
        let at = |v: f32, n: usize| (v.round().max(0.0) as usize).min(n - 1);
        let curvature = curvature.values[at(s.y, height) * width + at(s.x, width)];
        0.5 * s.volume * s.volume * PI * s.sigma * s.sigma * curvature
    };
    sprays.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    let mut movable = (share * sprays.len() as f64) as usize;
    for k in candidates {
        let (volume, gain) = best(k);
        if sprays.len() >= most {
            // The least of the old ones: the new ones were put before them.
            let goes = movable > 0 && sprays.last().is_some_and(|s| worth(s) < gain);
            if !goes {
                break;
            }
            sprays.pop();
            movable -= 1;
        }
        let (x, y) = ((k % width) as f32, (k / width) as f32);
        sprays.insert(0, FreeSpray { x, y, volume: volume.min(bounds.max_volume), sigma: bounds.min_sigma });
    }
}

/// Pixels of positive value that are the largest of their neighbours two pixels around, the first of equals.
fn peaks(plane: &Plane) -> Vec<usize> {
    let (width, height) = (plane.width, plane.values.len() / plane.width);
    let near = |k: usize, n: usize| k.saturating_sub(2)..(k + 3).min(n);
    let is_peak = |k: usize| {
        let value = plane.values[k];
        value > 0.0
            && near(k / width, height).all(|j| {
                near(k % width, width).all(|i| {
                    let other = j * width + i;
                    plane.values[other] < value || (plane.values[other] == value && other >= k)
                })
            })
    };
    (0..plane.values.len()).filter(|&k| is_peak(k)).collect()
}
