//! Views seen from elsewhere, and the incremental ray cast of reloaded blocks.

use nalgebra::{Isometry3, Point3, Vector3};
use tsdf_hash::ray_cast::{IncrementalRayCast, IncrementalRayCastSettings, RayCastSettings, View};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Error, Intrinsics, Map, Settings};

use crate::eviction::{FREE, add};
use crate::scene::{Shot, hit_sphere, look_at, room};

const SIZE: (usize, usize) = (160, 120);
const CAMERA: Intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };

/// The view that a perfect ray cast would make of surfaces with known normals.
fn analytic(shot: &Shot, normal: impl Fn(&Point3<f64>) -> Vector3<f64>) -> View {
    let mut view = View::new();
    (view.width, view.height) = (shot.width, shot.height);
    view.intrinsics = Some(shot.intrinsics);
    view.world_from_camera = shot.world_from_camera;
    view.depth.clone_from(&shot.depth);
    view.colours = (0..shot.depth.len()).map(|k| [(k % 251) as u8, 7, 9]).collect();
    view.weights = (0..shot.depth.len()).map(|k| (k % 1000) as u16 + 1).collect();
    let normal = |(at, z): (usize, &f32)| normal(&point(&view, at, *z)).cast::<f32>().into();
    view.normals = shot.depth.iter().enumerate().map(normal).collect();
    view
}

/// The point of a pixel in the world.
fn point(view: &View, at: usize, depth: f32) -> Point3<f64> {
    let (k, z) = (view.intrinsics.unwrap(), f64::from(depth));
    let (u, v) = ((at % view.width) as f64, (at / view.width) as f64);
    view.world_from_camera * Point3::new((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z)
}

fn assert_same(a: &View, b: &View) {
    assert_eq!((&a.depth, &a.normals), (&b.depth, &b.normals));
    assert_eq!((&a.colours, &a.weights), (&b.colours, &b.weights));
}

/// Difference from the analytic room: mean and share of hits among the pixels.
fn error(view: &View, shot: &Shot) -> (f64, f64) {
    let hits = view.depth.iter().zip(&shot.depth).filter(|(z, _)| **z > 0.0);
    let errors: Vec<f64> = hits.map(|(z, true_z)| f64::from((z - true_z).abs())).collect();
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.len() as f64 / view.depth.len() as f64)
}

/// Distances along a plane are linear, so that the cast is exact in every cell, those between two blocks included.
#[test]
fn a_cast_plane_is_the_plane() {
    let (normal, offset) = (Vector3::new(-0.8, 0.35, 0.25).normalize(), -1.3);
    let hit =
        |o: &Point3<f64>, d: &Vector3<f64>| Some((offset - normal.dot(&o.coords)) / normal.dot(d)).filter(|t| *t > 0.0);
    let from = look_at(Point3::new(0.1, -0.2, 0.3), Point3::new(1.5, -0.4, 0.5));
    let mut map = Map::new(FREE).unwrap();
    let shot = Shot::take((320, 240), [260.0; 2], from, hit);
    map.integrate(&shot.view(), None, &from).unwrap();
    let to = look_at(Point3::new(0.25, -0.1, 0.35), Point3::new(1.5, -0.35, 0.45));
    let expected = Shot::take(SIZE, [220.0; 2], to, hit);
    let view = map.ray_cast(&expected.intrinsics, SIZE.0, SIZE.1, &to, &RayCastSettings::default()).unwrap();
    let errors: Vec<f32> = view.depth.iter().zip(&expected.depth).map(|(z, true_z)| (z - true_z).abs()).collect();
    assert!(errors.iter().all(|e| *e < 2e-4), "{:?}", errors.iter().copied().fold(0.0, f32::max));
    assert!(view.normals.iter().all(|n| Vector3::from(n.map(f64::from)).dot(&normal) > 0.9999));
}

