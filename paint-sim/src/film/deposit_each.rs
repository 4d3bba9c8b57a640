//! Shots with sprays of their own, as moving air leaves them.

use std::sync::Arc;

use super::deposit::{count_quanta, deposit_batch_each};
use super::{Film, MassBalance};
use crate::error::{Error, check_range};
use crate::spray::{Shot, SprayModel};
use crate::surface::Surface;

impl Film {
    /// [`Film::deposit`] of shots each of which has its own spray ([`spray::air::drifted`](crate::spray::air::drifted)): where all sprays are
    /// one, the same to the last femtolitre.
    ///
    /// # Errors
    /// As [`Film::deposit`].
    pub fn deposit_each(
        &mut self,
        shots: &[(Shot, SprayModel)],
        surface: &dyn Surface,
        threads: usize,
    ) -> Result<MassBalance, Error> {
        self.deposit_each_told(shots, surface, threads, &mut |_, _| ())
    }

    /// The same, and tells `landed` how much comes onto which texel.
    pub(super) fn deposit_each_told(
        &mut self,
        shots: &[(Shot, SprayModel)],
        surface: &dyn Surface,
        threads: usize,
        landed: &mut dyn FnMut(u32, u64),
    ) -> Result<MassBalance, Error> {
        shots.iter().try_for_each(|(_, spray)| spray.check())?;
        check_range("threads", threads as f64, 1.0, 1024.0, "between 1 and 1024")?;
        let emitted = count_quanta(shots.iter().map(|(shot, _)| shot))?;
        let index = Arc::clone(&self.index);
        let hits = |batch: &[(Shot, SprayModel)]| deposit_batch_each(&index, batch, &|each| *each, surface, threads);
        self.deposit_hits(shots, emitted, &hits, landed, &mut |_, _| ())
    }
}
