//! The seam at which one map is swapped for another.

use nalgebra::Isometry3;

use crate::{CastSettings, ColourView, DepthView, Error, FrameReport, Intrinsics, Map, Mesh, View};

/// A dense map, whoever keeps it: on the processor ([`Map`]), on a GPU, or the caller's own.
///
/// Maps of this crate that were given the same frames have the same hash, whatever keeps them.
///
/// ```
/// use nalgebra::Isometry3;
/// use tsdf_hash::{DenseMap, DepthView, Error, Map, Settings};
///
/// fn correct(map: &mut dyn DenseMap, view: &DepthView, old: &Isometry3<f64>, new: &Isometry3<f64>) -> Result<(), Error> {
///     map.deintegrate(view, None, old)?;
///     map.integrate(view, None, new)?;
///     Ok(())
/// }
///
/// let maps: Vec<Box<dyn DenseMap>> = vec![Box::new(Map::new(Settings::default())?)];
/// assert_eq!((maps[0].blocks(), maps[0].mesh()?.faces.len()), (0, 0));
/// # Ok::<(), Error>(())
/// ```
pub trait DenseMap {
    /// Fuses a frame; all or nothing, as [`Map::integrate`].
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error>;

    /// Takes a frame out; all or nothing, as [`Map::deintegrate`].
    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error>;

    /// What a camera sees of the surface that is in active memory, as [`Map::ray_cast`].
    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &CastSettings,
    ) -> Result<View, Error>;

    /// The surface of the whole map, all tiers.
    fn mesh(&self) -> Result<Mesh, Error>;

    /// A hash of all voxels, as [`Map::hash`].
    fn hash(&self) -> Result<u64, Error>;

    /// Number of blocks.
    fn blocks(&self) -> usize;

    /// Bytes of the memory that [`Settings::max_bytes`](crate::Settings::max_bytes) caps.
    fn bytes(&self) -> usize;
}

impl DenseMap for Map {
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        Map::integrate(self, depth, colour, world_from_camera)
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        Map::deintegrate(self, depth, colour, world_from_camera)
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &CastSettings,
    ) -> Result<View, Error> {
        Map::ray_cast(self, intrinsics, width, height, world_from_camera, settings)
    }

    fn mesh(&self) -> Result<Mesh, Error> {
        let memory = self.memory();
        let all_active = memory.held_blocks + memory.host_blocks + memory.disk_blocks + memory.file_blocks == 0;
        if all_active { Ok(Map::mesh(self)) } else { Ok(self.whole()?.mesh()) }
    }

    fn hash(&self) -> Result<u64, Error> {
        Ok(Map::hash(self))
    }

    fn blocks(&self) -> usize {
        Map::blocks(self)
    }

    fn bytes(&self) -> usize {
        Map::bytes(self)
    }
}
