//! One of several paints of a mission file: what is in the tank, and where it shall be.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::design::Design;
use paint_sim::paint::PaintName;

/// An entry of `[[paints]]`. The paints are flown in their order, each with a tank of its own, over those before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MissionPaint {
    /// What is in the tank.
    pub name: PaintName,
    /// Where and how thick: a design as a mission has it, the darker the thicker.
    pub design: Option<String>,
    /// A picture on the mesh's own texture coordinates instead.
    pub texture: Option<PathBuf>,
    /// A coat of this thickness instead, metres.
    pub fill: Option<f64>,
}

impl MissionPaint {
    /// Its folder among the results, by its place in the order, from 1.
    pub(crate) fn folder(&self, place: usize) -> String {
        format!("{place}_{}", self.name.as_str())
    }

    /// The same with files that begin at a folder.
    pub(crate) fn in_folder(self, folder: &Path) -> Self {
        Self {
            design: self.design.map(|design| file_of_design(design, |file| folder.join(file))),
            texture: self.texture.map(|file| folder.join(file)),
            ..self
        }
    }

    /// The same with the files that it names as absolute paths.
    pub(crate) fn absolute(&self) -> Self {
        Self {
            design: self.design.clone().map(|design| file_of_design(design, absolute)),
            texture: self.texture.clone().map(absolute),
            ..self.clone()
        }
    }
}

/// A design with its file, where it is one, at another place.
pub(crate) fn file_of_design(design: String, place: impl FnOnce(PathBuf) -> PathBuf) -> String {
    if Design::is_built_in(&design) { design } else { place(design.into()).display().to_string() }
}

/// A path from the root; as it is where the system does not know its own folder.
pub(crate) fn absolute(file: PathBuf) -> PathBuf {
    std::path::absolute(&file).unwrap_or(file)
}
