//! A recorded sequence: which images, from where, through which camera.

use std::path::PathBuf;

use nalgebra::Isometry3;
use tsdf_hash::Intrinsics;

/// A sequence of depth images, with colour and poses where they were recorded.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// How the folder is laid out: `7-Scenes`, `TUM`, `ICL-NUIM` or `Redwood`.
    pub layout: &'static str,
    /// Camera of the depth images; colour images are taken as registered to it.
    pub intrinsics: Intrinsics,
    /// Units of the depth images per metre.
    pub depth_scale: f64,
    /// The frames, by rising stamps.
    pub frames: Vec<FrameFiles>,
}

/// One frame, not yet read.
#[derive(Debug, Clone)]
pub struct FrameFiles {
    /// Seconds.
    pub stamp: f64,
    /// 16-bit PNG.
    pub depth: PathBuf,
    /// PNG or JPEG.
    pub colour: Option<PathBuf>,
    /// Recorded pose of the camera: z forward, x right, y down.
    pub world_from_camera: Option<Isometry3<f64>>,
}
