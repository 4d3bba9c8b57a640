//! A mission as a file: all that is needed to fly it again.

mod known_surface;
mod paints;
mod picture;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use paint_sim::TriangleSurface;
use serde::{Deserialize, Serialize};

use crate::appearance::{Appearance, UNIT_THICKNESS};
use crate::design::{Design, DesignError, MATERIALS, Picture};
use crate::mesh_frame::{MeshScale, Subject, scale_of, up_of};
use crate::mesh_io::{MeshError, TriangleMesh, read_mesh};
use crate::mesh_placement::{MeshPlacement, PlacementError, UpAxis, place_mesh, place_scene};
use crate::mission::{LocalisationChoice, MissionError, MissionSettings, PaintingTask};
use crate::mission_paint::{MissionPaint, file_of_design};
use crate::onboard::{LocalisationError, surveyed_map};
use crate::palette_choice::{PaletteChoice, PaletteError};
use crate::region::{Region, RegionError, Scene};
use crate::relative_path::from_folder;
use crate::say;
use crate::scan_flight::{self, ScanFlight, ScanFlightError, save as save_scan_flight};
use crate::wall::Wall;
use crate::world::rock_wall;
use crate::{run_folder, whole_file};

/// The map of a surface that the robot has not scanned and shall find itself on.
const SURVEY_FILE: &str = "surveyed.tsdf";
/// Thickness of an even coat, metres: what paint is thicker does not show.
const COAT: std::ops::RangeInclusive<f64> = 0.999e-6..=60.001e-6;

/// What to paint on what, and how. TOML; a field that is left out has its default, one that is not known is an error.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MissionFile {
    /// Surface to paint, OBJ, glTF, PLY, STL or OFF; the built-in rock wall if there is none. Relative paths begin at the file's folder.
    pub mesh: Option<PathBuf>,
    /// Metres per unit of the mesh file, or the unit; without it what the file says, else what its size tells.
    pub scale: Option<MeshScale>,
    /// Axis of the mesh file that points up; without it what the file or its base says, else what is usual in such files.
    pub up: Option<UpAxis>,
    /// What to paint: `strata`, `stripes`, `gradient`, `colours`, `materials` or a picture file; strata on the rock wall; on a mesh
    /// the textures that its file names, stripes without.
    pub design: Option<String>,
    /// A coat of this thickness, metres, over all that is in reach, instead of a design.
    pub fill: Option<f64>,
    /// Picture on the mesh's own texture coordinates instead.
    pub texture: Option<PathBuf>,
    /// Scan the surface first and paint what was mapped.
    pub scan: bool,
    /// The part that is painted, in the coordinates of the mesh file; all of it without.
    pub region: Option<Region>,
    /// Parts that stay clean, windows in a front, in the same coordinates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keep_clean: Vec<Region>,
    /// All numbers.
    pub settings: MissionSettings,
    /// The paints of a picture in colour: `cmyk`, `six`, `spot:N` or a file of paints; the design is separated for them.
    pub palette: Option<PaletteChoice>,
    /// A file with the paints that `spot:N` chooses from; artists' pigments without.
    pub available: Option<PathBuf>,
    /// The wall under a picture in colour: `sandstone`, `white`, `concrete`, `dark`, `#rrggbb`, or `mesh`; the colours of the mesh, where it has some that
    /// are not the design, else sandstone.
    pub wall: Option<Wall>,
    /// Several paints, each with what it paints, in the order in which they are flown; one paint with the design above without.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub paints: Vec<MissionPaint>,
}

