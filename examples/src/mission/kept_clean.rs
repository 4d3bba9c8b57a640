//! What lies where the surface shall stay clean.

use super::run::Mission;
use crate::report::CleanFigures;

/// Thickness from which a place is soiled, metres.
const SOILED: f64 = 1e-6;

/// Of the films of missions on one surface together.
pub(super) fn kept_clean(missions: &[&Mission]) -> CleanFigures {
    let Some(first) = missions.first() else { return CleanFigures::default() };
    let (mut area, mut volume, mut soiled) = (0.0, 0.0, 0.0);
    for (k, texel) in first.film.texels().iter().enumerate().filter(|(k, _)| first.task.clean[first.pixels[*k]]) {
        let thickness: f64 = missions.iter().map(|mission| mission.film.thickness(k)).sum();
        area += texel.area;
        volume += thickness * texel.area;
        soiled += if thickness >= SOILED { texel.area } else { 0.0 };
    }
    let any = |value: f64| (area > 0.0).then_some(value);
    CleanFigures {
        kept_clean_m2: any(area),
        kept_clean_thickness_mean_m: any(volume / area),
        kept_clean_soiled_share: any(soiled / area),
    }
}
