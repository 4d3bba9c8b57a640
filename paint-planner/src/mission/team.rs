//! Several robots that paint one surface at the same time.

use crate::error::{Error, ensure};

/// Most robots of a team.
const MOST: usize = 64;

/// Robots that paint at the same time (ours: the papers fly one).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Team {
    /// How many, 1 to 64 (default 1).
    pub robots: usize,
    /// Least distance between the positions of two vehicles, m (default 2).
    pub apart: f64,
}

impl Default for Team {
    fn default() -> Self {
        Self { robots: 1, apart: 2.0 }
    }
}

impl Team {
    /// Refuses numbers that make no sense.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn check(&self) -> Result<(), Error> {
        let robots = self.robots as f64;
        ensure("team.robots", robots, (1..=MOST).contains(&self.robots), "between 1 and 64")?;
        ensure("team.apart", self.apart, (0.1..=100.0).contains(&self.apart), "between 0.1 and 100 m")
    }
}

/// Who flies a flight, and when in the order of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Turn {
    /// Layer of paint: one begins when the one before has ended.
    pub layer: usize,
    /// Robot, from 0, in the order of the cells along the surface.
    pub robot: usize,
    /// Which of the robot's two cells: all robots begin in their first.
    pub shift: usize,
}
