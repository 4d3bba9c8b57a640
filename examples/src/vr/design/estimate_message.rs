//! What a design comes to, as the page takes it.

use serde::Serialize;

use super::message::{ESTIMATE, with_head};
use crate::mission::{CoatsEstimate, KnownSurface, MissionError};

/// The head; four bytes for each texel follow, row by row from above: sRGB, and 0 beside the surface, 85 out of reach, 170 clean, 255 painted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct EstimateHead {
    /// The change after which this is so.
    pub(super) number: u64,
    /// The surface that the texels lie on, and how many of what size there are.
    pub(super) surface: u64,
    pub(super) texels: [usize; 2],
    pub(super) texel_m: f64,
    /// Whether these are the numbers of the mission itself, not of a coarser one.
    pub(super) own: bool,
    pub(super) paints: Vec<PaintHead>,
    pub(super) flight_time_s: f64,
    pub(super) mission_time_s: f64,
    pub(super) out_of_reach_share: f64,
    pub(super) out_of_gamut_share: Option<f64>,
    /// What the planning said.
    pub(super) notes: Vec<String>,
}

/// A paint in it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct PaintHead {
    pub(super) name: String,
    pub(super) srgb: [u8; 3],
    pub(super) litres: f64,
    pub(super) flight_time_s: f64,
}

impl EstimateHead {
    /// Of an estimate, or of a bare surface without one; `number` and `surface` as below.
    pub(super) fn new([number, surface]: [u64; 2], known: &KnownSurface, estimate: Option<&CoatsEstimate>) -> Self {
        let paints = estimate.map_or(&[][..], |estimate| &estimate.paints).iter().map(|paint| PaintHead {
            name: paint.name.clone(),
            srgb: paint.srgb,
            litres: paint.litres,
            flight_time_s: paint.flight_time_s,
        });
        Self {
            number,
            surface,
            texels: [known.surface().width(), known.surface().height()],
            texel_m: known.surface().texels.texel_m,
            own: false,
            paints: paints.collect(),
            flight_time_s: estimate.map_or(0.0, |estimate| estimate.flight_time_s),
            mission_time_s: estimate.map_or(0.0, |estimate| estimate.mission_time_s),
            out_of_reach_share: known.out_of_reach_share(),
            out_of_gamut_share: estimate.and_then(|estimate| estimate.out_of_gamut_share),
            notes: Vec::new(),
        }
    }

    /// The message.
    pub(super) fn with_texels(&self, texels: &[u8]) -> Vec<u8> {
        with_head(ESTIMATE, self, texels)
    }
}

/// What the texels look like and whether they are painted.
pub(super) fn texels(known: &KnownSurface, estimate: Option<&CoatsEstimate>) -> Result<Vec<u8>, MissionError> {
    let page: Vec<Option<[u8; 3]>> = match estimate {
        Some(estimate) => estimate.page().collect(),
        None => known.bare_page()?,
    };
    let texel = |(colour, reach): (&Option<[u8; 3]>, u8)| {
        let [red, green, blue] = colour.unwrap_or_default();
        [red, green, blue, 85 * reach]
    };
    Ok(page.iter().zip(known.reach_page()).flat_map(texel).collect())
}
