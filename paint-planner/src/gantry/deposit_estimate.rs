//! The paint that the robot believes to be there, counted where the smoothed motion says that it was sprayed from.
//!
//! The filter errs by half a millimetre, the same way for a whole sweep. Later poses tell how: paint that is counted by them is known twice
//! as well, and the next sweeps fill what is really missing.

use std::collections::VecDeque;

use nalgebra::Isometry3;

use super::model::DepositModel;
use super::pose_filter::PoseFilter;
use super::pose_smoother::PoseSmoother;

/// Steps after which more poses say little more about one.
const SETTLED: usize = 50;

/// A time step in which paint flew.
struct Sprayed {
    step: usize,
    /// Mean position of the nozzle on its slide, m: the robot counts the motor's steps.
    position: f64,
    /// Share of the time step.
    open: f64,
}

/// Paint that settles where it was sprayed as the motion becomes known.
pub struct DepositEstimate<M: DepositModel> {
    smoother: PoseSmoother,
    /// Half of a time step, s.
    half_step: f64,
    /// Paint of all steps that are not recent.
    settled: M::Deposit,
    recent: VecDeque<Sprayed>,
}

impl<M: DepositModel> DepositEstimate<M> {
    /// On a surface as it is; time steps last `step` seconds, and the estimate is asked for every `interval` of them.
    pub fn new(deposit: M::Deposit, step: f64, interval: usize) -> Self {
        let smoother = PoseSmoother::new(SETTLED + interval + 1);
        Self { smoother, half_step: 0.5 * step, settled: deposit, recent: VecDeque::new() }
    }

    /// Takes in the filter, once in every time step.
    pub fn observe(&mut self, filter: &PoseFilter) {
        self.smoother.push(filter);
    }

    /// Paint flew for the share `open` of a time step, from the gantry position `position` (m) in the mean.
    pub fn sprayed(&mut self, step: usize, position: f64, open: f64) {
        self.recent.push_back(Sprayed { step, position, open });
    }

    /// The paint before step `now`, which has been observed.
    pub fn estimate(&mut self, model: &M, model_from_world: &Isometry3<f64>, now: usize) -> M::Deposit {
        let motions = self.smoother.latest_first();
        let add = |deposit: &mut M::Deposit, sprayed: &Sprayed| {
            // The smoother remembers all steps since the last time that it was asked.
            let Some(motion) = motions.get(now - sprayed.step) else { return };
            let model_from_robot = model_from_world * motion.after(self.half_step);
            model.spray(&model.footprint(&model_from_robot, sprayed.position, sprayed.step), sprayed.open, deposit);
        };
        while let Some(sprayed) = self.recent.pop_front_if(|sprayed| sprayed.step + SETTLED <= now) {
            add(&mut self.settled, &sprayed);
        }
        let mut estimate = self.settled.clone();
        self.recent.iter().for_each(|sprayed| add(&mut estimate, sprayed));
        estimate
    }
}
