//! How a run localises and maps.

use crate::device_map::Device;
use crate::error::Error;
#[cfg(feature = "pose-graph")]
use crate::loop_closure::settings::LoopSettings;
use crate::settings::Settings;
use crate::slam::motion_model::OdometryError;
use crate::tracking::settings::TrackingSettings;

/// Which poses a run believes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PoseSource {
    /// Those given with the frames.
    Given,
    /// Those that the tracker finds, from the one given with the first frame, or from the origin.
    #[default]
    Tracked,
    /// Those that the tracker finds, led from frame to frame by the motion between those given.
    Odometry(OdometryError),
}

/// Settings of a [`Slam`](crate::slam::Slam).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct SlamSettings {
    /// The map.
    pub map: Settings,
    /// What keeps it.
    pub device: Device,
    /// Which poses are believed.
    pub poses: PoseSource,
    /// How frames are tracked; noise and threads are those of the map.
    pub tracking: TrackingSettings,
    /// Seconds from one frame to the next (ours: a thirtieth): frames much farther apart have others missing between them.
    pub frame_interval: f64,
    /// Whether frames are fused. Without, the camera is found in a stored map, which stays as it is.
    pub fuse: bool,
    /// Whether the camera is somewhere in a stored map at first, and is looked for by its keyframes.
    pub relocalise_first: bool,
    /// Looks for loops, and the map follows the corrected poses, if there are settings; noise and threads are those of the map.
    #[cfg(feature = "pose-graph")]
    pub loops: Option<LoopSettings>,
    /// Fused frames that follow a correction with each new one (ours: 4; a loop of a minute is in the map after a few seconds).
    pub reintegrated_per_frame: usize,
    /// Frames that share one ray cast to be tracked against; those between see it forward projected ("onboard+", thesis Paper I, section 6.2,
    /// every few frames). 1 (the default): each has its own. A run that goes on from a stored state begins with a new one.
    pub model_every: usize,
    /// Of given poses, one in so many is compared with the map before its frame is fused (ours: 5); 0: none.
    pub check_every: usize,
}

impl Default for SlamSettings {
    fn default() -> Self {
        Self {
            map: Settings::default(),
            device: Device::default(),
            poses: PoseSource::default(),
            tracking: TrackingSettings::default(),
            frame_interval: 1.0 / 30.0,
            fuse: true,
            relocalise_first: false,
            #[cfg(feature = "pose-graph")]
            loops: None,
            reintegrated_per_frame: 4,
            model_every: 1,
            check_every: 5,
        }
    }
}

impl SlamSettings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |name, value, requirement| Err(Error::InvalidSetting { name, value, requirement });
        if !(self.frame_interval.is_finite() && self.frame_interval > 0.0) {
            return refuse("frame_interval", self.frame_interval, "finite and above 0 seconds");
        }
        if let PoseSource::Odometry(OdometryError { turn, shift }) = self.poses
            && !(turn.is_finite() && turn > 0.0 && shift.is_finite() && shift > 0.0)
        {
            return refuse(
                "poses.odometry",
                turn.min(shift),
                "finite and above 0, the turn (radians) and the shift (metres)",
            );
        }
        if self.model_every == 0 {
            return refuse("model_every", 0.0, "1 or more frames");
        }
        if self.relocalise_first && self.poses == PoseSource::Given {
            return refuse("relocalise_first", 1.0, "false (0) where poses are given");
        }
        if self.closes_loops() && !self.fuse {
            return refuse("loops", 1.0, "none (0) where frames are not fused");
        }
        Ok(())
    }

    pub(crate) fn closes_loops(&self) -> bool {
        #[cfg(feature = "pose-graph")]
        return self.loops.is_some();
        #[cfg(not(feature = "pose-graph"))]
        false
    }
}
