//! One of several paints of a mission file: what is in the tank, and where it shall be.

use std::path::PathBuf;

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

    /// The same with the files that it names at other places.
    pub(crate) fn with_files(self, place: &dyn Fn(PathBuf) -> PathBuf) -> Self {
        Self {
            design: self.design.map(|design| file_of_design(design, place)),
            texture: self.texture.map(place),
            ..self
        }
    }
}

/// A design with its file, where it is one, at another place.
pub(crate) fn file_of_design(design: String, place: impl FnOnce(PathBuf) -> PathBuf) -> String {
    if Design::is_built_in(&design) { design } else { place(design.into()).display().to_string() }
}
