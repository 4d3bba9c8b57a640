//! Algorithm 1 of the VR paper with the resets that its print lacks.

use std::collections::VecDeque;

use nalgebra::Point3;

use super::breaks::{breaks, painted_step};
use super::feedback::Feedback;
use super::settings::{FarReference, SessionSettings};
use super::state::{VrMode, VrState};
use super::task::{Segment, Task};

/// What became of the states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct QueueCounts {
    /// Painting and viewing states that entered the queue.
    pub accepted: u64,
    /// Those refused while the person had to wait, rule (e).
    pub refused_waiting: u64,
    /// Those refused because the queue was full.
    pub refused_full: u64,
    /// Painting states from too far away, rule (b).
    pub far: u64,
    /// Painting states whose ray met nothing.
    pub without_hit: u64,
}

/// What the person has been told and need not hear again.
#[derive(Debug, Clone, Default)]
struct Said {
    full: bool,
    far: bool,
}

/// The queue `Q` of a live session and the segment `S` that grows from it.
#[derive(Debug, Clone)]
pub struct LiveQueue {
    settings: SessionSettings,
    queue: VecDeque<VrState>,
    segment: Vec<VrState>,
    /// `d_seg`.
    length: f64,
    /// Whether the segment is no more than the state that the one before has left for it.
    carried: bool,
    /// Length of everything painted before the segment, m.
    start: f64,
    /// The state that entered before, whether or not it was accepted, and the mode of the last one processed.
    entered: Option<VrState>,
    processed: VrMode,
    /// Rule (e): nothing enters until the queue is empty.
    waiting: bool,
    said: Said,
    feedback: Vec<Feedback>,
    counts: QueueCounts,
}

impl LiveQueue {
    /// An empty queue.
    pub fn new(settings: SessionSettings) -> Self {
        Self {
            settings,
            queue: VecDeque::new(),
            segment: Vec::new(),
            length: 0.0,
            carried: false,
            start: 0.0,
            entered: None,
            processed: VrMode::Idle,
            waiting: false,
            said: Said::default(),
            feedback: Vec::new(),
            counts: QueueCounts::default(),
        }
    }

    /// A state comes in.
    pub fn push(&mut self, state: VrState) {
        let before = self.entered.replace(state);
        if state.mode == VrMode::Idle {
            // Of a pause only its latest state matters.
            if self.queue.back().is_some_and(|last| last.mode == VrMode::Idle) {
                self.queue.pop_back();
            }
            if !self.waiting {
                self.queue.push_back(state);
            }
            let released = before.is_some_and(|before| before.mode != VrMode::Idle);
            if released && !self.waiting && (self.queue.len() > 1 || !self.segment.is_empty()) {
                self.waiting = true;
                self.feedback.push(Feedback::Wait { states: self.queue.len() });
            }
            return;
        }
        if self.waiting {
            self.counts.refused_waiting += 1;
            if before.is_none_or(|before| before.mode == VrMode::Idle) {
                self.feedback.push(Feedback::Wait { states: self.queue.len() });
            }
            return;
        }
        if self.queue.len() >= self.settings.capacity {
            self.counts.refused_full += 1;
            if !self.said.full {
                self.feedback.push(Feedback::QueueFull { capacity: self.settings.capacity });
            }
            self.said.full = true;
            return;
        }
        self.said.full = false;
        self.counts.accepted += 1;
        self.queue.push_back(state);
    }

    /// Runs Algorithm 1 until there is a task or the queue is empty; see [`LiveQueue::step`].
    pub fn next_task(&mut self, now: f64, vehicle: &Point3<f64>) -> Option<Task> {
        while !self.queue.is_empty() {
            let task = self.step(now, vehicle);
            if task.is_some() {
                return task;
            }
        }
        self.step(now, vehicle)
    }

    /// The next piece of the stroke that the vehicle is painting, if it is complete: for a vehicle that goes on without a halt. Unlike
    /// [`LiveQueue::next_task`] it may be asked for while the vehicle is busy, and never begins anything else.
    pub fn next_continuation(&mut self, now: f64, vehicle: &Point3<f64>) -> Option<Segment> {
        while !self.queue.is_empty() && self.segment.last().is_some_and(|last| last.mode == VrMode::Painting) {
            if let Some(Task::Segment(segment)) = self.step(now, vehicle) {
                return Some(segment);
            }
        }
        None
    }

    /// Takes back what [`LiveQueue::next_continuation`] has just given, where the vehicle must halt before it: it takes all that comes
    /// until the vehicle asks for a task, as the vehicle is farther behind then.
    pub fn give_back(&mut self, segment: Segment) {
        self.start = segment.start;
        self.length = segment.length;
        self.segment = segment.states;
        self.carried = false;
    }

