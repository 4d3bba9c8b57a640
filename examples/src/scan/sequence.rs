//! A recorded sequence: which images, from where, through which camera.

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::Intrinsics;

use super::image_source::ImageSource;

/// A sequence of depth images, with colour and poses where they were recorded.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// How the folder is laid out: `7-Scenes`, `TUM`, `ICL-NUIM`, `Redwood` or `MCAP`.
    pub layout: &'static str,
    /// Camera of the depth images; colour images are taken as registered to it, unless there is a [`ColourCamera`].
    pub intrinsics: Intrinsics,
    /// Where the camera is from, in words.
    pub camera_origin: String,
    /// Width and height of the camera's images, where a file says so; otherwise those of the first image.
    pub image_size: Option<[usize; 2]>,
    /// Units of the depth images per metre.
    pub depth_scale: f64,
    /// Where the scale is from, in words.
    pub scale_origin: String,
    /// A colour camera that stands elsewhere.
    pub colour_camera: Option<ColourCamera>,
    /// Samples of a gyroscope on the camera: seconds, and the angular rate along the camera's axes, rad/s.
    pub angular_rates: Vec<(f64, Vector3<f64>)>,
    /// The frames, by rising stamps.
    pub frames: Vec<FrameFiles>,
}

impl Sequence {
    /// Seconds from one frame to the next, the median; a thirtieth of one frame alone.
    pub fn interval(&self) -> f64 {
        let mut steps: Vec<f64> = self.frames.windows(2).map(|pair| pair[1].stamp - pair[0].stamp).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().filter(|step| *step > 0.0).unwrap_or(1.0 / 30.0)
    }

    /// Camera, scale and where they are from, in one line.
    pub fn description(&self) -> String {
        let k = &self.intrinsics;
        let size = self.image_size.map_or_else(String::new, |[w, h]| format!(", {w} x {h} pixels"));
        format!(
            "fx {} fy {} cx {} cy {}{size} ({}); {} units per metre ({})",
            k.fx, k.fy, k.cx, k.cy, self.camera_origin, self.depth_scale, self.scale_origin
        )
    }
}

/// A colour camera beside the depth camera.
#[derive(Debug, Clone, Copy)]
pub struct ColourCamera {
    /// Takes points of the colour camera into the depth camera.
    pub depth_from_colour: Isometry3<f64>,
    /// Its camera, if it is not the depth camera's.
    pub intrinsics: Option<Intrinsics>,
}

/// One frame, not yet read.
#[derive(Debug, Clone)]
pub struct FrameFiles {
    /// Seconds.
    pub stamp: f64,
    /// Depth: 16 bits of units, or floating-point metres.
    pub depth: ImageSource,
    /// Colour or grey.
    pub colour: Option<ImageSource>,
    /// Recorded pose of the camera: z forward, x right, y down.
    pub world_from_camera: Option<Isometry3<f64>>,
    /// Whether a pose was recorded that is no number, as recorders write when they have lost the camera.
    pub lost: bool,
}
