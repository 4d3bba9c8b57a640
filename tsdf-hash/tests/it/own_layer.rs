//! Layers of voxel blocks that are not a `Map`: a dense grid of the caller's own, followed by the mesh and the distance field.

use std::cell::Cell;

use nalgebra::{Point3, Vector3};
use tsdf_hash::distance_field::{DistanceField, DistanceSettings};
use tsdf_hash::layer::{BlockChanges, BlockReader, MapVersion, TsdfLayer, VoxelBlock};
use tsdf_hash::mesh::IncrementalMesher;
use tsdf_hash::{Error, Settings, UpdateReport};

use crate::topology::{assert_manifold, directed_edges};

/// Blocks along each axis on either side of the origin.
const REACH: i32 = 3;
const SIDE: i32 = 2 * REACH;

/// A cube of blocks in one array, filled from a closed form.
struct DenseGrid {
    settings: Settings,
    version: MapVersion,
    blocks: Vec<VoxelBlock>,
    /// When each block last changed.
    stamps: Vec<u64>,
    /// Reads that fail from now on.
    failures: Cell<usize>,
}

impl DenseGrid {
    fn new() -> Self {
        let count = SIDE.pow(3) as usize;
        Self {
            settings: Settings { voxel_size: 0.02, ..Settings::default() },
            version: MapVersion::unique(),
            blocks: vec![VoxelBlock::ZERO; count],
            stamps: vec![0; count],
            failures: Cell::new(0),
        }
    }

    fn coordinates(slot: usize) -> [i32; 3] {
        let slot = slot as i32;
        [slot % SIDE - REACH, slot / SIDE % SIDE - REACH, slot / (SIDE * SIDE) - REACH]
    }

    fn slot(block: [i32; 3]) -> Option<usize> {
        let inside = block.iter().all(|c| (-REACH..REACH).contains(c));
        inside.then(|| block.iter().rev().fold(0, |slot, c| slot * SIDE as usize + (c + REACH) as usize))
    }

    /// Makes the grid that of another closed form; blocks that are equal have not changed.
    fn fill(&mut self, sdf: impl Fn(&Point3<f64>) -> f64) {
        let (h, mu) = (self.settings.voxel_size, self.settings.truncation());
        for slot in 0..self.blocks.len() {
            let corner = Self::coordinates(slot);
            let mut block = VoxelBlock::ZERO;
            for voxel in 0..512 {
                let local = [voxel % 8, voxel / 8 % 8, voxel / 64];
                let centre = [0, 1, 2].map(|k| (f64::from(corner[k]) * 8.0 + local[k] as f64 + 0.5) * h);
                assert!(block.add_distance(voxel, (sdf(&Point3::from(centre)) / mu) as f32, 1));
            }
            if block != self.blocks[slot] {
                self.version.stamp += 1;
                self.stamps[slot] = self.version.stamp;
                self.blocks[slot] = block;
            }
        }
    }
}

impl TsdfLayer for DenseGrid {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges {
        BlockChanges::new(self.version, before, |stamp| {
            let later = |slot: &usize| self.stamps[*slot] > stamp.unwrap_or(0);
            (0..self.blocks.len()).filter(later).map(Self::coordinates).collect()
        })
    }

    fn contains_block(&self, block: [i32; 3]) -> bool {
        Self::slot(block).is_some()
    }

    fn read_blocks<'a>(&'a self, _: &mut dyn Iterator<Item = [i32; 3]>) -> Result<Box<dyn BlockReader + 'a>, Error> {
        Ok(Box::new(self))
    }
}

impl BlockReader for &DenseGrid {
    fn block<'a>(&'a self, block: [i32; 3], _: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        if self.failures.get() > 0 {
            self.failures.set(self.failures.get() - 1);
            return Err(Error::CorruptBlock { what: "a block of the test", block });
        }
        Ok(DenseGrid::slot(block).map(|slot| &self.blocks[slot]))
    }
}

fn sphere(centre: Point3<f64>) -> impl Fn(&Point3<f64>) -> f64 {
    move |p| (p - centre).norm() - 0.3
}

fn fresh(grid: &DenseGrid) -> (IncrementalMesher, DistanceField) {
    let mut field = DistanceField::new(&DistanceSettings { max_distance: 1.0 }).unwrap();
    let mut mesher = IncrementalMesher::new();
    mesher.update(grid).unwrap();
    field.update(grid).unwrap();
    (mesher, field)
}

