//! The map of the last keyframes, to track against while loops are looked for.
//!
//! Against the whole map, a camera that comes back jumps onto the old surface as soon as it is within reach: the drift is then folded into
//! the frame where it jumps, and no loop is measured. Against what was seen lately it goes on smoothly until a loop is closed.

use nalgebra::Isometry3;

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::{ColourView, DepthView};
use crate::map::Map;
use crate::settings::Settings;

/// Keyframes that a map takes before another one is begun, which replaces it after as many again: it holds 8 to 16, and the search for
/// loops takes those ten or more before the present one for old.
const KEYFRAMES: usize = 8;

/// Two maps in turns: frames are fused into both, and tracked against the older one.
pub struct LocalMap {
    settings: Settings,
    /// The older one first; empty before the first frame.
    maps: Vec<Map>,
    /// Keyframes when the newer one was begun.
    begun: usize,
    /// Corrections move the world, not these maps.
    world_from_maps: Isometry3<f64>,
}

impl LocalMap {
    /// Empty; with the settings of the whole map, but no disk.
    pub fn new(settings: &Settings) -> Self {
        Self { settings: settings.beside(), maps: Vec::new(), begun: 0, world_from_maps: Isometry3::identity() }
    }

    /// The map to track against, and where its world is; `None` before the first frame.
    pub fn older(&mut self) -> Option<(&mut dyn DenseMap, Isometry3<f64>)> {
        let world_from_maps = self.world_from_maps;
        self.maps.first_mut().map(|map| (map as &mut dyn DenseMap, world_from_maps))
    }

    /// Takes a frame that was fused at a pose, when the run had so many keyframes.
    ///
    /// # Errors
    /// As [`Map::integrate`].
    pub fn fuse(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        keyframes: usize,
    ) -> Result<(), Error> {
        if self.maps.is_empty() || keyframes >= self.begun + KEYFRAMES {
            if self.maps.len() == 2 {
                self.maps.remove(0);
            }
            self.maps.push(Map::new(self.settings)?);
            self.begun = keyframes;
        }
        let mut pose = self.world_from_maps.inverse() * world_from_camera;
        pose.rotation.renormalize();
        for map in &mut self.maps {
            // Nothing is taken out again.
            map.integrate_where_room(depth, colour, &pose, &mut Vec::new())?;
        }
        Ok(())
    }

    /// The camera is somewhere else: what was seen lately is not around it.
    pub fn forget(&mut self) {
        self.maps.clear();
        self.world_from_maps = Isometry3::identity();
    }

    /// The world was corrected.
    pub fn move_by(&mut self, correction: &Isometry3<f64>) {
        self.world_from_maps = correction * self.world_from_maps;
        self.world_from_maps.rotation.renormalize();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::images::{DepthData, Intrinsics};
    use crate::ray_cast::settings::RayCastSettings;

    /// A flat wall two metres before the camera.
    fn fuse(local: &mut LocalMap, pose: &Isometry3<f64>, keyframes: usize) {
        let data = vec![2.0_f32; 80 * 60];
        let intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };
        let view = DepthView { width: 80, height: 60, data: DepthData::F32 { data: &data }, intrinsics };
        local.fuse(&view, None, pose, keyframes).unwrap();
    }

    /// Whether a ray from the camera of a pose meets the wall in the map that is tracked against.
    fn is_seen(local: &mut LocalMap, pose: &Isometry3<f64>) -> bool {
        let (map, world_from_map) = local.older().unwrap();
        let camera = world_from_map.inverse() * pose;
        let settings = RayCastSettings::default();
        let intrinsics = Intrinsics { fx: 10.0, fy: 10.0, cx: 0.0, cy: 0.0 };
        let view = map.ray_cast(&intrinsics, 1, 1, &camera, &settings).unwrap();
        let depth = f64::from(view.depth[0]);
        assert!(depth == 0.0 || (depth - 2.0).abs() < 5e-3, "{depth}");
        depth > 0.0
    }

    #[test]
    fn what_was_seen_long_ago_is_forgotten_and_corrections_move_the_rest() {
        let mut local = LocalMap::new(&Settings { voxel_size: 0.04, ..Settings::default() });
        assert!(local.older().is_none());
        // A keyframe every five metres: no wall reaches the next one.
        let place = |k: usize| Isometry3::translation(0.0, 5.0 * k as f64, 0.0);
        for k in 0..20 {
            fuse(&mut local, &place(k), k);
            let oldest = (0..=k).find(|n| is_seen(&mut local, &place(*n))).unwrap();
            let span = k + 1 - oldest;
            assert!(span <= 2 * KEYFRAMES && (span >= KEYFRAMES || oldest == 0), "{oldest} of {k}");
        }
        let correction = Isometry3::new(Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.0, 0.0, 0.4));
        local.move_by(&correction);
        assert!(is_seen(&mut local, &(correction * place(19))));
        // What comes now is fused beside it, in the corrected world.
        fuse(&mut local, &(correction * place(20)), 20);
        assert!(is_seen(&mut local, &(correction * place(20))));
        local.forget();
        assert!(local.older().is_none());
    }
}
