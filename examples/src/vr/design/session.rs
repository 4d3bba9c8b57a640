//! A design: what the page has said so far, and the mission that it is.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Similarity3, UnitVector3, Vector3};
use paint_sim::paint::PaintName;

use super::design_error::DesignError;
use super::message::{Change, DesignState, PageMessage, Part, PictureState, read_picture};
use super::mission_folder::write_mission;
use super::picture_store::{PictureStore, StoredPicture};
use crate::mission_file::MissionFile;
use crate::palette_choice::PaletteChoice;
use crate::picture_placement::PicturePlacement;
use crate::region::Region;
use crate::wall::Wall;

/// Most parts that stay clean.
const MOST_PARTS: usize = 64;
/// Farthest coordinate of a point and farthest offset of a picture, metres.
const FARTHEST: f64 = 1e5;
/// How palettes of one paint begin.
const ONE: &str = "one:";

/// The surface that the page shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShownSurface {
    /// Surfaces are counted.
    pub(super) number: u64,
    /// Width and height of the plane that pictures lie on, metres.
    pub(super) extent: [f64; 2],
    /// Where points of the mesh (about its origin) stand.
    pub(super) world_from_mesh: Similarity3<f64>,
    /// The origin, in the coordinates of the file.
    pub(super) origin: [f64; 3],
}

/// What is to be done after a message.
#[derive(Debug, PartialEq)]
pub(super) enum Handled {
    /// The design has changed: its mission comes to something else.
    Changed,
    /// The mission is written there.
    Written(PathBuf),
    /// The person ends it.
    Ended,
}

/// A design without a network: a function of the messages.
pub(super) struct DesignSession {
    /// The surface and the numbers.
    base: MissionFile,
    folder: PathBuf,
    store: PictureStore,
    picture: Option<StoredPicture>,
    placement: PicturePlacement,
    palette: PaletteChoice,
    /// The one paint instead of the palette.
    one_paint: Option<PaintName>,
    wall: Option<Wall>,
    parts: Parts,
    /// The latest of which there is a surface.
    known_parts: Option<Parts>,
    shown: Option<ShownSurface>,
    number: u64,
}

/// What is painted and what not.
#[derive(Debug, Clone, Default, PartialEq)]
struct Parts {
    region: Option<Region>,
    keep_clean: Vec<Region>,
}

impl DesignSession {
    /// Begins with a bare surface; missions go into `folder`.
    ///
    /// # Errors
    /// No room for pictures.
    pub(super) fn new(base: MissionFile, folder: &Path) -> Result<Self, DesignError> {
        Ok(Self {
            base,
            folder: folder.to_owned(),
            store: PictureStore::new()?,
            picture: None,
            placement: PicturePlacement::default(),
            palette: PaletteChoice::Six,
            one_paint: None,
            wall: None,
            parts: Parts::default(),
            known_parts: None,
            shown: None,
            number: 0,
        })
    }

    /// Takes a text of the page.
    ///
    /// # Errors
    /// A line for the page; the design is as it was.
    pub(super) fn handle(&mut self, text: &str) -> Result<Handled, DesignError> {
        let message: PageMessage =
            serde_json::from_str(text).map_err(|error| DesignError::Malformed(error.to_string()))?;
        let handled = self.change(message.change)?;
        self.number = self.number.max(message.number);
        Ok(handled)
    }

    /// Takes a picture file; it lies whole in the middle.
    ///
    /// # Errors
    /// As [`DesignSession::handle`].
    pub(super) fn handle_picture(&mut self, message: &[u8]) -> Result<Handled, DesignError> {
        let (head, bytes) = read_picture(message)?;
        let picture = self.store.store(&head.name, bytes)?;
        let size = self.shown.map(|shown| PicturePlacement::default().size_in(shown.extent, picture.aspect)[0]);
        self.placement = PicturePlacement { size, ..PicturePlacement::default() };
        self.picture = Some(picture);
        self.number = self.number.max(head.number);
        Ok(Handled::Changed)
    }

    fn change(&mut self, change: Change) -> Result<Handled, DesignError> {
        match change {
            Change::Place { offset, size, rotate } => {
                for value in offset {
                    within("offset", value, value.abs() <= FARTHEST, "within 100 km")?;
                }
                within("size", size, (0.01..=1000.0).contains(&size), "from 1 cm to 1 km")?;
                within("rotate", rotate, rotate.abs() <= 1e3, "an angle in radians")?;
                self.placement = PicturePlacement { offset, size: Some(size), rotate, ..PicturePlacement::default() };
            }
            Change::Palette { name } => self.choose_palette(&name)?,
            Change::Wall { name } => {
                self.wall = name.map(|name| name.parse().map_err(DesignError::Name)).transpose()?;
            }
            Change::Region { surface, part } => self.parts.region = Some(self.region_of(surface, &part)?),
            Change::WholeSurface => self.parts.region = None,
            Change::KeepClean { surface, part } => {
                if self.parts.keep_clean.len() >= MOST_PARTS {
                    return Err(DesignError::TooManyParts(MOST_PARTS));
                }
                let region = self.region_of(surface, &part)?;
                self.parts.keep_clean.push(region);
            }
            Change::UndoClean => {
                self.parts.keep_clean.pop();
            }
            Change::Write => return self.write().map(Handled::Written),
            Change::End => return Ok(Handled::Ended),
        }
        Ok(Handled::Changed)
    }

    fn choose_palette(&mut self, name: &str) -> Result<(), DesignError> {
        if let Some(paint) = name.strip_prefix(ONE) {
            let known = PaintName::ALL.into_iter().find(|known| known.as_str() == paint);
            self.one_paint = Some(known.ok_or_else(|| DesignError::Name(format!("there is no paint {paint:?}")))?);
            return Ok(());
        }
        match name.parse().map_err(DesignError::Name)? {
            // The page names no files of this machine.
            PaletteChoice::File(_) => Err(DesignError::Name(format!("there is no palette {name:?}"))),
            palette => {
                (self.palette, self.one_paint) = (palette, None);
                Ok(())
            }
        }
    }

