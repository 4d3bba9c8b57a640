//! A mission as a file: all that is needed to fly it again.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::design::{Design, DesignError, Picture};
use crate::mesh_io::{MeshError, TriangleMesh, read_mesh};
use crate::mesh_placement::{MeshPlacement, PlacementError, UpAxis, place_mesh};
use crate::mission::{Decision, MissionError, MissionSettings};
use crate::scan_flight::{ScanFlight, ScanFlightError, save as save_scan_flight};
use crate::world::rock_wall;

/// What to paint on what, and how. TOML; a field that is left out has its default, one that is not known is an error.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MissionFile {
    /// Surface to paint, OBJ, PLY or OFF; the built-in rock wall if there is none. Relative paths begin at the file's folder.
    pub mesh: Option<PathBuf>,
    /// Metres per unit of the mesh file; without it the longest side becomes 3 m.
    pub scale: Option<f64>,
    /// Axis of the mesh file that points up; y for OBJ and z otherwise.
    pub up: Option<UpAxis>,
    /// What to paint: `strata`, `stripes`, `gradient`, `colours` or a picture file; strata on the rock wall, stripes on a mesh.
    pub design: Option<String>,
    /// Picture on the mesh's own texture coordinates instead.
    pub texture: Option<PathBuf>,
    /// Scan the surface first and paint what was mapped.
    pub scan: bool,
    /// All numbers.
    pub settings: MissionSettings,
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
    /// The mesh lacks what the mission asks of it.
    #[error("{path}: has no texture coordinates for --texture; leave it out or use --design")]
    NoTextureCoordinates {
        /// The mesh.
        path: String,
    },
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

impl MissionFile {
    /// Reads a mission; paths in it begin at its folder.
    pub fn read(path: &Path) -> Result<Self, MissionFileError> {
        let name = || path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| MissionFileError::File { path: name(), source })?;
        let mut mission: Self = toml::from_str(&text).map_err(|error| MissionFileError::Malformed {
            path: name(),
            why: error.to_string().trim_end().to_owned(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in [&mut mission.mesh, &mut mission.texture].into_iter().flatten() {
            *file = folder.join(&*file);
        }
        if let Some(picture) = mission.design.as_mut().filter(|design| !Design::is_built_in(design)) {
            *picture = folder.join(&*picture).display().to_string();
        }
        Ok(mission)
    }

    /// Writes the mission, with the files it names as absolute paths and every number that it had.
    pub fn write(&self, path: &Path) -> Result<(), MissionFileError> {
        let absolute = |file: &PathBuf| std::path::absolute(file).unwrap_or_else(|_| file.clone());
        let picture = |design: &String| {
            if Design::is_built_in(design) { design.clone() } else { absolute(&design.into()).display().to_string() }
        };
        let written = Self {
            mesh: self.mesh.as_ref().map(absolute),
            texture: self.texture.as_ref().map(absolute),
            design: self.design.as_ref().map(picture),
            ..self.clone()
        };
        let name = || path.display().to_string();
        let text = toml::to_string(&written)
            .map_err(|error| MissionFileError::Malformed { path: name(), why: error.to_string() })?;
        std::fs::write(path, text).map_err(|source| MissionFileError::File { path: name(), source })
    }

    /// Makes the folder of the results and leaves the mission there as `mission.toml`.
    pub fn write_into(&self, folder: &Path) -> Result<(), MissionFileError> {
        std::fs::create_dir_all(folder)
            .map_err(|source| MissionFileError::Folder { path: folder.display().to_string(), source })?;
        self.write(&folder.join("mission.toml"))
    }

    /// Reads the surface and the design, scans if asked to, and decides; what the scan leaves goes into `folder`.
    pub fn decide(&self, folder: &Path) -> Result<Decision, MissionFileError> {
        let settings = self.settings.clone();
        let (name, mesh) = self.read_surface()?;
        let mesh = if self.scan {
            let scan_flight = ScanFlight::fly(&mesh, settings.seed, settings.threads)
                .map_err(|source| MissionFileError::Scan { surface: self.mesh_prefix(), source })?;
            save_scan_flight(&scan_flight, folder).map_err(|source| self.in_mesh(source))?;
            scan_flight.mesh
        } else {
            mesh
        };
        let usual = if self.mesh.is_some() { "stripes" } else { "strata" };
        let design = match &self.texture {
            Some(texture) => Design::Texture(Picture::open(texture)?),
            None => Design::from_name(self.design.as_deref().unwrap_or(usual), settings.seed)?,
        };
        Decision::make(&name, &mesh, &design, settings).map_err(|source| self.in_mesh(source))
    }

    /// Name and mesh of the surface, placed before the robot.
    pub fn read_surface(&self) -> Result<(String, TriangleMesh), MissionFileError> {
        Ok(match &self.mesh {
            None => ("Rock wall".to_owned(), rock_wall(self.settings.seed)),
            Some(path) => {
                let name = path.file_stem().map_or("Mesh".into(), |s| s.to_string_lossy());
                (name.into_owned(), self.load(path)?)
            }
        })
    }

    /// An error of the mission with the name of the mesh before it.
    pub fn in_mesh(&self, source: MissionError) -> MissionFileError {
        MissionFileError::Mission { surface: self.mesh_prefix(), source }
    }

    fn mesh_prefix(&self) -> String {
        self.mesh.as_ref().map_or_else(String::new, |path| format!("{}: ", path.display()))
    }

    /// Reads and places a mesh.
    fn load(&self, path: &Path) -> Result<TriangleMesh, MissionFileError> {
        let mut mesh = read_mesh(path)?;
        let name = path.display().to_string();
        if self.texture.is_some() && mesh.uv.is_none() {
            return Err(MissionFileError::NoTextureCoordinates { path: name });
        }
        let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
        let up = self.up.unwrap_or(if is_obj { UpAxis::Y } else { UpAxis::Z });
        let placed = place_mesh(&mut mesh, MeshPlacement { scale: self.scale, up })
            .map_err(|source| MissionFileError::Placement { path: name.clone(), source })?;
        let hung = if placed.hung { ", hung like a wall" } else { "" };
        eprintln!("{name}: {} faces, scale {:.4}{hung}", mesh.faces.len(), placed.scale);
        Ok(mesh)
    }
}
