//! Why a target is left bare.

/// Why a target is not served.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum NotServed {
    /// The joints reach no permitted incidence.
    OutOfReach,
    /// Something stands between nozzle and target.
    Hidden,
    /// At every heading the vehicle comes too near something, or joints or tool forbid it.
    NoHeading,
    /// The trajectory came too near something there, whatever clearance its targets were given.
    TooNear,
    /// No flight leads there from the rest.
    NoTransit,
    /// The vehicle passes it, but between it and the next one the spray would miss its aim: the valve stays shut.
    Missed,
    /// The caller gave it no clearance: a rehearsal had touched something there.
    Excluded,
}
