//! Many designs on one surface: what does not depend on the design is found once.

use std::path::Path;

use super::{MissionFile, MissionFileError};
use crate::mission::{CoatTasks, KnownSurface};

impl MissionFile {
    /// As [`MissionFile::decide_coats`] for a file with one design, on a surface that is that of this file but for the design, its placement and its paints.
    ///
    /// # Errors
    /// As [`MissionFile::decide_coats`].
    pub fn decide_on_known(&self, surface: &KnownSurface, folder: &Path) -> Result<CoatTasks, MissionFileError> {
        if !self.paints.is_empty() {
            return Err(MissionFileError::Paints(
                "several paints with designs of their own are several decisions".into(),
            ));
        }
        self.check_palette()?;
        let settings = self.settings.clone();
        let mesh = &surface.scene().canvas;
        let decided = match &self.palette {
            Some(palette) => surface.decide_picture(self.picture_design(palette, mesh)?, settings, folder),
            None => surface.decide(&self.grey_design(mesh)?, settings, folder),
        };
        decided.map_err(|source| self.in_mesh(source))
    }
}
