//! The figures of a mapping run.

use serde::Serialize;
use tsdf_hash::slam::PoseSource;

use super::mapped::Scan;
use super::sequence::Sequence;

/// What `report.json` of a scan holds. Flat, SI units in the names; every number is finite.
#[derive(Debug, Clone, Serialize)]
pub struct ScanReport {
    /// Version of the program.
    pub version: &'static str,
    /// Frames that were fused.
    pub frames: usize,
    /// Frames that were left out.
    pub frames_skipped: usize,
    /// Frames that a run before this one had fused or left out.
    pub frames_resumed: usize,
    /// Frames whose colour image could not be read.
    pub frames_without_colour: usize,
    /// `given`, `tracked` or `odometry`.
    pub poses: &'static str,
    /// Focal lengths and principal point of the depth camera, pixels.
    pub camera_px: [f64; 4],
    /// Where they are from.
    pub camera_origin: String,
    /// The camera that fits the frames clearly better; absent where none does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_fits_better_px: Option<[f64; 4]>,
    /// Units of the depth images per metre.
    pub depth_units_per_m: f64,
    /// Where that is from.
    pub depth_scale_origin: String,
    /// Share of the pixels with a depth in the range.
    pub valid_share: f64,
    /// Share of those that were fused.
    pub fused_share: f64,
    /// Gaps that were filled and fused, as a share of the valid pixels.
    pub filled_share: f64,
    /// Share of the depth that agrees with the map at the frame's pose before it is fused, median; absent where no frame sees what others
    /// have seen, and for tracked poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_agreement_median: Option<f64>,
    /// Times that tracking lost the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_losses: Option<usize>,
    /// Frames that did not fix all six directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_degenerate_frames: Option<usize>,
    /// Those of them that were left out, because no odometry knew more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_degenerate_left_out: Option<usize>,
    /// Processor time of tracking a frame, ray cast included, median.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_cpu_ms_median: Option<f64>,
    /// Times that a camera was found by keyframes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_relocalisations: Option<usize>,
    /// Keyframes that are stored with the map.
    pub keyframes: usize,
    /// Loops that were found; absent where they were not looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loops: Option<usize>,
    /// Corrections of the trajectory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_corrections: Option<usize>,
    /// Corrections whose bundle adjustment was not taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_adjustments_refused: Option<usize>,
    /// Frames that were de-integrated and integrated anew, over all corrections.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_frames_reintegrated: Option<usize>,
    /// Largest drift that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_drift_max_m: Option<f64>,
    /// Position error of the tracked poses against those recorded, rigidly aligned, root mean square; absent where there are no three, or all lie
    /// on one line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_se3_rmse_m: Option<f64>,
    /// Edge of a voxel.
    pub voxel_m: f64,
    /// Processor time of one fusion, median.
    pub integrate_cpu_ms_median: f64,
    /// Processor time of a ray cast of the size of the depth images, median.
    pub raycast_cpu_ms_median: f64,
    /// Mean distance between the depth cast and the depth that was measured from the same place.
    pub depth_error_mean_m: f64,
    /// Share of the measured pixels at which the map has a surface.
    pub raycast_fill: f64,
    /// Processor time of the mesh from nothing.
    pub mesh_full_cpu_ms: f64,
    /// Processor time of following the map with its mesh after a frame, median; absent for a map on a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_incremental_cpu_ms_median: Option<f64>,
    /// Largest number of bytes in active memory.
    pub active_bytes_peak: usize,
    /// Largest number of bytes in the host tier.
    pub host_bytes_peak: usize,
    /// Blocks of the map.
    pub blocks: usize,
    /// Hash of all voxels: equal for equal maps.
    pub map_hash: String,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Edges of the mesh with more than two triangles.
    pub non_manifold_edges: usize,
    /// Length of the camera's path.
    pub path_length_m: f64,
    /// Worker threads.
    pub threads: usize,
    /// What computed the map.
    pub device: String,
    /// Largest resident memory.
    pub peak_rss_bytes: u64,
}

