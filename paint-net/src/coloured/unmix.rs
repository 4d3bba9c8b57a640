//! What depth of which paint a pixel would need if it could be painted alone.

use super::mixture::{Block, Mixture, ROWS};
use crate::network::BLOCK;
use crate::palette::MOST_PAINTS;

/// Turns over all paints.
const TURNS: usize = 8;
/// Absorbances are told apart down to this reflectance.
const DARKEST: f32 = 1e-3;

/// What a film absorbs that makes a wall look like a colour.
pub(super) fn absorbance(wall: f32, colour: f32) -> f32 {
    (wall.max(DARKEST) / colour.max(DARKEST)).ln()
}

impl Mixture {
    /// Brings the depths of a block of pixels near what is wanted: by coordinate descent on absorbances, where paints simply
    /// add up.
    #[inline(always)]
    pub(super) fn unmix(
        &self,
        depths: &mut [Block; MOST_PAINTS],
        wanted: &[Block; 3],
        measure: &[Block; 6],
        deepest: f32,
    ) {
        let (mut rest, mut weight) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 3]);
        for band in 0..3 {
            for lane in 0..BLOCK {
                let colour = wanted[band][lane];
                rest[band][lane] = absorbance(self.wall[band], colour);
                // An absorbance counts by the change of colour that it makes.
                weight[band][lane] = measure[ROWS[band][band]][lane] * colour.max(0.02) * colour.max(0.02);
            }
        }
        let mut over = [[0.0; BLOCK]; MOST_PAINTS];
        for (over, density) in over.iter_mut().zip(&self.density).take(self.paints) {
            for lane in 0..BLOCK {
                let bend: f32 = (0..3).map(|b| weight[b][lane] * density[b] * density[b]).sum();
                over[lane] = 1.0 / bend.max(1e-30);
            }
        }
        for depth in depths.iter_mut() {
            *depth = [0.0; BLOCK];
        }
        for _ in 0..TURNS {
            for ((depth, density), over) in depths.iter_mut().zip(&self.density).zip(&over).take(self.paints) {
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
}
