//! Where the robot was: the steps of the pose filter smoothed backwards over a short window (Rauch, Tung and Striebel, 1965).
//!
//! The nozzle must be steered by what is known now, but what has been sprayed may be booked later: half a second of later
//! measurements halves the error of the place.

use std::collections::VecDeque;

use nalgebra::{Matrix4, Matrix4x3};

use super::filter_state::transition;
use super::pose_filter::{FilterStep, PoseFilter};
use super::robot_motion::RobotMotion;

/// The last steps of a filter.
#[derive(Debug, Clone)]
pub struct PoseSmoother {
    steps: VecDeque<FilterStep>,
    window: usize,
}

impl PoseSmoother {
    /// Remembers `window` steps, at least one.
    pub fn new(window: usize) -> Self {
        Self { steps: VecDeque::new(), window: window.max(1) }
    }

    /// Takes in the filter after each of its updates; the oldest step beyond the window is forgotten. Passes over a filter that has not
    /// started.
    pub fn push(&mut self, filter: &PoseFilter) {
        let Some(step) = filter.step() else { return };
        if self.steps.len() == self.window {
            self.steps.pop_front();
        }
        self.steps.push_back(*step);
    }

    /// The motion at each remembered step, the latest first: it is the filter's own, those before it know all that came after them.
    pub fn latest_first(&self) -> Vec<RobotMotion> {
        let mut motions = Vec::with_capacity(self.steps.len());
        // What has to be added to the prediction of the step after.
        let mut later: Option<(&FilterStep, [Matrix4x3<f64>; 2])> = None;
        for step in self.steps.iter().rev() {
            let mut smoothed = step.filtered;
            if let Some((next, [place, turn])) = later {
                let back = |filtered: &Matrix4<f64>, predicted: &Matrix4<f64>| {
                    // A covariance that cannot be inverted says nothing about the step before.
                    let inverse = predicted.try_inverse().unwrap_or_else(Matrix4::zeros);
                    filtered * transition(next.dt).transpose() * inverse
                };
                smoothed.shift(&(back(&step.filtered.position, &next.predicted.position) * place));
                smoothed.turn(&(back(&step.filtered.rotation, &next.predicted.rotation) * turn));
            }
            motions.push(smoothed.motion);
            later = (!step.begins).then(|| (step, smoothed.minus(&step.predicted)));
        }
        motions
    }
}
