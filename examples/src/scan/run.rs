//! The mapping run: every frame once, in order.

use std::path::Path;

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::{CastSettings, Map, Mesh, View};
use vio_ekf::{Stamp, Trajectory};

use super::{Images, Sequence, SequenceError};
use crate::progress::Stage;

/// How a sequence is mapped.
#[derive(Debug, Clone, Copy)]
pub struct ScanSettings {
    /// The map.
    pub map: tsdf_hash::Settings,
    /// Frames between two looks at the map from the camera's own place.
    pub look_every: usize,
}

impl Default for ScanSettings {
    fn default() -> Self {
        Self { map: tsdf_hash::Settings::default(), look_every: 10 }
    }
}

/// A mapped sequence.
pub struct Scan {
    /// The map.
    pub map: Map,
    /// Its mesh.
    pub mesh: Mesh,
    /// Poses of the frames that were fused.
    pub trajectory: Trajectory,
    /// Indices of the frames that were fused.
    pub fused: Vec<usize>,
    /// Frames that could not be fused, with the reason.
    pub skipped: Vec<(usize, String)>,
    /// Processor time of each fusion, seconds.
    pub integrate_s: Vec<f64>,
    /// What looking at the map showed, and took.
    pub looks: Vec<Look>,
    /// Processor time of the mesh from nothing, seconds.
    pub mesh_s: f64,
    /// Largest number of bytes of the map.
    pub bytes_peak: usize,
}

/// The map, seen from where a frame was taken, beside that frame.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Processor time of the ray cast, seconds.
    pub seconds: f64,
    /// Mean distance between the depth cast and the depth measured, over the pixels that have both, metres.
    pub depth_error: f64,
    /// Share of the measured pixels at which the map has a surface.
    pub fill: f64,
}

/// Why a run gave no map.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// The sequence cannot be read.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// The map refused its settings.
    #[error(transparent)]
    Map(#[from] tsdf_hash::Error),
    /// The poses make no trajectory.
    #[error(transparent)]
    Trajectory(#[from] vio_ekf::Error),
    /// A picture cannot be rendered.
    #[error(transparent)]
    Render(#[from] paint_sim::Error),
    /// A picture cannot be saved.
    #[error(transparent)]
    Picture(#[from] crate::pictures::PictureError),
    /// No frame could be fused.
    #[error("{folder}: none of the {frames} frames could be fused; the first: {first}")]
    NothingFused {
        /// The sequence.
        folder: String,
        /// Frames it lists.
        frames: usize,
        /// What was wrong with the first of them.
        first: String,
    },
}

impl Scan {
    /// Maps a sequence by its recorded poses. Frames that cannot be used are counted and left out.
    pub fn run(folder: &Path, sequence: &Sequence, settings: ScanSettings) -> Result<Self, ScanError> {
        let stage = Stage::start("fuse");
        let mut map = Map::new(settings.map)?;
        let mut skipped = Vec::new();
        let mut integrate_s = Vec::with_capacity(sequence.frames.len());
        let mut fused = Vec::with_capacity(sequence.frames.len());
        let mut trajectory = Trajectory::default();
        let (mut looks, mut view) = (Vec::new(), View::new());
        let mut bytes_peak = 0;
        for (index, frame) in sequence.frames.iter().enumerate() {
            stage.share(index as f64 / sequence.frames.len() as f64);
            let Some(pose) = frame.world_from_camera else {
                skipped.push((index, format!("{}: no pose was recorded for it", frame.depth.display())));
                continue;
            };
            let look = index % settings.look_every.max(1) == 0;
            match fuse(&mut map, sequence, index, &pose, look.then_some(&mut view)) {
                Ok((seconds, look)) => {
                    integrate_s.push(seconds);
                    looks.extend(look);
                    fused.push(index);
                    trajectory.push(Stamp::from_secs(frame.stamp)?, pose)?;
                    bytes_peak = bytes_peak.max(map.bytes());
                }
                Err(why) => skipped.push((index, format!("{}: {why}", frame.depth.display()))),
            }
        }
        if integrate_s.is_empty() {
            let first = skipped.first().map_or_else(String::new, |(_, why)| why.clone());
            let frames = sequence.frames.len();
            return Err(ScanError::NothingFused { folder: folder.display().to_string(), frames, first });
        }
        stage.done(&format!("{} frames, {} left out, {} blocks", integrate_s.len(), skipped.len(), map.blocks()));

        let stage = Stage::start("mesh");
        let start = ProcessTime::now();
        let mesh = map.mesh();
        let mesh_s = start.elapsed().as_secs_f64();
        stage.done(&format!("{} vertices, {} triangles", mesh.positions.len(), mesh.faces.len()));
        Ok(Self { map, mesh, trajectory, fused, skipped, looks, integrate_s, mesh_s, bytes_peak })
    }
}

/// Processor time that the fusion took, seconds, and a look at the map if a view is given.
fn fuse(
    map: &mut Map,
    sequence: &Sequence,
    index: usize,
    pose: &Isometry3<f64>,
    view: Option<&mut View>,
) -> Result<(f64, Option<Look>), ScanError> {
    let images = Images::read(&sequence.frames[index])?;
    let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
    let start = ProcessTime::now();
    map.integrate(&depth, images.colour(sequence.intrinsics).as_ref(), pose)?;
    let seconds = start.elapsed().as_secs_f64();
    let Some(view) = view else { return Ok((seconds, None)) };
    let map_settings = map.settings();
    let (min_depth, max_depth) = (map_settings.min_depth, map_settings.max_depth);
    let settings = CastSettings { min_depth, max_depth, colour: true, threads: map_settings.threads };
    let start = ProcessTime::now();
    map.ray_cast_into(&sequence.intrinsics, depth.width, depth.height, pose, &settings, view)?;
    let cast = start.elapsed().as_secs_f64();
    let measured = images.metres(sequence.depth_scale).map(|z| Some(z).filter(|z| (min_depth..=max_depth).contains(z)));
    let (mut pixels, mut hits, mut error) = (0_usize, 0_usize, 0.0);
    for (z, seen) in measured.zip(&view.depth).filter_map(|(z, seen)| Some((z?, *seen))) {
        pixels += 1;
        if seen > 0.0 {
            hits += 1;
            error += (f64::from(seen) - z).abs();
        }
    }
    let look =
        (hits > 0).then(|| Look { seconds: cast, depth_error: error / hits as f64, fill: hits as f64 / pixels as f64 });
    Ok((seconds, look))
}
