//! Where paint was so thick that it ran.

use std::path::Path;

use super::error::MissionError;
use super::run::Mission;
use crate::pictures::Rgb;

/// Colours of paint that ran, of paint that stayed, and of the bare surface.
const RAN: [u8; 3] = [200, 30, 30];
const STAYED: [u8; 3] = [120, 120, 120];
const BARE: [u8; 3] = [225, 225, 225];

/// Share by area of what missions on one surface have painted on which the paint of one of them ran.
pub(super) fn sagging_share(missions: &[&Mission]) -> f64 {
    let Some(first) = missions.first() else { return 0.0 };
    let (mut painted, mut ran) = (0.0, 0.0);
    for (k, texel) in first.film.texels().iter().enumerate() {
        let runs = missions.iter().any(|mission| mission.ran[k]);
        if runs || missions.iter().any(|mission| mission.film.volumes()[k] > 0) {
            painted += texel.area;
            ran += if runs { texel.area } else { 0.0 };
        }
    }
    ran / f64::max(painted, f64::MIN_POSITIVE)
}

/// `sagging.png`: the page with what ran; nothing is written where none did.
pub(super) fn save_sagging(missions: &[&Mission], folder: &Path) -> Result<(), MissionError> {
    let Some(first) = missions.first().filter(|_| sagging_share(missions) > 0.0) else { return Ok(()) };
    let coverage = &first.task.coverage;
    let mut page = vec![None; coverage.width() * coverage.height()];
    for (k, &pixel) in first.pixels.iter().enumerate() {
        page[pixel] = Some(match missions {
            _ if missions.iter().any(|mission| mission.ran[k]) => RAN,
            _ if missions.iter().any(|mission| mission.film.volumes()[k] > 0) => STAYED,
            _ => BARE,
        });
    }
    Ok(Rgb::of_page(coverage.width(), coverage.height(), page).save(&folder.join("sagging.png"))?)
}
