//! An atlas as files that other programs open: OBJ with material and pictures, and glTF binary, a file for each page.

use std::fmt::Write as _;
use std::path::Path;

use uv_param::Atlas;

use super::error::UnwrapError;
use crate::mesh_io::TriangleMesh;
use crate::mesh_placement::UpAxis;
use crate::pictures::write_png;
use crate::textured_mesh::TexturedMesh;
use crate::whole_file;

/// Unit and up axis of the mesh file.
#[derive(Clone, Copy)]
pub(super) struct FileFrame {
    /// Metres per unit.
    pub(super) scale: f64,
    /// The axis that points up.
    pub(super) up: UpAxis,
}

/// Writes `atlas.obj`, `atlas.mtl`, `atlas_texture[_N].png` and `atlas[_N].glb`.
///
/// The OBJ keeps every vertex of the mesh at its place and number (`mesh` in the unit of its file); texture coordinates have
/// indices of their own. Faces that were left out are not in it. glTF has metres and y up.
pub(super) fn save(
    atlas: &Atlas,
    mesh: &TriangleMesh,
    frame: FileFrame,
    textures: &[image::RgbImage],
    folder: &Path,
) -> Result<(), UnwrapError> {
    let write = |name: String, bytes: &[u8]| {
        let path = folder.join(name);
        whole_file::write(&path, bytes).map_err(|e| UnwrapError::unwritable(&path, &e))
    };
    for (page, texture) in textures.iter().enumerate() {
        let path = folder.join(format!("atlas_texture{}.png", suffix(page)));
        write_png(&path, texture, texture.dimensions().into()).map_err(|e| UnwrapError::unwritable(&path, &e))?;
        let mut part = page_mesh(atlas, page);
        let mut origin = mesh.origin.map(|c| c * frame.scale);
        if frame.up == UpAxis::Y {
            part.positions.iter_mut().chain([&mut origin]).for_each(|[_, y, z]| (*y, *z) = (-*z, *y));
        }
        let PageMesh { positions, faces, uv } = &part;
        let textured = TexturedMesh { positions, faces, origin, uv: uv.clone(), texture: texture.clone() };
        let glb = textured.glb().map_err(|e| UnwrapError::unwritable(folder, &e))?;
        write(format!("atlas{}.glb", suffix(page)), &glb)?;
    }
    write("atlas.obj".into(), obj(atlas, mesh, frame).as_bytes())?;
    write("atlas.mtl".into(), mtl(atlas.pages().len()).as_bytes())
}

/// Nothing for the first page, `_N` for the others.
pub(super) fn suffix(page: usize) -> String {
    if page == 0 { String::new() } else { format!("_{page}") }
}

fn mtl(pages: usize) -> String {
    let mut text = String::new();
    for page in 0..pages {
        let texture = suffix(page);
        let _ = writeln!(text, "newmtl page{page}\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd atlas_texture{texture}.png");
    }
    text
}

fn obj(atlas: &Atlas, mesh: &TriangleMesh, frame: FileFrame) -> String {
    let mut text = String::new();
    if let UpAxis::X | UpAxis::Y | UpAxis::Z = frame.up {
        let _ = writeln!(text, "# unit {} m, {} up", frame.scale, frame.up.name());
    }
    text.push_str("mtllib atlas.mtl\n");
    let digits = digits(mesh);
    for position in &mesh.positions {
        let [x, y, z] = position;
        if let Some(digits) = digits {
            let [x, y, z] = [0, 1, 2].map(|c| f64::from(position[c]) + mesh.origin[c]);
            let _ = writeln!(text, "v {x:.digits$} {y:.digits$} {z:.digits$}");
        } else {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
    }
    let mut first = Vec::with_capacity(atlas.charts().len());
    let mut count = 1;
    for (chart, placement) in atlas.charts().iter().zip(atlas.placements()) {
        first.push(count);
        count += chart.uv().len();
        for &uv in chart.uv() {
            let [u, v] = on_unit_page(atlas, placement.page, placement.apply(uv));
            let _ = writeln!(text, "vt {u} {v}");
        }
    }
    for page in 0..atlas.pages().len() {
        let _ = writeln!(text, "usemtl page{page}");
        for source in faces_in_input_order(atlas) {
            let (chart, local) = atlas.chart_of_face(source.face);
            if atlas.placements()[chart].page != page {
                continue;
            }
            let coordinates = atlas.charts()[chart].disk().faces()[local];
            text.push('f');
            for (k, coordinate) in coordinates.iter().enumerate() {
                // Corners in the order of the layout, which is counter-clockwise; vertices by their own numbers.
                let v = mesh.faces[source.input][atlas.surface().source_corner(source.face, k)];
                let _ = write!(text, " {}/{}", v + 1, *coordinate as usize + first[chart]);
            }
            text.push('\n');
        }
    }
    text
}

/// Decimals that a mesh far from the origin of its coordinates has in single precision; `None` near it, where its numbers are the shortest that read
/// back the same.
fn digits(mesh: &TriangleMesh) -> Option<usize> {
    let (low, high) = mesh.bounds();
    let longest = (0..3).map(|c| f64::from(high[c] - low[c])).fold(f64::MIN_POSITIVE, f64::max);
    (mesh.origin != [0.0; 3]).then(|| (7.0 - longest.log10().ceil()).clamp(0.0, 12.0) as usize)
}

struct FaceOfInput {
    input: usize,
    face: usize,
}

fn faces_in_input_order(atlas: &Atlas) -> impl Iterator<Item = FaceOfInput> + '_ {
    atlas.surface().face_source().iter().enumerate().map(|(face, &input)| FaceOfInput { input: input as usize, face })
}

/// Coordinates in [0, 1] on the picture of the page.
fn on_unit_page(atlas: &Atlas, page: usize, [x, y]: [f64; 2]) -> [f64; 2] {
    let [columns, rows] = atlas.pages()[page].map(|texels| texels as f64 * atlas.texel_m());
    [x / columns, y / rows]
}

struct PageMesh {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    uv: Vec<[f64; 2]>,
}

/// The charts of a page, vertices doubled at seams.
fn page_mesh(atlas: &Atlas, page: usize) -> PageMesh {
    let mut part = PageMesh { positions: Vec::new(), faces: Vec::new(), uv: Vec::new() };
    for (chart, placement) in atlas.charts().iter().zip(atlas.placements()).filter(|(_, p)| p.page == page) {
        let first = part.positions.len() as u32;
        part.positions.extend_from_slice(chart.disk().positions());
        part.uv.extend(chart.uv().iter().map(|&uv| on_unit_page(atlas, page, placement.apply(uv))));
        part.faces.extend(chart.disk().faces().iter().map(|face| face.map(|v| v + first)));
    }
    part
}
