//! What the nozzle and its grid allow.

use crate::error::{Error, require};

/// Where sprays may lie and how large they may be.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Limits {
    /// Distance between sprays along a row, 1 to 1000 pixels. Default 2 (σ of the thesis' nozzle).
    pub spray_spacing: usize,
    /// Distance between rows, 1 to 1000 pixels. Default 2.
    pub row_spacing: usize,
    /// Largest depth of one spray. Default 3: beyond it ink no longer shows a difference.
    pub max_volume: f64,
    /// Sprays smaller than this are not worth opening the valve for; they are dropped and the others refitted. Default 0.
    pub min_volume: f64,
    /// Largest number of sprays, 0 to leave the wall as it is; `None` for no limit.
    pub max_sprays: Option<usize>,
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Limits {
    pub(super) const DEFAULT: Self =
        Self { spray_spacing: 2, row_spacing: 2, max_volume: 3.0, min_volume: 0.0, max_sprays: None };

    pub(crate) fn check(&self) -> Result<(), Error> {
        // Work is done in whole cells: one far larger than the picture is only empty work.
        for (name, spacing) in [("spray_spacing", self.spray_spacing), ("row_spacing", self.row_spacing)] {
            require(name, spacing as f64, (1..=1000).contains(&spacing), "it must lie in 1..=1000 pixels")?;
        }
        let max = self.max_volume;
        require("max_volume", max, max > 0.0 && max.is_finite(), "it must be positive and finite")?;
        let min = self.min_volume;
        require("min_volume", min, (0.0..=max).contains(&min), "it must lie in [0, max_volume]")
    }
}
