//! What lies where the surface shall stay clean.

use super::run::Mission;

/// Thickness from which a place is soiled, metres.
const SOILED: f64 = 1e-6;

/// Paint on what stays clean.
#[derive(Debug, Clone, Copy)]
pub(super) struct KeptClean {
    /// Its area, m².
    pub(super) area: f64,
    /// Mean thickness, m.
    pub(super) thickness: f64,
    /// Share of the area with a micrometre or more.
    pub(super) soiled: f64,
}

impl KeptClean {
    /// The films of missions on one surface together; `None` where nothing stays clean.
    pub(super) fn of(missions: &[&Mission]) -> Option<Self> {
        let first = missions.first()?;
        let (mut area, mut volume, mut soiled) = (0.0, 0.0, 0.0);
        for (k, texel) in first.film.texels().iter().enumerate().filter(|(k, _)| first.task.clean[first.pixels[*k]]) {
            let thickness: f64 = missions.iter().map(|mission| mission.film.thickness(k)).sum();
            area += texel.area;
            volume += thickness * texel.area;
            soiled += if thickness >= SOILED { texel.area } else { 0.0 };
        }
        (area > 0.0).then(|| Self { area, thickness: volume / area, soiled: soiled / area })
    }
}
