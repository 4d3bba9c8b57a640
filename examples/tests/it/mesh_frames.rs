//! Meshes as they come: in any unit, with any axis up, hundreds of kilometres from the origin, in every format. Each is placed as the same mesh in
//! metres about its middle, or refused by name.

use nalgebra::Vector3;
use paintcopter::mesh_io::{TriangleMesh, read_mesh};
use paintcopter::mission_file::MissionFile;

use crate::scratch::Scratch;

type Points = Vec<[f64; 3]>;
type Faces = Vec<[u32; 3]>;

/// Quads between rings of `n` points; `closed` joins the last point of a ring with its first.
fn rings(count: u32, n: u32, closed: bool) -> Faces {
    let last = if closed { n } else { n - 1 };
    let quad = |k: u32, i: u32| {
        let [a, b] = [k * n + i, k * n + (i + 1) % n];
        [[a, b, b + n], [a, b + n, a + n]]
    };
    (0..count - 1).flat_map(|k| (0..last).flat_map(move |i| quad(k, i))).collect()
}

/// A closed vase of 3 m on a flat foot, z up, metres.
fn vase() -> (Points, Faces) {
    let (count, n) = (41, 48);
    let mut points = Points::new();
    for k in 0..count {
        let t = f64::from(k) / f64::from(count - 1);
        for i in 0..n {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            // Not round: what lies on its side or mirrored would not be the same.
            let radius = 0.45 + 0.3 * (2.2 * t).sin() - 0.68 * t.powi(3) + 0.05 * (3.0 * angle).cos() * (1.0 - t) * t;
            points.push([radius * angle.cos(), 1.1 * radius * angle.sin(), 3.0 * t]);
        }
    }
    let mut faces = rings(count, n, true);
    for (ring, height, turned) in [(0, 0.0, true), (count - 1, 3.0, false)] {
        let middle = points.len() as u32;
        points.push([0.0, 0.0, height]);
        let rim = |i: u32| ring * n + i % n;
        faces.extend((0..n).map(|i| if turned { [rim(i + 1), rim(i), middle] } else { [rim(i), rim(i + 1), middle] }));
    }
    (points, faces)
}

/// An open bust: cut off flat below, a bump for a face, 2 m high.
fn bust() -> (Points, Faces) {
    let (count, n) = (31, 40);
    let mut points = Points::new();
    for k in 0..count {
        let t = f64::from(k) / f64::from(count - 1);
        for i in 0..n {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            let radius = (0.6 - 0.25 * (4.0 * t).sin()) * (1.0 - t.powi(6)).sqrt() + 0.01;
            let nose = 0.15 * (-(angle - 3.1).powi(2) / 0.1 - (t - 0.7).powi(2) / 0.01).exp();
            points.push([(radius + nose) * angle.cos(), radius * angle.sin(), 2.0 * t]);
        }
    }
    (points, rings(count, n, true))
}

/// A lying terrain of 3 x 2 m with bumps of 6 cm, z up.
fn terrain() -> (Points, Faces) {
    let (count, n) = (33, 49);
    let at = |k: u32, i: u32| {
        let [x, y] = [f64::from(i) / 16.0, f64::from(k) / 16.0];
        [x, y, 0.06 * (4.0 * x).sin() * (3.0 * y).cos() + 0.05 * x]
    };
    ((0..count).flat_map(|k| (0..n).map(move |i| at(k, i))).collect(), rings(count, n, false))
}

/// One row of the table: how the mesh is written.
struct Row {
    name: &'static str,
    mesh: fn() -> (Points, Faces),
    /// Units in a metre.
    units: f64,
    /// Whether the file has y up.
    y_up: bool,
    /// Where the middle lies, units of the file, in the file's axes.
    offset: [f64; 3],
    format: &'static str,
    /// A comment of the file.
    comment: &'static str,
    /// `--scale`.
    scale: Option<&'static str>,
    /// Words of the refusal; empty: the same result.
    refused: &'static [&'static str],
}

const ROW: Row = Row {
    name: "",
    mesh: vase,
    units: 1.0,
    y_up: false,
    offset: [0.0; 3],
    format: "ply",
    comment: "",
    scale: None,
    refused: &[],
};
const UTM: [f64; 3] = [431_250.37, 5_412_307.91, 212.4];
const LOST: &[&str] = &["relief is lost", "double precision", "steps of"];
const FEET: f64 = 1.0 / 0.3048;
const INCHES: f64 = 1.0 / 0.0254;

