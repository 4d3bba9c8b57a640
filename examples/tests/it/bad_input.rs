//! The binary on input that cannot be painted: one clear line, an exit code, no panic.

use std::path::Path;
use std::process::{Command, Output};

use crate::scratch::Scratch;

fn paintcopter(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_paintcopter")).args(arguments).arg("--out").arg(folder).output().unwrap()
}

/// Runs on a mesh and expects one line that holds all the words.
fn refused(scratch: &Scratch, arguments: &[&str], words: &[&str]) {
    let output = paintcopter(arguments, &scratch.0.join("out"));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
    let line =
        text.lines().find(|l| l.starts_with("paintcopter: ")).unwrap_or_else(|| panic!("no error line in {text}"));
    for word in words {
        assert!(line.contains(word), "\"{word}\" is missing in: {line}");
    }
    assert!(!text.contains("panicked"), "{text}");
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn meshes_that_are_no_surface_are_refused() {
    let s = Scratch::new("meshes");
    let mesh = |name: &str, text: &str, words: &[&str]| {
        s.write(name, text);
        let file = s.path(name);
        refused(&s, &["--mesh", &file], &[&[name], words].concat());
    };
    refused(&s, &["--mesh", "no/such/file.obj"], &["no/such/file.obj", "cannot be read"]);
    mesh("picture.fbx", "solid", &["extension", ".obj"]);
    mesh("nothing.stl", "solid", &["no triangle"]);
    mesh("line.stl", "solid\nvertex 0 0 0\nvertex 1 0 0\nendloop\n", &["line 4", "three vertices"]);
    mesh("empty.obj", "", &["no triangle"]);
    mesh("points.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", &["no triangle"]);
    mesh("index.obj", &format!("{SQUARE}f 1 2 9\n"), &["line 5", "9"]);
    mesh("word.obj", "v 0 zero 0\n", &["line 1", "zero"]);
    mesh("short.off", "OFF\n4 2 0\n0 0 0\n", &["fewer lines"]);
    mesh("nan.obj", &format!("{SQUARE}v nan 0 0\nf 1 2 3\nf 1 3 5\n"), &["not finite"]);
    mesh("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", &["no extent"]);
    mesh("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", &["area"]);
    mesh("broken.ply", "ply\nformat ascii 1.0\nelement vertex 2\n", &["broken.ply"]);
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let s = Scratch::new("options");
    let file = |name: &str, text: &str| {
        s.write(name, text);
        s.path(name)
    };
    let square = file("square.obj", &format!("{SQUARE}f 1 2 3\nf 1 3 4\n"));
    refused(&s, &["--mesh", &square, "--scale", "-1"], &["--scale -1", "positive"]);
    refused(&s, &["--mesh", &square, "--scale", "60"], &["3600 m²", "--scale", "--memory-gib"]);
    refused(&s, &["--mesh", &square, "--design", "zebra"], &["zebra", "stripes"]);
    refused(&s, &["--mesh", &square, "--design", "colours"], &["vertex colours"]);
    refused(&s, &["--mesh", &square, "--texture", "none.png"], &["texture coordinates"]);
    let textured = file("textured.obj", &format!("{SQUARE}vt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"));
    refused(&s, &["--mesh", &textured, "--texture", "none.png"], &["none.png"]);
    let not_a_picture = file("design.png", "this is text");
    refused(&s, &["--mesh", &square, "--design", &not_a_picture], &["design.png", "picture"]);
}

#[test]
fn a_surface_that_no_gun_reaches_is_refused() {
    // A sheet folded flat: one half looks up, the other down.
    let s = Scratch::new("flat");
    let text = "OFF\n6 4 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 -0.05\n0 1 -0.05\n3 0 1 2\n3 0 2 3\n3 1 4 5\n3 1 5 2\n";
    s.write("sheet.off", text);
    let sheet = s.path("sheet.off");
    refused(&s, &["--mesh", &sheet, "--up", "z"], &["sheet.off", "cannot be sprayed"]);
}

#[test]
fn an_output_folder_that_cannot_be_made_is_named() {
    let s = Scratch::new("folder");
    s.write("taken", "a file where a folder should be");
    let output = paintcopter(&[], &s.0.join("taken/out"));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(text.contains("taken") && text.contains("--out"), "{text}");
}
