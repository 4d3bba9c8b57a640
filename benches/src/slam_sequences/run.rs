//! The SLAM over a sequence, and how well it did.

use cpu_time::ThreadTime;
use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;
use tsdf_hash::loop_closure::LoopSettings;
use tsdf_hash::mesh::Mesh;
use tsdf_hash::slam::{Event, FrameImages, Slam, SlamSettings, SlamState};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Map, Settings};
use vio_ekf::eval::{Alignment, ate};

use super::camera::Shot;
use super::sequence::{Rendered, Sequence};
use crate::Rng;

/// Readings of the gyroscope per second, their noise and their bias (a consumer's), rad/s.
const GYROSCOPE_RATE: f64 = 200.0;
const GYROSCOPE_NOISE: f64 = 2.4e-3;
const GYROSCOPE_BIAS: [f64; 3] = [0.01, -0.008, 0.005];

/// Images from one line of progress to the next.
const PROGRESS_EVERY: usize = 100;
/// Connected components of the mesh with fewer triangles are specks (ours).
const LEAST_TRIANGLES: usize = 36;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Is shown every image before the SLAM is: its number, its time, s, and the pose of the camera.
pub type See<'a> = &'a mut dyn FnMut(usize, f64, &Isometry3<f64>, &Shot) -> Result<(), AnyError>;

/// What a run may use.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Images; the sequence has no more.
    pub frames: usize,
    /// Edge of a voxel, m.
    pub voxel: f64,
    /// Seed of room, way and noise.
    pub seed: u64,
    /// Threads.
    pub threads: usize,
    /// Bytes of active memory; what does not fit is evicted to ordinary memory. `None`: no bound, nothing is evicted.
    pub active_bytes: Option<usize>,
}

/// Figures of a run, in SI units.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The sequence.
    pub sequence: &'static str,
    /// Its images.
    pub frames: usize,
    /// Images with a pose.
    pub tracked: usize,
    /// Times that the camera was lost.
    pub losses: usize,
    /// Loops that were closed.
    pub loops: usize,
    /// Way of the camera.
    pub path_m: f64,
    /// Error of the positions, root mean square, the first pose given.
    pub ate_m: f64,
    /// The same after rigid alignment.
    pub ate_se3_m: f64,
    /// Distance of the mesh's vertices from the surfaces, mean and deviation.
    pub mesh_mean_m: f64,
    /// The deviation.
    pub mesh_deviation_m: f64,
    /// The median.
    pub mesh_median_m: f64,
    /// Mean and deviation without connected components of fewer than 36 triangles.
    pub mesh_without_specks_m: [f64; 2],
    /// Vertices of the mesh.
    pub vertices: usize,
    /// The same without those components.
    pub vertices_without_specks: usize,
    /// Most bytes of active memory.
    pub active_bytes: usize,
    /// Most bytes that were evicted.
    pub evicted_bytes: usize,
    /// Median time of the processor for tracking an image.
    pub tracking_s: f64,
    /// The same for fusing it.
    pub fusion_s: f64,
}

