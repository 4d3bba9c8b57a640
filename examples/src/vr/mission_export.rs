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

/// Writes `mission.toml` and a picture for every paint, `mission_NAME.png`: its thickness as ink. Paints lie in the order in which they were
/// first used. A session on a map has no mesh file to name, and one without paint nothing to fly: then none is written.
pub(super) fn write_mission(session: &Session, appearance: &Appearance, folder: &Path) -> Result<(), VrError> {
    let (settings, world) = (session.settings(), session.world());
    let films = session.canvases()[0].paints();
    if settings.map.is_some() || films.is_empty() {
        return Ok(());
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
    let mut mission = MissionFile {
        mesh: settings.mesh.clone(),
        scale: settings.scale,
        up: settings.up,
        settings: MissionSettings { seed: settings.seed, placement, ..MissionSettings::default() },
        ..MissionFile::default()
    };
    if let [MissionPaint { name, design, .. }] = &paints[..] {
        (mission.settings.paint, mission.design) = (*name, design.clone());
    } else {
        mission.paints = paints;
    }
    Ok(mission.write(&folder.join("mission.toml"))?)
}
