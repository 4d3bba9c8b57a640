//! All droplets of a nozzle cast at once: the cone is a camera, its droplets are the pixels.

use super::candidate::{Candidate, value};
use super::cone::Cone;
use super::directions::{BLOCK, Block, Droplets};
use super::sweep::Nozzle;
use super::texel_surface::TexelSurface;

/// Marks a droplet that meets nothing.
const NOTHING: u32 = u32::MAX;

/// Where a droplet meets the painted side of a face.
pub(super) struct DropletHit {
    /// Texel, row by row.
    pub(super) texel: u32,
    /// Squared distance from the nozzle, m^2.
    pub(super) distance_squared: f32,
    /// Distance of the nozzle from the plane of the face, m: the distance times the cosine of the incidence.
    pub(super) height: f32,
}

/// Buffers of one worker.
#[derive(Default)]
pub(super) struct Caster {
    candidates: Vec<Candidate>,
    /// Those that a block's box touches.
    near: Vec<u32>,
}

/// For each droplet of a block the nearest face yet.
struct BlockHits {
    inverse_depth: [f32; BLOCK],
    candidate: [u32; BLOCK],
}

impl Caster {
    /// Casts the droplets and calls `hit` for each that lands on a texel, in the order of the set.
    pub(super) fn cast(
        &mut self,
        surface: &TexelSurface,
        nozzle: &Nozzle,
        droplets: &Droplets,
        mut hit: impl FnMut(&DropletHit),
    ) {
        let size = [surface.width() as i32, surface.height() as i32];
        self.candidates.clear();
        let (candidates, rotation) = (&mut self.candidates, nozzle.rotation());
        surface.faces_in(&Cone::new(nozzle, droplets), |face| {
            candidates.extend(Candidate::new(face, &rotation, &nozzle.origin.coords));
        });
        let farthest = (1.0 / droplets.range) as f32;
        for block in &droplets.blocks {
            self.near.clear();
            let overlapping = self.candidates.iter().enumerate().filter(|(_, candidate)| overlap(candidate, block));
            self.near.extend(overlapping.map(|(index, _)| index as u32));
            match self.near[..] {
                [] => {}
                // Most blocks see one face and nothing else.
                [only] if covers(&self.candidates[only as usize], block, farthest) => {
                    let candidate = &self.candidates[only as usize];
                    if candidate.painted {
                        (0..BLOCK).for_each(|k| hit(&land(candidate, block, k, size)));
                    }
                }
                _ => {
                    let mut hits = BlockHits { inverse_depth: [farthest; BLOCK], candidate: [NOTHING; BLOCK] };
                    for &index in &self.near {
                        test(&self.candidates[index as usize], index, block, &mut hits);
                    }
                    for (k, &index) in hits.candidate.iter().enumerate() {
                        if let Some(candidate) = self.candidates.get(index as usize).filter(|face| face.painted) {
                            hit(&land(candidate, block, k, size));
                        }
                    }
                }
            }
        }
    }
}

/// Where droplet `k` of a block meets a face that it is known to meet.
#[inline(always)]
fn land(candidate: &Candidate, block: &Block, k: usize, [width, height]: [i32; 2]) -> DropletHit {
    let (x, y) = (block.x[k], block.y[k]);
    let inverse = 1.0 / value(&candidate.sum, x, y);
    // Rounding may reach past the texture by an ulp.
    let column = ((value(&candidate.texel[0], x, y) * inverse) as i32).clamp(0, width - 1);
    let row = ((value(&candidate.texel[1], x, y) * inverse) as i32).clamp(0, height - 1);
    let depth = candidate.determinant * inverse;
    let distance_squared = depth * depth * (x * x + y * y + 1.0);
    DropletHit { texel: (row * width + column) as u32, distance_squared, height: candidate.height }
}

fn overlap(candidate: &Candidate, block: &Block) -> bool {
    (0..2).all(|k| candidate.low[k] <= block.high[k] && candidate.high[k] >= block.low[k])
}

/// Whether every droplet of the block meets the face within range: linear forms are smallest in a corner of the box.
fn covers(candidate: &Candidate, block: &Block, farthest: f32) -> bool {
    let corners = [
        [block.low[0], block.low[1]],
        [block.high[0], block.low[1]],
        [block.low[0], block.high[1]],
        [block.high[0], block.high[1]],
    ];
    let side = candidate.determinant.signum();
    corners.iter().all(|&[x, y]| {
        candidate.edges.iter().all(|edge| value(edge, x, y) * side > 0.0)
            && value(&candidate.sum, x, y) / candidate.determinant > farthest
    })
}

/// Written with selections instead of branches, and without the care for NaN that `min` and `max` take, so that the compiler makes vectors
/// of it.
fn test(candidate: &Candidate, index: u32, block: &Block, hits: &mut BlockHits) {
    let [a, b, c] = &candidate.edges;
    let side = candidate.determinant.signum();
    let inverse_determinant = 1.0 / candidate.determinant;
    for k in 0..BLOCK {
        let (x, y) = (block.x[k], block.y[k]);
        let (u, v, w) = (value(a, x, y), value(b, x, y), value(c, x, y));
        let inverse_depth = (u + v + w) * inverse_determinant;
        // Ahead of the nozzle all forms have the determinant's sign.
        let (u, v, w) = (u * side, v * side, w * side);
        let least = if u < v { u } else { v };
        let least = if least < w { least } else { w };
        let reached = if least >= 0.0 { inverse_depth } else { 0.0 };
        let nearer = reached > hits.inverse_depth[k];
        hits.inverse_depth[k] = if nearer { reached } else { hits.inverse_depth[k] };
        hits.candidate[k] = if nearer { index } else { hits.candidate[k] };
    }
}
