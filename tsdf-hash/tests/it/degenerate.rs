//! Where shape alone fixes a pose hardly, or not at all: no colour, no odometry.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use tsdf_hash::Settings;
use tsdf_hash::slam::{Event, FrameOutcome, LeftOut, Slam, SlamSettings};
use tsdf_hash::tracking::TrackingStatus;

use crate::noisy_room::apart;
use crate::scene::{Shot, hit_sphere};

const FRAMES: usize = 30;

/// Follows a camera around a ball of 40 cm, 36 mm a frame, from the tenth on turning about its own axis as well, before walls at `half` its size
/// along each axis; returns what became of each frame, and by how much it is off, metres and radians.
fn around_a_ball(half: [f64; 3]) -> Vec<(FrameOutcome, Option<(f64, f64)>)> {
    let hit = |o: &Point3<f64>, d: &Vector3<f64>| {
        let walls = (0..3).map(|k| (if d[k] > 0.0 { half[k] - o[k] } else { -half[k] - o[k] }) / d[k]);
        let wall = walls.fold(f64::INFINITY, f64::min);
        Some(hit_sphere(0.4)(o, d).filter(|t| *t > 1e-6).map_or(wall, |t| t.min(wall)))
    };
    let map = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut slam = Slam::new(SlamSettings { map, ..SlamSettings::default() }).unwrap();
    let pose = |k: usize| {
        let angle = 0.036 * k as f64;
        let eye = Vector3::new(angle.sin(), 0.0, -angle.cos());
        let roll = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.02 * k.saturating_sub(10) as f64);
        Isometry3::from_parts(eye.into(), UnitQuaternion::face_towards(&-eye, &Vector3::y()) * roll)
    };
    (0..FRAMES)
        .map(|k| {
            let shot = Shot::take((320, 240), [262.5; 2], pose(k), hit);
            let outcome = slam.frame(k as f64 / 30.0, &shot.view(), None, (k == 0).then(|| pose(0)).as_ref()).unwrap();
            let off = outcome.world_from_camera.map(|found| apart(&found, &pose(k)));
            (outcome, off)
        })
        .collect()
}

/// The walls, floor and ceiling weigh little beside the ball, whose noise is a tenth of theirs, but they fix the turn about it.
#[test]
fn far_walls_fix_what_a_near_ball_does_not() {
    for (outcome, off) in around_a_ball([2.2, 0.8, 2.2]) {
        assert!(off.is_some_and(|(metres, _)| metres < 0.01), "{off:?} {outcome:?}");
    }
}

/// Before one wall, nothing fixes the turn about the ball's axis but the rims of what was seen: no frame is fused along a guess. The
/// first one hides the same of the wall however the camera turns.
#[test]
fn what_nothing_fixes_is_left_out() {
    for (k, (outcome, off)) in around_a_ball([2.2; 3]).into_iter().skip(1).enumerate() {
        let tracking = outcome.tracking.as_ref().unwrap();
        if let Some((metres, radians)) = off {
            assert!(
                k > 0 && tracking.is_tracked() && metres < 5e-3 && radians < 2e-3,
                "{k}: {metres} m, {radians} rad"
            );
            continue;
        }
        assert_eq!((tracking.status, tracking.is_tracked()), (TrackingStatus::Degenerate, false));
        let left_out = |event: &Event| matches!(event, Event::LeftOut { why: LeftOut::Degenerate { .. }, .. });
        assert!(outcome.events.iter().any(left_out), "{outcome:?}");
    }
}
