//! Which targets flights serve, and why not the others.

use crate::not_served::NotServed;
use crate::plan::Plan;
use crate::target::Target;

/// Targets with paint, by what becomes of them. Each counts once: what is given up and flown once more has its paint in the later flight only.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TargetOutcomes {
    /// All targets with paint.
    pub targets: usize,
    /// Not served: those whose normal the joints do not reach.
    pub out_of_reach: usize,
    /// Those that something stands in front of.
    pub hidden: usize,
    /// Those without a heading at which the robot fits, or from which it could go on to the next one.
    pub without_heading: usize,
    /// Those at which the trajectory came too near something.
    pub too_near: usize,
    /// Those that no flight was found to.
    pub without_transit: usize,
    /// Those passed with the valve shut, as the spray would miss.
    pub missed: usize,
    /// Those given up in the rehearsal.
    pub excluded: usize,
}

impl TargetOutcomes {
    /// Counts the targets of a flight.
    pub fn add_flight(&mut self, targets: &[Target], plan: &Plan) {
        for k in painted(targets) {
            self.targets += 1;
            if plan.flow[k] > 0.0 {
                continue;
            }
            // Paint lies between a target and the next: either may be the reason.
            let ends = k..k + 2;
            let mut reasons = plan.not_served[ends].iter().flatten();
            let excluded = reasons.clone().find(|why| **why == NotServed::Excluded);
            self.note(excluded.or_else(|| reasons.next()).copied(), 1);
        }
    }

    /// Counts targets that no flight was planned for, for a reason common to all.
    pub fn add_refused(&mut self, targets: &[Target], why: NotServed) {
        let count = painted(targets).count();
        self.targets += count;
        self.note(Some(why), count);
    }

    /// Two targets that are both served with a flight between them, and no paint, have headings too far apart.
    fn note(&mut self, why: Option<NotServed>, count: usize) {
        *match why {
            Some(NotServed::OutOfReach) => &mut self.out_of_reach,
            Some(NotServed::Hidden) => &mut self.hidden,
            Some(NotServed::NoHeading) | None => &mut self.without_heading,
            Some(NotServed::TooNear) => &mut self.too_near,
            Some(NotServed::NoTransit) => &mut self.without_transit,
            Some(NotServed::Missed) => &mut self.missed,
            Some(NotServed::Excluded) => &mut self.excluded,
        } += count;
    }

    fn reasons(&self) -> [(usize, &'static str); 7] {
        [
            (self.out_of_reach, "out of the joints' reach"),
            (self.hidden, "hidden"),
            (self.without_heading, "without a heading"),
            (self.too_near, "too near something"),
            (self.without_transit, "without a flight to them"),
            (self.missed, "off the aim"),
            (self.excluded, "left bare after the rehearsal"),
        ]
    }

    /// All that are not served.
    pub fn not_served(&self) -> usize {
        self.reasons().iter().map(|(count, _)| count).sum()
    }

    /// For people: how many are not served, and why.
    pub fn summary(&self) -> String {
        let why: Vec<String> = self
            .reasons()
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, why)| format!("{count} {why}"))
            .collect();
        let why = if why.is_empty() { String::new() } else { format!(" ({})", why.join(", ")) };
        format!("{} of {} targets not served{why}", self.not_served(), self.targets)
    }
}

/// Targets with paint between them and the next.
fn painted(targets: &[Target]) -> impl Iterator<Item = usize> {
    (0..targets.len().saturating_sub(1)).filter(|&k| targets[k].dose > 0.0)
}
