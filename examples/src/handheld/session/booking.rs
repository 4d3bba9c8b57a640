//! The paint that the robot believes to be there, booked where the smoothed motion says that it was sprayed from.
//!
//! The filter errs by half a millimetre, the same way for a whole sweep. Later poses tell how: paint that is booked by them is known twice
//! as well, and the next sweeps fill what is really missing.

use std::collections::VecDeque;

use nalgebra::Isometry3;
use paint_planner::gantry::{PoseFilter, PoseSmoother, RobotMotion};
use paint_sim::droplets::{Coverage, StepHits};

use crate::handheld::forecast::PaintJob;

/// Ticks after which more poses say little more about one.
const SETTLED: usize = 50;

/// A tick in which paint flew.
struct Sprayed {
    tick: usize,
    /// Mean position of the nozzle on its slide, m: the robot counts the steps.
    position: f64,
    /// Share of the tick.
    open: f64,
}

/// Paint on its way into the books.
pub(super) struct Booking {
    smoother: PoseSmoother,
    /// Paint of all ticks that are not recent.
    settled: Coverage,
    recent: VecDeque<Sprayed>,
}

impl Booking {
    /// On a surface as it is; asked for the belief every `interval` ticks.
    pub(super) fn new(bare: Coverage, interval: usize) -> Self {
        Self { smoother: PoseSmoother::new(SETTLED + interval + 1), settled: bare, recent: VecDeque::new() }
    }

    /// Takes in the filter, once in every tick.
    pub(super) fn observe(&mut self, filter: &PoseFilter) {
        self.smoother.push(filter);
    }

    /// Paint flew during a tick.
    pub(super) fn sprayed(&mut self, tick: usize, position: f64, open: f64) {
        self.recent.push_back(Sprayed { tick, position, open });
    }

    /// The paint before tick `now`, which has been observed.
    pub(super) fn belief(&mut self, job: &PaintJob, model_from_world: &Isometry3<f64>, now: usize) -> Coverage {
        let motions = self.smoother.latest_first();
        let (deposit, geometry) = (&job.settings.deposit, &job.settings.geometry);
        let book = |coverage: &mut Coverage, sprayed: &Sprayed| {
            // The smoother remembers all ticks since the last time that it was asked.
            let Some(motion) = motions.get(now - sprayed.tick) else { return };
            let pose = model_from_world * RobotMotion::after(motion, 0.5 * deposit.step);
            let droplets = &job.sets[sprayed.tick % job.sets.len()];
            let hits = StepHits::cast(job.surface, &geometry.nozzle(&pose, sprayed.position), droplets);
            coverage.spray(&hits, (sprayed.open * deposit.droplet() as f64).round() as u64);
        };
        while let Some(sprayed) = self.recent.pop_front_if(|sprayed| sprayed.tick + SETTLED <= now) {
            book(&mut self.settled, &sprayed);
        }
        let mut belief = self.settled.clone();
        self.recent.iter().for_each(|sprayed| book(&mut belief, sprayed));
        belief
    }
}
