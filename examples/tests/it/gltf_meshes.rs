//! glTF files of other programs, and OBJ with MTL: geometry, pictures, and what cannot be read.

use std::path::Path;

use clap::Parser as _;
use paintcopter::mesh_io::{MeshError, TextureSource, TriangleMesh, read_mesh};
use paintcopter::picture_placement::PicturePlacement;
use paintcopter::unwrap::{Arguments, run};
use serde_json::{Value, json};

use crate::scratch::Scratch;

const RED: [u8; 3] = [200, 10, 10];
const BLUE: [u8; 3] = [10, 10, 200];

/// Left half red, right half blue, as a PNG.
fn picture() -> Vec<u8> {
    let picture = image::RgbImage::from_fn(64, 64, |x, _| image::Rgb(if x < 32 { RED } else { BLUE }));
    let mut png = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    png
}

/// A document whose accessors are grown with their bytes.
struct Document {
    json: Value,
    bytes: Vec<u8>,
}

impl Document {
    fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "buffers": [{}],
            "bufferViews": [], "accessors": [], "meshes": [], "nodes": [], "scenes": []
        });
        Self { json, bytes: Vec::new() }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    fn accessor(&mut self, bytes: &[u8], count: usize, kind: &str, component: u32) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "count": count, "type": kind, "componentType": component});
        self.push("accessors", accessor)
    }

    fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let width = if kind == "VEC2" { 2 } else { 3 };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let k = self.accessor(&bytes, values.len() / width, kind, 5126);
        // The format asks for the bounds of positions.
        (self.json["accessors"][k]["min"], self.json["accessors"][k]["max"]) = (json!([0, 0, 0]), json!([1, 1, 0]));
        k
    }

    fn glb(mut self) -> Vec<u8> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.json["buffers"][0]["byteLength"] = self.bytes.len().into();
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes()[..], kind, data].concat();
        let header = [&b"glTF"[..], &2_u32.to_le_bytes(), &(total as u32).to_le_bytes()].concat();
        [header, chunk(b"JSON", &text), chunk(b"BIN\0", &self.bytes)].concat()
    }

    /// The unit square of the plane z = 0 with a picture whose first row lies at y = 1.
    fn square() -> Self {
        let mut d = Self::new();
        let positions = d.floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.], "VEC3");
        let uv = d.floats(&[0., 1., 1., 1., 1., 0., 0., 0.], "VEC2");
        let indices = d.accessor(&[0, 1, 2, 0, 2, 3], 6, "SCALAR", 5121);
        let view = d.view(&picture());
        d.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
        d.json["textures"] = json!([{"source": 0}]);
        d.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        let attributes = json!({"POSITION": positions, "TEXCOORD_0": uv});
        d.push("meshes", json!({"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}));
        d.push("nodes", json!({"mesh": 0}));
        d.push("scenes", json!({"nodes": [0]}));
        d
    }
}

/// A square with a picture.
pub(crate) fn square_glb() -> Vec<u8> {
    Document::square().glb()
}

/// The same as a document and a buffer that lies beside it under this name.
pub(crate) fn square_gltf(buffer: &str) -> (Vec<u8>, Vec<u8>) {
    let mut d = Document::square();
    (d.json["buffers"][0]["byteLength"], d.json["buffers"][0]["uri"]) = (d.bytes.len().into(), buffer.into());
    (d.json.to_string().into_bytes(), d.bytes)
}

/// A small file to damage.
pub(crate) fn triangle_glb() -> Vec<u8> {
    let mut d = Document::new();
    let positions = d.floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.], "VEC3");
    let indices = d.accessor(&[0, 1, 2], 3, "SCALAR", 5121);
    d.push("meshes", json!({"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]}));
    d.push("nodes", json!({"mesh": 0}));
    d.push("scenes", json!({"nodes": [0]}));
    d.glb()
}

fn read(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let scratch = Scratch::new("gltf");
    scratch.write("mesh.glb", bytes);
    read_mesh(&scratch.0.join("mesh.glb"))
}

/// A node moved and turned within a moved and enlarged one, and a mirrored copy: where the corners lie, and which way they wind.
#[test]
fn nodes_move_turn_and_mirror() {
    let mut d = Document::square();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    d.json["nodes"] = json!([
        {"translation": [10, 0, 0], "scale": [2, 2, 2], "children": [1]},
        {"translation": [1, 0, 0], "rotation": [0, 0, half, half], "mesh": 0},
        {"matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1], "mesh": 0}
    ]);
    d.json["scenes"] = json!([{"nodes": [0, 2]}]);
    let mesh = read(&d.glb()).unwrap();
    // (x, y) turns to (-y, x), moves by 1, doubles, moves by 10.
    let expected = [[12., 0., 0.], [12., 2., 0.], [10., 2., 0.], [10., 0., 0.]];
    for (found, expected) in mesh.positions.iter().zip(expected) {
        assert!(found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{found:?} {expected:?}");
    }
    assert_eq!(mesh.positions[4..], [[0., 0., 5.], [-1., 0., 5.], [-1., 1., 5.], [0., 1., 5.]]);
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]);
    let uv = mesh.uv.unwrap();
    let coordinates: Vec<_> = uv.faces[2].iter().map(|&i| uv.coordinates[i as usize]).collect();
    assert_eq!(coordinates, [[0., 0.], [1., 1.], [1., 0.]], "v runs up, and the coordinates follow the winding");
    assert_eq!(mesh.materials.unwrap().faces, [0; 4]);
    assert!(mesh.notes[0].contains("2 primitive(s), y up"), "{:?}", mesh.notes);
}

/// Quantised positions, sparse changes, a strip, 16-bit indices, vertex colours, and a primitive without coordinates.
/// Two hundred thousand nodes, each the only child of the one before, a millimetre up: deeper than any stack.
#[test]
fn nodes_may_nest_as_deep_as_they_like() {
    const DEEP: usize = 200_000;
    let mut d = Document::square();
    let node = |k: usize| json!({"children": [k + 1], "translation": [0.0, 0.001, 0.0]});
    let mut nodes: Vec<Value> = (0..DEEP).map(node).collect();
    nodes.push(json!({"mesh": 0}));
    d.json["nodes"] = nodes.into();
    let mesh = read(&d.glb()).unwrap();
    let low = mesh.bounds_in_file().0;
    assert!((low[1] - 200.0).abs() < 1e-3, "{low:?}");
}

#[test]
fn encodings_and_joined_primitives() {
    let mut d = Document::square();
    // -1, 0 and 1 as normalised bytes, padded to four.
    let quantised = d.accessor(&[129, 129, 0, 0, 127, 129, 0, 0, 129, 127, 0, 0, 127, 127, 0, 0], 4, "VEC3", 5120);
    d.json["accessors"][quantised]["normalized"] = true.into();
    (d.json["accessors"][quantised]["min"], d.json["accessors"][quantised]["max"]) =
        (json!([-127, -127, 0]), json!([127, 127, 0]));
    let view = d.json["accessors"][quantised]["bufferView"].as_u64().unwrap() as usize;
    d.json["bufferViews"][view]["byteStride"] = 4.into();
    let (places, raised) = (d.view(&[3, 0]), d.view(&[0, 0, 127]));
    d.json["accessors"][quantised]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": places, "componentType": 5123}, "values": {"bufferView": raised}});
    let strip = d.accessor(&[0, 0, 1, 0, 2, 0, 3, 0], 4, "SCALAR", 5123);
    d.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    d.push(
        "meshes",
        json!({"primitives": [
            {"attributes": {"POSITION": quantised}, "indices": strip, "mode": 5},
            {"attributes": {"POSITION": 0}, "mode": 1}
        ]}),
    );
    d.push("nodes", json!({"mesh": 1}));
    d.json["scenes"] = json!([{"nodes": [0, 1]}]);
    let mesh = read(&d.glb()).unwrap();
    assert_eq!(mesh.positions[4..], [[-1., -1., 0.], [1., -1., 0.], [-1., 1., 0.], [0., 0., 1.]]);
    assert_eq!(mesh.faces[2..], [[4, 5, 6], [6, 5, 7]]);
    let materials = mesh.materials.unwrap();
    assert!(materials.textured() && materials.materials[materials.faces[2] as usize].texture.is_none());
    assert!(mesh.notes.iter().any(|n| n.contains("2 faces without")), "{:?}", mesh.notes);
    assert!(mesh.notes.iter().any(|n| n.contains("1 primitive(s) of points or lines")), "{:?}", mesh.notes);
}

/// `KHR_texture_transform`: a quarter turn and a shift, by the matrix of the specification.
#[test]
fn a_texture_is_moved_as_its_extension_says() {
    let mut d = Document::square();
    d.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({
        "KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3]}});
    let mesh = read(&d.glb()).unwrap();
    let uv = mesh.uv.unwrap();
    // Corner 0 has (0, 1) in the file: u' = -3 v + 0.5, v' = 2 u + 0.25, then v runs up.
    let found = uv.coordinates[uv.faces[0][0] as usize];
    assert!((found[0] + 2.5).abs() < 1e-6 && (found[1] - 0.75).abs() < 1e-6, "{found:?}");
}

/// JSON with its bytes in a file, whose name has a space, and as a data URI.
#[test]
fn buffers_and_pictures_beside_the_document() {
    let s = Scratch::new("gltf-files");
    let mut d = Document::square();
    let length = d.bytes.len();
    s.write("all bytes.bin", &d.bytes);
    s.write("paint.png", picture());
    d.json["buffers"] = json!([{"byteLength": length, "uri": "all%20bytes.bin"}]);
    d.json["images"] = json!([{"uri": "paint.png"}]);
    s.write("mesh.gltf", d.json.to_string());
    let mesh = read_mesh(&s.0.join("mesh.gltf")).unwrap();
    assert_eq!((mesh.positions.len(), mesh.faces.len()), (4, 2));
    assert_eq!(mesh.materials.unwrap().materials[0].texture, Some(TextureSource::File(s.0.join("paint.png"))));
    // "Man" and "Ma" of RFC 4648's own explanation: three bytes of four letters, two of three with padding.
    d.json["buffers"] = json!([{"byteLength": 3, "uri": "data:application/octet-stream;base64,TWFu"}]);
    s.write("short.gltf", d.json.to_string());
    let error = read_mesh(&s.0.join("short.gltf")).unwrap_err().to_string();
    assert!(error.contains("beyond the end"), "{error}");
    d.json["images"] = json!([{"uri": "data:image/png;base64,TWE="}]);
    d.json["buffers"] = json!([{"byteLength": length, "uri": "all%20bytes.bin"}]);
    s.write("inside.gltf", d.json.to_string());
    let mesh = read_mesh(&s.0.join("inside.gltf")).unwrap();
    assert_eq!(mesh.materials.unwrap().materials[0].texture, Some(TextureSource::Bytes(b"Ma".to_vec())));
    std::fs::remove_file(s.0.join("all bytes.bin")).unwrap();
    let error = read_mesh(&s.0.join("mesh.gltf")).unwrap_err().to_string();
    assert!(error.contains("all bytes.bin") && error.contains("export one .glb"), "{error}");
}

#[test]
fn what_cannot_be_read_is_said() {
    type Change = fn(&mut Document);
    let cases: [(Change, &[&str]); 8] = [
        (|d| d.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), &["draco", "without compression"]),
        (|d| d.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]), &["EXT_mesh_gpu_instancing"]),
        (|d| d.json["accessors"][0]["count"] = 5.into(), &["accessor 0", "beyond the end"]),
        (|d| d.json["accessors"][1]["count"] = 3.into(), &["accessor 1", "3 elements for 4 vertices"]),
        (|d| d.json["accessors"][0]["count"] = 0.into(), &["accessor 0", "0 elements"]),
        (|d| d.json["bufferViews"][2]["byteOffset"] = 12.into(), &["does not exist", "4 vertices"]),
        (|d| d.json["bufferViews"][0]["byteLength"] = 1_000_000_000.into(), &["beyond the end"]),
        (|d| d.json["nodes"] = json!([{"children": [0], "mesh": 0}]), &["more than one parent"]),
    ];
    for (k, (change, words)) in cases.into_iter().enumerate() {
        let mut d = Document::square();
        change(&mut d);
        let error = read(&d.glb()).expect_err(&format!("case {k}")).to_string();
        assert!(words.iter().all(|w| error.contains(w)) && error.contains("mesh.glb"), "case {k}: {error}");
    }
}

fn unwrapped(scratch: &Scratch, mesh: &str, out: &str) -> image::RgbImage {
    let out = scratch.0.join(out);
    let words = ["unwrap", "--mesh", &scratch.path(mesh), "--texel", "0.02", "--out", out.to_str().unwrap()];
    run(&Arguments::try_parse_from(words).unwrap()).unwrap();
    image::open(out.join("atlas_texture.png")).unwrap().to_rgb8()
}

fn halves(picture: &image::RgbImage) -> [usize; 2] {
    [RED, BLUE].map(|wanted| picture.pixels().filter(|p| p.0 == wanted).count())
}

/// A picture in a glTF, carried to an atlas, written as glTF, read again: the square stands as it stood and looks as it looked.
#[test]
fn the_picture_of_a_gltf_goes_around() {
    let s = Scratch::new("gltf-around");
    s.write("square.glb", Document::square().glb());
    let first = halves(&unwrapped(&s, "square.glb", "one"));
    // 1 m² in texels of 2 cm are 2500; the column at the middle is mixed.
    assert!(first.iter().all(|&n| (1150..=1350).contains(&n)), "{first:?}");
    let again = read_mesh(&s.0.join("one/atlas.glb")).unwrap();
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for p in &again.positions {
        (low, high) = ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])));
    }
    assert_eq!((low, high), ([0.0; 3], [1.0, 1.0, 0.0]));
    let second = halves(&unwrapped(&s, "one/atlas.glb", "two"));
    assert!(second.iter().all(|&n| (1150..=1350).contains(&n)), "{second:?}");
}

