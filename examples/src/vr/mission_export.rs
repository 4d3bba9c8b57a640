//! A session as a mission: what was painted becomes the picture of a mission file, which `paintcopter` and `plan` read.

use std::path::Path;

use super::error::VrError;
use super::session::Session;
use crate::appearance::{Appearance, UNIT_THICKNESS};
use crate::design::DARKEST;
use crate::mission::MissionSettings;
use crate::mission_file::MissionFile;
use crate::picture_placement::{PicturePlacement, PlacementMode};
use crate::pictures::Rgb;

/// Name of the picture.
const PICTURE: &str = "mission_paint.png";

/// Writes `mission.toml` and its picture: the thickness of all paints together as the ink of the mission's one paint. A session on a map
/// has no mesh file to name, and none is written; whether one was.
pub(super) fn write_mission(session: &Session, appearance: &Appearance, folder: &Path) -> Result<bool, VrError> {
    let settings = session.settings();
    if settings.map.is_some() {
        return Ok(false);
    }
    let surface = &session.world().surface;
    let grey = |thickness: f64| {
        let ink = appearance.ink().forward(thickness / UNIT_THICKNESS);
        (255.0 * (1.0 - ink / DARKEST).clamp(0.0, 1.0)).round() as u8
    };
    let pixels = session.canvases()[0].thickness().into_iter().map(|thickness| [grey(thickness); 3]);
    Rgb::from_pixels(surface.width(), surface.height(), pixels).save(&folder.join(PICTURE))?;
    let placement = PicturePlacement { mode: PlacementMode::Stretch, ..PicturePlacement::default() };
    let mission = MissionFile {
        mesh: settings.mesh.clone(),
        scale: settings.scale,
        up: settings.up,
        design: Some(folder.join(PICTURE).display().to_string()),
        settings: MissionSettings { seed: settings.seed, placement, ..MissionSettings::default() },
        ..MissionFile::default()
    };
    mission.write(&folder.join("mission.toml"))?;
    Ok(true)
}
