//! The interlock of the valve: paint leaves only while the spray is expected to meet its aim.

use nalgebra::{Isometry3, Point3};

use super::estimator::Estimator;
use super::pan_tilt::PanTilt;
use super::reference::ReferenceState;
use crate::error::{Error, check_positive};

/// When the valve is kept shut although the reference asks for paint.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Interlock {
    /// Largest distance of the aim from the spray's axis, m. Default 1.5 cm.
    pub miss: f64,
    /// Largest error of the distance from nozzle to aim, m. Default 5 cm: with a stand-off of 10 cm the 5 to 15 cm of Paper II,
    /// section 7.1.
    pub distance: f64,
}

/// An estimate whose poses have jumped by more than this share of the largest miss has to settle first (ours).
const UNSETTLED: f64 = 0.5;

impl Default for Interlock {
    fn default() -> Self {
        Self { miss: 0.015, distance: 0.05 }
    }
}

/// Share of a spot that is left for what the prediction errs between a decision and its effect (ours).
const PREDICTED: f64 = 0.3;

impl Interlock {
    /// So that no paint leaves more than a spot's deviation, m, beside its aim.
    #[must_use]
    pub fn within(spot: f64) -> Self {
        Self { miss: (1.0 - PREDICTED) * spot, ..Self::default() }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        check_positive("valve.interlock.miss", self.miss)?;
        check_positive("valve.interlock.distance", self.distance)
    }

    /// Whether paint may leave a nozzle at a reported pose and reported angles.
    fn permits(
        &self,
        ptu: &dyn PanTilt,
        world_from_body: &Isometry3<f64>,
        angles: [f64; 2],
        wanted: &ReferenceState,
    ) -> bool {
        // Without an aim there is nothing to judge by.
        wanted.aim.is_none_or(|aim: Point3<f64>| {
            let (nozzle, axis) = ptu.nozzle(world_from_body, angles);
            let ray = aim - nozzle;
            let along = ray.dot(&axis);
            let off = (ray - axis.into_inner() * along).norm();
            along > 0.0 && off <= self.miss && (along - wanted.nozzle_distance).abs() <= self.distance
        })
    }
}

/// The interlock at work: one decision for each control step.
#[derive(Debug, Clone)]
pub struct InterlockState {
    settings: Option<Interlock>,
    /// Control steps from a command of the joints to its effect, and from one of the valve.
    delays: [usize; 2],
    commands: Vec<[f64; 2]>,
    /// What the joints have reported.
    angles: Vec<[f64; 2]>,
    /// Whether nothing spoke against paint in the last control step: a valve that was shut is not opened for a single one.
    permitted: bool,
    open: Vec<bool>,
}

/// A joint sticks that within so many control steps is told to move by this angle, rad, and moves by less than this share of it (ours).
const STUCK_STEPS: usize = 3;
const STUCK_TOLD: f64 = 1e-3;
const STUCK_SHARE: f64 = 0.1;

/// What is known when a control step begins.
#[derive(Clone, Copy)]
pub struct InterlockInput<'a> {
    /// `None` while no pose arrives.
    pub estimator: Option<&'a Estimator>,
    /// The joints as they report themselves.
    pub angles: [f64; 2],
    /// The joints as they are commanded now.
    pub command: [f64; 2],
    /// The reference now.
    pub now: &'a ReferenceState,
    /// The reference when the valve will have followed.
    pub later: &'a ReferenceState,
    /// Time until then, s.
    pub ahead: f64,
}

impl InterlockState {
    /// `None` leaves the valve to the reference. Delays of joints and valve in control steps.
    pub fn new(settings: Option<Interlock>, delays: [f64; 2]) -> Self {
        let delays = delays.map(|steps| steps.round() as usize);
        Self { settings, delays, commands: Vec::new(), angles: Vec::new(), permitted: false, open: Vec::new() }
    }

    /// Decides for the control step that begins: the spray must meet its aim now and when the valve will have followed; without a
    /// pose the valve is shut. The joints will then be where they were commanded to, but for what they are off now; one that sticks
    /// will be where it is.
    pub fn decide(&mut self, ptu: &dyn PanTilt, known: &InterlockInput) {
        self.commands.push(known.command);
        let [joints, valve] = self.delays;
        let commanded = |ago: usize| self.commands[self.commands.len().saturating_sub(1 + ago)];
        let (now, later) = (commanded(joints), commanded(joints.saturating_sub(valve)));
        self.angles.push(known.angles);
        let before = commanded(joints + STUCK_STEPS);
        let way = &self.angles[self.angles.len().saturating_sub(1 + STUCK_STEPS)..];
        let sticks = |k: usize| {
            let told = (now[k] - before[k]).abs();
            // There and back is moved, too.
            let moved: f64 = way.windows(2).map(|pair| (pair[1][k] - pair[0][k]).abs()).sum();
            told > STUCK_TOLD && moved < STUCK_SHARE * told
        };
        let expected = [0, 1].map(|k| if sticks(k) { known.angles[k] } else { later[k] + known.angles[k] - now[k] });
        let permits = |interlock: &Interlock, estimator: &Estimator| {
            estimator.innovation() <= UNSETTLED * interlock.miss
                && interlock.permits(ptu, &estimator.predict(0.0), known.angles, known.now)
                && interlock.permits(ptu, &estimator.predict(known.ahead), expected, known.later)
        };
        let permitted = match (&self.settings, known.estimator) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(interlock), Some(estimator)) => permits(interlock, estimator),
        };
        self.open.push(permitted && (self.permitted || self.last()));
        self.permitted = permitted;
    }

    /// The decision of the last control step; before the first nothing is forbidden.
    pub fn last(&self) -> bool {
        self.open.last().copied().unwrap_or(true)
    }

    /// The decision of a control step, counted from the first; before it nothing was forbidden.
    pub fn open(&self, control_step: i64) -> bool {
        usize::try_from(control_step).ok().and_then(|k| self.open.get(k)).copied().unwrap_or(true)
    }
}
