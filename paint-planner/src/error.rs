//! What can be wrong with an input, and what to do about it.

use thiserror::Error;

/// Everything the planners and the trajectory can refuse.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A path needs at least two targets.
    #[error("a path of {count} targets cannot be flown: give at least two")]
    TooFewTargets {
        /// Number of targets given.
        count: usize,
    },
    /// A field of one target is unusable.
    #[error("target {index}: {what}")]
    Target {
        /// Index of the target.
        index: usize,
        /// What is wrong and what is asked for.
        what: &'static str,
    },
    /// A setting is out of its range.
    #[error("setting `{name}` = {value} must be {requirement}")]
    Setting {
        /// Path of the field inside [`Settings`](crate::Settings).
        name: &'static str,
        /// The value found.
        value: f64,
        /// The range it has to be in.
        requirement: &'static str,
    },
    /// The caller's surface or tool answers what cannot be.
    #[error("{what} (asked at {:.3}, {:.3}, {:.3} m)", .at[0], .at[1], .at[2])]
    World {
        /// What is wrong with the answer.
        what: &'static str,
        /// The point of the world that was asked about, m.
        at: [f64; 3],
    },
    /// A recording of the attitude tells nothing.
    #[error("no response can be identified from this recording: {what}")]
    Recording {
        /// What is wrong with it.
        what: &'static str,
    },
    /// No target can be served by this tool on this surface.
    #[error(
        "none of the {count} targets is reachable: check the direction of the normals, the joint limits and the clearance"
    )]
    NothingReachable {
        /// Number of targets given.
        count: usize,
    },
    /// No flight is found to any stroke, or to the goal pose. (Single strokes to which there is none are marked as not reachable instead.)
    #[error("no collision-free way from {from} to {to}: split the path there, or lower the clearance")]
    NoTransit {
        /// Where the stretch before ends ("start pose" or a target index).
        from: String,
        /// Where the stretch after begins ("goal pose" or a target index).
        to: String,
    },
    /// The final trajectory touches the surface although its waypoints do not.
    #[error("the trajectory comes to {clearance:.3} m from the surface: raise `clearance` or lower `timing.tolerance`")]
    Collision {
        /// Distance between the collision body and the surface, m (negative: overlap).
        clearance: f64,
    },
    /// Knots and durations given to [`Trajectory`](crate::trajectory::Trajectory) do not describe a curve.
    #[error("trajectory knot {index}: {what}")]
    Knot {
        /// Index of the knot or segment.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A state of a VR session that no headset sends.
    #[error("VR state {sequence}: {what}")]
    VrState {
        /// Sequence number of the state.
        sequence: u64,
        /// What is wrong and what is asked for.
        what: &'static str,
    },
    /// A frame of the gantry's sensors that none measures.
    #[error("frame at {time} s: {what}")]
    Frame {
        /// Time of the frame, s.
        time: f64,
        /// What is wrong and what is asked for.
        what: &'static str,
    },
    /// A plan in flight cannot go on with the next segment.
    #[error("the plan in flight cannot be continued: {what}; let it halt and plan from there")]
    Continuation {
        /// Why not.
        what: &'static str,
    },
    /// A linear system lost positive definiteness; the input is scaled beyond f64.
    #[error("{stage} became numerically singular: check units (metres, seconds) and weights")]
    Numerical {
        /// The computation that failed.
        stage: &'static str,
    },
}

/// Refuses a setting that does not hold.
pub(crate) fn ensure(name: &'static str, value: f64, holds: bool, requirement: &'static str) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::Setting { name, value, requirement }) }
}
