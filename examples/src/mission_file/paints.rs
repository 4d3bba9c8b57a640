//! A mission with several paints: as many missions of one paint, on one surface.

use std::path::Path;

use super::{MissionFile, MissionFileError};
use crate::mission::{Coat, CoatTasks, MissionSettings};
use crate::mission_paint::MissionPaint;
use crate::say;

impl MissionFile {
    /// The same for every paint in flying order; a file without `paints` is one coat, whose results belong into `folder` itself.
    pub fn decide_coats(&self, folder: &Path) -> Result<CoatTasks, MissionFileError> {
        if let Some(palette) = &self.palette {
            let place = self.place(folder)?;
            return self.decide_palette(palette, &place, folder);
        }
        self.check_palette()?;
        if self.paints.is_empty() {
            let coats = vec![Coat { folder: folder.to_owned(), task: self.decide(folder)? }];
            return Ok(CoatTasks { coats, picture: None });
        }
        let coats = self.coats()?;
        let place = self.place(folder)?;
        let decide = |(number, coat): (usize, Self)| {
            let folder = folder.join(self.paints[number].folder(number + 1));
            coat.write_into(&folder)?;
            say!("paint {} of {}: {}", number + 1, self.paints.len(), coat.settings.paint.as_str());
            let task = coat.decide_on(&place);
            let task = task.map_err(|error| in_paint(error, &self.paints[number]))?;
            Ok(Coat { folder, task })
        };
        let coats = coats.into_iter().enumerate().map(decide).collect::<Result<_, MissionFileError>>()?;
        Ok(CoatTasks { coats, picture: None })
    }

    /// Refuses what only a palette would use.
    pub(super) fn check_palette(&self) -> Result<(), MissionFileError> {
        if self.palette.is_none() && (self.wall.is_some() || self.available.is_some()) {
            let why = "the wall and the paints to choose from belong to a palette: give one";
            return Err(MissionFileError::Palette(why));
        }
        Ok(())
    }

    /// The missions of one paint that this one is made of.
    fn coats(&self) -> Result<Vec<Self>, MissionFileError> {
        if self.design.is_some() || self.texture.is_some() || self.fill.is_some() {
            let both = "each paint has a design, texture or fill of its own: leave out that of the file";
            return Err(MissionFileError::Paints(both.into()));
        }
        let coat = |paint: &MissionPaint| {
            let MissionPaint { name, design, texture, fill } = paint.clone();
            if design.is_none() && texture.is_none() && fill.is_none() {
                let name = name.as_str();
                return Err(MissionFileError::Paints(format!("{name}: give a design, a texture or a fill")));
            }
            let settings = MissionSettings { paint: name, ..self.settings.clone() };
            Ok(Self { design, texture, fill, settings, paints: Vec::new(), ..self.clone() })
        };
        self.paints.iter().map(coat).collect()
    }
}

/// An error that one of several paints has.
fn in_paint(error: MissionFileError, paint: &MissionPaint) -> MissionFileError {
    match error {
        MissionFileError::Mission { surface, source } => {
            MissionFileError::Mission { surface, source: source.in_paint(paint.name.as_str()) }
        }
        error => error,
    }
}
