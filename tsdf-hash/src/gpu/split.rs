//! Which blocks of a frame are where, and whether what it did to them may stay.

use super::device::Device;
use super::fuse::{Mode, Pass, Tally, fresh};
use super::pool::Pool;
use crate::Error;
use crate::fuse::Sign;
use crate::key::Key;

/// The mode of an update.
pub(super) fn mode(sign: Sign) -> Mode {
    if sign == Sign::Plus { Mode::Plus } else { Mode::Minus }
}

/// The blocks that a frame has touched, or would.
pub(super) fn touched<'a>(blocks: impl Iterator<Item = &'a (Key, u32)>, tallies: &[Tally]) -> Vec<(Key, Tally)> {
    blocks.zip(tallies).map(|((key, _), tally)| (*key, *tally)).filter(|(_, tally)| tally.voxels() > 0).collect()
}

/// Whether a frame may stay that needs some new blocks and has changed others; if so, there is memory for the new ones.
pub(super) fn admit(
    pool: &mut Pool,
    device: &Device,
    sign: Sign,
    needed: &[(Key, Tally)],
    changed: &[(Key, Tally)],
) -> Result<(), Error> {
    match (sign, needed.first()) {
        (Sign::Minus, Some((key, _))) => return Err(Error::NotIntegrated { block: key.block() }),
        (Sign::Plus, _) if needed.len() > pool.room() => return Err(pool.out_of_budget()),
        _ => {}
    }
    // The pages mix the keys, and the first of them is named.
    match changed.iter().filter(|work| work.1.fault()).map(|work| work.0).min() {
        Some(key) if sign == Sign::Plus => Err(Error::Saturated { block: key.block() }),
        Some(key) => Err(Error::NotIntegrated { block: key.block() }),
        None => pool.reserve(device, needed.len()),
    }
}

/// Blocks of a frame, with their slots.
pub(super) struct Split {
    pub(super) absent: Vec<(Key, u32)>,
    /// By page.
    pub(super) present: Vec<Vec<(Key, u32)>>,
}

impl Split {
    pub(super) fn new(pool: &Pool, keys: &[Key]) -> Self {
        let mut split = Self { absent: Vec::new(), present: vec![Vec::new(); pool.pages.len()] };
        for &key in keys {
            match pool.get(key) {
                Some(place) => split.present[place.page].push((key, place.slot)),
                None => split.absent.push((key, fresh(0))),
            }
        }
        split
    }

    /// Blocks that get slots now.
    pub(super) fn added(pool: &mut Pool, keys: &[(Key, Tally)]) -> Self {
        let mut split = Self { absent: Vec::new(), present: vec![Vec::new(); pool.pages.len()] };
        for &(key, _) in keys {
            let place = pool.insert(key);
            split.present[place.page].push((key, fresh(place.slot)));
        }
        split
    }

    pub(super) fn count(&self) -> Pass<'_> {
        Pass { mode: Mode::Count, page: 0, blocks: &self.absent }
    }

    pub(super) fn update(&self, mode: Mode) -> impl Iterator<Item = Pass<'_>> {
        self.present.iter().enumerate().map(move |(page, blocks)| Pass { mode, page, blocks })
    }
}