const TABLE: [Row; 24] = [
    Row { name: "metres, OBJ", format: "obj", ..ROW },
    Row { name: "metres, y up, OFF", y_up: true, format: "off", ..ROW },
    Row { name: "metres, z up, OFF", format: "off", ..ROW },
    Row { name: "metres, y up, STL", y_up: true, format: "stl", ..ROW },
    Row { name: "metres, binary STL", format: "binary.stl", ..ROW },
    Row { name: "metres, glTF", y_up: true, format: "gltf", ..ROW },
    Row { name: "millimetres, STL", units: 1e3, format: "stl", ..ROW },
    Row { name: "millimetres, y up, OBJ", units: 1e3, y_up: true, format: "obj", mesh: bust, ..ROW },
    Row { name: "centimetres, OFF", units: 1e2, y_up: true, format: "off", mesh: bust, ..ROW },
    Row { name: "feet, said in the file", units: FEET, comment: "units: feet", format: "obj", ..ROW },
    Row { name: "feet, said by the switch", units: FEET, scale: Some("ft"), mesh: bust, ..ROW },
    Row { name: "inches, said in the file", units: INCHES, comment: "Units = inch", mesh: bust, ..ROW },
    Row { name: "inches, said by the switch", units: INCHES, scale: Some("in"), format: "stl", ..ROW },
    Row { name: "UTM, PLY", offset: UTM, ..ROW },
    Row { name: "UTM, terrain, OBJ", offset: UTM, format: "obj", mesh: terrain, ..ROW },
    Row { name: "UTM, y up, OFF", offset: [UTM[0], UTM[2], -UTM[1]], y_up: true, format: "off", mesh: bust, ..ROW },
    Row { name: "UTM, glTF node", offset: [UTM[0], UTM[2], -UTM[1]], y_up: true, format: "gltf", mesh: bust, ..ROW },
    Row {
        name: "state plane in feet",
        offset: [7.6e6, 6.8e5, 530.0],
        units: FEET,
        scale: Some("ft"),
        format: "obj",
        ..ROW
    },
    Row { name: "1e7, OBJ", offset: [1e7; 3], format: "obj", ..ROW },
    Row { name: "1e7, terrain, PLY", offset: [1e7, -1e7, 1e7], mesh: terrain, ..ROW },
    Row {
        name: "Gauss-Krueger in millimetres",
        offset: [3.4e9, 5.4e9, 1e5],
        units: 1e3,
        format: "off",
        mesh: terrain,
        ..ROW
    },
    Row { name: "UTM, binary STL", offset: UTM, format: "binary.stl", refused: LOST, ..ROW },
    Row { name: "UTM, PLY of floats", offset: UTM, format: "float.ply", mesh: bust, refused: LOST, ..ROW },
    Row {
        name: "1e7, OBJ of seven digits",
        offset: [1e7; 3],
        format: "short.obj",
        mesh: terrain,
        refused: LOST,
        ..ROW
    },
];

/// The file's points of a mesh in metres with z up.
fn in_file(row: &Row, points: &Points) -> Points {
    let turned = |[x, y, z]: [f64; 3]| if row.y_up { [x, z, -y] } else { [x, y, z] };
    points
        .iter()
        .map(|p| {
            let p = turned(*p);
            [0, 1, 2].map(|c| p[c] * row.units + row.offset[c])
        })
        .collect()
}

