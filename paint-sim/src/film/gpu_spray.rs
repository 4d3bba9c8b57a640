//! Shots that are sprayed onto a film with a GPU.

use std::sync::Arc;

use super::deposit::{HitList, Scratch, deposit_batch, quanta, round_shot, shadow_rays};
use super::gpu_shares::GpuShares;
use super::texel_index::TexelIndex;
use crate::error::Error;
use crate::gpu::{Fallback, GpuOptions};
use crate::spray::{Shot, SprayModel};
use crate::surface::{ShadowRay, Surface};

/// A GPU that knows the texels of a film: made by [`Film::gpu_spray`](super::Film::gpu_spray), for [`Film::deposit_on`](super::Film::deposit_on).
///
/// What comes onto each texel is, to the femtolitre, what the processor puts there, whatever the adapter. The shares of the shots are computed in
/// double precision made of integers, by the processor's operations in their order. Sums and the rounding to femtolitres are the processor's.
pub struct GpuSpray {
    shares: GpuShares,
    fallback: Fallback,
}

impl GpuSpray {
    pub(super) fn new(index: &Arc<TexelIndex>, options: &GpuOptions) -> Result<Self, Error> {
        Ok(Self { shares: GpuShares::new(index, options)?, fallback: Fallback::default() })
    }

    /// Whether it knows these texels.
    pub(super) fn knows(&self, index: &Arc<TexelIndex>) -> bool {
        Arc::ptr_eq(index, &self.shares.index)
    }

    /// Name and driver of the adapter.
    pub fn name(&self) -> &str {
        self.shares.adapter()
    }

    /// The fault after which the processor does everything.
    pub fn fault(&self) -> Option<&Error> {
        self.fallback.fault()
    }

    /// The hit list of a batch, as [`deposit_batch`] gives it.
    pub(super) fn deposit_batch(
        &self,
        batch: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
    ) -> HitList {
        let mut scratch = Scratch::default();
        let mut left = batch;
        while !left.is_empty() {
            let Some(shares) = self.fallback.attempt(|| self.shares.of_first(left, spray)) else {
                scratch.hits.extend(deposit_batch(&self.shares.index, left, spray, surface, threads));
                break;
            };
            let (done, rest) = left.split_at(shares.len());
            self.round(done, shares, spray, surface, &mut scratch);
            left = rest;
        }
        scratch.hits
    }

    /// Takes the shadowed shares away, and rounds the others to quanta.
    fn round(
        &self,
        shots: &[Shot],
        mut shares: Vec<Vec<(u32, f64)>>,
        spray: &SprayModel,
        surface: &dyn Surface,
        scratch: &mut Scratch,
    ) {
        let mut rays = Vec::new();
        for (shot, shares) in shots.iter().zip(&shares) {
            let (from, towards) = shadow_rays(&self.shares.index, shot, spray, surface, shares);
            let ray = |(direction, length)| ShadowRay { origin: shot.origin, direction, from, length };
            rays.extend(towards.into_iter().map(ray));
        }
        let mut dark = surface.occluded_each(&rays).into_iter();
        for (shot, shares) in shots.iter().zip(&mut shares) {
            shares.retain(|_| dark.next() != Some(true));
            std::mem::swap(&mut scratch.shares, shares);
            let emitted = quanta(shot.volume);
            if emitted > 0 {
                round_shot(emitted, spray.efficiency, scratch);
            }
        }
    }
}