#[test]
fn a_warped_plane_is_the_plane() {
    // Oblique to both cameras; fy of either sign, and twice the focal length in the second image.
    let (normal, offset) = (Vector3::new(-0.8, 0.35, 0.25).normalize(), -1.3);
    let hit =
        |o: &Point3<f64>, d: &Vector3<f64>| Some((offset - normal.dot(&o.coords)) / normal.dot(d)).filter(|t| *t > 0.0);
    let from = look_at(Point3::new(0.1, -0.2, 0.3), Point3::new(1.5, -0.4, 0.5));
    let to = look_at(Point3::new(0.25, -0.1, 0.35), Point3::new(1.5, -0.35, 0.45));
    for (fy, zoom) in [(130.0, 1.0), (-130.0, 1.0), (130.0, 2.0)] {
        let view = analytic(&Shot::take(SIZE, [130.0, fy], from, hit), |_| normal);
        let expected = Shot::take(SIZE, [130.0 * zoom, fy * zoom], to, hit);
        let warped = view.warped(&expected.intrinsics, SIZE, &to).unwrap();
        assert_eq!(warped.world_from_camera, to);
        let mut inside = 0;
        for (at, (&z, &true_z)) in warped.depth.iter().zip(&expected.depth).enumerate() {
            // Where the first camera saw the point, a pixel away from the rim of its image.
            let seen = from.inverse_transform_point(&point(&warped, at, true_z));
            let (u, v) = (130.0 * seen.x / seen.z + 79.5, fy * seen.y / seen.z + 59.5);
            let visible = (1.0..158.0).contains(&u) && (1.0..118.0).contains(&v);
            inside += usize::from(visible);
            assert!(!visible || z > 0.0, "a hole at {at}");
            assert!(z == 0.0 || (z - true_z).abs() < 2e-6 * true_z, "{z} instead of {true_z}");
            if visible {
                // What is carried along comes from a pixel nearby.
                let source = usize::from(warped.weights[at]) - 1;
                let near = (0..SIZE.0 * SIZE.1).skip(source).step_by(1000).any(|k| {
                    let apart = [(k % SIZE.0) as f64 - u, (k / SIZE.0) as f64 - v];
                    warped.colours[at] == [(k % 251) as u8, 7, 9] && apart.iter().all(|d| d.abs() < 1.6)
                });
                assert!(near && (Vector3::from(warped.normals[at]) - normal.cast()).norm() < 1e-6);
            }
        }
        assert!(inside > 12_000, "{inside}");
    }
}

#[test]
fn a_view_warped_to_its_own_place_is_itself() {
    let shot =
        Shot::take(SIZE, [130.0; 2], look_at(Point3::new(3.0, -40.0, 2.0), Point3::new(2.0, -38.0, 2.1)), |o, d| {
            hit_sphere(0.7)(&Point3::from(o - Point3::new(2.0, -38.0, 2.0)), d)
        });
    let view = analytic(&shot, |p| (p - Point3::new(2.0, -38.0, 2.0)).normalize());
    let again = view.warped(&CAMERA, SIZE, &shot.world_from_camera).unwrap();
    assert!(again.hits() > 2000 && again.hits() == view.hits());
    assert_eq!(again.weights.iter().filter(|w| **w > 0).count(), view.hits());
    for (at, (z, before)) in again.depth.iter().zip(&view.depth).enumerate() {
        assert!((z - before).abs() < 2e-6 * before || (*z == 0.0 && *before == 0.0));
        assert!(*z == 0.0 || (again.normals[at], again.colours[at]) == (view.normals[at], view.colours[at]));
    }
}

#[test]
fn a_warped_sphere_keeps_to_its_surface_and_shows_no_back() {
    let hit = hit_sphere(0.6);
    let from = Shot::take(SIZE, [130.0; 2], look_at(Point3::new(2.0, 0.1, 0.2), Point3::origin()), &hit);
    let view = analytic(&from, |p| p.coords.normalize());
    // Pixels are 1.4 m / 130 = 11 mm apart on the sphere. A hit is at most 1.5 of that from the centre of a pixel that shows
    // it, 1.5 / cos on the surface: the tangent plane is off by (16 mm / cos)^2 / 2 r along the normal.
    let to = look_at(Point3::new(1.9, 0.6, 0.1), Point3::origin());
    let warped = view.warped(&CAMERA, SIZE, &to).unwrap();
    let mut checked = 0;
    for (at, &z) in warped.depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let p = point(&warped, at, z);
        let ray = (Point3::from(to.translation.vector) - p).normalize();
        let cosine = Vector3::from(warped.normals[at].map(f64::from)).dot(&ray);
        assert!(cosine > 0.0);
        if cosine > 0.4 {
            checked += 1;
            assert!((p.coords.norm() - 0.6).abs() < (0.016 / cosine).powi(2) / 1.2 + 1e-5, "{p} at {cosine}");
        }
    }
    assert!(checked > 2500, "{checked}");
    // From the other side nothing of it can be seen.
    let behind = look_at(Point3::new(-2.0, -0.1, -0.2), Point3::origin());
    assert_eq!(view.warped(&CAMERA, SIZE, &behind).unwrap().hits(), 0);
    // And a camera that is turned away sees nothing, without a division by what is beside it.
    let away = look_at(Point3::new(2.0, 0.1, 0.2), Point3::new(4.0, 0.0, 0.0));
    assert_eq!(view.warped(&CAMERA, SIZE, &away).unwrap().hits(), 0);
}

