//! What the person does: states and commands, in one sequence.

use nalgebra::Point3;
use paint_planner::teleop::VrState;
use serde::{Deserialize, Serialize};

/// A button of the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Whether the robot follows at once.
    Live {
        /// Whether it does.
        on: bool,
    },
    /// What the hand does is left out of the session until it goes on; the robot finishes what it has and hovers.
    Pause {
        /// Whether it is.
        on: bool,
    },
    /// Take the last stroke back that is not flown yet.
    Undo,
    /// Take back what is painted within a radius and not flown yet.
    Erase {
        /// Centre in the world, m.
        point: Point3<f64>,
        /// Radius, m.
        radius: f64,
    },
    /// Fly what was painted while the robot did not follow.
    Fly,
    /// Write recording and results so far, and go on.
    Save,
    /// Write the results and end.
    End,
}

/// One entry of a session. States and commands share one sequence without gaps, so that nothing is lost or done twice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// What the hand does.
    State(VrState),
    /// What a button does.
    Command {
        /// Its place in the sequence.
        sequence: u64,
        /// The button.
        command: Command,
    },
}

impl Event {
    /// Place in the sequence.
    pub fn sequence(&self) -> u64 {
        match self {
            Self::State(state) => state.sequence,
            Self::Command { sequence, .. } => *sequence,
        }
    }

    /// Refuses numbers that no page sends.
    ///
    /// # Errors
    /// As [`VrState::check`].
    pub fn check(&self) -> Result<(), paint_planner::Error> {
        match self {
            Self::State(state) => state.check(),
            Self::Command { sequence, command: Command::Erase { point, radius } }
                if !(point.iter().all(|c| c.is_finite()) && (0.0..=1.0).contains(radius)) =>
            {
                let what = "an eraser needs a finite point and a radius of at most a metre";
                Err(paint_planner::Error::VrState { sequence: *sequence, what })
            }
            Self::Command { .. } => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_eraser_has_a_place_and_a_size() {
        let erase = |x: f64, radius: f64| {
            let command = Command::Erase { point: Point3::new(x, 0.0, 0.0), radius };
            Event::Command { sequence: 7, command }.check()
        };
        for (x, radius) in [(0.0, 0.0), (-3.0, 0.06), (0.0, 1.0)] {
            assert!(erase(x, radius).is_ok(), "{radius}");
        }
        for (x, radius) in [(0.0, 1.01), (0.0, -0.01), (0.0, f64::NAN), (f64::NAN, 0.1), (f64::INFINITY, 0.1)] {
            let error = erase(x, radius).unwrap_err();
            assert!(matches!(error, paint_planner::Error::VrState { sequence: 7, .. }), "{radius}: {error}");
        }
    }
}
