//! A mission with several paints: as many missions of one paint, on one surface.

use std::path::Path;

use super::{MissionFile, MissionFileError};
use crate::mission::{Coat, MissionSettings};
use crate::mission_paint::MissionPaint;
use crate::say;

impl MissionFile {
    /// The same for every paint in flying order; a file without `paints` is one coat, whose results belong into `folder` itself.
    pub fn decide_coats(&self, folder: &Path) -> Result<Vec<Coat>, MissionFileError> {
        if self.paints.is_empty() {
            return Ok(vec![Coat { folder: folder.to_owned(), task: self.decide(folder)? }]);
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
        coats.into_iter().enumerate().map(decide).collect()
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
            MissionFileError::Mission { surface, source: source.in_paint(paint.name) }
        }
        error => error,
    }
}
