//! Which targets the flights of a mission serve, and why not the others.

use paint_planner::{NotServed, Plan, Target};

use super::rehearse::BARE;

/// Targets with paint and their fate. Each counts once: what is given up and flown once more has its paint in the later flight only.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Service {
    /// All targets with paint.
    pub(super) targets: usize,
    /// Those whose normal the joints do not reach.
    pub(super) out_of_reach: usize,
    /// Those that something stands in front of.
    pub(super) hidden: usize,
    /// Those without a heading at which the robot fits, or from which it could go on to the next one.
    pub(super) without_heading: usize,
    /// Those at which the trajectory came too near something.
    pub(super) too_near: usize,
    /// Those that no flight was found to.
    pub(super) without_transit: usize,
    /// Those given up in the rehearsal in wind.
    pub(super) left_in_wind: usize,
}

impl Service {
    /// Counts the targets of a flight; `clearance` of each as rehearsed, metres.
    pub(super) fn add_flight(&mut self, targets: &[Target], plan: &Plan, clearance: &[f64]) {
        for k in painted(targets) {
            self.targets += 1;
            if plan.flow[k] > 0.0 {
                continue;
            }
            // Paint lies between a target and the next: either may be the reason.
            let ends = k..k + 2;
            if clearance[ends.clone()].iter().any(|clearance| *clearance >= BARE) {
                self.left_in_wind += 1;
            } else {
                self.note(plan.not_served[ends].iter().flatten().next().copied(), 1);
            }
        }
    }

    /// Counts targets that no flight was planned for, for a reason common to all.
    pub(super) fn add_refused(&mut self, targets: &[Target], why: NotServed) {
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
        } += count;
    }

    fn reasons(&self) -> [(usize, &'static str); 6] {
        [
            (self.out_of_reach, "out of the joints' reach"),
            (self.hidden, "hidden"),
            (self.without_heading, "without a heading"),
            (self.too_near, "too near something"),
            (self.without_transit, "without a flight to them"),
            (self.left_in_wind, "left bare after the rehearsal"),
        ]
    }

    /// All that are not served.
    pub(super) fn not_served(&self) -> usize {
        self.reasons().iter().map(|(count, _)| count).sum()
    }

    /// For people: how many are not served, and why.
    pub(super) fn summary(&self) -> String {
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use ptu_kinematics::Ptu;

    use super::super::given_up::take_given_up;
    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::adapters::Robot;

    #[test]
    fn every_target_counts_once_and_with_its_reason() {
        let settings = MissionSettings::default();
        let (surface, mut targets) = (test_panel::surface(), test_panel::targets());
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let mut plan = test_panel::plan(&surface, &robot, &settings);
        let painted = targets.len() - 1;
        let mut clearance = vec![settings.planner.clearance; targets.len()];
        let count = |targets: &[Target], plan: &Plan, clearance: &[f64]| {
            let mut service = Service::default();
            service.add_flight(targets, plan, clearance);
            service
        };
        assert_eq!(count(&targets, &plan, &clearance), Service { targets: painted, ..Service::default() });
        // A stretch that is given up and flown once more, one that no flight leads to, and one that wind does not permit.
        for k in (10..14).chain(20..23).chain([30]) {
            plan.flow[k] = 0.0;
        }
        plan.not_served[20..24].fill(Some(NotServed::NoTransit));
        clearance[31] = BARE;
        let before = count(&targets, &plan, &clearance);
        assert_eq!((before.without_heading, before.without_transit, before.left_in_wind), (4, 3, 1));
        let again = take_given_up(&mut targets, &plan, None, &surface, &robot, &settings).unwrap().unwrap();
        let mut after = count(&targets, &plan, &clearance);
        after.add_refused(&again.targets, NotServed::TooNear);
        assert_eq!((after.targets, after.too_near, after.not_served()), (painted, 7, 8));
        assert_eq!(
            after.summary(),
            format!("8 of {painted} targets not served (7 too near something, 1 left bare after the rehearsal)")
        );
    }
}
