//! A dense map of one's own: whatever keeps the blocks, tracker and mesh work on it. This one counts what it is asked for.

use nalgebra::Isometry3;
use tsdf_hash::layer::{BlockChanges, BlockReader, MapVersion, TsdfLayer};
use tsdf_hash::mesh::IncrementalMesher;
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::ray_cast::{RayCastSettings, View};
use tsdf_hash::slam::{Frontend, SlamSettings, StampedPose};
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

/// A tour of `strange` steps, each the `turn`-th part of a turn, then a frame of the other side of the room: ray casts without and with that
/// frame, and the largest error of the tour, m.
fn tour(model_every: usize, turn: usize, strange: usize) -> ([usize; 2], f64) {
    let settings = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut own = CountingMap { map: Map::new(settings).unwrap(), integrations: 0, ray_casts: 0 };
    let slam = SlamSettings { model_every, ..SlamSettings::default() };
    let mut frontend = Frontend::new(&slam, &settings).unwrap();
    let keyframes = KeyframeIndex::new();
    let taken = |step: usize| {
        let shot = Shot::take((160, 120), [131.25; 2], room::pose(step, turn), |o, d| Some(room::hit(o, d)));
        shot.painted(|p| room::colour(p, 1.0))
    };
    let mut worst = 0.0_f64;
    for frame in 0..strange {
        let shot = taken(frame);
        let stamped = StampedPose { stamp: frame as f64 / 30.0, world_from_camera: Some(shot.world_from_camera) };
        let located = frontend.locate(&mut own, &keyframes, &stamped, &shot.view(), shot.colour().as_ref()).unwrap();
        let found = located.world_from_camera.expect("a pose for every frame");
        worst = worst.max((found.translation.vector - shot.world_from_camera.translation.vector).norm());
        own.integrate(&shot.view(), shot.colour().as_ref(), &found).unwrap();
    }
    let before = own.ray_casts;
    let shot = taken(strange + turn / 2);
    let stamped = StampedPose { stamp: strange as f64 / 30.0, world_from_camera: None };
    let located = frontend.locate(&mut own, &keyframes, &stamped, &shot.view(), shot.colour().as_ref()).unwrap();
    assert_eq!(located.world_from_camera, None);
    ([before, own.ray_casts], worst)
}

#[test]
fn frames_share_a_ray_cast_as_long_as_they_see_what_it_saw() {
    let ([each, _], exact) = tour(1, 720, 16);
    assert_eq!(each, 15);
    let ([shared, after], error) = tour(4, 720, 16);
    assert_eq!(shared, 4);
    assert!(exact < 4e-3 && error < 4e-3, "{exact} m, {error} m");
    // Where a frame does not fit, that may be the old view's fault.
    assert!(after > shared, "{after} ray casts");
    // Three degrees a frame: after four of them too little is left of what was seen.
    let ([shared, _], error) = tour(16, 120, 16);
    assert!((4..=5).contains(&shared) && error < 8e-3, "{shared} ray casts, {error} m");
}
