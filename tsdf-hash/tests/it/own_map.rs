//! A dense map of one's own: whatever keeps the blocks, tracker and mesh work on it. This one counts what it is asked for.

use nalgebra::Isometry3;
use tsdf_hash::layer::{BlockChanges, BlockReader, MapVersion, TsdfLayer};
use tsdf_hash::mesh::IncrementalMesher;
use tsdf_hash::ray_cast::{RayCastSettings, View};
use tsdf_hash::tracking::{PosePrior, Tracker, TrackingSettings, TrackingStatus};
use tsdf_hash::{ColourView, DenseMap, DepthView, Error, FrameReport, Intrinsics, Map, Settings};

use crate::scene::{Shot, room};

struct CountingMap {
    map: Map,
    integrations: usize,
    ray_casts: usize,
}

impl TsdfLayer for CountingMap {
    fn settings(&self) -> &Settings {
        self.map.settings()
    }

    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges {
        self.map.changes_since(before)
    }

    fn contains_block(&self, block: [i32; 3]) -> bool {
        self.map.contains_block(block)
    }

    fn read_blocks<'a>(
        &'a self,
        wanted: &mut dyn Iterator<Item = [i32; 3]>,
    ) -> Result<Box<dyn BlockReader + 'a>, Error> {
        self.map.read_blocks(wanted)
    }
}

impl DenseMap for CountingMap {
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrations += 1;
        self.map.integrate(depth, colour, world_from_camera)
    }

    fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrations += 1;
        self.map.integrate_at(time, depth, colour, world_from_camera)
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrations -= 1;
        self.map.deintegrate(depth, colour, world_from_camera)
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error> {
        self.ray_casts += 1;
        self.map.ray_cast(intrinsics, width, height, world_from_camera, settings)
    }

    fn hash(&self) -> Result<u64, Error> {
        Ok(self.map.hash())
    }

    fn blocks(&self) -> usize {
        self.map.blocks()
    }

    fn bytes(&self) -> usize {
        self.map.bytes()
    }
}

#[test]
fn a_map_of_ones_own_is_tracked_and_meshed() {
    let settings = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut own = CountingMap { map: Map::new(settings).unwrap(), integrations: 0, ray_casts: 0 };
    let mut map = Map::new(settings).unwrap();
    let [first, second] = [0, 1].map(|k| {
        let pose = room::pose(k, 360);
        Shot::take((160, 120), [131.25; 2], pose, |o, d| Some(room::hit(o, d)))
    });
    own.integrate(&first.view(), None, &first.world_from_camera).unwrap();
    map.integrate(&first.view(), None, &first.world_from_camera).unwrap();
    let prior = PosePrior { world_from_camera: first.world_from_camera, covariance: None };
    let track = |map: &mut dyn DenseMap| {
        let mut tracker = Tracker::new(TrackingSettings::default()).unwrap();
        tracker.track(map, &second.view(), None, &prior).unwrap()
    };
    let (outcome, expected) = (track(&mut own), track(&mut map));
    assert_eq!(outcome.status, TrackingStatus::Tracked);
    assert_eq!(outcome.world_from_camera, expected.world_from_camera);
    assert!(own.ray_casts > 0 && own.integrations == 1);
    // The provided mesh, and the same one followed step by step.
    let mesh = DenseMap::mesh(&own).unwrap();
    assert!(!mesh.faces.is_empty());
    let mut mesher = IncrementalMesher::new();
    mesher.update(&own).unwrap();
    assert_eq!(mesher.mesh().faces.len(), mesh.faces.len());
    own.deintegrate(&first.view(), None, &first.world_from_camera).unwrap();
    assert_eq!((own.integrations, own.blocks(), DenseMap::mesh(&own).unwrap().faces.len()), (0, 0, 0));
}
