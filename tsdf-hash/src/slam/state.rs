//! What a run leaves, and another one can go on from.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::error::Error;
use crate::file::map_file::MapFile;
use crate::keyframes::index::KeyframeIndex;
use crate::map::Map;
use crate::mesh::triangle_mesh::Mesh;
use crate::settings::Settings;
use crate::slam::frontend_state::FrontendState;
use crate::slam::trajectory_text::{trajectory_from_tum, trajectory_to_tum};

/// Names of the metadata in a map's file: last stamp, trajectory and keyframes, and where they were tracked, the tracked camera.
const KEYS: [&str; 3] = ["scan.last_stamp", "scan.trajectory", "scan.keyframes"];
const FRONTEND: &str = "scan.frontend";

/// A map with what localises a camera in it, and what a run has done so far.
pub struct SlamState {
    /// The map.
    pub map: Map,
    /// To find a camera by.
    pub keyframes: KeyframeIndex,
    /// Stamps, seconds, and poses of the frames that have one.
    pub trajectory: Vec<(f64, Isometry3<f64>)>,
    /// Stamp of the last frame that was looked at, seconds; minus infinity before the first.
    pub last_stamp: f64,
    /// Number of the next frame: those of the frames so far are not stored with a map, only their poses.
    pub next_frame: usize,
    /// How the camera moved and what its frames were like, if it was tracked: with it, a run goes on as if it had not been interrupted
    /// (but with loops, whose search begins anew).
    pub frontend: Option<FrontendState>,
}

impl SlamState {
    /// Nothing but a map.
    pub fn new(map: Map) -> Self {
        let (keyframes, trajectory) = (KeyframeIndex::new(), Vec::new());
        Self { map, keyframes, trajectory, last_stamp: f64::NEG_INFINITY, next_frame: 0, frontend: None }
    }

    /// Reads what [`Slam::save`](crate::slam::Slam::save) wrote; of a map that was saved alone, the map. Memory and threads are those of
    /// `settings`, everything else is the file's. `swap` is the file of the disk tier, as for [`Map::with_swap`].
    ///
    /// # Errors
    /// As [`MapFile::into_map`]; [`Error::InvalidMetadata`], [`Error::CorruptFile`].
    pub fn read(file: MapFile, settings: &Settings, swap: Option<&Path>) -> Result<Self, Error> {
        let metadata = file.metadata()?;
        let text = |k: usize| metadata.get(KEYS[k]).map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        let last_stamp = text(0).map(|text| {
            let why = format!("\"{text}\" is no number of seconds");
            text.parse().map_err(|_| Error::InvalidMetadata { key: KEYS[0], why })
        });
        let trajectory =
            text(1).map(|text| trajectory_from_tum(&text).map_err(|why| Error::InvalidMetadata { key: KEYS[1], why }));
        let keyframes = metadata.get(KEYS[2]).map(|bytes| KeyframeIndex::from_bytes(bytes));
        let frontend = metadata.get(FRONTEND).map(|bytes| {
            let read = FrontendState::from_text(&String::from_utf8_lossy(bytes));
            read.map_err(|why| Error::InvalidMetadata { key: FRONTEND, why })
        });
        let &Settings { max_bytes, threads, memory, .. } = settings;
        let continued = Settings { max_bytes, threads, memory, ..*file.settings() };
        Ok(Self {
            map: file.into_map(continued, swap)?,
            keyframes: keyframes.transpose()?.unwrap_or_default(),
            trajectory: trajectory.transpose()?.unwrap_or_default(),
            last_stamp: last_stamp.transpose()?.unwrap_or(f64::NEG_INFINITY),
            next_frame: 0,
            frontend: frontend.transpose()?,
        })
    }

    /// The map and its keyframes, to localise in or to extend by other recordings.
    #[must_use]
    pub fn without_trajectory(self) -> Self {
        Self { keyframes: self.keyframes, ..Self::new(self.map) }
    }

    /// Writes all of it into a map's file, with a mesh if there is one, and other metadata.
    ///
    /// # Errors
    /// As [`Map::save`].
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        let Self { last_stamp, trajectory, keyframes, frontend, .. } = self;
        let metadata = with_metadata(metadata, *last_stamp, trajectory, keyframes, frontend.as_ref());
        self.map.save(path, mesh, &metadata)
    }
}

/// Adds what a later run needs.
pub(crate) fn with_metadata(
    mut metadata: BTreeMap<String, Vec<u8>>,
    last_stamp: f64,
    trajectory: &[(f64, Isometry3<f64>)],
    keyframes: &KeyframeIndex,
    frontend: Option<&FrontendState>,
) -> BTreeMap<String, Vec<u8>> {
    let values =
        [last_stamp.to_string().into_bytes(), trajectory_to_tum(trajectory).into_bytes(), keyframes.to_bytes()];
    metadata.extend(KEYS.map(String::from).into_iter().zip(values));
    metadata.extend(frontend.map(|frontend| (FRONTEND.into(), frontend.to_text().into_bytes())));
    metadata
}
