//! What the parts that the robot does not reach would need.

use serde::Serialize;

/// Shares of the surface that are out of reach, by what they are and by the least that would reach them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ReachNeeds {
    /// Out of reach and facing up by more than 45 degrees.
    pub unreached_tops_share: f64,
    /// Out of reach and facing down by more than 45 degrees.
    pub unreached_undersides_share: f64,
    /// Out of reach though they face the side: in hollows, behind something, or where the chart is stretched beyond use.
    pub unreached_hidden_share: f64,
    /// Reached with a tilt joint of 80 degrees (`--tilt 80`).
    pub reach_needs_tilt_share: f64,
    /// Reached with an arm longer by 0.4 m (`--arm`), but not so.
    pub reach_needs_arm_share: f64,
    /// Reached with both, but not with one.
    pub reach_needs_tilt_and_arm_share: f64,
    /// Reached by none of these, but by a vehicle that hovers pitched by up to 45 degrees (`--pitch 45`: planned, not simulated).
    pub reach_needs_pitch_share: f64,
    /// Reached only by such a vehicle with the longer arm.
    pub reach_needs_pitch_and_arm_share: f64,
    /// Reached by none of them.
    pub reach_needs_more_share: f64,
}

impl ReachNeeds {
    /// In words: what is bare, and the switch that reaches it.
    pub(crate) fn describe(&self) -> String {
        let parts = [
            (self.unreached_tops_share, "tops"),
            (self.unreached_undersides_share, "undersides"),
            (self.unreached_hidden_share, "hollows and what something hides"),
        ];
        let ways = [
            (self.reach_needs_tilt_share, "by --tilt 80"),
            (self.reach_needs_arm_share, "by an --arm longer by 0.4 m"),
            (self.reach_needs_tilt_and_arm_share, "by both"),
            (self.reach_needs_pitch_share, "by --pitch 45 (`plan` alone)"),
            (self.reach_needs_pitch_and_arm_share, "by --pitch 45 and the longer arm"),
            (self.reach_needs_more_share, "by no switch"),
        ];
        let list = |shares: &[(f64, &str)]| {
            let said = shares.iter().filter(|(share, _)| *share >= 0.0005);
            said.map(|(share, what)| format!("{:.1} % {what}", 100.0 * share)).collect::<Vec<_>>().join(", ")
        };
        format!("bare: {}; reached: {}", list(&parts), list(&ways))
    }
}
