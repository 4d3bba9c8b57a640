//! Unmixing: what depth of which paint a pixel would need if it could be painted alone.

use super::mixture::{Block, Mixture, ROWS, absorbance};
use super::palette::MAX_PAINTS;
use crate::network::BLOCK;

/// Sweeps of the coordinate descent over all paints.
const SWEEPS: usize = 8;
/// Brings the depths of a block of pixels near what is wanted: by coordinate descent on absorbances, where paints simply
/// add up.
#[inline(always)]
pub(super) fn unmix(
    mixture: &Mixture,
    depths: &mut [Block; MAX_PAINTS],
    wanted: &[Block; 3],
    metric: &[Block; 6],
    deepest: f32,
) {
    let (mut rest, mut weight) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 3]);
    for band in 0..3 {
        for lane in 0..BLOCK {
            let colour = wanted[band][lane];
            rest[band][lane] = absorbance(mixture.substrate[band], colour);
            // An absorbance counts by the change of colour that it makes.
            weight[band][lane] = metric[ROWS[band][band]][lane] * colour.max(0.02) * colour.max(0.02);
        }
    }
    let mut over = [[0.0; BLOCK]; MAX_PAINTS];
    for (over, density) in over.iter_mut().zip(&mixture.density).take(mixture.paints) {
        for lane in 0..BLOCK {
            let curvature: f32 = (0..3).map(|b| weight[b][lane] * density[b] * density[b]).sum();
            over[lane] = 1.0 / curvature.max(1e-30);
        }
    }
    for depth in depths.iter_mut() {
        *depth = [0.0; BLOCK];
    }
    for _ in 0..SWEEPS {
        for ((depth, density), over) in depths.iter_mut().zip(&mixture.density).zip(&over).take(mixture.paints) {
            for lane in 0..BLOCK {
                let missing = weight[0][lane] * density[0] * rest[0][lane]
                    + weight[1][lane] * density[1] * rest[1][lane]
                    + weight[2][lane] * density[2] * rest[2][lane];
                let now = (depth[lane] + missing * over[lane]).max(0.0).min(deepest);
                let more = now - depth[lane];
                for band in 0..3 {
                    rest[band][lane] -= more * density[band];
                }
                depth[lane] = now;
            }
        }
    }
}
