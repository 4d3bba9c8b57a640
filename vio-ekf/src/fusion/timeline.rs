use super::Pose;
use super::belief::{Belief, Workspace};
use super::settings::{FusionSettings, PoseSource};
use crate::filter::history::History;
use crate::filter::interval::Interval;
use crate::{Imu, ImuNoise, Stamp};

/// Beliefs are kept at this many of the samples in memory besides those at poses, so that the past can be forgotten in
/// steps even while no pose comes.
const CHECKPOINTS: usize = 8;

/// A place on the line: time, then checkpoints before poses, then the poses by their sources.
pub(crate) type Place = (Stamp, usize);

/// A time at which the belief is kept.
#[derive(Debug, Clone)]
struct Event {
    /// None for a checkpoint.
    pose: Option<Pose>,
    place: Place,
    /// After the event; meaningless while the samples have not reached it.
    after: Belief,
}

/// The recent past in order of time, whatever the order in which it became known.
///
/// Every event's belief is a function of the belief before it, of the samples between, and of its pose. A pose that
/// arrives late is put in its place, and all beliefs after it are made anew: they become what they would have been.
#[derive(Debug, Clone)]
pub(crate) struct Timeline {
    /// Before this nothing can change.
    base: Belief,
    base_place: Place,
    events: Vec<Event>,
    /// Events up to the latest sample.
    reached: usize,
    samples: History,
    /// From the last event reached until the latest sample.
    pub(crate) since: Interval,
    /// Beliefs not in use.
    spare: Vec<Belief>,
    /// Samples since the last checkpoint.
    counted: usize,
    capacity: usize,
    work: Workspace,
}

/// What the beliefs are made with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules<'a> {
    pub(crate) noise: &'a ImuNoise,
    pub(crate) settings: &'a FusionSettings,
    pub(crate) sources: &'a [PoseSource],
}

impl Timeline {
    pub(crate) fn new(base: Belief, sample: Imu, rules: &Rules) -> Self {
        let settings = rules.settings;
        let capacity = settings.history_poses + CHECKPOINTS + 2;
        Self {
            events: Vec::with_capacity(capacity),
            reached: 0,
            samples: History::new(sample, base.stamp, settings.history_samples + 1),
            since: Interval::default(),
            spare: vec![base.clone(); capacity],
            counted: 0,
            capacity: settings.history_poses,
            work: Workspace::new(rules.sources.len()),
            base_place: (base.stamp, 0),
            base,
        }
    }

    /// The latest belief whose time the samples have reached.
    pub(crate) fn latest(&self) -> &Belief {
        if self.reached > 0 { &self.events[self.reached - 1].after } else { &self.base }
    }

    /// The time that is known of.
    pub(crate) fn now(&self) -> Stamp {
        self.samples.now()
    }

    pub(crate) fn sample(&self) -> &Imu {
        self.samples.latest()
    }

    /// The place before which nothing can change.
    pub(crate) fn settled(&self) -> Place {
        self.base_place
    }

    /// Takes one more sample; its stamp must be after all others.
    pub(crate) fn imu(&mut self, sample: Imu, rules: &Rules) {
        if self.samples.is_full() {
            self.forget();
        }
        self.samples.push(sample);
        self.counted += 1;
        let due = self.counted * CHECKPOINTS >= rules.settings.history_samples && sample.stamp > self.latest().stamp;
        if due {
            self.counted = 0;
            self.insert(None, (sample.stamp, 0), rules);
        } else if self.events.get(self.reached).is_some_and(|event| event.place.0 <= sample.stamp) {
            self.redo(self.reached, rules);
        } else {
            let core = &self.latest().core;
            let biases = [core.gyro_bias, core.accel_bias];
            self.samples.extend_to_latest(&mut self.since, &biases, rules.noise);
        }
    }

    /// Whether there is already something at a place.
    pub(crate) fn holds(&self, place: Place) -> bool {
        self.events.binary_search_by_key(&place, |event| event.place).is_ok()
    }

    /// Settles what must be so that a pose can be taken; false if nothing can be before the samples have gone on.
    pub(crate) fn make_room(&mut self) -> bool {
        let capacity = self.capacity;
        let full = |events: &[Event]| events.iter().filter(|event| event.pose.is_some()).count() >= capacity;
        while full(&self.events) && self.reached > 0 {
            self.settle();
        }
        !full(&self.events)
    }

    /// Puts a pose in its place. There must be room, and the place must be after what is settled.
    pub(crate) fn pose(&mut self, pose: Pose, place: Place, rules: &Rules) {
        self.insert(Some(pose), place, rules);
    }

    fn insert(&mut self, pose: Option<Pose>, place: Place, rules: &Rules) {
        let index = self.events.partition_point(|event| event.place < place);
        let after = self.spare.pop().unwrap_or_else(|| self.base.clone());
        self.events.insert(index, Event { pose, place, after });
        if place.0 <= self.samples.now() {
            self.redo(index.min(self.reached), rules);
        }
    }

    /// Makes the beliefs from an event on anew.
    fn redo(&mut self, from: usize, rules: &Rules) {
        let now = self.samples.now();
        for index in from..self.events.len() {
            if self.events[index].place.0 > now {
                break;
            }
            let (before, rest) = self.events.split_at_mut(index);
            let before = before.last().map_or(&self.base, |event| &event.after);
            let event = &mut rest[0];
            event.after.assign(before);
            let until = event.place.0;
            let biases = [before.core.gyro_bias, before.core.accel_bias];
            let interval = self.samples.between(before.stamp, until, &biases, rules.noise);
            let step = interval.step_from(&before.core.velocity, &before.core.attitude, rules.settings.gravity);
            event.after.propagate(&step, interval.duration, until, rules.sources);
            if let Some(pose) = &event.pose {
                let reading = self.samples.reading(until);
                event.after.update(pose, &reading, rules.settings, &mut self.work);
            }
            event.after.judge(&rules.settings.limits);
        }
        self.reached = self.events.partition_point(|event| event.place.0 <= now);
        let latest = self.latest();
        let biases = [latest.core.gyro_bias, latest.core.accel_bias];
        self.since = self.samples.between(latest.stamp, now, &biases, rules.noise);
    }

    /// Makes the first event the base.
    fn settle(&mut self) {
        let event = self.events.remove(0);
        self.base_place = event.place;
        self.spare.push(std::mem::replace(&mut self.base, event.after));
        self.reached -= 1;
        self.samples.advance(self.base.stamp);
    }

    /// Makes room for a sample.
    fn forget(&mut self) {
        while self.samples.is_full() && self.reached > 0 {
            self.settle();
        }
        // Those before a start that was set ahead of them.
        self.samples.advance(self.base.stamp);
    }
}