#[test]
fn a_room_warped_is_nearly_a_room_cast() {
    let mut map = Map::new(FREE).unwrap();
    let shots = room::tour(60, 2, &Isometry3::identity());
    for shot in &shots[..16] {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    let cast = |shot: &Shot| {
        map.ray_cast(&shot.intrinsics, shot.width, shot.height, &shot.world_from_camera, &RayCastSettings::default())
            .unwrap()
    };
    // Between two ray casts lies a sixth of what lies between these frames: 1 degree and 2 cm.
    let between = |t: f64| {
        let pose = shots[7].world_from_camera.lerp_slerp(&shots[8].world_from_camera, t);
        Shot::take((320, 240), [262.5; 2], pose, |o, d| Some(room::hit(o, d)))
    };
    let (from, to) = (between(0.0), between(1.0 / 3.0));
    let full = cast(&to);
    let warped = cast(&from).warped(&to.intrinsics, (320, 240), &to.world_from_camera).unwrap();
    let ((full_mean, full_fill), (mean, fill)) = (error(&full, &to), error(&warped, &to));
    println!("cast {:.3} mm, {full_fill:.4}; warped {:.3} mm, {fill:.4}", 1e3 * full_mean, 1e3 * mean);
    // What the first camera saw of the second image: the rest is new.
    let k = from.intrinsics;
    let known = (0..320 * 240)
        .filter(|&at| {
            let p = from.world_from_camera.inverse_transform_point(&point(&full, at, to.depth[at]));
            let (u, v) = ((k.fx * p.x / p.z + k.cx).round(), (k.fy * p.y / p.z + k.cy).round());
            (0.0..320.0).contains(&u)
                && (0.0..240.0).contains(&v)
                && (p.z / f64::from(from.depth[v as usize * 320 + u as usize]) - 1.0).abs() < 0.01
        })
        .count() as f64
        / (320.0 * 240.0);
    println!("{known:.4} known");
    assert!(mean < 1.25 * full_mean && fill > known - 0.02 && fill < known + 0.02);
    // Where both see something, all but the rims of things agree.
    let both: Vec<f32> = (full.depth.iter().zip(&warped.depth))
        .filter(|(a, b)| **a > 0.0 && **b > 0.0)
        .map(|(a, b)| (a - b).abs())
        .collect();
    let near = both.iter().filter(|e| **e < 1e-3).count() as f64 / both.len() as f64;
    println!("{near:.4} within 1 mm");
    assert!(near > 0.97, "{near}");
}

#[test]
fn views_that_make_no_sense_are_refused() {
    let shot = Shot::take(SIZE, [130.0; 2], Isometry3::identity(), |_, _| Some(1.0));
    let view = analytic(&shot, |_| -Vector3::z());
    let here = Isometry3::identity();
    assert!(matches!(view.warped(&CAMERA, (0, 5), &here), Err(Error::InvalidSize { .. })));
    let none = Intrinsics { fx: f64::NAN, ..CAMERA };
    assert!(matches!(view.warped(&none, SIZE, &here), Err(Error::InvalidIntrinsics { .. })));
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(matches!(view.warped(&CAMERA, SIZE, &nowhere), Err(Error::InvalidPose { .. })));
    let mut short = view.clone();
    short.normals.clear();
    assert!(matches!(short.warped(&CAMERA, SIZE, &here), Err(Error::WrongLength { .. })));
    assert_eq!(View::new().warped(&CAMERA, SIZE, &here).unwrap().hits(), 0);
    // Pixels that are no numbers are no hits.
    let mut odd = view.clone();
    odd.depth[..300].fill(f32::NAN);
    odd.depth[300..600].fill(f32::INFINITY);
    odd.normals[600..900].fill([f32::NAN; 3]);
    let warped = odd.warped(&CAMERA, SIZE, &here).unwrap();
    assert!(warped.hits() >= view.hits() - 900 && warped.depth.iter().all(|z| *z == 0.0 || (z - 1.0).abs() < 1e-5));
    // A lens that would make a splat of the whole image of each hit.
    let tele = Intrinsics { fx: 1e6, fy: 1e6, ..CAMERA };
    view.warped(&tele, SIZE, &here).unwrap();
    for settings in [
        IncrementalRayCastSettings { alpha: 1.1, ..IncrementalRayCastSettings::default() },
        IncrementalRayCastSettings { max_weight: 0.0, ..IncrementalRayCastSettings::default() },
        IncrementalRayCastSettings { neighbour_share: f64::NAN, ..IncrementalRayCastSettings::default() },
        IncrementalRayCastSettings { min_depth: 7.0, ..IncrementalRayCastSettings::default() },
    ] {
        assert!(matches!(IncrementalRayCast::new(settings), Err(Error::InvalidSetting { .. })));
    }
}

/// A map that has seen `first`, then something else for long, and then `first` again: its blocks were reloaded and wait.
fn revisited(first: &Shot, times: usize, transfers: usize) -> Map {
    revisited_with(&vec![first; times], transfers)
}

fn revisited_all(shots: &[&Shot]) -> Map {
    revisited_with(shots, 1 << 20)
}

fn revisited_with(shots: &[&Shot], transfers: usize) -> Map {
    let limits = MemoryLimits { host_bytes: 16 << 20, max_age: 1.0, max_transfers: transfers, ..FREE.memory };
    let memory = MemoryLimits { merge_timeout: f64::MAX, ..limits };
    let mut map = Map::new(Settings { memory, ..FREE }).unwrap();
    // A wall far from everything else.
    let aside = look_at(Point3::new(50.0, 0.0, 0.0), Point3::new(51.0, 0.0, 0.0));
    let aside = Shot::take((32, 24), [30.0; 2], aside, |o, d| Some((51.0 - o.x) / d.x));
    let mut see = |time: f64, shot: &Shot| map.integrate_at(time, &shot.view(), None, &shot.world_from_camera).unwrap();
    for (k, shot) in shots.iter().enumerate() {
        see(k as f64 * 0.01, shot);
    }
    for k in 0..200 {
        see(10.0 + f64::from(k) * 0.01, &aside);
    }
    assert!(map.reloaded_blocks().is_empty());
    // Without the repetitions.
    let mut seen: Vec<&Shot> = Vec::new();
    for &shot in shots {
        if !seen.iter().any(|other| std::ptr::eq(*other, shot)) {
            map.integrate_at(30.0 + seen.len() as f64 * 0.01, &shot.view(), None, &shot.world_from_camera).unwrap();
            seen.push(shot);
        }
    }
    assert!(!map.reloaded_blocks().is_empty());
    map
}

#[test]
fn an_incremental_ray_cast_shows_the_old_surface() {
    let wall = (Vector3::new(-0.8, 0.35, 0.25).normalize(), -1.3);
    let plane = move |o: &Point3<f64>, d: &Vector3<f64>| {
        Some((wall.1 - wall.0.dot(&o.coords)) / wall.0.dot(d)).filter(|t| *t > 0.0)
    };
    let eye = look_at(Point3::new(0.1, -0.2, 0.3), Point3::new(1.5, -0.4, 0.5));
    let map = revisited(&Shot::take(SIZE, [130.0; 2], eye, plane), 3, 1024);
    let mut old = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
    // One step of the stored distance is 2.4 um; the gradient of the sums is exact on a plane but for that.
    for (k, shift) in [0.0, 0.03, 0.06].into_iter().enumerate() {
        let pose = Isometry3::translation(0.0, shift, 0.0) * eye;
        let expected = Shot::take(SIZE, [130.0; 2], pose, plane);
        let read = old.update(&map.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
        // Only what was cut by the rim of the image is read again.
        assert!(if k == 0 { read > 100 } else { read > 0 && read < 100 }, "{read}");
        let view = old.view();
        assert!(view.hits() > 16_000, "{}", view.hits());
        for (at, (z, true_z)) in view.depth.iter().zip(&expected.depth).enumerate().filter(|(_, (z, _))| **z > 0.0) {
            assert!((z - true_z).abs() < 1e-4, "{z} instead of {true_z}");
            assert!(Vector3::from(view.normals[at].map(f64::from)).dot(&wall.0) > 0.9999);
            assert!((0.0..=1.0).contains(&old.reliability()[at]) && view.weights[at] > 0);
        }
    }
    old.clear();
    assert!(old.view().depth.is_empty() && old.reliability().is_empty());
}

#[test]
fn an_incremental_ray_cast_of_a_sphere_lies_on_it() {
    let shot = Shot::take(SIZE, [130.0; 2], look_at(Point3::new(1.8, 0.1, 0.2), Point3::origin()), hit_sphere(0.6));
    let map = revisited(&shot, 3, 1024);
    let mut old = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
    let pose = look_at(Point3::new(1.75, 0.2, 0.2), Point3::origin());
    old.update(&map.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
    let view = old.view();
    let mut errors = Vec::new();
    for (at, &z) in view.depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let p = point(view, at, z);
        let outward = p.coords.normalize();
        if outward.dot(&(Point3::from(pose.translation.vector) - p).normalize()) > 0.5 {
            errors.push((p.coords.norm() - 0.6).abs());
            assert!(Vector3::from(view.normals[at].map(f64::from)).dot(&outward) > 0.97);
        }
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("{} pixels, mean error {:.3} mm", errors.len(), 1e3 * mean);
    // A tenth of a voxel.
    assert!(errors.len() > 2000 && mean < 0.002, "{} {mean}", errors.len());
}

#[test]
fn blocks_reloaded_in_parts_end_where_all_at_once_do() {
    let shot = Shot::take(SIZE, [130.0; 2], room::pose(0, 60), |o, d| Some(room::hit(o, d)));
    let pose = shot.world_from_camera;
    let mut slow = revisited(&shot, 2, 60);
    let mut parts_of = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
    let mut fill = Vec::new();
    for k in 0..40 {
        parts_of.update(&slow.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
        fill.push(parts_of.view().hits());
        slow.integrate_at(31.0 + f64::from(k) * 0.01, &shot.view(), None, &pose).unwrap();
    }
    parts_of.update(&slow.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
    assert!(fill[0] > 0 && 4 * fill[0] < fill[39] && fill.is_sorted(), "{fill:?}");
    let fast = revisited(&shot, 2, 1 << 20);
    let once = || {
        let mut view = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
        view.update(&fast.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
        view
    };
    let (once, again) = (once(), once());
    assert_same(once.view(), again.view());
    assert_eq!(once.reliability(), again.reliability());
    assert_eq!(fast.reloaded_blocks().blocks(), slow.reloaded_blocks().blocks());
    // The same surface: entries were rounded to pixels on the way, borders had one-sided gradients for a while.
    let (a, b) = (error(once.view(), &shot), error(parts_of.view(), &shot));
    println!("at once {:.3} mm, {:.4}; in parts {:.3} mm, {:.4}", 1e3 * a.0, a.1, 1e3 * b.0, b.1);
    assert!(a.0 < 0.01 && a.1 > 0.95 && b.0 < 0.01 && b.1 > 0.95);
    // Nothing arrives any more: the view stays, and does not creep.
    let before = parts_of.clone();
    for _ in 0..5 {
        parts_of.update(&slow.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
    }
    assert!(parts_of.view().hits().abs_diff(before.view().hits()) < 20);
}

#[test]
fn reliability_is_that_of_the_paper() {
    // A wall that lies in the middle between voxels, at x = 1.01: the nearest are at a distance of h / 2 = mu / 8.
    let pose = look_at(Point3::origin(), Point3::new(1.0, 0.0, 0.0));
    let shot = Shot::take(SIZE, [130.0; 2], pose, |o, d| Some((1.0 - o.x) / d.x));
    let map = revisited(&shot, 3, 1024);
    for (alpha, max_weight) in [(0.5, 20.0), (0.25, 60_000.0), (1.0, 1.0), (0.0, 1.0)] {
        let settings = IncrementalRayCastSettings { alpha, max_weight, ..IncrementalRayCastSettings::default() };
        let mut old = IncrementalRayCast::new(settings).unwrap();
        old.update(&map.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap();
        let mut whole = 0;
        for (at, &found) in old.reliability().iter().enumerate().filter(|(at, _)| old.view().depth[*at] > 0.0) {
            let observed = (f64::from(old.view().weights[at]) / max_weight).min(1.0);
            let most = alpha * observed + (1.0 - alpha) * (1.0 - 0.125);
            // Its own pixel, or one beside; in the middle of the wall the nearest voxels win.
            let share = f64::from(found) / most;
            assert!(share < 1.0 + 1e-3, "{found} instead of {most}");
            whole += usize::from((share - 1.0).abs() < 1e-3);
        }
        assert!(whole > 2000, "{whole} at {alpha}");
    }
    let mut coloured = Map::new(FREE).unwrap();
    add(&mut coloured, &shot).unwrap();
    assert!(coloured.reloaded_blocks().is_empty());
    let mut none = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
    assert_eq!(none.update(&coloured.reloaded_blocks(), &CAMERA, SIZE, &pose).unwrap(), 0);
    assert_eq!(none.view().hits(), 0);
}

/// A plate in front of a wall.
#[allow(clippy::unnecessary_wraps, reason = "scenes may be missed by a ray; this one is not")]
fn plate_and_wall(o: &Point3<f64>, d: &Vector3<f64>) -> Option<f64> {
    let at = |x: f64| (x - o.x) / d.x;
    let plate = o + d * at(1.0);
    let hit = plate.y.abs() < 0.25 && plate.z.abs() < 0.25;
    Some(if hit { at(1.0) } else { at(2.0) })
}

/// The wall is hidden by the plate from the new camera, and was seen by the old one.
#[test]
fn what_is_occluded_is_not_shown() {
    let from = look_at(Point3::new(0.0, 0.9, 0.0), Point3::new(1.5, 0.35, 0.0));
    let to = look_at(Point3::new(0.0, 0.0, 0.0), Point3::new(1.5, 0.0, 0.0));
    let shot = Shot::take(SIZE, [130.0; 2], from, plate_and_wall);
    let expected = Shot::take(SIZE, [130.0; 2], to, plate_and_wall);
    // The middle of the plate as the new camera sees it.
    let middle: Vec<usize> = (0..SIZE.0 * SIZE.1)
        .filter(|at| (at % SIZE.0).abs_diff(SIZE.0 / 2) < 20 && (at / SIZE.0).abs_diff(SIZE.1 / 2) < 20)
        .collect();
    assert!(middle.iter().all(|&at| (expected.depth[at] - 1.0).abs() < 1e-6));
    let check = |view: &View| {
        let shown: Vec<f32> = middle.iter().map(|&at| view.depth[at]).filter(|z| *z > 0.0).collect();
        assert!(shown.len() > 1000, "{}", shown.len());
        assert!(shown.iter().all(|z| (z - 1.0).abs() < 0.02), "{:?}", shown.iter().find(|z| **z > 1.1));
    };
    let view = analytic(&shot, |_| -Vector3::x());
    check(&view.warped(&CAMERA, SIZE, &to).unwrap());
    // Weight counts more than distance here, and the wall has been seen from near, too: it is the more reliable one.
    let near = look_at(Point3::new(1.4, 0.0, 0.0), Point3::new(2.0, 0.0, 0.0));
    let near = Shot::take(SIZE, [130.0; 2], near, |o, d| Some((2.0 - o.x) / d.x));
    let map = revisited_all(&[&shot, &near, &near, &near]);
    let mut old = IncrementalRayCast::new(IncrementalRayCastSettings::default()).unwrap();
    old.update(&map.reloaded_blocks(), &CAMERA, SIZE, &to).unwrap();
    check(old.view());
}

/// Every ray of an image one by one, against the closed form; along the axes, oblique, and from outside of all blocks.
#[test]
fn single_rays_meet_the_room_where_it_is() {
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    for shot in room::tour(20, 2, &Isometry3::identity()) {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    let (mut hits, mut errors) = (0, Vec::new());
    for k in 0..400 {
        let pose = room::pose(k, 400);
        let origin = Point3::from(pose.translation.vector);
        let aside = 0.4 * (f64::from(k as u32) * 0.7).sin();
        let direction = pose.rotation * Vector3::new(aside, 0.1, 1.0) * 3.0;
        let expected = room::hit(&origin, &direction) * direction.norm();
        let Some(hit) = map.cast(&origin, &direction, 10.0) else { continue };
        hits += 1;
        errors.push((hit.distance - expected).abs());
        assert!((hit.point - origin).norm() - hit.distance < 1e-9 && hit.normal.dot(&direction) < 0.0);
        // A shorter ray ends before it.
        assert!(map.cast(&origin, &direction, hit.distance - 0.05).is_none());
    }
    errors.sort_unstable_by(f64::total_cmp);
    assert!(hits > 380, "{hits}");
    assert!(
        errors[hits / 2] < 0.5e-3 && errors[hits * 9 / 10] < 5e-3,
        "{} {}",
        errors[hits / 2],
        errors[hits * 9 / 10]
    );
    let origin = Point3::new(0.0, 0.0, 1.5);
    assert!(map.cast(&origin, &Vector3::zeros(), 10.0).is_none());
    assert!(map.cast(&origin, &Vector3::x(), f64::NAN).is_none());
    assert!(map.cast(&Point3::new(1e9, 0.0, 0.0), &Vector3::x(), 1.0).is_none());
}