/// What is wrong with a mission.
#[derive(Debug, thiserror::Error)]
pub enum MissionFileError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The folder for the results.
    #[error("{path}: cannot be created ({source}): choose another --out")]
    Folder {
        /// The folder.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is no mission.
    #[error("{path}: {why}")]
    Malformed {
        /// The file.
        path: String,
        /// The place, and what is wrong there.
        why: String,
    },
    /// The mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh cannot be placed.
    #[error("{path}: {source}")]
    Placement {
        /// The mesh.
        path: String,
        /// What is wrong.
        source: PlacementError,
    },
    /// The region holds nothing, or cannot be read.
    #[error("{path}: {source}")]
    Region {
        /// The mesh.
        path: String,
        /// What is wrong.
        source: RegionError,
    },
    /// No pose of the robot paints anything of the region.
    #[error(
        "{path}: --region {region}: no pose of the robot can paint any of it: something stands before it, it faces up or down, or it faces \
         away; the mesh reaches from {:?} to {:?} in the coordinates of its file (--up says which way is up, now {up:?})",
        extent[0], extent[1]
    )]
    RegionOutOfReach {
        /// The mesh.
        path: String,
        /// The region.
        region: String,
        /// Least and largest coordinates of the mesh.
        extent: Box<[[f64; 3]; 2]>,
        /// What points up.
        up: UpAxis,
    },
    /// A region of what is not known yet.
    #[error("region: a surface that the robot scans first has no coordinates yet; leave out the region or the scan")]
    RegionBeforeScan,
    /// Faults of sensors that are not there.
    #[error(
        "faults of sensors (settings.sensor_faults; `robot --fault camera` and the like) are for a robot that flies by its own senses: add \
         --localisation slam"
    )]
    NoSensors,
    /// The mesh lacks what the mission asks of it.
    #[error("{path}: has no texture coordinates for --texture; leave it out or use --design")]
    NoTextureCoordinates {
        /// The mesh.
        path: String,
    },
    /// Paints that cannot be flown as the file has them.
    #[error("paints: {0}")]
    Paints(String),
    /// A palette that does not go with the rest of the file.
    #[error("palette: {0}")]
    Palette(&'static str),
    /// A palette without paints.
    #[error(transparent)]
    PaletteFile(#[from] PaletteError),
    /// A coat that cannot be asked for.
    #[error("fill: {0}")]
    Fill(&'static str),
    /// The design cannot be used.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The scan failed.
    #[error("{surface}{source}")]
    Scan {
        /// The mesh file with a colon, or nothing.
        surface: String,
        /// What is wrong.
        source: ScanFlightError,
    },
    /// The mission refused.
    #[error("{surface}{source}")]
    Mission {
        /// The mesh file with a colon, or nothing.
        surface: String,
        /// What is wrong.
        source: MissionError,
    },
}

/// The surface itself with its name, what is really there where the robot scans it first, and what it finds itself in.
struct Place {
    name: String,
    scene: Scene,
    /// The true surface.
    truth: Option<TriangleMesh>,
    /// The file of a map of it.
    map: Option<PathBuf>,
}

impl Place {
    /// A task on it, told of the true surface and the map.
    fn known(&self, task: PaintingTask) -> Result<PaintingTask, MissionError> {
        let task = match &self.truth {
            Some(truth) => task.on_true_surface(truth)?,
            None => task,
        };
        Ok(match &self.map {
            Some(map) => task.in_map(map.clone()),
            None => task,
        })
    }
}

impl MissionFile {
    /// Reads a mission; paths in it begin at its folder.
    pub fn read(path: &Path) -> Result<Self, MissionFileError> {
        let name = || path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| MissionFileError::File { path: name(), source })?;
        let mission: Self = toml::from_str(&text).map_err(|error| MissionFileError::Malformed {
            path: name(),
            why: error.to_string().trim_end().to_owned(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(mission.with_files(&|file| folder.join(file)))
    }

    fn with_files(self, place: &dyn Fn(PathBuf) -> PathBuf) -> Self {
        Self {
            mesh: self.mesh.map(place),
            texture: self.texture.map(place),
            design: self.design.map(|design| file_of_design(design, place)),
            palette: self.palette.map(|palette| palette.with_file(place)),
            available: self.available.map(place),
            region: self.region.map(|region| region.with_file(place)),
            keep_clean: self.keep_clean.into_iter().map(|region| region.with_file(place)).collect(),
            paints: self.paints.into_iter().map(|paint| paint.with_files(place)).collect(),
            ..self
        }
    }

    /// Writes the mission with every number that it had. The files it names are said from its folder, so that both can be moved together;
    /// from the root where they have no folder in common.
    pub fn write(&self, path: &Path) -> Result<(), MissionFileError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let written = self.clone().with_files(&|file| from_folder(folder, file));
        let name = || path.display().to_string();
        let text = toml::to_string(&written)
            .map_err(|error| MissionFileError::Malformed { path: name(), why: error.to_string() })?;
        whole_file::write(path, text).map_err(|source| MissionFileError::File { path: name(), source })
    }

    /// Begins a run of a program in a folder, and leaves the mission there as `mission.toml`.
    pub fn begin_run(&self, folder: &Path, program: &str) -> Result<(), MissionFileError> {
        run_folder::begin(folder, program)
            .map_err(|source| MissionFileError::Folder { path: folder.display().to_string(), source })?;
        self.write_into(folder)
    }

    /// Makes the folder of the results and leaves the mission there as `mission.toml`.
    pub fn write_into(&self, folder: &Path) -> Result<(), MissionFileError> {
        std::fs::create_dir_all(folder)
            .map_err(|source| MissionFileError::Folder { path: folder.display().to_string(), source })?;
        self.write(&folder.join("mission.toml"))
    }

    /// Reads the surface and the design, scans if asked to, and decides; what the scan leaves goes into `folder`.
    ///
    /// # Errors
    /// A file with several paints among others: see [`MissionFile::decide_coats`].
    pub fn decide(&self, folder: &Path) -> Result<PaintingTask, MissionFileError> {
        if !self.paints.is_empty() || self.palette.is_some() {
            return Err(MissionFileError::Paints("several paints are several decisions".into()));
        }
        self.decide_on(&self.place(folder)?)
    }

    /// Reads the surface and scans it if asked to.
    fn place(&self, folder: &Path) -> Result<Place, MissionFileError> {
        let own_senses = match self.settings.localisation {
            None => self.scan,
            Some(chosen) => chosen == LocalisationChoice::Slam,
        };
        if !self.settings.sensor_faults.is_empty() && !own_senses {
            return Err(MissionFileError::NoSensors);
        }
        let (name, scene) = self.read_surface()?;
        if !self.scan {
            let map = own_senses.then(|| self.survey(&scene, folder)).transpose()?;
            return Ok(Place { name, scene, truth: None, map });
        }
        if self.is_place() {
            return Err(MissionFileError::RegionBeforeScan);
        }
        let scan_flight = ScanFlight::fly(&scene.canvas, self.settings.seed, self.settings.threads)
            .map_err(|source| MissionFileError::Scan { surface: self.mesh_prefix(), source })?;
        save_scan_flight(&scan_flight, folder).map_err(|source| self.in_mesh(source))?;
        let map = folder.join(scan_flight::MAP_FILE);
        Ok(Place { name, scene: Scene::whole(scan_flight.mesh), truth: Some(scene.canvas), map: Some(map) })
    }

    /// Leaves a map of the surface as it is given, in which the robot finds itself by shape.
    fn survey(&self, scene: &Scene, folder: &Path) -> Result<PathBuf, MissionFileError> {
        let file = folder.join(SURVEY_FILE);
        let TriangleMesh { positions, faces, .. } = &scene.canvas;
        let map = TriangleSurface::new(positions, faces)
            .map_err(LocalisationError::from)
            // Surfaces are turned so that they face the robot, which is at smaller x.
            .and_then(|surface| surveyed_map(&surface, &-Vector3::x(), self.settings.threads))
            .and_then(|map| Ok(map.save(&file, None, BTreeMap::new())?));
        map.map_err(|error| self.in_mesh(MissionError::Localisation(error)))?;
        Ok(file)
    }

    /// Reads the design and decides.
    fn decide_on(&self, place: &Place) -> Result<PaintingTask, MissionFileError> {
        let Place { name, scene, .. } = place;
        let design = self.grey_design(&scene.canvas)?;
        let task = PaintingTask::new(name, scene, &design, self.settings.clone());
        task.and_then(|task| place.known(task)).map_err(|source| self.in_mesh(source))
    }

    /// The design of one paint.
    fn grey_design(&self, mesh: &TriangleMesh) -> Result<Design, MissionFileError> {
        let seed = self.settings.seed;
        let materials = mesh.materials.as_ref().filter(|materials| materials.textured() && mesh.uv.is_some());
        Ok(match (&self.texture, &self.design, materials) {
            _ if self.fill.is_some() => self.coat()?,
            (Some(texture), ..) => Design::Texture(Picture::open(texture)?),
            (None, Some(name), _) if name != MATERIALS => Design::from_name(name, seed)?,
            (None, _, Some(materials)) => {
                say!("{}wanted is the texture that the file names", self.mesh_prefix());
                Design::from_materials(materials)?
            }
            (None, Some(_), None) => {
                return Err(DesignError::Missing("textures of its own (OBJ with MTL, glTF)").into());
            }
            (None, None, None) if self.mesh.is_some() => Design::Stripes,
            (None, None, None) => Design::Strata { seed },
        })
    }

    /// The design of an even coat.
    fn coat(&self) -> Result<Design, MissionFileError> {
        if self.texture.is_some() || self.design.is_some() {
            return Err(MissionFileError::Fill(
                "takes the place of a design or a texture: leave them out, or the coat",
            ));
        }
        let thickness = self.fill.filter(|thickness| COAT.contains(thickness));
        let thickness = thickness.ok_or(MissionFileError::Fill("give a thickness from 1 to 60 micrometres"))?;
        // Ink is on the scale of charcoal, whatever the paint.
        let paint = Appearance::charcoal_on_sandstone().map_err(|error| self.in_mesh(error.into()))?;
        Ok(Design::Even { ink: paint.ink().forward(thickness / UNIT_THICKNESS) })
    }

    /// Name and mesh of the surface, placed before the robot, with what stands in its way.
    pub fn read_surface(&self) -> Result<(String, Scene), MissionFileError> {
        Ok(match &self.mesh {
            None => ("Rock wall".to_owned(), self.select("rock wall", rock_wall(self.settings.seed), 1.0)?),
            Some(path) => {
                let name = path.file_stem().map_or("Mesh".into(), |s| s.to_string_lossy());
                (name.into_owned(), self.load(path)?)
            }
        })
    }

    /// An error of the mission with the name of the mesh before it.
    pub fn in_mesh(&self, source: MissionError) -> MissionFileError {
        if let (MissionError::OutOfReach { .. }, Some(region), Some(path)) = (&source, &self.region, &self.mesh)
            && let Ok(mesh) = read_mesh(path)
        {
            let (low, high) = mesh.bounds_in_file();
            let (up, _) = up_of(&mesh, path, self.up);
            let (path, region) = (path.display().to_string(), region.to_string());
            return MissionFileError::RegionOutOfReach { path, region, extent: Box::new([low, high]), up };
        }
        MissionFileError::Mission { surface: self.mesh_prefix(), source }
    }

    fn mesh_prefix(&self) -> String {
        self.mesh.as_ref().map_or_else(String::new, |path| format!("{}: ", path.display()))
    }

    /// The part of a mesh that is painted, and the rest.
    fn select(&self, name: &str, mesh: TriangleMesh, unit: f64) -> Result<Scene, MissionFileError> {
        let wrong = |source| MissionFileError::Region { path: name.to_owned(), source };
        let (all, finest) = (mesh.faces.len(), self.settings.texel / unit);
        let mut scene = match &self.region {
            Some(region) => region.split(mesh, finest, unit).map_err(wrong)?,
            None => Scene::whole(mesh),
        };
        scene.canvas.notes.iter().for_each(|note| say!("{name}: {note}"));
        if let Some(region) = &self.region {
            say!("{name}: {} of {all} faces lie in the region {region}", scene.canvas.faces.len());
        }
        for region in &self.keep_clean {
            scene.keep_clean(region, finest, unit).map_err(wrong)?;
        }
        Ok(scene)
    }

    /// Whether parts of it are named by its coordinates: a mesh is a place in metres then, else an object.
    fn is_place(&self) -> bool {
        self.region.is_some() || !self.keep_clean.is_empty()
    }

    /// Reads and places a mesh.
    fn load(&self, path: &Path) -> Result<Scene, MissionFileError> {
        let mut mesh = read_mesh(path)?;
        let name = path.display().to_string();
        if self.texture.is_some() && mesh.uv.is_none() {
            return Err(MissionFileError::NoTextureCoordinates { path: name });
        }
        let (up, up_said) = up_of(&mesh, path, self.up);
        let subject = if self.is_place() { Subject::Place } else { Subject::Object };
        let (scale, scale_said) = scale_of(&mesh, self.scale, subject);
        let placement = MeshPlacement { scale: Some(scale), up };
        let (mut scene, placed) = if self.is_place() {
            let unit = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
            let mut scene = self.select(&name, mesh, unit)?;
            let placed = place_scene(&mut scene, placement);
            (scene, placed)
        } else {
            mesh.notes.iter().for_each(|note| say!("{name}: {note}"));
            let placed = place_mesh(&mut mesh, placement);
            (Scene::whole(mesh), placed)
        };
        let placed = placed.map_err(|source| MissionFileError::Placement { path: name.clone(), source })?;
        scene.world_from_mesh = placed.world_from_mesh;
        let hung = if placed.hung { ", hung like a wall" } else { "" };
        say!("{name}: {} faces, {scale_said}, {up_said}{hung}", scene.canvas.faces.len());
        Ok(scene)
    }
}
