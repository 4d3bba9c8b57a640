//! The seam for whoever reads a map block by block: the mesh, the distance field, distance queries.

use nalgebra::{Point3, Vector3};

use crate::blocks::trilinear::TrilinearCell;
use crate::error::Error;
use crate::settings::Settings;

pub use crate::blocks::voxel_block::VoxelBlock;
pub use crate::changes::{BlockChanges, MapVersion};
pub use crate::codec::{decode_block, encode_block};

/// Reads single blocks.
pub trait BlockReader {
    /// The block at these block coordinates, `None` where there is none. `scratch` is there for a block that has to be put
    /// together first.
    ///
    /// # Errors
    /// Those of the map, when the block cannot be read.
    fn block<'a>(&'a self, block: [i32; 3], scratch: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error>;
}

/// A layer of voxel blocks with a truncated signed distance, whoever keeps it (voxblox and nvblox call it so): what
/// [`IncrementalMesher`](crate::mesh::IncrementalMesher) and [`DistanceField`](crate::distance_field::DistanceField) follow.
///
/// The block `b` spans `8h b .. 8h (b + 1)` in the world, `h` being the voxel size; voxel `(i, j, k)` has its centre at
/// `(i + ½, j + ½, k + ½) h`.
pub trait TsdfLayer {
    /// Voxel size, truncation distance and all else that its distances depend on.
    fn settings(&self) -> &Settings;

    /// What has changed since an earlier version, or everything there is for `None` and for a version of another map.
    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges;

    /// Whether there is a block at these block coordinates.
    fn contains_block(&self, block: [i32; 3]) -> bool;

    /// A reader of the blocks that are `wanted`, in any order and perhaps more than once. A layer in the processor's memory
    /// need not look at them; one elsewhere fetches them together.
    ///
    /// # Errors
    /// Those of the map, when a block cannot be fetched.
    fn read_blocks<'a>(
        &'a self,
        wanted: &mut dyn Iterator<Item = [i32; 3]>,
    ) -> Result<Box<dyn BlockReader + 'a>, Error>;

    /// Signed distance from the nearest surface, metres, by trilinear interpolation, of the whole layer; `None` where one of
    /// the eight voxels around the point was never observed. For many points of a layer that is not in the processor's
    /// memory, a [`DistanceField`](crate::distance_field::DistanceField) is faster.
    ///
    /// # Errors
    /// Those of the map, when a block cannot be read.
    fn distance(&self, point_in_world: &Point3<f64>) -> Result<Option<f64>, Error> {
        Ok(cell_around(self, point_in_world)?.map(|cell| cell.distance()))
    }

    /// [`distance`](Self::distance), and its gradient in the world: of length about one near a surface, away from it.
    ///
    /// # Errors
    /// As [`distance`](Self::distance).
    fn distance_and_gradient(&self, point_in_world: &Point3<f64>) -> Result<Option<(f64, Vector3<f64>)>, Error> {
        let cell = cell_around(self, point_in_world)?;
        Ok(cell.map(|cell| (cell.distance(), cell.gradient() / self.settings().voxel_size)))
    }
}

/// The eight voxels around a point, from up to eight blocks.
pub(crate) fn cell_around<L: TsdfLayer + ?Sized>(
    layer: &L,
    point: &Point3<f64>,
) -> Result<Option<TrilinearCell>, Error> {
    let keys = TrilinearCell::blocks(layer.settings(), point);
    let reader = layer.read_blocks(&mut keys.iter().map(|key| key.block()))?;
    let (mut blocks, mut scratch) = (Vec::with_capacity(keys.len()), Box::new(VoxelBlock::ZERO));
    for key in keys {
        let Some(block) = reader.block(key.block(), &mut scratch)? else { return Ok(None) };
        blocks.push((key, block.clone()));
    }
    let find = |wanted| blocks.iter().find(|(key, _)| *key == wanted).map(|(_, block)| block);
    Ok(TrilinearCell::around(layer.settings(), find, point))
}
