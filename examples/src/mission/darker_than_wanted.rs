//! The share of the surface that came out darker than anything wanted near it.

use paint_net::metrics::darker_than_wanted;

use super::error::MissionError;
use super::run::Mission;

/// How much darker, grey levels of 255.
const DARKER: f64 = 15.0;

/// Share of the surface's pixels that are darker by 15 grey levels than the darkest that is wanted within 3 cm.
pub(super) fn share(mission: &Mission) -> Result<f64, MissionError> {
    let grey = |depth: f64| {
        let [r, g, b] = mission.task.appearance.srgb(depth).map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let points: Vec<[f64; 3]> = mission.film.texels().iter().map(|texel| texel.point.coords.into()).collect();
    let greys = |depth: &paint_net::Image| mission.pixels.iter().map(|&k| grey(depth.data()[k])).collect::<Vec<_>>();
    let dark = darker_than_wanted(&points, &greys(&mission.painted_depth()), &greys(&mission.wanted_depth()), DARKER)?;
    Ok(dark.iter().filter(|&&dark| dark).count() as f64 / dark.len().max(1) as f64)
}