impl ScanReport {
    /// The figures of a run.
    pub fn new(scan: &Scan, sequence: &Sequence) -> Self {
        let (map, metrics) = (&scan.state.map, &scan.metrics);
        let (settings, quality) = (map.settings(), &metrics.quality);
        let tracking = (scan.poses != PoseSource::Given).then_some(&metrics.statistics);
        let loops = metrics.loops.then_some(&metrics.statistics);
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        let k = &sequence.intrinsics;
        let casts: Vec<f64> = metrics.ray_casts.iter().map(|cast| cast.seconds).collect();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            frames: scan.fused.len(),
            frames_skipped: scan.skipped.len(),
            frames_resumed: scan.resumed,
            frames_without_colour: metrics.without_colour,
            poses: match scan.poses {
                PoseSource::Given => "given",
                PoseSource::Tracked => "tracked",
                PoseSource::Odometry(_) => "odometry",
            },
            camera_px: [k.fx, k.fy, k.cx, k.cy],
            camera_origin: sequence.camera_origin.clone(),
            camera_fits_better_px: metrics.camera_doubt.map(|doubt| {
                let k = doubt.fits_better;
                [k.fx, k.fy, k.cx, k.cy]
            }),
            depth_units_per_m: sequence.depth_scale,
            depth_scale_origin: sequence.scale_origin.clone(),
            valid_share: share(quality.valid, quality.pixels),
            fused_share: quality.fused_share(),
            filled_share: share(quality.filled, quality.valid),
            depth_agreement_median: (!quality.agreement.is_empty()).then(|| quality.median_agreement()),
            tracking_losses: tracking.map(|t| t.losses),
            tracking_degenerate_frames: tracking.map(|t| t.degenerate_frames),
            tracking_degenerate_left_out: tracking.map(|t| t.degenerate_left_out),
            tracking_cpu_ms_median: tracking.map(|_| 1e3 * median(&metrics.tracking_s)),
            tracking_relocalisations: tracking.map(|t| t.relocalisations),
            keyframes: scan.state.keyframes.len(),
            loops: loops.map(|l| l.loops),
            loop_corrections: loops.map(|l| l.corrections),
            loop_adjustments_refused: loops.map(|l| l.adjustments_refused),
            loop_frames_reintegrated: loops.map(|l| l.reintegrated),
            loop_drift_max_m: loops.map(|l| l.largest_drift),
            ate_se3_rmse_m: metrics.ate_se3_rmse,
            voxel_m: settings.voxel_size,
            integrate_cpu_ms_median: 1e3 * median(&metrics.integrate_s),
            raycast_cpu_ms_median: 1e3 * median(&casts),
            depth_error_mean_m: mean(metrics.ray_casts.iter().map(|cast| cast.depth.mean_error)),
            raycast_fill: mean(metrics.ray_casts.iter().map(|cast| cast.depth.fill)),
            mesh_full_cpu_ms: 1e3 * metrics.mesh_s,
            mesh_incremental_cpu_ms_median: (!metrics.mesh_update_s.is_empty())
                .then(|| 1e3 * median(&metrics.mesh_update_s)),
            active_bytes_peak: metrics.statistics.active_bytes_peak,
            host_bytes_peak: metrics.statistics.host_bytes_peak,
            blocks: map.blocks(),
            map_hash: format!("{:016x}", map.hash()),
            vertices: scan.mesh.positions.len(),
            triangles: scan.mesh.faces.len(),
            non_manifold_edges: non_manifold_edges(&scan.mesh.faces),
            path_length_m: scan.trajectory.path_length(),
            threads: settings.threads,
            device: scan.device.clone(),
            peak_rss_bytes: crate::report::peak_resident_bytes(),
        }
    }
}

/// The middle value, 0 of none.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// 0 of none.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1);
    values.sum::<f64>() / count as f64
}

fn non_manifold_edges(faces: &[[u32; 3]]) -> usize {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|&[a, b, c]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]])
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() > 2).count()
}
