//! What a run has made so far, and what it leaves.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use super::Slam;
use crate::device_map::DeviceMap;
use crate::error::Error;
use crate::keyframes::index::KeyframeIndex;
use crate::mesh::incremental::IncrementalMesher;
use crate::mesh::triangle_mesh::Mesh;
use crate::slam::camera_check::CameraDoubt;
use crate::slam::frame_source::FrameSource;
use crate::slam::frontend::Frontend;
use crate::slam::frontend_state::FrontendState;
use crate::slam::outcome::SlamStatistics;
use crate::slam::quality::Quality;
use crate::slam::state::{SlamState, with_metadata};

impl<S: FrameSource> Slam<S> {
    /// The map, on whatever device.
    pub fn map(&self) -> &DeviceMap {
        &self.map
    }

    /// The map, for ray casts and decisions about reloaded blocks. What is fused or taken out here is not in the trajectory.
    pub fn map_mut(&mut self) -> &mut DeviceMap {
        &mut self.map
    }

    /// Why the map is on the processor, if [`Device::Auto`](crate::slam::Device::Auto) has found no GPU.
    pub fn device_fallback(&self) -> Option<&Error> {
        self.fallback.as_ref()
    }

    /// Lets the incremental mesh follow the map, and returns it: patches, those that have changed, or all of it.
    ///
    /// # Errors
    /// As [`IncrementalMesher::update`].
    pub fn update_mesh(&mut self) -> Result<&mut IncrementalMesher, Error> {
        self.mesher.update(self.map.dense())?;
        Ok(&mut self.mesher)
    }

    /// The incremental mesh as of the last [`update_mesh`](Self::update_mesh).
    pub fn mesher(&mut self) -> &mut IncrementalMesher {
        &mut self.mesher
    }

    /// Stamps, seconds, and corrected poses `world_from_camera` of all frames that have one, those of earlier runs first.
    pub fn trajectory(&self) -> &[(f64, Isometry3<f64>)] {
        &self.trajectory
    }

    /// Numbers and corrected poses of the frames of this run that have one.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = (usize, Isometry3<f64>)> {
        let earlier = self.trajectory.len() - self.frames.len();
        self.frames.iter().copied().zip(self.trajectory[earlier..].iter().map(|(_, pose)| *pose))
    }

    /// The keyframes, at their corrected poses.
    pub fn keyframes(&self) -> &KeyframeIndex {
        self.backend.keyframes()
    }

    /// What the frames were worth.
    pub fn quality(&self) -> &Quality {
        &self.quality
    }

    /// The camera that fits the frames clearly better than the one given, as far as the camera has turned; also an
    /// [`Event`](crate::slam::Event) when it has turned enough. A wrong depth scale cannot be told from frames alone.
    pub fn camera_doubt(&self) -> Option<CameraDoubt> {
        self.camera_check.doubt(&self.map.dense().settings().noise)
    }

    /// What was counted.
    pub fn statistics(&self) -> &SlamStatistics {
        &self.statistics
    }

    /// Writes map, keyframes and trajectory into a map's file, with a mesh if there is one, and other metadata;
    /// [`SlamState::read`] reads it. Let the map follow first ([`reintegrate`](Self::reintegrate)): it must fit the poses.
    ///
    /// # Errors
    /// As [`DeviceMap::save`].
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        let metadata = with_metadata(
            metadata,
            self.last_stamp,
            &self.trajectory,
            self.keyframes(),
            self.frontend_state().as_ref(),
        );
        self.map.save(path, mesh, &metadata)
    }

    /// Lets the map follow all corrections, and hands over what the run has made.
    ///
    /// # Errors
    /// As [`reintegrate`](Self::reintegrate), and those of a GPU.
    pub fn finish(mut self) -> Result<SlamState, Error> {
        self.reintegrate(usize::MAX)?;
        let frontend = self.frontend_state();
        let Self { map, backend, trajectory, last_stamp, next_frame, .. } = self;
        let keyframes = backend.keyframes().clone();
        Ok(SlamState { map: map.into_map()?, keyframes, trajectory, last_stamp, next_frame, frontend })
    }

    fn frontend_state(&self) -> Option<FrontendState> {
        self.frontend.as_ref().map(Frontend::state)
    }
}
