//! A session as a mission: what was painted becomes the pictures of a mission file, which `paintcopter` and `plan` read.

use std::path::Path;

use super::error::VrError;
use super::session::Session;
use crate::appearance::{Appearance, UNIT_THICKNESS};
use crate::design::DARKEST;
use crate::mission::MissionSettings;
use crate::mission_file::MissionFile;
use crate::mission_paint::MissionPaint;
use crate::picture_placement::{PicturePlacement, PlacementMode};
use crate::pictures::Rgb;
use crate::say;

/// A share of the paint that is said.
const SAID: f64 = 0.01;

/// Writes `mission.toml` and a picture for every paint, `mission_NAME.png`: its thickness as ink. Paints lie in the order in which they were
/// first used. A session on a map has no mesh file to name, and one without paint nothing to fly: then none is written. The share of the paint
/// that is too thick for the scale of ink, and is left out.
pub(super) fn write_mission(session: &Session, appearance: &Appearance, folder: &Path) -> Result<f64, VrError> {
    let (settings, world) = (session.settings(), session.world());
    let films = session.canvases()[0].paints();
    if settings.map.is_some() || films.is_empty() {
        return Ok(0.0);
    }
    let thickest = UNIT_THICKNESS * appearance.ink().inverse(DARKEST);
    let sum = |of: &dyn Fn(f64) -> f64| films.iter().flat_map(|(_, film)| film).map(|t| of(*t)).sum::<f64>();
    let left_out = sum(&|t| (t - thickest).max(0.0)) / sum(&|t| t);
    if left_out > SAID {
        let (percent, micrometres) = (100.0 * left_out, 1e6 * thickest);
        say!(
            "mission.toml: {percent:.0} % of the paint is left out: it lies thicker than {micrometres:.0} micrometres"
        );
    }
    let grey = |thickness: f64| {
        let ink = appearance.ink().forward(thickness / UNIT_THICKNESS);
        (255.0 * (1.0 - ink / DARKEST).clamp(0.0, 1.0)).round() as u8
    };
    let mut paints = Vec::new();
    for (number, thickness) in films {
        let name = world.palette[number].name;
        let picture = folder.join(format!("mission_{}.png", name.as_str()));
        let pixels = thickness.into_iter().map(|thickness| [grey(thickness); 3]);
        Rgb::from_pixels(world.surface.width(), world.surface.height(), pixels).save(&picture)?;
        let design = Some(picture.display().to_string());
        paints.push(MissionPaint { name, design, texture: None, fill: None });
    }
    let placement = PicturePlacement { mode: PlacementMode::Stretch, ..PicturePlacement::default() };
    // The session's nozzle, with as many texels to its spot as a mission has.
    let defaults = MissionSettings::default();
    let texel = defaults.texel * settings.spot / defaults.spot;
    let mut mission = MissionFile {
        mesh: settings.mesh.clone(),
        scale: settings.scale,
        up: settings.up,
        settings: MissionSettings { seed: settings.seed, placement, spot: settings.spot, texel, ..defaults },
        ..MissionFile::default()
    };
    if let [MissionPaint { name, design, .. }] = &paints[..] {
        (mission.settings.paint, mission.design) = (*name, design.clone());
    } else {
        mission.paints = paints;
    }
    mission.write(&folder.join("mission.toml"))?;
    Ok(left_out)
}
