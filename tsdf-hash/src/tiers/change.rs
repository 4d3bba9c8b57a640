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
    /// Blocks that it touched where they lie in host memory.
    in_host: Vec<Key>,
}

/// A frame, and what is to be done with it.
#[derive(Clone, Copy)]
struct Job<'a> {
    frame: &'a Frame<'a>,
    sign: Sign,
    moment: Moment,
    threads: usize,
}

/// A block in work, out of its slot.
struct Present {
    key: Key,
    slot: usize,
    block: Box<Block>,
    tally: Tally,
}

/// The part of a frame in a block that was neither active nor loose in host memory.
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
        let job = Job { frame, sign, moment, threads };
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
        job.update(sign, &mut present);
        let mut change = Change::default();
        let fault = present.iter().find(|work| work.tally.fault).map(|work| work.key);
        self.put_back(present, &mut change);
        let outcome = match fault {
            Some(key) => Err(refused(sign, key)),
            None => self.split_blocks_fit(sign, &change.touched).and_then(|()| self.absent(job, absent, &mut change)),
        };
        match outcome {
            Ok(partials) => {
                self.finish(sign, partials, moment, &mut change);
                self.removed += change.removed as u64;
            }
            Err(error) => {
                self.cold.abort();
                self.undo(job, &change.touched);
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
    fn undo(&mut self, job: Job, touched: &[Key]) {
        let taken = touched.iter().filter_map(|&key| {
            let slot = self.active.slot(key)?;
            Some(Present { key, slot, block: self.active.take(slot)?, tally: Tally::default() })
        });
        let mut present: Vec<_> = taken.collect();
        job.update(job.sign.opposite(), &mut present);
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
                && let Some(older) = self.cold.add_to(key, block)?
            {
                *seen = older.with(*seen);
                self.cold.remove(key);
            }
        }
        Ok(())
    }

    /// The frame in blocks that are not active. As long as active memory has room, once it has sent away what the frame does
    /// not touch, it gets copies of what is new in them: those are returned. For the rest, loose blocks in host memory are
    /// changed where they lie, and what is new elsewhere is staged in cold memory.
    fn absent(&mut self, job: Job, mut absent: Vec<Key>, change: &mut Change) -> Result<Vec<Partial>, Error> {
        let mut kept = Vec::new();
        while job.sign == Sign::Plus && !absent.is_empty() && self.active.room() + self.movable() > kept.len() {
            let some = self.in_flight(job, &kept).min(absent.len());
            self.add_partials(job, &mut absent[..some], &mut kept, change)?;
            absent.drain(..some);
        }
        // To stage one block, another one may have to be packed.
        loop {
            let (loose, mut others): (Vec<_>, Vec<_>) =
                absent.into_iter().partition(|&key| self.cold.loose.note(key, self.call));
            absent = loose;
            if others.is_empty() {
                break;
            }
            for some in others.chunks_mut(self.in_flight(job, &kept)) {
                self.add_partials(job, some, &mut kept, change)?;
            }
        }
        // Last, because nobody would know how to take it back.
        self.change_in_host(job, &absent, change)?;
        Ok(kept)
    }

    /// How many partial sums may wait outside the tiers: one blank block per thread, and one to check sums with, count too.
    fn in_flight(&self, job: Job, kept: &[Partial]) -> usize {
        (self.active.room() + self.active.spare())
            .saturating_sub(kept.len() + 1 + self.threads_for_partials(job))
            .max(1)
    }

    fn threads_for_partials(&self, job: Job) -> usize {
        job.threads.min(self.active.spare() - 2)
    }

    /// Adds the parts of a frame in blocks that are neither active nor loose, or takes them out.
    fn add_partials(
        &mut self,
        job: Job,
        keys: &mut [Key],
        kept: &mut Vec<Partial>,
        change: &mut Change,
    ) -> Result<(), Error> {
        let partials = partials(job.frame, keys, self.threads_for_partials(job));
        let mut waiting = partials.len();
        let mut room = self.active.room().saturating_sub(kept.len());
        let mut movable = self.movable();
        for partial in partials {
            change.voxels += partial.voxels;
            change.blocks += 1;
            if job.sign == Sign::Minus {
                change.removed += usize::from(self.take_out_cold(&partial)?);
                continue;
            }
            if !self.fits(partial.key, &partial.block)? {
                return Err(refused(job.sign, partial.key));
            }
            change.added += usize::from(self.is_new(partial.key));
            if room == 0 && movable > 0 {
                self.make_room(waiting, job.moment.eye)?;
                movable = 0;
                room = self.active.room().saturating_sub(kept.len());
            }
            waiting -= 1;
            if room > 0 {
                room -= 1;
                kept.push(partial);
            } else {
                let seen = self.seen_now(job.moment);
                self.cold.stage(partial.key, partial.block, seen).map_err(|error| self.or_no_tiers(error))?;
            }
        }
        Ok(())
    }

    /// Changes loose blocks. After an error they are as they were.
    fn change_in_host(&mut self, job: Job, keys: &[Key], change: &mut Change) -> Result<(), Error> {
        let taken = keys.iter().filter_map(|&key| {
            let (slot, block) = self.cold.loose.take(key)?;
            Some(Present { key, slot, block, tally: Tally::default() })
        });
        let mut present: Vec<_> = taken.collect();
        job.update(job.sign, &mut present);
        let outcome = present.iter().try_for_each(|work| {
            // Out of its slot it does not count twice: what it has to fit together with is held.
            let alone = job.sign == Sign::Minus || self.held.len() == 0;
            let fits = !work.tally.fault && (alone || self.fits(work.key, &work.block)?);
            if fits { Ok(()) } else { Err(refused(job.sign, work.key)) }
        });
        if outcome.is_err() {
            job.update(job.sign.opposite(), &mut present);
        }
        for work in present {
            self.cold.loose.put(work.slot, work.block);
            if work.tally.voxels > 0 {
                change.in_host.push(work.key);
                change.voxels += work.tally.voxels;
            }
        }
        outcome
    }

    fn seen_now(&mut self, moment: Moment) -> Seen {
        Seen { last: moment.time, frames: 1, call: self.call, stamp: self.active.tick() }
    }

    /// Without cold memory it is active memory that is full.
    pub(super) fn or_no_tiers(&self, error: Error) -> Error {
        if self.cold.exists() { error } else { self.active.out_of_budget() }
    }

    fn is_new(&self, key: Key) -> bool {
        !self.cold.contains(key) && self.held.get(key).is_none()
    }

    /// Takes a partial sum out of a block that is cold; returns whether nothing is left of it.
    fn take_out_cold(&mut self, partial: &Partial) -> Result<bool, Error> {
        let mut sum = Box::new(Block::ZERO);
        let seen = self.cold.add_to(partial.key, &mut sum)?;
        let Some(seen) = seen.filter(|_| !sum.subtract(&partial.block)) else {
            return Err(refused(Sign::Minus, partial.key));
        };
        let seen = Seen { frames: seen.frames.saturating_sub(1), stamp: self.active.tick(), ..seen };
        let gone = sum.is_empty();
        self.cold.stage_instead(partial.key, sum, seen)?;
        Ok(gone)
    }

    /// Nothing can fail any more.
    fn finish(&mut self, sign: Sign, partials: Vec<Partial>, moment: Moment, change: &mut Change) {
        self.cold.commit();
        change.blocks += change.touched.len();
        let mut emptied = Vec::new();
        for &key in &change.touched {
            let Some((block, seen)) = self.active.get_mut(key) else { continue };
            seen.count(sign, moment);
            if block.is_empty() {
                emptied.push(key);
            }
        }
        change.removed += emptied.len();
        for key in emptied {
            self.active.remove(key);
        }
        change.blocks += change.in_host.len();
        for &key in &change.in_host {
            let Some(mut seen) = self.cold.loose.seen(key) else { continue };
            seen.count(sign, moment);
            seen.stamp = self.active.tick();
            change.removed += usize::from(self.cold.note_change(key, seen));
        }
        for partial in partials {
            change.touched.push(partial.key);
            let seen = self.seen_now(moment);
            self.active.insert(partial.key, partial.block, seen);
        }
    }
}

impl Seen {
    fn count(&mut self, sign: Sign, moment: Moment) {
        match sign {
            Sign::Plus => {
                self.last = moment.time;
                self.frames = self.frames.saturating_add(1);
            }
            Sign::Minus => self.frames = self.frames.saturating_sub(1),
        }
    }
}

impl Job<'_> {
    fn update(&self, sign: Sign, present: &mut [Present]) {
        in_chunks(present, self.threads, |chunk| {
            for work in chunk {
                work.tally = self.frame.apply(sign, work.key, &mut work.block);
            }
        });
    }
}

fn refused(sign: Sign, key: Key) -> Error {
    match sign {
        Sign::Plus => Error::Saturated { block: key.block() },
        Sign::Minus => Error::NotIntegrated { block: key.block() },
    }
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
