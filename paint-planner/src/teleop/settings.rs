//! The numbers of a session.

use super::state::{RATE, VrState};
use crate::settings::{NozzleSettings, Settings, TimingSettings};

/// From where the distance to the paint is measured that asks the person to move closer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum FarReference {
    /// The person's nozzle, as the prose of Section III-B has it; the default.
    Nozzle,
    /// The vehicle, as Algorithm 1 prints it.
    Vehicle,
}

/// Thresholds of the VR paper, Section III-B, and of the cuts that it leaves open.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct SessionSettings {
    /// Length of a live segment, m: `Delta_seg`. Default 0.1 (ours; the paper flies 1 and 0.5 m, which costs latency).
    pub segment: f64,
    /// Length up to which a segment takes all that waits, m: a vehicle that is behind halts less often. Default 1 (ours); that of
    /// `segment` cuts as the paper does.
    pub longest: f64,
    /// Distance between cradle and vehicle from which the vehicle follows, m: `Delta_seek` (1 m, VR paper, Section III-B).
    pub seek: f64,
    /// Distance from which painting is refused, m: `Delta_far` (1 m, VR paper, Section III-B).
    pub far: f64,
    /// From where that is measured.
    pub far_reference: FarReference,
    /// Most states that wait; more are refused (default 5400, a minute; ours).
    pub capacity: usize,
    /// A jump of the hit that ends a stroke, m (default 0.05; ours).
    pub hit_jump: f64,
    /// A jump of the normal that ends a stroke, rad (default 60 degrees; ours).
    pub normal_jump: f64,
    /// Time without a hit that ends a stroke, s (default 0.05; ours).
    pub hit_gap: f64,
    /// Time without states after which what has come is planned, s (default 0.3; ours).
    pub timeout: f64,
    /// Lag of the vehicle's nozzle behind the hand from which the person is shown the vehicle, m (default 0.5; ours).
    pub show_vehicle: f64,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self {
            segment: 0.1,
            longest: 1.0,
            seek: 1.0,
            far: 1.0,
            far_reference: FarReference::Nozzle,
            capacity: 5400,
            hit_jump: 0.05,
            normal_jump: 60_f64.to_radians(),
            hit_gap: 0.05,
            timeout: 0.3,
            show_vehicle: 0.5,
        }
    }
}

/// How a segment becomes targets (ours: the paper prints no conversion).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct TargetSettings {
    /// Hits nearer to each other than this are one, which keeps their time, m (default 0.5 mm).
    pub merge: f64,
    /// Distance between targets, m (default 0.01).
    pub spacing: f64,
    /// Radius over which the normal is averaged, m (default 0.014, the spot of the default nozzle at its stand-off).
    pub footprint: f64,
}

impl Default for TargetSettings {
    fn default() -> Self {
        Self { merge: 0.5e-3, spacing: 0.01, footprint: 0.014 }
    }
}

/// How tasks are flown (all defaults ours).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct TeleopSettings {
    /// Thresholds of the session.
    pub session: SessionSettings,
    /// How segments become targets.
    pub targets: TargetSettings,
    /// Whether a segment gets one coat of its paint, instead of what the hand gave every place (default no).
    pub even_coat: bool,
    /// The planner for paint; its stand-off is that of the hand.
    pub painting: Settings,
    /// The planner for looking at the surface with the valve shut.
    pub viewing: Settings,
    /// Nearest and farthest distance of the nozzle from the surface that the hand can ask for, m (default 0.06 and 0.14).
    pub stand_off: [f64; 2],
    /// Time that planning takes on the session's clock, s: a plan begins so much later than its task was taken (default one tick; for a
    /// real vehicle the longest that it takes).
    pub planning_time: f64,
    /// Time before its end in which a flight may be continued, s: the next segment is planned as late as the vehicle need not slow down
    /// (default 1.5).
    pub continue_within: f64,
}

/// Distance at which the vehicle looks at the surface, m.
const VIEW_DISTANCE: f64 = 0.8;

impl TeleopSettings {
    /// The defaults over a planner's settings.
    pub fn new(planner: &Settings) -> Self {
        // Who follows a hand has no time for every bend of the surface: a stronger pull between neighbours, and a trajectory that may
        // pass its waypoints at a third of the spot's deviation.
        let painting = Settings {
            nozzle: NozzleSettings { ca: 1.0, cb: 0.01, ..planner.nozzle.clone() },
            timing: TimingSettings { tolerance: 0.005, ..planner.timing.clone() },
            ..planner.clone()
        };
        let nozzle = NozzleSettings {
            stand_off: VIEW_DISTANCE,
            min: 0.75 * VIEW_DISTANCE,
            max: 1.25 * VIEW_DISTANCE,
            ..planner.nozzle.clone()
        };
        Self {
            session: SessionSettings::default(),
            targets: TargetSettings::default(),
            even_coat: false,
            painting,
            viewing: Settings { nozzle, ..planner.clone() },
            stand_off: [0.06, 0.14],
            planning_time: 1.0 / RATE,
            continue_within: 1.5,
        }
    }

    /// Distance of the gun from the surface as the vehicle will keep it, m.
    pub fn stand_off_of(&self, state: &VrState) -> f64 {
        let distance =
            state.hit.map_or(self.painting.nozzle.stand_off, |hit| (hit.point - state.nozzle_position()).norm());
        distance.clamp(self.stand_off[0], self.stand_off[1])
    }

    /// The planner for paint from a distance, m.
    pub(super) fn painting_from(&self, stand_off: f64) -> Settings {
        let mut settings = self.painting.clone();
        settings.nozzle.stand_off = stand_off;
        settings
    }
}

impl Default for TeleopSettings {
    fn default() -> Self {
        Self::new(&Settings::default())
    }
}
