//! What the person is told (VR paper, Section III-B).

/// A message to the person.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(tag = "say", rename_all = "snake_case")
)]
pub enum Feedback {
    /// Rule (b): the paint is too far away.
    MoveCloser {
        /// How far, m.
        distance: f64,
    },
    /// Rule (e): the vehicle has to catch up before the next stroke.
    Wait {
        /// States that wait.
        states: usize,
    },
    /// The wait is over.
    Ready,
    /// Rule (d): the vehicle is this far behind the hand; it is shown, and the person may slow down.
    ShowVehicle {
        /// Latency in distance, m.
        lag: f64,
    },
    /// It has caught up and need not be shown any more.
    HideVehicle,
    /// The queue is full: what is painted now is not flown.
    QueueFull {
        /// States that the queue holds.
        capacity: usize,
    },
}
