//! What became of the film.

use serde::Serialize;

/// Paint on what should stay clean; nothing where all may be painted.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct CleanFigures {
    /// Its area.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_clean_m2: Option<f64>,
    /// Mean thickness of all paints there nevertheless.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_clean_thickness_mean_m: Option<f64>,
    /// Share of that area with a micrometre or more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_clean_soiled_share: Option<f64>,
}

/// Where it ran, where none should be, and what the robot saw of it.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FilmFigures {
    /// Share by area of the painted surface on which the paint was so thick that it ran.
    pub sagging_share: f64,
    /// What should stay clean.
    #[serde(flatten)]
    pub clean: CleanFigures,
    /// Error of the film's thickness as the robot saw it over that thickness (both RMS), where it is a tenth of a unit or more and not opaque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub film_estimate_error_share: Option<f64>,
    /// Share of those texels that it saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub film_estimate_seen_share: Option<f64>,
    /// Paint that it found to be missing, and painted again.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paint_missing_kg: Option<f64>,
}
