//! The delay buffer of the fusion: states in order of time, repropagated when a late pose arrives.

use super::filter_state::{FilterState, Workspace};
use super::pose_model::WhitenedPose;
use super::settings::{FusionSettings, PoseSource};
use crate::inertial::imu_buffer::ImuBuffer;
use crate::inertial::preintegration::ImuPreintegration;
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// States are kept at this many of the buffered samples besides those at poses, so that the buffer can be freed in steps even
/// while no pose comes.
const CHECKPOINTS: usize = 8;

/// Order of events: time, then checkpoints before poses, then the poses by their sources.
pub(crate) type EventOrder = (Stamp, usize);

/// A time at which the state is kept.
#[derive(Debug, Clone)]
struct Event {
    /// None for a checkpoint.
    pose: Option<WhitenedPose>,
    order: EventOrder,
    /// After the event; meaningless while the samples have not reached it.
    after: FilterState,
}

/// The recent states in order of time, whatever the order in which poses arrived (Lynen et al. 2013).
///
/// The state at each event is a function of the state before it, of the samples between, and of its pose. A pose that arrives late
/// is inserted at its time, and all states after it are recomputed: they become what they would have been.
#[derive(Debug, Clone)]
pub(crate) struct StateBuffer {
    /// The oldest state; before it nothing can change.
    base: FilterState,
    base_order: EventOrder,
    events: Vec<Event>,
    /// Events up to the latest sample.
    reached: usize,
    samples: ImuBuffer,
    /// From the last event reached until the latest sample.
    prediction: ImuPreintegration,
    /// States not in use.
    spare: Vec<FilterState>,
    /// Samples since the last checkpoint.
    counted: usize,
    capacity: usize,
    workspace: Workspace,
}

/// Settings that the states are computed with.
#[derive(Debug, Clone)]
pub(crate) struct FilterContext {
    pub(crate) noise: ImuNoise,
    pub(crate) settings: FusionSettings,
    pub(crate) sources: Vec<PoseSource>,
}

impl StateBuffer {
    pub(crate) fn new(base: FilterState, sample: Imu, context: &FilterContext) -> Self {
        let settings = &context.settings;
        let capacity = settings.buffer_poses + CHECKPOINTS + 2;
        Self {
            events: Vec::with_capacity(capacity),
            reached: 0,
            samples: ImuBuffer::new(sample, base.stamp, settings.buffer_samples + 1),
            prediction: ImuPreintegration::default(),
            spare: vec![base.clone(); capacity],
            counted: 0,
            capacity: settings.buffer_poses,
            workspace: Workspace::new(context.sources.len()),
            base_order: (base.stamp, 0),
            base,
        }
    }

    /// The latest state whose time the samples have reached.
    pub(crate) fn latest(&self) -> &FilterState {
        if self.reached > 0 { &self.events[self.reached - 1].after } else { &self.base }
    }

    /// The time that is known of.
    pub(crate) fn now(&self) -> Stamp {
        self.samples.now()
    }

    /// The samples, and the preintegration from the latest state until now.
    pub(crate) fn prediction(&self) -> (&ImuBuffer, &ImuPreintegration) {
        (&self.samples, &self.prediction)
    }

    /// The event before which nothing can change.
    pub(crate) fn oldest(&self) -> EventOrder {
        self.base_order
    }

    /// Takes one more sample; its stamp must be after all others.
    pub(crate) fn imu(&mut self, sample: Imu, context: &FilterContext) {
        if self.samples.is_full() {
            self.free_buffer();
        }
        self.samples.push(sample);
        self.counted += 1;
        let due = self.counted * CHECKPOINTS >= context.settings.buffer_samples && sample.stamp > self.latest().stamp;
        if due {
            self.counted = 0;
            self.insert(None, (sample.stamp, 0), context);
        } else if self.events.get(self.reached).is_some_and(|event| event.order.0 <= sample.stamp) {
            self.repropagate(self.reached, context);
        } else {
            let core = &self.latest().core;
            let correction = core.imu_correction();
            self.samples.continue_to_latest(&mut self.prediction, &correction, &context.noise);
        }
    }

    /// Whether there is already an event with this order.
    pub(crate) fn contains(&self, order: EventOrder) -> bool {
        self.events.binary_search_by_key(&order, |event| event.order).is_ok()
    }

    /// Drops the oldest states so that a pose can be taken; false if none can be dropped before further samples have come.
    pub(crate) fn make_room(&mut self) -> bool {
        let capacity = self.capacity;
        let full = |events: &[Event]| events.iter().filter(|event| event.pose.is_some()).count() >= capacity;
        while full(&self.events) && self.reached > 0 {
            self.drop_oldest();
        }
        !full(&self.events)
    }

    /// Inserts a pose at its time. There must be room, and it must be after the oldest state.
    pub(crate) fn pose(&mut self, pose: WhitenedPose, order: EventOrder, context: &FilterContext) {
        self.insert(Some(pose), order, context);
    }

    fn insert(&mut self, pose: Option<WhitenedPose>, order: EventOrder, context: &FilterContext) {
        let index = self.events.partition_point(|event| event.order < order);
        let after = self.spare.pop().unwrap_or_else(|| self.base.clone());
        self.events.insert(index, Event { pose, order, after });
        if order.0 <= self.samples.now() {
            self.repropagate(index.min(self.reached), context);
        }
    }

    /// Recomputes the states from an event on.
    fn repropagate(&mut self, from: usize, context: &FilterContext) {
        let now = self.samples.now();
        for index in from..self.events.len() {
            if self.events[index].order.0 > now {
                break;
            }
            let (before, rest) = self.events.split_at_mut(index);
            let before = before.last().map_or(&self.base, |event| &event.after);
            let event = &mut rest[0];
            event.after.assign(before);
            let until = event.order.0;
            let correction = before.core.imu_correction();
            let preintegration = self.samples.preintegrate_between(before.stamp, until, &correction, &context.noise);
            let transition =
                preintegration.transition(&before.core.velocity, &before.core.attitude, context.settings.gravity);
            event.after.propagate(&transition, preintegration.duration, until, &context.sources);
            if let Some(pose) = &event.pose {
                let reading = self.samples.reading(until);
                event.after.update(pose, &reading, &context.settings, &mut self.workspace);
            }
            event.after.check_divergence(&context.settings.divergence);
        }
        self.reached = self.events.partition_point(|event| event.order.0 <= now);
        let latest = self.latest();
        let correction = latest.core.imu_correction();
        self.prediction = self.samples.preintegrate_between(latest.stamp, now, &correction, &context.noise);
    }

    /// Makes the first event the oldest state.
    fn drop_oldest(&mut self) {
        let event = self.events.remove(0);
        self.base_order = event.order;
        self.spare.push(std::mem::replace(&mut self.base, event.after));
        self.reached -= 1;
        self.samples.advance(self.base.stamp);
    }

    /// Makes room for a sample.
    fn free_buffer(&mut self) {
        while self.samples.is_full() && self.reached > 0 {
            self.drop_oldest();
        }
        // Those before an initial state that was ahead of them.
        self.samples.advance(self.base.stamp);
    }
}