fn write(scratch: &Scratch, row: &Row, points: &Points, faces: &Faces) -> std::path::PathBuf {
    let name = row.format.replace("gltf", "mesh.gltf");
    let digits = if row.format == "short.obj" { 6 } else { 15 };
    let number = |v: f64| format!("{v:.digits$e}");
    let vertex = |p: &[f64; 3]| p.map(number).join(" ");
    let lines = |lines: Vec<String>| lines.join("\n") + "\n";
    let vertices = |before: &str| lines(points.iter().map(|p| format!("{before}{}", vertex(p))).collect());
    let triangles = |before: &str, first: u32| {
        let line = |f: &[u32; 3]| format!("{before}{} {} {}", f[0] + first, f[1] + first, f[2] + first);
        lines(faces.iter().map(line).collect())
    };
    let text = match row.format {
        "obj" | "short.obj" => format!("# {}\n{}{}", row.comment, vertices("v "), triangles("f ", 1)),
        "off" => format!("OFF\n{} {} 0\n{}{}", points.len(), faces.len(), vertices(""), triangles("3 ", 0)),
        "ply" => {
            let comment = if row.comment.is_empty() { String::new() } else { format!("comment {}\n", row.comment) };
            format!(
                "ply\nformat ascii 1.0\n{comment}element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
                 element face {}\nproperty list uchar int vertex_indices\nend_header\n{}{}",
                points.len(),
                faces.len(),
                vertices(""),
                triangles("3 ", 0)
            )
        }
        "stl" => {
            let corners = |face: &[u32; 3]| face.map(|v| format!("vertex {}", vertex(&points[v as usize]))).join("\n");
            let facet = |face| format!("facet normal 0 0 0\nouter loop\n{}\nendloop\nendfacet", corners(face));
            format!("solid a\n{}endsolid a\n", lines(faces.iter().map(facet).collect()))
        }
        _ => {
            scratch.write(&name, binary(row, points, faces));
            return scratch.0.join(name);
        }
    };
    let name = if row.format.contains('.') { name } else { format!("mesh.{name}") };
    scratch.write(&name, text);
    scratch.0.join(name)
}

/// Formats of single precision.
fn binary(row: &Row, points: &Points, faces: &Faces) -> Vec<u8> {
    let floats = |p: &[f64; 3]| p.map(|c| (c as f32).to_le_bytes()).concat();
    match row.format {
        "binary.stl" => {
            let mut bytes = vec![b' '; 80];
            bytes.extend((faces.len() as u32).to_le_bytes());
            for face in faces {
                bytes.extend([0; 12]);
                bytes.extend(face.iter().flat_map(|&v| floats(&points[v as usize])));
                bytes.extend([0; 2]);
            }
            bytes
        }
        "float.ply" => {
            let mut bytes = format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n\
                 property list uchar int vertex_indices\nend_header\n",
                points.len(),
                faces.len()
            )
            .into_bytes();
            bytes.extend(points.iter().flat_map(floats));
            for face in faces {
                bytes.push(3);
                bytes.extend(face.iter().flat_map(|v| (*v as i32).to_le_bytes()));
            }
            bytes
        }
        // The node carries the offset, as programs that know of single precision write it.
        "gltf" => {
            let local = |p: &[f64; 3]| [0, 1, 2].map(|c| p[c] - row.offset[c]);
            let mut bytes: Vec<u8> = points.iter().flat_map(|p| floats(&local(p))).collect();
            bytes.extend(faces.iter().flatten().flat_map(|v| v.to_le_bytes()));
            let (vertices, indices) = (12 * points.len(), 12 * faces.len());
            let uri = format!("data:application/octet-stream;base64,{}", base64(&bytes));
            serde_json::json!({
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "translation": row.offset}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                "buffers": [{"byteLength": bytes.len(), "uri": uri}],
                "bufferViews": [
                    {"buffer": 0, "byteOffset": 0, "byteLength": vertices},
                    {"buffer": 0, "byteOffset": vertices, "byteLength": indices}],
                "accessors": [
                    {"bufferView": 0, "count": points.len(), "type": "VEC3", "componentType": 5126},
                    {"bufferView": 1, "count": 3 * faces.len(), "type": "SCALAR", "componentType": 5125}]
            })
            .to_string()
            .into_bytes()
        }
        other => panic!("{other}"),
    }
}

/// RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |b: &[u8]| {
        let word = b.iter().fold(0, |w, &byte| w << 8 | u32::from(byte)) << (8 * (3 - b.len()));
        let letters = (0..=b.len()).map(move |k| char::from(LETTERS[(word >> (18 - 6 * k)) as usize & 63]));
        letters.chain("=".repeat(3 - b.len()).chars().collect::<Vec<_>>()).collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

/// Largest distance of a corner from where it belongs.
fn off(found: &TriangleMesh, expected: &TriangleMesh) -> f32 {
    assert_eq!(found.faces.len(), expected.faces.len());
    let distance = |(p, q): ([f32; 3], [f32; 3])| (Vector3::from(p) - Vector3::from(q)).norm();
    let corners = |face| found.corners(face).into_iter().zip(expected.corners(face));
    (0..found.faces.len()).flat_map(corners).map(distance).fold(0.0, f32::max)
}

