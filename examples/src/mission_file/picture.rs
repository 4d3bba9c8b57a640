//! A mission whose design is separated for several paints.

use std::path::Path;

use super::{MissionFile, MissionFileError, Place};
use crate::colour_design::ColourDesign;
use crate::colour_picture::ColourPicture;
use crate::design::{DesignError, MATERIALS, MURAL};
use crate::mesh_io::TriangleMesh;
use crate::mission::{CoatTasks, MissionSettings, PictureDesign, decide_picture};
use crate::mural::Mural;
use crate::palette_choice::PaletteChoice;
use crate::picture_file::open_in_srgb;
use crate::picture_placement::PicturePlacement;
use crate::say;
use crate::wall::{Wall, has_colours};

impl MissionFile {
    /// The same, or where it says nothing of what to paint and by whom the mural in six paints on the rock wall.
    #[must_use]
    pub fn or_mural(self) -> Self {
        let settings = &self.settings;
        let one_paint =
            settings.layered.is_some() || settings.look || settings.painter != MissionSettings::default().painter;
        let said = self.design.is_some() || self.texture.is_some() || self.fill.is_some() || !self.paints.is_empty();
        if self.mesh.is_some() || self.palette.is_some() || said || one_paint {
            return self;
        }
        Self { design: Some(MURAL.to_owned()), palette: Some(PaletteChoice::Six), ..self }
    }

    /// Separates the picture for the palette and decides each paint; results belong into folders of their own in `folder`.
    pub(super) fn decide_palette(
        &self,
        palette: &PaletteChoice,
        place: &Place,
        folder: &Path,
    ) -> Result<CoatTasks, MissionFileError> {
        if self.fill.is_some() || !self.paints.is_empty() {
            return Err(MissionFileError::Palette("separates a design: leave out the coat, or the paints of the file"));
        }
        if self.settings.layered.is_some() || self.settings.look {
            return Err(MissionFileError::Palette(
                "layers by intensity and looking again know one paint only: leave them out",
            ));
        }
        let picture = self.picture_design(palette, &place.scene.canvas)?;
        decide_picture(&place.name, &place.scene, picture, self.settings.clone(), folder, &|task| place.known(task))
            .map_err(|source| self.in_mesh(source))
    }

    /// What to paint in colour, with what, on what.
    pub(super) fn picture_design(
        &self,
        palette: &PaletteChoice,
        mesh: &TriangleMesh,
    ) -> Result<PictureDesign, MissionFileError> {
        let paints = palette.candidates(self.available.as_deref())?;
        let (design, own_colours) = self.colour_design(mesh)?;
        let usual = if has_colours(mesh) && !own_colours && self.mesh.is_some() { Wall::Mesh } else { Wall::Sandstone };
        let wall = self.wall.unwrap_or(usual);
        say!("wall: {wall}");
        Ok(PictureDesign { design, paints, wall })
    }

    /// The design in colour, and whether it is the mesh's own colours.
    fn colour_design(&self, mesh: &TriangleMesh) -> Result<(ColourDesign, bool), MissionFileError> {
        let own = || match (&mesh.materials, &mesh.colours) {
            (Some(materials), _) if materials.textured() && mesh.uv.is_some() => {
                Ok(ColourDesign::Materials(ColourPicture::of_materials(materials)?))
            }
            (_, Some(_)) => Ok(ColourDesign::VertexColours),
            _ => Err(DesignError::Missing("colours of its own")),
        };
        let read = |path: &Path| {
            let unusable = |error| DesignError::Unusable {
                name: path.display().to_string(),
                why: format!("cannot be read as a picture ({error})"),
            };
            let (picture, converted) = open_in_srgb(path).map_err(unusable)?;
            if converted {
                say!("{}: colours converted from its profile to sRGB", path.display());
            }
            ColourPicture::new(&picture)
        };
        let mural = ColourDesign::Mural(Mural { seed: self.settings.seed });
        let (design, own_colours) = match (&self.texture, self.design.as_deref()) {
            (Some(texture), _) => (ColourDesign::Texture(read(texture)?), false),
            (None, Some(MURAL)) => (mural, false),
            (None, Some(MATERIALS | "colours")) => (own()?, true),
            (None, Some("strata" | "stripes" | "gradient")) => {
                return Err(MissionFileError::Palette(
                    "the design is grey: give a picture, mural, materials or colours",
                ));
            }
            (None, Some(file)) => (ColourDesign::Picture(read(Path::new(file))?), false),
            (None, None) if self.mesh.is_some() && has_colours(mesh) => (own()?, true),
            (None, None) => (mural, false),
        };
        let placed = self.settings.placement != PicturePlacement::default();
        if placed && !matches!(design, ColourDesign::Picture(_)) || own_colours && self.settings.viewpoint.is_some() {
            let why = "--place, --size, --rotate, --offset and --project move a picture, but the design is none, or lies on the mesh already";
            return Err(DesignError::NotMovable(why).into());
        }
        Ok((design, own_colours))
    }
}
