//! What the person is told, beside pictures.

use paint_planner::teleop::Feedback;
use serde::Serialize;

/// A message of the session.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Notice {
    /// Feedback of the rules.
    Feedback(Feedback),
    /// A line to read.
    Text {
        /// The line.
        text: String,
    },
    /// Recording and results so far are written.
    Saved {
        /// The recording.
        path: String,
        /// Share of the paint that the mission leaves out, because it lies thicker than a picture can say.
        left_out: f64,
    },
    /// The session is over; the results are written.
    Ended {
        /// Where.
        folder: String,
        /// As in [`Notice::Saved`].
        left_out: f64,
        /// Why the results are not usable, if they are not.
        failed: Option<String>,
    },
}
