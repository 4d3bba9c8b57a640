//! What flies the plans.

use nalgebra::Point3;

use crate::plan::Plan;
use crate::target::Target;

/// A plan on the session's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Number of its task in the session, from 0.
    pub number: u64,
    /// When it begins, s.
    pub begin: f64,
    /// The plan; it ends at rest, whatever happens to the session.
    pub plan: Plan,
    /// What it serves.
    pub targets: Vec<Target>,
    /// Distance of the nozzle from the surface that it was planned with, m.
    pub stand_off: f64,
    /// Number of the paint on the palette.
    pub colour: u8,
    /// The part of the pattern that it paints: where it begins, and its length, m. `None` where it does not paint.
    pub pattern: Option<[f64; 2]>,
    /// Whether it begins in the motion of the flight before, which ends there; any other begins at rest.
    pub takes_over: bool,
}

impl Flight {
    /// When it ends, s.
    pub fn end(&self) -> f64 {
        self.begin + self.plan.trajectory.duration()
    }

    /// Where on the pattern it is at a time, m; only where it paints.
    pub fn painted(&self, now: f64) -> Option<f64> {
        let [start, length] = self.pattern?;
        Some(start + length * share_passed(&self.plan.target_time, now - self.begin))
    }
}

/// Share of the targets that are passed.
fn share_passed(times: &[f64], elapsed: f64) -> f64 {
    let after = times.partition_point(|time| *time <= elapsed);
    let Some(before) = after.checked_sub(1) else { return 0.0 };
    let within = times.get(after).map_or(0.0, |next| (elapsed - times[before]) / (next - times[before]));
    ((before as f64 + within) / (times.len() - 1).max(1) as f64).clamp(0.0, 1.0)
}

/// What flies: an autopilot, or a simulation of one.
pub trait Vehicle {
    /// What may go wrong in taking a flight.
    type Error;

    /// Position of its body now, m.
    fn position(&self) -> Point3<f64>;

    /// Takes a flight, to be begun at [`Flight::begin`]: there it replaces the one in the air where it
    /// [takes over](Flight::takes_over), and otherwise none is in the air.
    ///
    /// # Errors
    /// Whatever keeps it from being flown; it is none of the session then.
    fn fly(&mut self, flight: &Flight) -> Result<(), Self::Error>;

    /// Whether a flight is over; by the clock unless the vehicle knows better.
    fn has_finished(&self, flight: &Flight, now: f64) -> bool {
        now >= flight.end()
    }
}
