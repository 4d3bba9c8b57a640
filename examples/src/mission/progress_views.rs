//! The surface while it is painted (thesis, Fig. 8.9).

use std::path::Path;

use nalgebra::Point3;
use paint_net::Image;
use paint_sim::Camera;
use paint_sim::render::Shading;
use paint_sim::surface::Hit;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::run::Mission;
use super::shading::shading;
use super::view::{camera, picture_of, smaller, view};
use crate::pictures::{Tile, save_contact_sheet};

/// Longer side of a view, pixels.
const SIDE: u32 = 500;

/// Views of a surface from one place, one for each moment.
pub(super) struct ProgressViews<'a> {
    task: &'a PaintingTask,
    camera: Camera,
    moments: Vec<Tile>,
}

impl<'a> ProgressViews<'a> {
    pub(super) fn new(task: &'a PaintingTask) -> Result<Self, MissionError> {
        let corners: Vec<Point3<f64>> = task.surface.disk().positions().iter().map(|p| Point3::from(*p)).collect();
        Ok(Self { task, camera: smaller(&camera(task, &corners)?, SIDE), moments: Vec::new() })
    }

    /// The next moment, as `shade` shows the surface.
    pub(super) fn show(
        &mut self,
        caption: String,
        shade: &(dyn Fn(&Hit) -> Shading + Sync),
    ) -> Result<(), MissionError> {
        let picture = picture_of(&view(self.task, &self.camera, shade)?);
        self.moments.push(Tile { caption, picture });
        Ok(())
    }

    /// All moments in their order, in about as many rows as columns.
    pub(super) fn save(self, path: &Path) -> Result<(), MissionError> {
        let columns = self.moments.len().isqrt().max(1);
        let columns = if columns * columns < self.moments.len() { columns + 1 } else { columns };
        let mut moments = self.moments.into_iter().peekable();
        let mut rows = Vec::new();
        while moments.peek().is_some() {
            rows.push(moments.by_ref().take(columns).collect());
        }
        Ok(save_contact_sheet(path, &rows, SIDE)?)
    }
}

/// The surface of a mission in one paint: bare, and after each of equal parts of the spraying.
pub(super) fn save_progress(mission: &Mission, path: &Path) -> Result<(), MissionError> {
    let task = &mission.task;
    let bare = task.wanted.map(|_| 0.0);
    let painted = mission.painted_depth();
    let depths: Vec<&Image> =
        std::iter::once(&bare).chain(&mission.partly_painted).chain(std::iter::once(&painted)).collect();
    let mut views = ProgressViews::new(task)?;
    for (part, depth) in depths.iter().enumerate() {
        let percent = (100.0 * part as f64 / (depths.len() - 1) as f64).round();
        views.show(format!("{percent} %"), &|hit: &Hit| shading(task, depth, hit))?;
    }
    views.save(path)
}
