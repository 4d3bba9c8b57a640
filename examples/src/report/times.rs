//! How long the flights of a mission take, and what makes them as long as they are.

use paint_planner::Plan;
use paint_planner::timing::TimingSettings;
use serde::Serialize;

/// Figures of the time in the air. Flat, SI units in the names.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct TimeFigures {
    /// Lower bound of the time in the air along the same path within the same limits: the acceleration may jump (TOPP-RA).
    pub flight_time_bound_s: f64,
    /// Share of the time in the air in which the vehicle's speed limits it: 90 % of it is used, and more than of the other limits.
    pub limited_by_speed_share: f64,
    /// The same for the vehicle's acceleration.
    pub limited_by_acceleration_share: f64,
    /// Its heading rate.
    pub limited_by_heading_rate_share: f64,
    /// The rates of pan and tilt.
    pub limited_by_joint_rate_share: f64,
    /// The speed of the spot.
    pub limited_by_spot_speed_share: f64,
    /// The flow of the valve.
    pub limited_by_flow_share: f64,
    /// Longest time of spraying in which none of them does.
    pub longest_unlimited_spraying_s: f64,
}

impl TimeFigures {
    /// Of flights one after another.
    pub fn of<'a>(plans: impl Iterator<Item = &'a Plan>, limits: &TimingSettings) -> Self {
        let (mut figures, mut total) = (Self::default(), 0.0);
        for plan in plans {
            let (duration, limited) = (plan.trajectory.duration(), plan.binding_limits(limits));
            total += duration;
            figures.flight_time_bound_s += plan.report.time_bound;
            figures.longest_unlimited_spraying_s =
                figures.longest_unlimited_spraying_s.max(limited.longest_spraying_without);
            for (share, own) in figures.shares().into_iter().zip([
                limited.speed,
                limited.acceleration,
                limited.heading_rate,
                limited.joint_rate,
                limited.spot_speed,
                limited.flow,
            ]) {
                *share += duration * own;
            }
        }
        figures.shares().into_iter().for_each(|share| *share /= f64::max(total, f64::MIN_POSITIVE));
        figures
    }

    fn shares(&mut self) -> [&mut f64; 6] {
        [
            &mut self.limited_by_speed_share,
            &mut self.limited_by_acceleration_share,
            &mut self.limited_by_heading_rate_share,
            &mut self.limited_by_joint_rate_share,
            &mut self.limited_by_spot_speed_share,
            &mut self.limited_by_flow_share,
        ]
    }
}

/// What a report says of flights in several sorties.
pub(super) fn in_sorties(sorties: Option<usize>) -> String {
    sorties.map_or_else(String::new, |count| format!("Flown in {count} sorties.\n\n"))
}

/// What a report says first where some of the plans was not flown, s.
pub(crate) fn not_flown(left_s: Option<f64>) -> String {
    left_s.map_or_else(String::new, |left| format!("**Not all is flown: {left:.0} s of the plans are left.**\n\n"))
}