#[test]
fn a_dense_grid_is_meshed_and_measured() {
    let mut grid = DenseGrid::new();
    grid.fill(sphere(Point3::origin()));
    let (mesher, field) = fresh(&grid);
    let mesh = mesher.mesh();
    assert_manifold(&mesh);
    let edges = directed_edges(&mesh);
    assert!(mesh.faces.len() > 2000 && edges.keys().all(|&[a, b]| edges.contains_key(&[b, a])), "it is closed");
    for position in &mesh.positions {
        // A chord of the sphere's distance over one voxel is off by h^2 / 8 r at most, twice that for the curvature.
        let error = (Point3::from(position.map(f64::from)).coords.norm() - 0.3).abs();
        assert!(error < 4e-4, "{error}");
    }
    let layer: &dyn TsdfLayer = &grid;
    for direction in [Vector3::new(0.3, -0.5, 0.8), Vector3::new(-1.0, 0.1, 0.2), Vector3::new(0.6, 0.6, -0.5)] {
        let unit = direction.normalize();
        for distance in [-0.05, -0.01, 0.03, 0.06] {
            let point = Point3::from(unit * (0.3 + distance));
            let found = layer.distance(&point).unwrap().unwrap();
            assert!((found - distance).abs() < 1e-3, "{found} instead of {distance}");
            let (again, gradient) = layer.distance_and_gradient(&point).unwrap().unwrap();
            assert!(again == found && (gradient - unit).norm() < 0.05, "{gradient}");
            let far = field.distance(&point).unwrap();
            assert!((far - distance.abs()).abs() < 0.71 * 0.02, "{far}");
        }
        assert!((field.distance(&Point3::from(unit * 0.9)).unwrap() - 0.6).abs() < 1e-3);
    }
    assert_eq!(layer.distance(&Point3::new(0.0, 0.0, 5.0)).unwrap(), None);
    assert_eq!(layer.distance(&Point3::new(f64::NAN, 0.0, 0.0)).unwrap(), None);
}

#[test]
fn changes_of_a_dense_grid_are_followed() {
    let mut grid = DenseGrid::new();
    grid.fill(sphere(Point3::origin()));
    let (mut mesher, mut field) = fresh(&grid);
    // A bump on one side.
    let bump = |p: &Point3<f64>| sphere(Point3::origin())(p).min((p - Point3::new(0.0, 0.0, 0.3)).norm() - 0.06);
    grid.fill(bump);
    let reports = [mesher.update(&grid).unwrap(), field.update(&grid).unwrap()];
    for UpdateReport { changed, removed, rebuilt } in reports {
        assert!(changed > 0 && removed == 0 && rebuilt >= changed && rebuilt < grid.blocks.len() / 2, "{reports:?}");
    }
    let (new_mesher, new_field) = fresh(&grid);
    assert!(mesher.mesh() == new_mesher.mesh() && field.sites().eq(new_field.sites()));
    // A read that fails is told, and made up for.
    grid.fill(sphere(Point3::new(0.01, 0.0, 0.0)));
    grid.failures.set(1);
    assert!(matches!(mesher.update(&grid), Err(Error::CorruptBlock { .. })));
    grid.failures.set(1);
    assert!(matches!(field.update(&grid), Err(Error::CorruptBlock { .. })));
    mesher.update(&grid).unwrap();
    field.update(&grid).unwrap();
    let (new_mesher, new_field) = fresh(&grid);
    assert!(mesher.mesh() == new_mesher.mesh() && field.sites().eq(new_field.sites()));
    assert_eq!(mesher.update(&grid).unwrap(), UpdateReport::default());
    // Another grid starts anew.
    let mut other = DenseGrid::new();
    other.fill(bump);
    assert_eq!(mesher.update(&other).unwrap().changed, other.blocks.len());
    assert_eq!(mesher.mesh(), fresh(&other).0.mesh());
}

#[test]
fn a_voxel_block_keeps_sums_and_refuses_what_does_not_fit() {
    let mut block = VoxelBlock::ZERO;
    assert!(block.add_distance(5, 0.5, 3) && block.add_distance(5, -0.25, 1));
    assert!(block.add_colour(5, [255, 0, 51]) && block.add_colour(5, [255, 0, 51]));
    // (3 / 2 - 1 / 4) / 4.
    assert!((block.distance(5).unwrap() - 0.3125).abs() < 1e-4 && block.weight(5) == 4);
    assert_eq!(block.colour(5).map(|rgb| rgb.map(f32::round)), Some([255.0, 0.0, 53.0]));
    assert!(block.distance(6).is_none() && block.colour(6).is_none() && block.distance(512).is_none());
    let before = block.clone();
    assert!(
        !block.add_distance(512, 0.1, 1) && !block.add_distance(5, f32::NAN, 1) && !block.add_distance(5, 0.1, 65532)
    );
    assert!(!block.add_colour(512, [0; 3]) && block == before);
    for _ in 2..1040 {
        assert!(block.add_colour(5, [0; 3]));
    }
    assert!(!block.add_colour(5, [0; 3]));
}
