//! Drift that was put in is measured, loops are found, and what was mapped on the way is corrected.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use tsdf_hash::loop_closure::{LoopCloser, LoopSettings};
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::tracking::{Tracker, TrackingSettings};
use tsdf_hash::{Error, Map, Settings};

use crate::noisy_room::{alignment, apart, seen, shot, unit};
use crate::random::Random;
use crate::scene::{Shot, room};

/// What became of drift that was put in.
#[derive(Debug, Default)]
struct Measured {
    asked: usize,
    /// Views that fix the pose.
    found: usize,
    /// Measured to 2 mm and 0.1 degrees.
    exact: usize,
    /// Metres, radians.
    worst: [f64; 2],
}

/// 10 to 100 mm and 0.5 to 3 degrees in any direction, between the visit of the keyframes and a frame from there.
fn measured_drift(light: bool) -> Measured {
    let mut random = Random::new(17);
    let mut tracker = Tracker::new(TrackingSettings::default()).unwrap();
    let mut tally = Measured::default();
    let lit = |shot: Shot| if light { shot.painted(|p| room::colour(p, 0.0)) } else { shot };
    for k in 0..36_usize {
        let around = 10 * k;
        let mut keyframes = KeyframeIndex::new();
        let poses: Vec<_> = (0..7).map(|n| room::pose(around + 2 * n, 360)).collect();
        for pose in &poses {
            let shot = lit(seen(*pose, &mut random));
            keyframes.push(&shot.view(), shot.colour().as_ref(), pose).unwrap();
        }
        let mut old = keyframes.map_of(0..7, &poses, Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
        let truth = room::pose(around + 7, 360);
        let share = (k % 6) as f64 / 5.0;
        let (distance, angle) = (0.01 + 0.09 * share, (0.5 + 2.5 * share).to_radians());
        let drift = Isometry3::from_parts(
            (unit(&mut random) * distance).into(),
            UnitQuaternion::from_scaled_axis(unit(&mut random) * angle),
        );
        let drifted = Isometry3::from_parts(
            (truth.translation.vector + drift.translation.vector).into(),
            drift.rotation * truth.rotation,
        );
        tally.asked += 1;
        let present = lit(seen(truth, &mut random));
        let measured =
            tracker.drift(&mut old, &present.view(), present.colour().as_ref(), &drifted, None, &[drifted]).unwrap();
        // A view that does not fix the pose is told, not guessed.
        let Some(measured) = measured else { continue };
        tally.found += 1;
        assert!(measured.is_significant(), "{distance} m, {angle} rad: {}", measured.chi_squared);
        if k == 0 {
            // A present pose that is as uncertain as the registration halves what the distance is worth.
            let (mut tracker, both) = (Tracker::new(TrackingSettings::default()).unwrap(), measured.outcome.covariance);
            let (view, colour) = (present.view(), present.colour());
            let unsure = tracker.drift(&mut old, &view, colour.as_ref(), &drifted, Some(&both), &[drifted]);
            let share = unsure.unwrap().expect("found again").chi_squared / measured.chi_squared;
            assert!((share - 0.5).abs() < 1e-9, "{share}");
        }
        let (metres, radians) = apart(&measured.outcome.world_from_camera, &truth);
        let exact = metres < 2e-3 && radians < 0.1_f64.to_radians();
        tally.exact += usize::from(exact);
        // What is less exact says so.
        let covariance = &measured.outcome.covariance;
        let stated = covariance.fixed_view::<3, 3>(3, 3).trace().sqrt();
        assert!(exact || metres < 4.0 * stated, "{metres} m, stated {stated} m");
        tally.worst = [tally.worst[0].max(metres), tally.worst[1].max(radians)];
        let corrected = measured.corrected_from_drifted * drifted;
        assert!(apart(&corrected, &measured.outcome.world_from_camera).0 < 1e-9);
    }
    tally
}

#[test]
fn injected_drift_is_measured() {
    let lit = measured_drift(true);
    eprintln!("with colour: {lit:?}");
    assert!(10 * lit.found > 9 * lit.asked && 20 * lit.exact > 19 * lit.found, "{lit:?}");
    let dark = measured_drift(false);
    eprintln!("in the dark: {dark:?}");
    assert!(2 * dark.found > dark.asked && 10 * dark.exact > 9 * dark.found && dark.worst[0] < 8e-3, "{dark:?}");
}

/// Twice around the room by odometry that turns and shifts a little with every step.
pub(crate) fn drifting_tour(steps: usize, turns: usize) -> Vec<(Isometry3<f64>, Isometry3<f64>)> {
    let error = Isometry3::new(Vector3::new(1.2e-3, -0.8e-3, 0.6e-3), Vector3::new(2e-4, 7e-4, -3e-4));
    let mut believed = room::pose(0, steps);
    (0..steps * turns)
        .map(|k| {
            let truth = room::pose(k, steps);
            if k > 0 {
                believed *= room::pose(k - 1, steps).inverse() * truth * error;
            }
            (truth, believed)
        })
        .collect()
}

/// Mean distance of the mesh, put where it belongs, from the true surface, metres.
fn surface_error(map: &Map, world_from_map: &Isometry3<f64>) -> f64 {
    let mesh = map.mesh();
    let off = |p: &[f32; 3]| room::sdf(&(world_from_map * Point3::from(p.map(f64::from)))).abs().min(0.05);
    let sum: f64 = mesh.positions.iter().map(off).sum();
    sum / mesh.positions.len() as f64
}

/// What became of a tour that drifts; errors of the surface and of the poses, metres.
#[derive(Debug)]
struct Corrected {
    loops: usize,
    corrections: usize,
    /// Mean error of the mesh: before the first correction, and at the end.
    surface: [f64; 2],
    worst_pose: f64,
    /// Both at the end, with all poses laid over the true ones: the first pose, which is held, is as uncertain as any other.
    aligned: [f64; 2],
    /// Mean error of the mesh of the keyframes alone, aligned, and with their true poses: the frames between them are as good as the odometry.
    of_keyframes: [f64; 2],
}

/// Once and a quarter around the room by odometry that drifts; the map follows the corrections.
fn corrected_tour(light: bool) -> Corrected {
    let mut random = Random::new(23);
    let tour = drifting_tour(72, 2);
    let lit = |shot: Shot| if light { shot.painted(|p| room::colour(p, 0.0)) } else { shot };
    let shots: Vec<Shot> = tour[..90].iter().map(|(truth, _)| lit(seen(*truth, &mut random))).collect();
    let settings = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut map = Map::new(settings).unwrap();
    let mut closer = LoopCloser::new(LoopSettings::default()).unwrap();
    // Where each frame is in the map, and the keyframe that it belongs to.
    let mut fused: Vec<(Isometry3<f64>, usize)> = Vec::new();
    let mut correction = Isometry3::identity();
    let (mut corrections, mut loops, mut drifted_error) = (0, 0, 0.0);
    for (shot, (truth, believed)) in shots.iter().zip(&tour) {
        let pose = correction * believed;
        map.integrate(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
        let report = closer.add(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
        fused.push((pose, closer.poses().len() - 1));
        for found in &report.loops {
            loops += 1;
            let measured = closer.graph().betweens.iter().find(|f| f.first == found.old && f.second == found.present);
            assert!(measured.is_some() && found.drift.outcome.agreement > 0.85);
        }
        if let Some(before) = report.corrected_from {
            if corrections == 0 {
                drifted_error = surface_error(&map, &Isometry3::identity());
                assert!(apart(&pose, truth).0 > 0.04, "the drift is worth measuring");
            }
            corrections += 1;
            for (shot, (pose, keyframe)) in shots.iter().zip(&mut fused) {
                let moved = closer.poses()[*keyframe] * before[*keyframe].inverse() * *pose;
                map.deintegrate(&shot.view(), shot.colour().as_ref(), pose).unwrap();
                map.integrate(&shot.view(), shot.colour().as_ref(), &moved).unwrap();
                *pose = moved;
            }
            correction = fused[fused.len() - 1].0 * believed.inverse();
        }
    }
    if light {
        // Reversible: the map is that of its frames at their corrected poses.
        let mut anew = Map::new(settings).unwrap();
        for (shot, (pose, _)) in shots.iter().zip(&fused) {
            anew.integrate(&shot.view(), shot.colour().as_ref(), pose).unwrap();
        }
        assert_eq!(anew.hash(), map.hash());
    }
    let (poses, truth): (Vec<_>, Vec<_>) =
        fused.iter().zip(&tour).map(|((pose, _), (truth, _))| (*pose, *truth)).unzip();
    let worst = |from: &Isometry3<f64>| {
        poses.iter().zip(&truth).map(|(pose, truth)| apart(&(from * pose), truth).0).fold(0.0, f64::max)
    };
    let (held, best) = (Isometry3::identity(), alignment(&poses, &truth));
    let of_keyframes = [&poses, &truth].map(|poses| {
        let mut map = Map::new(settings).unwrap();
        let mut last = usize::MAX;
        for ((shot, pose), (_, keyframe)) in shots.iter().zip(poses).zip(&fused) {
            if std::mem::replace(&mut last, *keyframe) != *keyframe {
                map.integrate(&shot.view(), shot.colour().as_ref(), pose).unwrap();
            }
        }
        surface_error(&map, &alignment(poses, &truth))
    });
    Corrected {
        loops,
        corrections,
        surface: [drifted_error, surface_error(&map, &held)],
        worst_pose: worst(&held),
        aligned: [surface_error(&map, &best), worst(&best)],
        of_keyframes,
    }
}

#[test]
fn a_loop_is_found_and_the_map_is_corrected() {
    let found = corrected_tour(true);
    eprintln!("with colour: {found:?}");
    assert!(found.corrections > 0 && found.loops > 0, "{found:?}");
    assert!(found.surface[1] < 0.1 * found.surface[0] && found.worst_pose < 8e-3, "{found:?}");
    assert!(found.aligned[0] < 1.2e-3 && found.aligned[1] < 4e-3, "{found:?}");
    assert!(found.of_keyframes[0] < 1.5 * found.of_keyframes[1], "{found:?}");
}

/// Where walls slide along themselves, depth alone corrects less.
#[test]
fn a_loop_in_the_dark_is_corrected_too() {
    let found = corrected_tour(false);
    eprintln!("in the dark: {found:?}");
    assert!(found.corrections > 0 && found.loops > 0, "{found:?}");
    assert!(found.surface[1] < 0.3 * found.surface[0] && found.worst_pose < 20e-3, "{found:?}");
}

#[test]
fn without_drift_nothing_is_corrected() {
    let mut closer = LoopCloser::new(LoopSettings::default()).unwrap();
    let (mut loops, mut compared) = (0, 0);
    for k in 0..80 {
        let pose = room::pose(k, 72);
        let report = closer.add(&shot(pose).view(), None, &pose).unwrap();
        compared += report.compared;
        loops += report.loops.len();
        for found in &report.loops {
            let off = found.drift.distance(&pose);
            assert!(off < 4e-3 && found.drift.angle() < 3e-3, "{off} m");
        }
    }
    assert!(loops > 2 && compared >= loops, "{loops} of {compared}");
    for (k, pose) in closer.poses().iter().enumerate() {
        let nearest = (0..80).map(|n| apart(pose, &room::pose(n, 72)).0).fold(f64::INFINITY, f64::min);
        assert!(nearest < 5e-3, "keyframe {k} has moved by {nearest} m");
    }
}

#[test]
fn keyframes_survive_their_bytes_and_damage_is_named() {
    let mut index = KeyframeIndex::new();
    for k in 0..4 {
        let pose = room::pose(10 * k, 72);
        index.push(&shot(pose).view(), None, &pose).unwrap();
    }
    let bytes = index.to_bytes();
    let again = KeyframeIndex::from_bytes(&bytes).unwrap();
    assert_eq!((again.len(), again.bytes(), again.to_bytes()), (4, index.bytes(), bytes.clone()));
    let view = shot(room::pose(10, 72));
    let best = again.candidates(&view.view(), None, 1, |_| true).unwrap();
    assert!(best[0].keyframe == 1 && best[0].correlation > 0.999, "{best:?}");
    assert!(apart(&best[0].world_from_camera, &view.world_from_camera).1 < 1e-6);
    for cut in [0, 7, 12, 40, bytes.len() / 2, bytes.len() - 1] {
        assert!(matches!(KeyframeIndex::from_bytes(&bytes[..cut]), Err(Error::CorruptFile { .. })), "{cut}");
    }
    let mut random = Random::new(1);
    for _ in 0..300 {
        let mut damaged = bytes.clone();
        let at = (random.uniform() * damaged.len() as f64) as usize;
        damaged[at] ^= 1 << (8.0 * random.uniform()) as u8;
        let _ = KeyframeIndex::from_bytes(&damaged);
    }
    // A budget for one and a half depth images: the rest makes room, the newest stays.
    let each = index.bytes() / 4;
    let mut small = KeyframeIndex::with_budget(4 * each);
    let poses: Vec<_> = (0..8).map(|k| room::pose(10 * k, 72)).collect();
    for pose in &poses {
        small.push(&shot(*pose).view(), None, pose).unwrap();
    }
    assert!(small.bytes() <= 4 * each && small.len() == 8 && small.without_depth() >= 3, "{}", small.bytes());
    let settings = Settings { voxel_size: 0.02, ..Settings::default() };
    assert!(small.map_of(7..8, &poses, settings).unwrap().blocks() > 0);
    assert_eq!(small.map_of(1..2, &poses, settings).unwrap().blocks(), 0);
}
