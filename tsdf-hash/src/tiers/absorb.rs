//! Blocks that come from another map.

use super::Copies;
use crate::block::Block;
use crate::error::Error;
use crate::key::Key;
use crate::store::Seen;

impl Copies {
    /// Adds a block of another map: into the active copy if there is one, or else where there is room. After an error
    /// nothing has changed.
    pub(crate) fn absorb(&mut self, key: Key, block: &Block, eye: [f64; 3]) -> Result<(), Error> {
        let saturated = Error::Saturated { block: key.block() };
        if let Some(own) = self.active.get(key) {
            let mut sum = Box::new(own.clone());
            if sum.add(block) || !self.fits(key, &sum)? {
                return Err(saturated);
            }
            if let Some((own, _)) = self.active.get_mut(key) {
                *own = *sum;
            }
            return Ok(());
        }
        if !self.fits(key, block)? {
            return Err(saturated);
        }
        if self.active.room() == 0 {
            self.make_room(1, eye)?;
        }
        // Another map does not say when it saw the block: it counts as old.
        let seen = Seen { last: f64::MIN, frames: 1, call: self.call, stamp: self.active.tick() };
        if self.active.room() > 0 {
            self.active.insert(key, Box::new(block.clone()), seen);
            return Ok(());
        }
        let put = self.cold.put(key, Box::new(block.clone()), seen);
        put.map_err(|(_, error)| self.or_no_tiers(error))
    }
}
