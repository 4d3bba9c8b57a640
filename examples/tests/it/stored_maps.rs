//! A camera is found in a stored map, and nowhere else; loops that are looked for where there are none change nothing.

use std::path::Path;

use image::{ImageBuffer, Luma};
use vio_ekf::format::tum;

use crate::scratch::Scratch;
use crate::strange_recordings::{FRAMES, SIZE, change, pose, recording, scan};

fn copied(s: &Scratch, name: &str) -> String {
    let map = s.path(name);
    std::fs::copy(s.0.join("out/map.tsdf"), &map).unwrap();
    map
}

/// Largest distance of the written positions from the true ones.
fn worst(folder: &Path) -> f64 {
    let found = tum::read(&std::fs::read_to_string(folder.join("out/trajectory.tum")).unwrap()).unwrap();
    let apart = found.stamps().iter().zip(found.poses()).map(|(stamp, found)| {
        let k = ((stamp.as_secs() - 10.0) / 0.1).round() as usize;
        (found.translation.vector - pose(k).translation.vector).norm()
    });
    apart.fold(0.0, f64::max)
}

#[test]
fn a_camera_is_found_in_a_stored_map() {
    let s = recording("stored");
    let mapped = scan(&s, &[]);
    assert!(mapped.ok && mapped.figure("keyframes") >= 1.0, "{}", mapped.said);
    let map = copied(&s, "stored.tsdf");
    // Another visit, of which nobody knows the poses: it begins in the middle.
    std::fs::remove_file(s.0.join("groundtruth.txt")).unwrap();
    let ran = scan(&s, &["--relocalise", &map, "--frames", "3.."]);
    assert!(ran.ok, "{}", ran.said);
    assert_eq!((ran.figure("frames"), ran.figure("tracking_relocalisations")), (FRAMES as f64 - 3.0, 1.0));
    assert_eq!(ran.report["map_hash"], mapped.report["map_hash"], "nothing is fused");
    assert!(worst(&s.0) < 5e-3, "{} m", worst(&s.0));
    // Mapping on changes the map; what is stored then is found again.
    let ran = scan(&s, &["--relocalise", &map, "--extend"]);
    assert!(ran.ok && ran.report["map_hash"] != mapped.report["map_hash"], "{}", ran.said);
    let again = copied(&s, "extended.tsdf");
    let ran = scan(&s, &["--relocalise", &again]);
    assert!(ran.ok && ran.figure("frames") == FRAMES as f64, "{}", ran.said);
}

#[test]
fn a_camera_elsewhere_is_not_found() {
    let s = recording("elsewhere");
    assert!(scan(&s, &[]).ok);
    let map = copied(&s, "stored.tsdf");
    // Steps of a staircase that never were in the map.
    for k in 0..FRAMES as u32 {
        let image =
            ImageBuffer::from_fn(SIZE.0, SIZE.1, |u, v| Luma([1100 + 100 * ((v + k) / 15) as u16 + (u / 4) as u16]));
        image.save(s.0.join(format!("depth/{k}.png"))).unwrap();
        std::fs::remove_file(s.0.join(format!("rgb/{k}.png"))).unwrap();
    }
    std::fs::remove_file(s.0.join("rgb.txt")).unwrap();
    let ran = scan(&s, &["--relocalise", &map]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["none of the 12 frames", "no keyframe of the map agrees"]);
    // A map without keyframes says what to do.
    s.write("none.tsdf", "");
    let ran = scan(&s, &["--relocalise", &s.path("none.tsdf")]);
    assert!(!ran.ok && ran.said.contains("none.tsdf"), "{}", ran.said);
}

/// A third of what is seen has come nearer by 15 cm: too much to be believed where the map cannot learn, and no matter where it does.
#[test]
fn a_stored_map_is_not_believed_where_much_has_changed() {
    let s = recording("changed");
    assert!(scan(&s, &[]).ok);
    let map = copied(&s, "stored.tsdf");
    for k in 6..FRAMES {
        change(&s, k, |u, _, depth| if u < SIZE.0 / 3 { depth - 150 } else { depth });
    }
    let ran = scan(&s, &["--relocalise", &map]);
    assert!(!ran.ok && ran.figure("frames") == 6.0, "{}", ran.said);
    ran.says(&["the camera is lost", "of the pixels agree with the map"]);
    let ran = scan(&s, &["--relocalise", &map, "--extend"]);
    assert!(ran.ok && ran.figure("frames") == FRAMES as f64, "{}", ran.said);
}

/// Four frames of the mapped place, then a staircase that never was in the map.
#[test]
fn a_camera_that_leaves_the_map_is_said_to_be_lost() {
    let s = recording("leaves");
    assert!(scan(&s, &[]).ok);
    let map = copied(&s, "stored.tsdf");
    for k in 4..FRAMES as u32 {
        let image =
            ImageBuffer::from_fn(SIZE.0, SIZE.1, |u, v| Luma([1100 + 100 * ((v + k) / 15) as u16 + (u / 4) as u16]));
        image.save(s.0.join(format!("depth/{k}.png"))).unwrap();
    }
    let ran = scan(&s, &["--relocalise", &map]);
    assert!(!ran.ok && (ran.figure("frames"), ran.figure("tracking_relocalisations")) == (4.0, 1.0), "{}", ran.said);
    ran.says(&["only 4 of 12 frames were found in the map", "the camera is lost"]);
}

#[test]
fn keyframes_survive_a_resumed_run() {
    let s = recording("keyframes");
    let half = scan(&s, &["--frames", "..6", "--poses", "tracked"]);
    let map = copied(&s, "half.tsdf");
    let rest = scan(&s, &["--resume", &map, "--poses", "tracked"]);
    assert!(rest.ok && rest.figure("keyframes") >= half.figure("keyframes"), "{}", rest.said);
    assert!(half.figure("keyframes") >= 1.0);
}

#[test]
fn loops_are_looked_for_and_change_nothing_where_there_is_none() {
    let s = recording("no-loop");
    let (plain, ran) = (scan(&s, &[]), scan(&s, &["--loops"]));
    assert!(ran.ok, "{}", ran.said);
    assert_eq!((ran.figure("loops"), ran.figure("loop_corrections")), (0.0, 0.0));
    assert_eq!(plain.report["map_hash"], ran.report["map_hash"]);
    assert!(plain.report["loops"].is_null());
}
