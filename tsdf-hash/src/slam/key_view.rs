//! One ray cast for several frames: those between see it from where they are (thesis Paper I, section 6.2, "onboard+").
//!
//! A ray cast costs ten times what its forward projection does. The paper leaves out the registration to the map between key frames, too;
//! here each frame is registered, because that is the cheaper half and keeps the map as sharp as it was.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::ray_cast::view::View;
use crate::tracking::pose::within;

/// A camera that has gone farther from where the view was cast sees too much that was hidden or outside: radians, metres (ours).
const NEAR: [f64; 2] = [0.2, 0.2];

/// The last ray cast that was tracked against.
#[derive(Debug)]
pub(crate) struct KeyView {
    /// Frames that share one.
    every: usize,
    view: Option<View>,
    /// How many have been tracked against it.
    frames: usize,
}

impl KeyView {
    /// None yet, each to be shared by so many frames.
    pub(crate) fn new(every: usize) -> Self {
        Self { every, view: None, frames: 0 }
    }

    /// A new one, which one frame has been tracked against.
    pub(crate) fn keep(&mut self, view: View) {
        (self.view, self.frames) = (Some(view), 1);
    }

    /// The map is not as it was, or the camera is elsewhere.
    pub(crate) fn forget(&mut self) {
        self.view = None;
    }

    /// The view from a pose in its world, for one more frame; `None` where a new one is due.
    ///
    /// # Errors
    /// A pose that makes no sense.
    pub(crate) fn seen_from(&mut self, world_from_camera: &Isometry3<f64>) -> Result<Option<View>, Error> {
        let Some(view) = self.view.as_ref().filter(|_| self.frames < self.every) else { return Ok(None) };
        let Some(intrinsics) = view.intrinsics.filter(|_| within(&view.world_from_camera, world_from_camera, NEAR))
        else {
            return Ok(None);
        };
        self.frames += 1;
        view.warped(&intrinsics, (view.width, view.height), world_from_camera).map(Some)
    }
}