#[test]
fn every_mesh_is_placed_as_the_same_in_metres_or_refused() {
    for row in &TABLE {
        let scratch = Scratch::new("mesh-frames");
        let (points, faces) = (row.mesh)();
        let place = |row: &Row, points: &Points| {
            let mesh = Some(write(&scratch, row, points, &faces));
            let scale = row.scale.map(|text| text.parse().unwrap());
            MissionFile { mesh, scale, ..MissionFile::default() }.read_surface().map(|(_, scene)| scene.canvas)
        };
        let (low, high) = points.iter().fold(([f64::MAX; 3], [f64::MIN; 3]), |(l, h), p| {
            ([0, 1, 2].map(|c| l[c].min(p[c])), [0, 1, 2].map(|c| h[c].max(p[c])))
        });
        let centred = points.iter().map(|p| [0, 1, 2].map(|c| p[c] - f64::midpoint(low[c], high[c]))).collect();
        let expected = place(&ROW, &centred).unwrap();
        match place(row, &in_file(row, &centred)) {
            Ok(found) => {
                assert!(row.refused.is_empty(), "{}: not refused", row.name);
                let off = off(&found, &expected);
                assert!(off < 5e-6, "{}: {off} m off", row.name);
            }
            Err(error) => {
                let said = error.to_string();
                let named = !row.refused.is_empty() && row.refused.iter().all(|word| said.contains(word));
                assert!(named && said.contains(row.format), "{}: {said}", row.name);
            }
        }
    }
}

/// The atlas of a surveyed mesh lies where the mesh does, in both of its files, and a region is given in the survey's coordinates.
#[cfg(feature = "unwrap")]
#[test]
fn a_surveyed_mesh_keeps_its_coordinates() {
    use clap::Parser as _;
    use paintcopter::unwrap::{Arguments, run};

    let scratch = Scratch::new("surveyed");
    let row = Row { offset: UTM, ..ROW };
    let (points, faces) = terrain();
    let surveyed = in_file(&row, &points);
    let mesh = write(&scratch, &row, &surveyed, &faces);
    let region = format!("box:{},{},200,{},{},230", UTM[0], UTM[1], UTM[0] + 1.5, UTM[1] + 3.0);
    let unwrap = |out: &str, more: &[&str]| {
        let out = scratch.path(out);
        let words = ["unwrap", "--mesh", mesh.to_str().unwrap(), "--texel", "0.05", "--out", &out];
        run(&Arguments::try_parse_from(words.into_iter().chain(more.iter().copied())).unwrap()).unwrap();
    };
    unwrap("whole", &[]);
    for file in ["atlas.obj", "atlas.glb"] {
        let atlas = read_mesh(&scratch.0.join("whole").join(file)).unwrap();
        assert_eq!(atlas.unit, Some(1.0), "{file}");
        let corner = |face: usize, k: usize| {
            let p = atlas.positions[atlas.faces[face][k] as usize];
            let [x, y, z] = [0, 1, 2].map(|c| f64::from(p[c]) + atlas.origin[c]);
            if file == "atlas.glb" { [x, -z, y] } else { [x, y, z] }
        };
        let mut all: Points =
            (0..atlas.faces.len()).flat_map(|f| (0..3).map(move |k| (f, k))).map(|(f, k)| corner(f, k)).collect();
        let mut expected: Points = faces.iter().flatten().map(|&v| surveyed[v as usize]).collect();
        let rounded = |p: &[f64; 3]| p.map(|c| (1e4 * c).round() as i64);
        all.sort_by_key(rounded);
        expected.sort_by_key(rounded);
        assert_eq!(all.len(), expected.len(), "{file}");
        for (a, e) in all.iter().zip(&expected) {
            assert!((0..3).all(|c| (a[c] - e[c]).abs() < 2e-6), "{file}: {a:?}, in the survey {e:?}");
        }
    }
    unwrap("half", &["--region", &region]);
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(scratch.0.join("half/report.json")).unwrap()).unwrap();
    let half = report["area_m2"].as_f64().unwrap();
    assert!((2.95..3.2).contains(&half), "1.5 m x 2 m and some slope: {half}");
}