    /// A part of the shown surface in the coordinates of the mesh file.
    fn region_of(&self, surface: u64, part: &Part) -> Result<Region, DesignError> {
        let shown = self.shown.filter(|shown| shown.number == surface).ok_or(DesignError::OldSurface)?;
        let in_file = |point: &[f64; 3]| {
            for value in point {
                within("point", *value, value.abs() <= FARTHEST, "on the surface")?;
            }
            let in_mesh = shown.world_from_mesh.inverse_transform_point(&Point3::from(*point));
            Ok::<[f64; 3], DesignError>([0, 1, 2].map(|c| in_mesh[c] + shown.origin[c]))
        };
        match part {
            Part::Pick { point } => Ok(Region::Pick(in_file(point)?)),
            Part::Disc { point, normal, radius } => {
                within("radius", *radius, (0.02..=100.0).contains(radius), "from 2 cm to 100 m")?;
                let [x, y, z] = in_file(point)?;
                let normal = UnitVector3::try_new(Vector3::from(*normal), 1e-6).ok_or(DesignError::OldSurface)?;
                let turned = shown.world_from_mesh.isometry.rotation.inverse_transform_unit_vector(&normal);
                let radius = radius / shown.world_from_mesh.scaling();
                Ok(Region::Plane([x, y, z, turned.x, turned.y, turned.z, radius]))
            }
        }
    }

    /// There is a surface with the parts of a mission.
    pub(super) fn accept_parts(&mut self, mission: &MissionFile) {
        self.known_parts = Some(Parts { region: mission.region.clone(), keep_clean: mission.keep_clean.clone() });
    }

    /// A surface is shown from now on. A picture that came before any surface lies in its middle.
    pub(super) fn show(&mut self, shown: ShownSurface) {
        self.shown = Some(shown);
        if let Some(picture) = self.picture.as_ref().filter(|_| self.placement.size.is_none()) {
            self.placement.size = Some(self.placement.size_in(shown.extent, picture.aspect)[0]);
        }
    }

    /// There is no such surface: the parts are again the latest of which there is one. Whether that changes anything.
    pub(super) fn take_back_parts(&mut self) -> bool {
        let known = self.known_parts.clone().filter(|known| *known != self.parts);
        let changed = known.is_some();
        self.parts = known.unwrap_or_else(|| self.parts.clone());
        changed
    }

    /// The mission of the design; without a picture it has no design.
    pub(super) fn mission(&self) -> MissionFile {
        let mut mission = self.base.clone();
        let settings = &mut mission.settings;
        settings.placement = if self.picture.is_some() { self.placement } else { PicturePlacement::default() };
        settings.paint = self.one_paint.unwrap_or(settings.paint);
        let in_colour = self.one_paint.is_none();
        mission.palette = in_colour.then(|| self.palette.clone());
        mission.wall = self.wall.filter(|_| in_colour);
        mission.design = self.picture.as_ref().map(|picture| picture.path.display().to_string());
        mission.region.clone_from(&self.parts.region);
        mission.keep_clean.clone_from(&self.parts.keep_clean);
        mission
    }

    fn write(&self) -> Result<PathBuf, DesignError> {
        let picture = self.picture.as_ref().ok_or(DesignError::NoPicture)?;
        write_mission(&self.mission(), picture, &self.folder)
    }

    /// The file of the picture.
    pub(super) fn picture(&self) -> Option<&StoredPicture> {
        self.picture.as_ref()
    }

    /// The surface that is shown.
    #[cfg(test)]
    pub(super) fn shown(&self) -> Option<ShownSurface> {
        self.shown
    }

    /// The latest change.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// The design as the page hears it.
    pub(super) fn state(&self) -> DesignState {
        let picture = |picture: &StoredPicture| {
            Some(PictureState {
                name: picture.name.clone(),
                aspect: picture.aspect,
                offset: self.placement.offset,
                size: self.placement.size?,
                rotate: self.placement.rotate,
            })
        };
        let palette =
            self.one_paint.map_or_else(|| self.palette.to_string(), |paint| format!("{ONE}{}", paint.as_str()));
        DesignState {
            number: self.number,
            picture: self.picture.as_ref().and_then(picture),
            palette,
            wall: self.wall.map(|wall| wall.to_string()),
            region: self.parts.region.as_ref().map(ToString::to_string),
            keep_clean: self.parts.keep_clean.iter().map(ToString::to_string).collect(),
        }
    }

    /// The palettes to choose from, as [`Change::Palette`] names them.
    pub(super) fn palettes() -> Vec<String> {
        let several = [PaletteChoice::Six, PaletteChoice::Cmyk];
        let spots = (1..=paint_sim::paint::MOST_FILMS).map(PaletteChoice::Spot);
        let ones = PaintName::ALL.map(|paint| format!("{ONE}{}", paint.as_str()));
        several.into_iter().chain(spots).map(|palette| palette.to_string()).chain(ones).collect()
    }

    /// The walls to choose from, as [`Change::Wall`] names them; a colour is one as well.
    pub(super) fn walls() -> Vec<String> {
        [Wall::Sandstone, Wall::White, Wall::Concrete, Wall::Dark, Wall::Mesh].map(|wall| wall.to_string()).into()
    }
}

fn within(what: &'static str, value: f64, sound: bool, must_be: &'static str) -> Result<(), DesignError> {
    if sound { Ok(()) } else { Err(DesignError::Range { what, value, must_be }) }
}
