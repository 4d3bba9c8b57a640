//! The mapping run: every frame once, in order.

use std::path::{Path, PathBuf};

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::{IncrementalMesher, Map, MapFile, Mesh, RayCastSettings};
use vio_ekf::{Stamp, Trajectory};

use super::decode::Images;
use super::error::ScanError;
use super::map_store::{Device, MapStore};
use super::sequence::Sequence;
use crate::progress::Stage;

/// How a sequence is mapped.
#[derive(Debug, Clone)]
pub struct ScanSettings {
    /// The map.
    pub map: tsdf_hash::Settings,
    /// Frames between two ray casts of the map from where the camera was.
    pub ray_cast_every: usize,
    /// Where the map is kept.
    pub device: Device,
    /// File of the disk tier, if there is to be one.
    pub swap: Option<PathBuf>,
    /// A stored map to go on from; its settings take the place of those here, but for memory and threads.
    pub resume: Option<PathBuf>,
}

impl Default for ScanSettings {
    fn default() -> Self {
        let map = tsdf_hash::Settings::default();
        Self { map, ray_cast_every: 10, device: Device::Cpu, swap: None, resume: None }
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
    /// What kept the map.
    pub device: String,
    /// What was measured on the way.
    pub metrics: ScanMetrics,
}

/// What was measured while the map grew.
#[derive(Debug, Clone, Default)]
pub struct ScanMetrics {
    /// Processor time of each fusion, seconds.
    pub integrate_s: Vec<f64>,
    /// Processor time of the incremental mesh update after each fusion, seconds; empty for a map on a GPU.
    pub mesh_update_s: Vec<f64>,
    /// Ray casts of the map: of the finished one, or, if blocks leave active memory, on the way.
    pub ray_casts: Vec<RayCastCheck>,
    /// Processor time of the mesh from nothing, seconds.
    pub mesh_s: f64,
    /// Largest number of bytes in active memory.
    pub active_bytes_peak: usize,
    /// Largest number of bytes in the host tier.
    pub host_bytes_peak: usize,
}

/// The map, seen from where a frame was taken, beside that frame.
#[derive(Debug, Clone, Copy)]
pub struct RayCastCheck {
    /// Processor time of the ray cast, seconds.
    pub seconds: f64,
    /// Mean distance between the depth cast and the depth measured, over the pixels that have both, metres.
    pub depth_error: f64,
    /// Share of the measured pixels at which the map has a surface.
    pub fill: f64,
}

impl Scan {
    /// Maps a sequence by its recorded poses. Frames that cannot be used are counted and left out.
    pub fn run(folder: &Path, sequence: &Sequence, settings: &ScanSettings) -> Result<Self, ScanError> {
        let stage = Stage::start("fuse");
        let mut store = MapStore::open(initial_map(settings)?, settings.device)?;
        let (mut mesher, mut metrics) = (IncrementalMesher::new(), ScanMetrics::default());
        let (mut fused, mut skipped) = (Vec::with_capacity(sequence.frames.len()), Vec::new());
        let mut trajectory = Trajectory::default();
        // What has left active memory is not seen by a ray: then each ray cast comes while its surroundings are still there.
        let leaving = settings.map.memory.host_bytes > 0;
        let due = |index: usize| index.is_multiple_of(settings.ray_cast_every.max(1));
        for (index, frame) in sequence.frames.iter().enumerate() {
            stage.share(index as f64 / sequence.frames.len() as f64);
            let Some(pose) = frame.world_from_camera else {
                skipped.push((index, format!("{}: no pose was recorded for it", frame.depth.display())));
                continue;
            };
            match fuse_frame(&mut store, &mut mesher, sequence, index, &pose, leaving && due(index), &mut metrics) {
                Ok(()) => {
                    fused.push(index);
                    trajectory.push(Stamp::from_secs(frame.stamp).map_err(vio_ekf::Error::from)?, pose)?;
                }
                Err(why) => skipped.push((index, format!("{}: {why}", frame.depth.display()))),
            }
        }
        if fused.is_empty() {
            let first = skipped.first().map_or_else(String::new, |(_, why)| why.clone());
            let frames = sequence.frames.len();
            return Err(ScanError::NothingFused { folder: folder.display().to_string(), frames, first });
        }
        let blocks = store.dense().blocks();
        stage.done(&format!("{} frames, {} left out, {blocks} blocks", fused.len(), skipped.len()));

        if !leaving {
            let stage = Stage::start("ray cast");
            for &index in fused.iter().filter(|&&index| due(index)) {
                stage.share(index as f64 / sequence.frames.len() as f64);
                metrics.ray_casts.extend(ray_cast_check(&mut store, sequence, index)?);
            }
            stage.done(&format!("{} ray casts", metrics.ray_casts.len()));
        }

        let stage = Stage::start("mesh");
        let start = ProcessTime::now();
        let mesh = store.dense().mesh()?;
        metrics.mesh_s = start.elapsed().as_secs_f64();
        stage.done(&format!("{} vertices, {} triangles", mesh.positions.len(), mesh.faces.len()));
        let (device, map) = (store.device(), store.into_map()?);
        Ok(Self { map, mesh, trajectory, fused, skipped, device, metrics })
    }
}

/// The map that the run starts with.
fn initial_map(settings: &ScanSettings) -> Result<Map, ScanError> {
    let Some(path) = &settings.resume else {
        return Ok(match &settings.swap {
            Some(swap) => Map::with_swap(settings.map, swap)?,
            None => Map::new(settings.map)?,
        });
    };
    let stored = |source| ScanError::Stored { path: path.display().to_string(), source };
    let file = MapFile::open(path).map_err(stored)?;
    let tsdf_hash::Settings { max_bytes, threads, memory, .. } = settings.map;
    let continued = tsdf_hash::Settings { max_bytes, threads, memory, ..*file.settings() };
    file.into_map(continued, settings.swap.as_deref()).map_err(stored)
}

/// Fuses a frame, updates the mesh and, if asked for, casts the map from where the frame was taken.
fn fuse_frame(
    store: &mut MapStore,
    mesher: &mut IncrementalMesher,
    sequence: &Sequence,
    index: usize,
    pose: &Isometry3<f64>,
    ray_cast: bool,
    metrics: &mut ScanMetrics,
) -> Result<(), ScanError> {
    let images = Images::read(&sequence.frames[index])?;
    let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
    let start = ProcessTime::now();
    store.dense().integrate(&depth, images.colour(sequence.intrinsics).as_ref(), pose)?;
    metrics.integrate_s.push(start.elapsed().as_secs_f64());
    metrics.active_bytes_peak = metrics.active_bytes_peak.max(store.dense().bytes());
    if let Some(map) = store.map() {
        metrics.host_bytes_peak = metrics.host_bytes_peak.max(map.memory().host_bytes);
        let start = ProcessTime::now();
        mesher.update(map)?;
        metrics.mesh_update_s.push(start.elapsed().as_secs_f64());
    }
    if ray_cast {
        metrics.ray_casts.extend(ray_cast_check(store, sequence, index)?);
    }
    Ok(())
}

/// `None` if the map has no surface where the frame has one.
fn ray_cast_check(store: &mut MapStore, sequence: &Sequence, index: usize) -> Result<Option<RayCastCheck>, ScanError> {
    let frame = &sequence.frames[index];
    let Some(pose) = &frame.world_from_camera else { return Ok(None) };
    let images = Images::read(frame)?;
    let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
    let &tsdf_hash::Settings { min_depth, max_depth, threads, .. } = store.settings();
    let settings = RayCastSettings { min_depth, max_depth, colour: true, threads };
    let start = ProcessTime::now();
    let view = store.dense().ray_cast(&depth.intrinsics, depth.width, depth.height, pose, &settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let measured = images.metres(sequence.depth_scale).map(|z| Some(z).filter(|z| (min_depth..=max_depth).contains(z)));
    let (mut pixels, mut hits, mut error) = (0_usize, 0_usize, 0.0);
    for (z, seen) in measured.zip(&view.depth).filter_map(|(z, seen)| Some((z?, *seen))) {
        pixels += 1;
        if seen > 0.0 {
            hits += 1;
            error += (f64::from(seen) - z).abs();
        }
    }
    let check = RayCastCheck { seconds, depth_error: error / hits as f64, fill: hits as f64 / pixels as f64 };
    Ok(Some(check).filter(|_| hits > 0))
}
