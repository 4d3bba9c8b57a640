//! Which of odometry and map errs where they contradict each other (ours).

use nalgebra::{Isometry3, Vector3};

use crate::stamp::Stamp;

/// What follows from a pose in the map beside the expected one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// They agree.
    Confirmed,
    /// One of them errs, and the odometry goes on.
    Doubted,
    /// It is the odometry.
    OdometryErrs,
}

/// What has jumped is about as far off as it was within this share.
const ABOUT: f64 = 0.3;

/// By how much a pose in the map was off the expected one: m and rad, along the world's axes.
#[derive(Debug, Clone, Copy)]
struct Offset {
    stamp: Stamp,
    shift: Vector3<f64>,
    turn: Vector3<f64>,
}

/// Poses in the map beside what was expected of them, one after another.
///
/// An odometry that errs drifts: its distance from the map grows. A map that errs, at a place that looks like another, say, jumps, and then stays
/// about as far off a sound odometry as it was: before a rim, where less fixes it, it wobbles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contradiction {
    /// More than these between two poses, m and rad, are a step.
    steady: [f64; 2],
    /// A pose is compared with one that is no older than this, s.
    memory_s: f64,
    /// A map that stays as far off as it has jumped is believed after so long, s.
    longest_jump_s: f64,
    last: Option<Offset>,
    /// When the poses that contradict began.
    since: Option<Stamp>,
    /// They began with a jump to there, and have been about as far off since.
    jumped: Option<Offset>,
}

impl Contradiction {
    /// Nothing weighed yet.
    pub(super) fn new(steady: [f64; 2], memory_s: f64, longest_jump_s: f64) -> Self {
        Self { steady, memory_s, longest_jump_s, last: None, since: None, jumped: None }
    }

    /// What was weighed was of another odometry.
    pub(super) fn forget(&mut self) {
        (self.last, self.since, self.jumped) = (None, None, None);
    }

    /// Takes a pose in the map beside the one that was expected; `follows`: it follows from the one before.
    pub(super) fn weigh(
        &mut self,
        stamp: Stamp,
        [expected, found]: [&Isometry3<f64>; 2],
        (agrees, follows): (bool, bool),
    ) -> Verdict {
        let offset = Offset {
            stamp,
            shift: found.translation.vector - expected.translation.vector,
            turn: (found.rotation * expected.rotation.inverse()).scaled_axis(),
        };
        let recent = |last: &Offset| stamp.secs_since(last.stamp) <= self.memory_s;
        let before = self.last.replace(offset).filter(recent);
        let [shift, turn] = self.steady;
        let steps =
            |last: &Offset| (offset.shift - last.shift).norm() > shift || (offset.turn - last.turn).norm() > turn;
        if agrees {
            (self.since, self.jumped) = (None, None);
            return Verdict::Confirmed;
        }
        let Some(since) = self.since else {
            (self.since, self.jumped) = (Some(stamp), before.as_ref().is_some_and(steps).then_some(offset));
            return Verdict::Doubted;
        };
        let stays = |jump: &Offset| {
            let about = |now: Vector3<f64>, then: Vector3<f64>, least: f64| {
                (now - then).norm() <= (ABOUT * then.norm()).max(least)
            };
            about(offset.shift, jump.shift, shift) && about(offset.turn, jump.turn, turn)
        };
        self.jumped = self.jumped.filter(|jump| before.is_some() && stays(jump));
        let believed = if self.jumped.is_some() { stamp.secs_since(since) > self.longest_jump_s } else { follows };
        if believed { Verdict::OdometryErrs } else { Verdict::Doubted }
    }
}
