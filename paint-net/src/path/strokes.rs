//! Sprays joined to strokes.

use crate::error::{Error, require};
use crate::model::Spray;

/// A run of sprays along a row or a line, in flying order.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// Its sprays; never empty.
    pub sprays: Vec<Spray>,
}

/// How sprays are joined to strokes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StrokeSettings {
    /// A gap between sprays longer than this ends a stroke, pixels. Default 8 (10 cm at the thesis' scale), ours.
    pub max_gap: f64,
}

impl Default for StrokeSettings {
    fn default() -> Self {
        Self { max_gap: 8.0 }
    }
}

/// Joins sprays to strokes in boustrophedon order: row by row from the top, every other row backwards, cut at long gaps. Every
/// spray is in exactly one stroke.
pub fn boustrophedon(sprays: &[Spray], settings: &StrokeSettings) -> Result<Vec<Stroke>, Error> {
    require("max_gap", settings.max_gap, settings.max_gap > 0.0, "it must be positive")?;
    for (k, s) in sprays.iter().enumerate() {
        if !(s.x.is_finite() && s.y.is_finite() && s.volume.is_finite()) {
            return Err(Error::Pixel {
                what: "spray list",
                x: k,
                y: 0,
                value: s.volume,
                range: "finite x, y and volume",
            });
        }
    }
    let mut ordered = sprays.to_vec();
    ordered.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
    let mut strokes = Vec::new();
    for (index, row) in ordered.chunk_by(|a, b| a.y == b.y).enumerate() {
        let mut row = row.to_vec();
        if index % 2 == 1 {
            row.reverse();
        }
        for run in row.chunk_by(|a, b| (a.x - b.x).abs() <= settings.max_gap) {
            strokes.push(Stroke { sprays: run.to_vec() });
        }
    }
    Ok(strokes)
}
