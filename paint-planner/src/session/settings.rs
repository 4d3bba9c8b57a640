//! The numbers of a session.

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
