//! A mission for every paint of a picture in colour.

use std::path::{Path, PathBuf};

use super::coats::{Coat, CoatTasks};
use super::decide_colours::decide_colours;
use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::settings::MissionSettings;
use crate::colour_design::ColourDesign;
use crate::mesh_io::TriangleMesh;
use crate::palette_choice::PaletteCandidates;
use crate::region::Scene;
use crate::wall::{Wall, WallSpectra};

/// What to paint in colour, with what, on what.
pub struct PictureDesign {
    /// The picture.
    pub design: ColourDesign,
    /// The paints.
    pub paints: PaletteCandidates,
    /// The wall.
    pub wall: Wall,
}

/// Unwraps a surface, lays the picture onto it, separates its colours and decides the sprays of every paint; each paint's results belong into a folder of its
/// own in `folder`. `finish` tells each task of the true surface and the map, where they are known.
///
/// # Errors
/// As [`PaintingTask::new`].
pub fn decide_picture(
    name: &str,
    scene: &Scene,
    picture: PictureDesign,
    settings: MissionSettings,
    folder: &Path,
    finish: &dyn Fn(PaintingTask) -> Result<PaintingTask, MissionError>,
) -> Result<CoatTasks, MissionError> {
    decide_picture_on(&PaintingTask::undecided(name, scene, settings)?, &scene.canvas, picture, folder, finish)
}

/// The same on a surface that is unwrapped already.
pub(super) fn decide_picture_on(
    task: &PaintingTask,
    mesh: &TriangleMesh,
    picture: PictureDesign,
    folder: &Path,
    finish: &dyn Fn(PaintingTask) -> Result<PaintingTask, MissionError>,
) -> Result<CoatTasks, MissionError> {
    let PictureDesign { design, paints, wall } = picture;
    let colours = design.on_surface(&task.surface, mesh, &task.settings.placement, task.settings.viewpoint)?;
    let (_, pixels) = task.surface.film_texels();
    let wall = WallSpectra::new(wall, &task.surface, mesh, &pixels)?;
    let mut picture = PictureTask::separate(task, &colours, &paints, wall, pixels)?;
    let paintings = decide_colours(task, &mut picture)?;
    let ground = picture.mean_wall()?;
    // What is not needed is not flown.
    let needed = |(_, painting): &(usize, paint_net::Painting)| !painting.sprays.is_empty();
    let coat = |(k, painting): (usize, paint_net::Painting)| {
        let paint = picture.paints[k].clone();
        let folder: PathBuf = folder.join(paint.folder(k + 1));
        let task = finish(task.of_paint(paint, &ground, painting)?)?;
        Ok(Coat { folder, task })
    };
    let coats = paintings.into_iter().enumerate().filter(needed).map(coat).collect::<Result<Vec<_>, MissionError>>()?;
    picture.keep(&coats.iter().map(|coat| coat.task.paint.name.clone()).collect::<Vec<_>>());
    Ok(CoatTasks { coats, picture: Some(picture) })
}
