//! What can be chosen about the robot and its spray, and what is said where a choice falls short.

use std::process::Command;

use serde_json::Value;

use crate::scratch::Scratch;

/// A closed box of 1 m.
const BOX: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// The report of a preview of the box.
fn preview(more: &[&str]) -> Value {
    let s = Scratch::new("choices");
    s.write("box.obj", BOX);
    let output = Command::new(env!("CARGO_BIN_EXE_paintcopter"))
        .current_dir(&s.0)
        .args(["--mesh", "box.obj", "--up", "z", "--texel", "0.05", "--spot", "0.05", "--preview", "--out", "out"])
        .args(more)
        .output()
        .unwrap();
    assert!(output.status.success(), "{more:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&std::fs::read(s.0.join("out/report.json")).unwrap()).unwrap()
}

/// Two of six sides face up and down, and a joint that goes further reaches them: what the report of the usual robot says comes true.
#[test]
fn a_tilt_joint_that_goes_further_reaches_tops_and_undersides() {
    let usual = preview(&[]);
    let share = |report: &Value, name: &str| report[name].as_f64().unwrap();
    for side in ["unreached_tops_share", "unreached_undersides_share"] {
        // Along its rim the smooth normal leans to the other side.
        assert!((share(&usual, side) - 1.0 / 6.0).abs() < 0.05, "{side}: {usual}");
    }
    let promised = share(&usual, "reach_needs_tilt_share");
    assert!(promised > 0.15, "{usual}");
    let steep = preview(&["--tilt", "80"]);
    let won = share(&steep, "reach_share") - share(&usual, "reach_share");
    assert!((won - promised).abs() < 0.02, "{promised:.3} promised, {won:.3} won");
}

#[test]
fn both_ends_of_the_stand_off_and_a_longer_arm_are_flown() {
    for more in [["--stand-off", "0.15"], ["--stand-off", "0.05"], ["--arm", "0.9"]] {
        assert!(preview(&more)["reach_share"].as_f64().unwrap() > 0.4, "{more:?}");
    }
}

#[cfg(feature = "paint-image")]
#[test]
fn a_picture_too_large_for_the_memory_is_refused_before_it_is_read() {
    let s = Scratch::new("memory");
    image::GrayImage::new(2000, 1000).save(s.0.join("large.png")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_paint-image"))
        .args(["--image", &s.path("large.png"), "--memory-gib", "0.2", "--out", &s.path("out")])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && text.contains("2000 x 1000") && text.contains("--memory-gib"), "{text}");
    assert!(!s.0.join("out").exists());
}

#[cfg(feature = "handheld")]
#[test]
fn a_mesh_without_target_gets_an_atlas_to_paint_on() {
    let s = Scratch::new("no-target");
    s.write("box.obj", BOX);
    let output = Command::new(env!("CARGO_BIN_EXE_handheld"))
        .args(["--mesh", &s.path("box.obj"), "--texel", "0.05", "--out", &s.path("out")])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    let atlas = image::open(s.0.join("out/atlas.png")).unwrap();
    let size = format!("{} x {} texels", atlas.width(), atlas.height());
    assert!(output.status.code() == Some(1) && text.contains("--target") && text.contains(&size), "{text}");
}