/// Runs the SLAM over a sequence.
///
/// # Errors
/// Limits that the map refuses, and what `see` reports.
pub fn run(sequence: &Sequence, limits: &Limits, see: See) -> Result<Figures, AnyError> {
    let rendered = sequence.rendered(limits.seed);
    let frames = limits.frames.min(sequence.frames);
    let again = sequence.rendered(limits.seed);
    let (settings, threads) = (settings(sequence, limits), limits.threads);
    let source = move |frame: usize| {
        let shot = again.shot(frame, threads);
        Ok(FrameImages::of(&shot.depth(), Some(&shot.colour())))
    };
    let mut slam = Slam::with_source(settings.clone(), SlamState::new(Map::new(settings.map)?), source)?;
    slam.set_clock(|| ThreadTime::now().as_duration().as_secs_f64());
    let (mut tracking, mut fusion) = (Vec::new(), Vec::new());
    let mut gyroscope = Readings::new(limits.seed);
    for frame in 0..frames {
        let (time, pose) = (rendered.time(frame), rendered.pose(frame));
        for (time, rate) in gyroscope.until(time, &rendered) {
            slam.angular_rate(time, rate)?;
        }
        let shot = rendered.shot(frame, threads);
        see(frame, time, &pose, &shot)?;
        let outcome = slam.frame(time, &shot.depth(), Some(&shot.colour()), (frame == 0).then_some(&pose))?;
        tracking.extend(outcome.tracking_seconds);
        for event in &outcome.events {
            match event {
                Event::Placed(placed) => fusion.extend(placed.fusion_seconds),
                Event::Lost | Event::Found | Event::Relocalised { .. } | Event::Degenerate { .. } => {
                    eprintln!("{} {frame}: {event:?}", sequence.name);
                }
                _ => {}
            }
        }
        if (frame + 1).is_multiple_of(PROGRESS_EVERY) {
            eprintln!("{}: {} of {frames} images, {} loops", sequence.name, frame + 1, slam.statistics().loops);
        }
    }
    let statistics = *slam.statistics();
    // A loop at the end is still to reach the map.
    while slam.reintegrate(usize::MAX)? > 0 {}
    let (truth, found): (Vec<_>, Vec<_>) = slam.frames().map(|(frame, pose)| (rendered.pose(frame), pose)).unzip();
    let mesh = slam.finish()?.map.consolidated()?.mesh();
    let off = |mesh: &Mesh| -> Vec<f64> {
        let place = |vertex: &[f32; 3]| Point3::from(vertex.map(f64::from));
        let mut off: Vec<f64> =
            mesh.positions.iter().map(|vertex| rendered.world.distance(&place(vertex)).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        off
    };
    let (all, parts) = (off(&mesh), off(&mesh.without_small_components(LEAST_TRIANGLES)));
    let steps = 1..frames;
    let step = |k: usize| (rendered.pose(k).translation.vector - rendered.pose(k - 1).translation.vector).norm();
    Ok(Figures {
        sequence: sequence.name,
        frames,
        tracked: found.len(),
        losses: statistics.losses,
        loops: statistics.loops,
        path_m: steps.map(step).sum(),
        ate_m: ate(&truth, &found, Alignment::None)?.position.rmse,
        ate_se3_m: ate(&truth, &found, Alignment::Se3)?.position.rmse,
        mesh_mean_m: mean(&all),
        mesh_deviation_m: deviation(&all),
        mesh_median_m: all.get(all.len() / 2).copied().unwrap_or_default(),
        mesh_without_specks_m: [mean(&parts), deviation(&parts)],
        vertices: all.len(),
        vertices_without_specks: parts.len(),
        active_bytes: statistics.active_bytes_peak,
        evicted_bytes: statistics.host_bytes_peak,
        tracking_s: median(tracking),
        fusion_s: median(fusion),
    })
}

fn settings(sequence: &Sequence, limits: &Limits) -> SlamSettings {
    let memory = MemoryLimits { host_bytes: limits.active_bytes.map_or(0, |_| 8 << 30), ..MemoryLimits::default() };
    let max_bytes = limits.active_bytes.unwrap_or(8 << 30);
    let (Limits { voxel: voxel_size, threads, .. }, noise) = (*limits, sequence.camera.noise_model());
    let map = Settings { voxel_size, max_bytes, memory, threads, noise, ..Settings::default() };
    SlamSettings {
        map,
        frame_interval: 1.0 / sequence.rate,
        loops: Some(LoopSettings::default()),
        ..SlamSettings::default()
    }
}

/// What the gyroscope has said so far.
struct Readings {
    next: usize,
    rng: Rng,
}

impl Readings {
    fn new(seed: u64) -> Self {
        Self { next: 0, rng: Rng::new(seed ^ 0x6779_726f) }
    }

    /// The readings up to a time, with their stamps.
    fn until(&mut self, time: f64, rendered: &Rendered) -> Vec<(f64, Vector3<f64>)> {
        let mut readings = Vec::new();
        while self.next as f64 / GYROSCOPE_RATE <= time {
            let stamp = self.next as f64 / GYROSCOPE_RATE;
            let noise = Vector3::from_fn(|_, _| GYROSCOPE_NOISE * self.rng.normal());
            readings.push((stamp, rendered.rate(stamp) + Vector3::from(GYROSCOPE_BIAS) + noise));
            self.next += 1;
        }
        readings
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