    /// One run of Algorithm 1 at the session's time `now` (s): takes the oldest state, and returns a task where one is complete.
    /// `vehicle` is the vehicle's position `r`, m. To be called while the vehicle can take a task.
    pub fn step(&mut self, now: f64, vehicle: &Point3<f64>) -> Option<Task> {
        let Some(&state) = self.queue.front() else {
            let silent = self.segment.last().is_some_and(|last| now - last.time >= self.settings.timeout);
            if self.segment.is_empty() && self.waiting {
                self.waiting = false;
                self.feedback.push(Feedback::Ready);
            }
            // What was given back is full already.
            return if silent || self.length >= self.settings.segment { self.flush() } else { None };
        };
        // Whatever ends the segment leaves its state in the queue for the next run, which then finds the segment empty.
        if self.ends_segment(&state, vehicle) {
            return self.flush();
        }
        self.queue.pop_front();
        let first = state.mode != self.processed && state.mode != VrMode::Idle;
        self.processed = state.mode;
        match state.mode {
            VrMode::Painting if self.too_far(&state, vehicle) => None,
            VrMode::Painting if state.hit.is_none() => {
                self.counts.without_hit += 1;
                self.processed = if first { VrMode::Idle } else { state.mode };
                None
            }
            VrMode::Painting | VrMode::Viewing => {
                self.append(state);
                if first {
                    Some(Task::Approach(state))
                } else if self.is_full() {
                    let task = self.flush();
                    // The next segment continues where this one ends.
                    self.segment.push(state);
                    self.carried = true;
                    task
                } else {
                    None
                }
            }
            VrMode::Idle => {
                let away = (state.cradle.position - vehicle).norm();
                (away >= self.settings.seek).then_some(Task::Seek(state))
            }
        }
    }

    /// Whether nothing waits and nothing is under way.
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty() && self.segment.is_empty()
    }

    /// States that wait.
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    /// Whether states are refused until the queue is empty, rule (e).
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// Length of everything that the hand has painted, m; the latency in distance is what the nozzle lacks of it.
    pub fn painted_length(&self) -> f64 {
        let mut length = self.start;
        let mut before = None;
        for state in self.segment.iter().chain(&self.queue) {
            if let Some((from, to)) =
                before.replace(state).filter(|from| !breaks(from, state, &self.settings)).map(|from| (from, state))
            {
                length += painted_step(from, to);
            }
        }
        length
    }

    /// What the person is to be told since the last call.
    pub fn take_feedback(&mut self) -> Vec<Feedback> {
        std::mem::take(&mut self.feedback)
    }

    /// What became of the states so far.
    pub fn counts(&self) -> QueueCounts {
        self.counts
    }

    /// Whether the segment is to be planned. While more waits it may grow: every segment costs the vehicle a halt.
    fn is_full(&self) -> bool {
        self.length >= self.settings.segment && (self.queue.is_empty() || self.length >= self.settings.longest)
    }

    fn ends_segment(&self, next: &VrState, vehicle: &Point3<f64>) -> bool {
        let Some(last) = self.segment.last() else { return false };
        if next.mode != last.mode {
            return true;
        }
        if next.mode == VrMode::Painting && self.distance(next, vehicle) >= self.settings.far {
            return true;
        }
        let lost = next.hit.is_none() && next.time - last.time <= self.settings.hit_gap;
        next.mode == VrMode::Painting && !lost && breaks(last, next, &self.settings)
    }

    /// Distance from which the hit is painted, m; 0 without one.
    fn distance(&self, state: &VrState, vehicle: &Point3<f64>) -> f64 {
        let from = match self.settings.far_reference {
            FarReference::Nozzle => state.nozzle_position(),
            FarReference::Vehicle => *vehicle,
        };
        state.hit.map_or(0.0, |hit| (hit.point - from).norm())
    }

    /// Rule (b). The stroke begins anew when the person has come closer.
    fn too_far(&mut self, state: &VrState, vehicle: &Point3<f64>) -> bool {
        let distance = self.distance(state, vehicle);
        let far = distance >= self.settings.far;
        if far {
            self.counts.far += 1;
            self.processed = VrMode::Idle;
            if !self.said.far {
                self.feedback.push(Feedback::MoveCloser { distance });
            }
        }
        self.said.far = far;
        far
    }

    fn append(&mut self, state: VrState) {
        if let Some(last) = self.segment.last() {
            self.length += match state.mode {
                VrMode::Painting => painted_step(last, &state),
                _ => (state.nozzle_position() - last.nozzle_position()).norm(),
            };
        }
        self.segment.push(state);
        self.carried = false;
    }

    /// `PlanTask(S)`, with the two resets that Algorithm 1 does not print.
    fn flush(&mut self) -> Option<Task> {
        let mode = self.segment.first()?.mode;
        let states = std::mem::take(&mut self.segment);
        let length = std::mem::take(&mut self.length);
        let start = self.start;
        self.start += if mode == VrMode::Painting { length } else { 0.0 };
        // A state that is only carried over has been planned already.
        let carried = std::mem::take(&mut self.carried);
        (!carried).then_some(Task::Segment(Segment { mode, states, start, length }))
    }
}
