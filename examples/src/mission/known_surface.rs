//! A surface that is read, unwrapped and searched for reach once, for many designs.

use std::path::Path;

use paint_net::Image;
use paint_sim::Paint;

use super::coats::{Coat, CoatTasks, Look, looks};
use super::decide_picture::{PictureDesign, decide_picture_on};
use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::settings::MissionSettings;
use crate::design::Design;
use crate::region::Scene;
use crate::surface::PaintSurface;

/// A surface with what the robot reaches of it. Its settings are those of the surface (texel) and of the robot; design, placement and paints may change.
pub struct KnownSurface {
    scene: Scene,
    task: PaintingTask,
}

impl KnownSurface {
    /// Unwraps a surface and searches it for reach. `name` is what reports call it.
    ///
    /// # Errors
    /// As [`PaintingTask::new`] before it looks at the design.
    pub fn new(name: &str, scene: Scene, settings: MissionSettings) -> Result<Self, MissionError> {
        Ok(Self { task: PaintingTask::undecided(name, &scene, settings)?, scene })
    }

    /// The mesh that is painted, and the rest.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The painted part, unwrapped.
    pub fn surface(&self) -> &PaintSurface {
        &self.task.surface
    }

    /// Share of the surface that no pose of the robot paints, what stays clean not counted.
    pub fn out_of_reach_share(&self) -> f64 {
        self.task.out_of_reach_share()
    }

    /// One byte for each texel, row by row from above: 0 beside the surface, 1 out of reach, 2 stays clean, 3 is painted.
    pub fn reach_page(&self) -> Vec<u8> {
        let task = &self.task;
        let of_texel = |(k, covered): (usize, &f64)| match (*covered > 0.0, task.clean[k], task.in_reach[k]) {
            (false, ..) => 0,
            (_, true, _) => 2,
            (.., reached) => 1 + 2 * u8::from(reached),
        };
        task.coverage.data().iter().enumerate().map(of_texel).collect()
    }

    /// What each texel looks like without paint, sRGB, row by row from above; `None` beside the surface.
    ///
    /// # Errors
    /// None but those of a wall without reflectance.
    pub fn bare_page(&self) -> Result<Vec<Option<[u8; 3]>>, MissionError> {
        let layers: [(&Paint, &Image); 0] = [];
        let bare = looks(layers.into_iter(), &self.task.coverage, None)?;
        Ok(bare.iter().map(|look| look.as_ref().map(Look::srgb8)).collect())
    }

    /// One paint for a design; results belong into `folder`.
    ///
    /// # Errors
    /// As [`PaintingTask::new`].
    pub fn decide(&self, design: &Design, settings: MissionSettings, folder: &Path) -> Result<CoatTasks, MissionError> {
        design.check_movable(&settings.placement, settings.viewpoint)?;
        let task = self.task.with_settings(settings)?.decided(design, &self.scene.canvas)?;
        Ok(CoatTasks { coats: vec![Coat { folder: folder.to_owned(), task }], picture: None })
    }

    /// All paints of a picture in colour, as [`decide_picture`](super::decide_picture).
    ///
    /// # Errors
    /// As [`PaintingTask::new`].
    pub fn decide_picture(
        &self,
        picture: PictureDesign,
        settings: MissionSettings,
        folder: &Path,
    ) -> Result<CoatTasks, MissionError> {
        decide_picture_on(&self.task.with_settings(settings)?, &self.scene.canvas, picture, folder, &Ok)
    }
}
