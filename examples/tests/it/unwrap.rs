//! `unwrap` from outside: what it writes can be read back and is what it says.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};

use clap::Parser;
use paintcopter::mesh_io::read_mesh;
use paintcopter::surface::PaintSurface;
use paintcopter::unwrap::{Arguments, UnwrapError, run};

use super::scratch::Scratch;

/// A closed box of 1 x 1 x 0.5 m whose sides have coordinates of their own on a picture.
const BOX: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 .5\nv 1 0 .5\nv 1 1 .5\nv 0 1 .5\nv 7 7 7
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
f 4/1 3/2 2/3 1/4\nf 5/1 6/2 7/3 8/4\nf 1/1 2/2 6/3 5/4\nf 2/1 3/2 7/3 6/4\nf 3/1 4/2 8/3 7/4\nf 4/1 1/2 5/3 8/4\n";

fn arguments(mesh: &Path, out: &Path, more: &[&str]) -> Arguments {
    let mut words = vec!["unwrap", "--mesh", mesh.to_str().unwrap(), "--out", out.to_str().unwrap()];
    words.extend(more);
    Arguments::try_parse_from(words).unwrap()
}

fn write(scratch: &Scratch, name: &str, text: &str) -> PathBuf {
    let path = scratch.0.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn figures(out: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap()
}

/// Half a sphere becomes one disk, which no bound but a relaxed one allows.
#[test]
fn a_relaxed_bound_is_said() {
    let scratch = Scratch::new("unwrap-relaxed");
    let (rings, sides) = (12, 24);
    let mut lines = vec!["v 0 0 1".to_owned()];
    for ring in 1..=rings {
        for side in 0..sides {
            let (polar, around) =
                (FRAC_PI_2 * f64::from(ring) / f64::from(rings), TAU * f64::from(side) / f64::from(sides));
            let [x, y, z] = [polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()];
            lines.push(format!("v {x} {y} {z}"));
        }
    }
    let vertex = |ring: i32, side: i32| if ring == 0 { 1 } else { 2 + (ring - 1) * sides + side % sides };
    for ring in 0..rings {
        for side in 0..sides {
            let [a, b] = [side, side + 1].map(|side| vertex(ring, side));
            let [c, d] = [side, side + 1].map(|side| vertex(ring + 1, side));
            lines.push(format!("f {a} {c} {d}"));
            lines.extend((ring > 0).then(|| format!("f {a} {d} {b}")));
        }
    }
    let mesh = write(&scratch, "half.obj", &lines.join("\n"));
    let report = |more: &[&str]| {
        let out = scratch.0.join("atlas");
        run(&arguments(&mesh, &out, &[&["--texel", "0.02"], more].concat())).unwrap();
        figures(&out)
    };
    let (relaxed, kept) = (report(&[]), report(&["--max-stretch", "1.15"]));
    let stretch = |report: &serde_json::Value| report["stretch_p99"].as_f64().unwrap();
    assert!(relaxed["charts"] == 1 && stretch(&relaxed) > 1.3, "{relaxed}");
    assert!(kept["charts"].as_u64() > Some(1) && stretch(&kept) <= 1.15, "{kept}");
    assert!(relaxed["stretch_relaxed"] == true && kept["stretch_relaxed"] == false);
}

#[test]
fn a_box_is_unfolded_and_read_back() {
    let scratch = Scratch::new("unwrap-box");
    let mesh = write(&scratch, "box.obj", BOX);
    let out = scratch.0.join("atlas");
    run(&arguments(&mesh, &out, &["--texel", "0.02"])).unwrap();
    let report = figures(&out);
    // 2 + 2 m² of sides; an unfolded box is isometric.
    assert!((report["area_m2"].as_f64().unwrap() - 4.0).abs() < 1e-6);
    assert!(report["stretch_max"].as_f64().unwrap() < 1.0 + 1e-6);
    assert_eq!(report["parts"], 1);
    assert_eq!(report["repaired_unreferenced_vertices"], 1);
    for zero in ["flips", "flips_f32", "overlaps", "repaired_non_manifold_edges", "repaired_degenerate_faces"] {
        assert_eq!(report[zero], 0, "{zero}");
    }
    let (before, after) = (read_mesh(&mesh).unwrap(), read_mesh(&out.join("atlas.obj")).unwrap());
    assert_eq!(after.positions, before.positions);
    assert_eq!(after.faces.len(), before.faces.len());
    let uv = after.uv.unwrap();
    let sides = ["page_width_px", "page_height_px"].map(|side| report[side].as_f64().unwrap() * 0.02);
    for (corners, coordinates) in after.faces.iter().zip(&uv.faces) {
        for k in 0..3 {
            let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            let [p, q] = [k, (k + 1) % 3].map(|k| after.positions[corners[k] as usize].map(f64::from));
            let [s, t] = [k, (k + 1) % 3]
                .map(|k| uv.coordinates[coordinates[k] as usize])
                .map(|uv| [sides[0] * f64::from(uv[0]), sides[1] * f64::from(uv[1])]);
            assert!((distance(&p, &q) - distance(&s, &t)).abs() < 1e-4);
        }
    }
    let glb = gltf::Gltf::from_slice(&std::fs::read(out.join("atlas.glb")).unwrap()).unwrap();
    assert_eq!(glb.images().count(), 1);
    assert!(std::fs::read_to_string(out.join("atlas.mtl")).unwrap().contains("atlas_texture.png"));
    let picture = image::open(out.join("charts.png")).unwrap().to_rgb8();
    assert_eq!(u64::from(picture.width()), report["page_width_px"].as_u64().unwrap());
    // No stretch: two greys of the checkerboard and the paper, nothing of the colours of stretch.
    assert!(picture.pixels().all(|p| p.0[2] >= p.0[0]));
}

/// Every side of the box has the same picture: left half red, right half blue; so have the sides on the new page.
#[test]
fn a_texture_is_carried_over() {
    let scratch = Scratch::new("unwrap-texture");
    let mesh = write(&scratch, "box.obj", BOX);
    let picture = scratch.0.join("picture.png");
    image::RgbImage::from_fn(64, 64, |x, _| image::Rgb(if x < 32 { [200, 10, 10] } else { [10, 10, 200] }))
        .save(&picture)
        .unwrap();
    let out = scratch.0.join("atlas");
    run(&arguments(&mesh, &out, &["--texel", "0.02", "--texture", picture.to_str().unwrap()])).unwrap();
    let texture = image::open(out.join("atlas_texture.png")).unwrap().to_rgb8();
    let count = |wanted: [u8; 3]| texture.pixels().filter(|p| p.0 == wanted).count() as f64;
    let (red, blue) = (count([200, 10, 10]), count([10, 10, 200]));
    // 4 m² in texels of 2 cm are 10000; a band about each middle line is mixed.
    assert!(red > 4000.0 && blue > 4000.0 && (red / blue - 1.0).abs() < 0.1, "{red} {blue}");
}

/// A closed box and three sheets at one edge are surfaces to paint: every side of them is on the page, once.
#[test]
fn what_is_no_disk_is_painted_all_around() {
    let scratch = Scratch::new("all-around");
    let fin = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n";
    for (text, sides, area) in [(BOX, 12, 4.0), (fin, 3, 1.5)] {
        let mesh = read_mesh(&write(&scratch, "mesh.obj", text)).unwrap();
        let surface = PaintSurface::new(&mesh, 0.02, &|_| ()).unwrap();
        assert_eq!(surface.disk().faces().len(), sides);
        let (texels, pixels) = surface.film_texels();
        assert!((texels.iter().map(|t| t.area).sum::<f64>() - area).abs() < 1e-9);
        // The robot's targets lie where the texels are.
        for (texel, &pixel) in texels.iter().zip(&pixels).step_by(97) {
            let (x, y) = ((pixel % surface.width()) as f64, (pixel / surface.width()) as f64);
            if let Some((point, _)) = surface.lift(x, y) {
                assert!((point - texel.point).norm() < 0.03);
            }
        }
    }
}

#[test]
fn seams_from_a_file_and_what_is_wrong_with_them() {
    let scratch = Scratch::new("unwrap-seams");
    let mesh = write(&scratch, "box.obj", BOX);
    let out = scratch.0.join("atlas");
    // All twelve edges: six charts.
    let all = "0 1\n1 2\n2 3\n3 0 # the bottom\n\n4 5\n5 6\n6 7\n7 4\n0 4\n1 5\n2 6\n3 7\n";
    let seams = write(&scratch, "seams.txt", all);
    run(&arguments(&mesh, &out, &["--seams", seams.to_str().unwrap()])).unwrap();
    assert_eq!(figures(&out)["charts"], 6);
    assert!((figures(&out)["seam_length_m"].as_f64().unwrap() - 10.0).abs() < 1e-6);
    let bad = write(&scratch, "bad.txt", "0 1\n0 6\n0 8\n");
    let refused = run(&arguments(&mesh, &out, &["--seams", bad.to_str().unwrap()])).unwrap_err();
    assert!(matches!(refused, UnwrapError::Atlas { .. }) && refused.to_string().contains("no edge"), "{refused}");
    let worse = write(&scratch, "worse.txt", "0 1\n0 x\n");
    let refused = run(&arguments(&mesh, &out, &["--seams", worse.to_str().unwrap()])).unwrap_err().to_string();
    assert!(refused.contains("line 2"), "{refused}");
}

/// Two boxes; then the second one is another. The first one's lines of the OBJ are the same, and so are its texels.
#[test]
fn what_did_not_change_keeps_its_texels() {
    let scratch = Scratch::new("unwrap-previous");
    let two = |height: &str| {
        let level = |z: &str| ["0 0", "1 0", "1 1", "0 1"].map(|corner| format!("v {corner} {z}\n")).concat();
        let sides = [[4, 3, 2, 1], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];
        let faces = |first: i32| {
            sides.map(|side| side.map(|v| (v + first).to_string()).join(" ")).map(|side| format!("f {side}\n")).concat()
        };
        [level("0"), level(".5"), level("5"), level(height), faces(0), faces(8)].concat()
    };
    let (old, new) = (write(&scratch, "old.obj", &two("5.5")), write(&scratch, "new.obj", &two("5.8")));
    let (first, second) = (scratch.0.join("first"), scratch.0.join("second"));
    run(&arguments(&old, &first, &["--texel", "0.02"])).unwrap();
    run(&arguments(&new, &second, &["--texel", "0.02", "--previous", first.to_str().unwrap()])).unwrap();
    let report = figures(&second);
    // The box that changed keeps its bottom: less of it is new than of the mesh.
    assert_eq!(report["kept_faces"], 14);
    assert!(report["kept_charts"].as_u64().unwrap() > 0, "{report}");
    let places = |out: &Path| {
        let (mesh, sides) = (read_mesh(&out.join("atlas.obj")).unwrap(), figures(out));
        let sides = ["page_width_px", "page_height_px"].map(|side| sides[side].as_f64().unwrap());
        let uv = mesh.uv.unwrap();
        let texels =
            move |f: usize| uv.faces[f].map(|i| [0, 1].map(|k| sides[k] * f64::from(uv.coordinates[i as usize][k])));
        (0..12).map(texels).collect::<Vec<_>>()
    };
    for (a, b) in places(&first).iter().flatten().flatten().zip(places(&second).iter().flatten().flatten()) {
        assert!((a - b).abs() < 1e-2, "{a} texels, now {b}");
    }
    let refused = run(&arguments(&new, &second, &["--previous", scratch.0.to_str().unwrap()])).unwrap_err().to_string();
    assert!(refused.contains("atlas.layout") && refused.contains("--previous"), "{refused}");
    let other = run(&arguments(&new, &second, &["--texel", "0.03", "--previous", first.to_str().unwrap()]));
    assert!(other.unwrap_err().to_string().contains("texel_m"));
}

#[test]
fn what_cannot_be_done_is_said() {
    let scratch = Scratch::new("unwrap-refusals");
    let mesh = write(&scratch, "plain.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let out = scratch.0.join("atlas");
    let refused = |more: &[&str]| run(&arguments(&mesh, &out, more)).unwrap_err().to_string();
    assert!(refused(&["--texture", "any.png"]).contains("no texture coordinates"));
    assert!(refused(&["--scale", "0"]).contains("--scale"));
    assert!(refused(&["--texel", "0"]).contains("texel_m"));
    assert!(refused(&["--page", "3,3", "--texel", "0.01"]).contains("use a larger texel"));
    assert!(refused(&["--max-stretch", "0.5"]).contains("max_stretch"));
    // Millimetres taken for metres: before anything is cut, let alone allocated.
    assert!(refused(&["--scale", "1000"]).contains("use a larger texel"));
    assert!(refused(&["--page", "9000,9000"]).contains("use a larger texel"));
}
