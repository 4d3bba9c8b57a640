//! One frame, put in or taken out: whole or not at all.

use super::Copies;
use crate::block::Block;
use crate::error::Error;
use crate::fuse::{Frame, Sign, Tally};
use crate::key::Key;
use crate::parallel::in_chunks;
use crate::store::Seen;

/// What a frame did.
#[derive(Default)]
pub(crate) struct Change {
    pub(crate) voxels: usize,
    pub(crate) blocks: usize,
    pub(crate) added: usize,
    pub(crate) removed: usize,
    /// Blocks that the frame touched and that are active.
    pub(crate) touched: Vec<Key>,
}

/// An active block in work, out of its slot.
struct Present {
    key: Key,
    slot: usize,
    block: Box<Block>,
    tally: Tally,
}

/// The part of a frame in a block that was not active.
struct Partial {
    key: Key,
    block: Box<Block>,
    voxels: usize,
}

/// When and from where the frame was taken.
#[derive(Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) time: f64,
    /// Position of the camera, in blocks.
    pub(crate) eye: [f64; 3],
}

impl Copies {
    /// Applies a frame to the blocks near it. After an error the sums are as they were.
    pub(crate) fn change(
        &mut self,
        frame: &Frame,
        sign: Sign,
        keys: &[Key],
        moment: Moment,
        threads: usize,
    ) -> Result<Change, Error> {
        self.call = self.call.wrapping_add(1);
        if sign == Sign::Minus {
            // What is taken out must have been in: that can be seen on whole sums only.
            self.gather(keys)?;
        }
        let mut absent = Vec::new();
        let mut present = Vec::with_capacity(keys.len());
        for &key in keys {
            match self.active.slot(key).and_then(|slot| Some((slot, self.active.take(slot)?))) {
                Some((slot, block)) => present.push(Present { key, slot, block, tally: Tally::default() }),
                None => absent.push(key),
            }
        }
        update(frame, sign, &mut present, threads);
        let mut change = Change::default();
        let fault = present.iter().find(|work| work.tally.fault).map(|work| work.key);
        self.put_back(present, &mut change);
        let outcome = match fault {
            Some(key) => Err(refused(sign, key)),
            None => self
                .split_blocks_fit(sign, &change.touched)
                .and_then(|()| self.absent(frame, sign, &mut absent, moment, threads, &mut change)),
        };
        match outcome {
            Ok(partials) => {
                self.finish(sign, partials, moment, &mut change);
                self.removed += change.removed as u64;
            }
            Err(error) => {
                self.cold.abort();
                self.undo(frame, sign, &change.touched, threads);
                return Err(error);
            }
        }
        Ok(change)
    }

    fn put_back(&mut self, present: Vec<Present>, change: &mut Change) {
        for work in present {
            self.active.put(work.slot, work.block);
            if work.tally.voxels > 0 {
                self.active.touch(work.slot, self.call);
                change.touched.push(work.key);
                change.voxels += work.tally.voxels;
            }
        }
    }

    /// Wrapping sums form a group: the opposite update restores every bit.
    fn undo(&mut self, frame: &Frame, sign: Sign, touched: &[Key], threads: usize) {
        let taken = touched.iter().filter_map(|&key| {
            let slot = self.active.slot(key)?;
            Some(Present { key, slot, block: self.active.take(slot)?, tally: Tally::default() })
        });
        let mut present: Vec<_> = taken.collect();
        update(frame, sign.opposite(), &mut present, threads);
        for work in present {
            self.active.put(work.slot, work.block);
        }
    }

    /// An active copy may have room left where the sum with the others has none.
    fn split_blocks_fit(&self, sign: Sign, touched: &[Key]) -> Result<(), Error> {
        if sign == Sign::Plus && !self.all_active() {
            for &key in touched {
                let fits = self.active.get(key).map_or(Ok(true), |block| self.fits(key, block))?;
                if !fits {
                    return Err(refused(sign, key));
                }
            }
        }
        Ok(())
    }

    /// Brings together all copies of the blocks that have one in active memory, and sends the other held ones away.
    fn gather(&mut self, keys: &[Key]) -> Result<(), Error> {
        if self.all_active() {
            return Ok(());
        }
        for &key in keys {
            self.unhold(key)?;
            if let Some((block, seen)) = self.active.get_mut(key)
                && let Some(label) = self.cold.add_to(key, block)?
            {
                *seen = label.seen().with(*seen);
                self.cold.remove(key);
            }
        }
        Ok(())
    }