/// An OBJ whose MTL names a picture by a path of another machine, one that is missing, and a colour.
#[test]
fn materials_of_an_obj_are_used_without_texture_option() {
    let s = Scratch::new("mtl");
    let square = |x: u32, first: u32, name: &str| {
        let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
        let (left, right) = (x, x + 1);
        format!("v {left} 0 0\nv {right} 0 0\nv {right} 1 0\nv {left} 1 0\nusemtl {name}\nf {a}/1 {b}/2 {c}/3 {d}/4\n")
    };
    let corners = "mtllib two words.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let text = [corners, &square(0, 1, "my paint"), &square(2, 5, "green"), &square(4, 9, "lost")].concat();
    s.write("mesh.obj", text);
    s.write(
        "two words.mtl",
        "# of another machine\nnewmtl my paint\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp on C:\\work\\two tone.png\r\n\
         newmtl green\nKd 0 0.5019608 0\nnewmtl lost\nmap_Kd nowhere.png\n",
    );
    s.write("two tone.png", picture());
    let mesh = read_mesh(&s.0.join("mesh.obj")).unwrap();
    assert!(mesh.notes.iter().any(|n| n.contains("nowhere.png")), "{:?}", mesh.notes);
    let page = unwrapped(&s, "mesh.obj", "atlas");
    assert!(halves(&page).iter().all(|&n| (1150..=1350).contains(&n)), "{:?}", halves(&page));
    let green = page.pixels().filter(|p| p.0 == [0, 128, 0]).count();
    assert!((2500..3300).contains(&green), "{green} texels and gutter");
    s.write("bare.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let notes = read_mesh(Path::new(&s.path("bare.obj"))).unwrap().notes;
    assert!(notes.iter().any(|n| n.contains("gone.mtl")), "{notes:?}");
}

/// The main job takes the picture that the file names as what is wanted.
#[test]
fn the_main_job_wants_what_the_file_shows() {
    let s = Scratch::new("gltf-wanted");
    s.write("square.glb", Document::square().glb());
    let file = paintcopter::mission_file::MissionFile {
        mesh: Some(s.0.join("square.glb")),
        scale: Some(paintcopter::mesh_frame::MeshScale::Factor(1.0)),
        ..Default::default()
    };
    let mesh = file.read_surface().unwrap().1.canvas;
    let materials = mesh.materials.as_ref().unwrap();
    let design = paintcopter::design::Design::from_materials(materials).unwrap();
    let surface = paintcopter::surface::PaintSurface::new(&mesh, 0.02, &|_| ()).unwrap();
    let wanted = design.on_surface(&surface, &mesh, &PicturePlacement::default(), None).unwrap();
    // 0.85 (1 - luma) of the two colours, red on the left.
    let ink = |[r, g, b]: [u8; 3]| {
        0.85 * (1.0 - (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) / 255.0)
    };
    let row = surface.height() / 2;
    assert!((wanted.at(5, row) - ink(RED)).abs() < 1e-3, "{}", wanted.at(5, row));
    assert!((wanted.at(surface.width() - 6, row) - ink(BLUE)).abs() < 1e-3);
}