    /// The parts of the frame in blocks that are not active. Those that active memory has no room for, once it has sent
    /// away all that the frame does not touch, are staged in cold memory; the others are returned.
    fn absent(
        &mut self,
        frame: &Frame,
        sign: Sign,
        mut absent: &mut [Key],
        moment: Moment,
        threads: usize,
        change: &mut Change,
    ) -> Result<Vec<Partial>, Error> {
        let threads = threads.min(self.active.spare() - 2);
        // One blank block per thread, and one to check sums with.
        let spare = self.active.spare() - 1 - threads;
        let mut room = self.active.room();
        let mut kept: Vec<Partial> = Vec::new();
        while !absent.is_empty() {
            let count = (room + spare).min(absent.len());
            let (some, rest) = absent.split_at_mut(count);
            absent = rest;
            let partials = partials(frame, some, threads);
            let mut waiting = partials.len();
            for partial in partials {
                change.voxels += partial.voxels;
                change.blocks += 1;
                if sign == Sign::Minus {
                    change.removed += usize::from(self.take_out_cold(&partial)?);
                    continue;
                }
                if !self.fits(partial.key, &partial.block)? {
                    return Err(refused(sign, partial.key));
                }
                change.added += usize::from(self.is_new(partial.key));
                if room == 0 {
                    self.make_room(waiting, moment.eye)?;
                    room = self.active.room().saturating_sub(kept.len());
                }
                waiting -= 1;
                if room > 0 {
                    room -= 1;
                    kept.push(partial);
                } else {
                    let seen = self.seen_now(moment);
                    self.cold.stage(partial.key, &partial.block, seen).map_err(|error| self.or_no_tiers(error))?;
                }
            }
        }
        Ok(kept)
    }

    fn seen_now(&mut self, moment: Moment) -> Seen {
        Seen { last: moment.time, frames: 1, call: self.call, stamp: self.active.tick() }
    }

    /// Without cold memory it is active memory that is full.
    pub(super) fn or_no_tiers(&self, error: Error) -> Error {
        if self.cold.exists() { error } else { self.active.out_of_budget() }
    }

    fn is_new(&self, key: Key) -> bool {
        self.cold.label(key).is_none() && self.held.get(key).is_none()
    }

    /// Takes a partial sum out of a block that is cold; returns whether nothing is left of it.
    fn take_out_cold(&mut self, partial: &Partial) -> Result<bool, Error> {
        let mut sum = Box::new(Block::ZERO);
        let label = self.cold.add_to(partial.key, &mut sum)?;
        let Some(label) = label.filter(|_| !sum.subtract(&partial.block)) else {
            return Err(refused(Sign::Minus, partial.key));
        };
        let seen = Seen { frames: label.frames.saturating_sub(1), stamp: self.active.tick(), ..label.seen() };
        self.cold.stage_instead(partial.key, &sum, seen)?;
        Ok(sum.is_empty())
    }

    /// Nothing can fail any more.
    fn finish(&mut self, sign: Sign, partials: Vec<Partial>, moment: Moment, change: &mut Change) {
        self.cold.commit();
        change.blocks += change.touched.len();
        let mut emptied = Vec::new();
        for &key in &change.touched {
            let Some((block, seen)) = self.active.get_mut(key) else { continue };
            match sign {
                Sign::Plus => {
                    seen.last = moment.time;
                    seen.frames = seen.frames.saturating_add(1);
                }
                Sign::Minus => seen.frames = seen.frames.saturating_sub(1),
            }
            if block.is_empty() {
                emptied.push(key);
            }
        }
        change.removed += emptied.len();
        for key in emptied {
            self.active.remove(key);
        }
        for partial in partials {
            change.touched.push(partial.key);
            let seen = self.seen_now(moment);
            self.active.insert(partial.key, partial.block, seen);
        }
    }
}

fn refused(sign: Sign, key: Key) -> Error {
    match sign {
        Sign::Plus => Error::Saturated { block: key.block() },
        Sign::Minus => Error::NotIntegrated { block: key.block() },
    }
}

fn update(frame: &Frame, sign: Sign, present: &mut [Present], threads: usize) {
    in_chunks(present, threads, |chunk| {
        for work in chunk {
            work.tally = frame.apply(sign, work.key, &mut work.block);
        }
    });
}

/// What the frame adds to each of these blocks, for those it touches.
fn partials(frame: &Frame, keys: &mut [Key], threads: usize) -> Vec<Partial> {
    let parts = in_chunks(keys, threads, |keys| {
        let mut blank = Box::new(Block::ZERO);
        let mut part = Vec::new();
        for &mut key in keys {
            let tally = frame.apply(Sign::Plus, key, &mut blank);
            if tally.voxels > 0 {
                part.push(Partial { key, block: blank.clone(), voxels: tally.voxels });
                *blank = Block::ZERO;
            }
        }
        part
    });
    parts.into_iter().flatten().collect()
}
