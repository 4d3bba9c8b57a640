//! glTF 2.0, binary or JSON: every mesh of the scene in one, where its nodes put it, y up as in the file.

mod accessor;
mod buffers;

use std::path::Path;

use ::gltf::json::validation::Checked;
use ::gltf::mesh::Mode;
use ::gltf::{Document, Gltf, Node, Primitive, Semantic};
use nalgebra::{Matrix4, Point3};
use paint_sim::colour::encode_srgb;

use super::fault::Fault;
use super::material::{MeshMaterial, MeshMaterials};
use super::mesh::{MeshUv, Parsed, TriangleMesh};
use accessor::numbers;

/// What our own files name as the program that wrote them.
pub(crate) const GENERATOR: &str = "PaintCopter";

/// Extensions that change only how light falls, or that are read.
const KNOWN: [&str; 3] = ["KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights_punctual"];
/// The same for all that begin so, but for materials that name their base colour elsewhere.
const SHADING: &str = "KHR_materials_";
const OTHER_COLOUR: &str = "KHR_materials_pbrSpecularGlossiness";

pub(super) fn parse(bytes: &[u8], folder: &Path) -> Result<Parsed, Fault> {
    let broken = |error: ::gltf::Error| Fault {
        place: "document".into(),
        what: format!("is no valid glTF 2.0 ({}): export it again", error.to_string().trim().replace('\n', "; ")),
    };
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(broken)?;
    let mut json = document.into_json();
    check_extensions(&json.extensions_required)?;
    prepare_positions(&mut json)?;
    prepare_images(&mut json)?;
    // Checked above: the validation knows only those that the crate itself reads.
    json.extensions_required.clear();
    // The format is in metres, many of its files are not; those written here are.
    let ours = json.asset.generator.as_deref() == Some(GENERATOR);
    let document = Document::from_json(json).map_err(broken)?;
    let mut joined = Joined {
        buffers: buffers::read(&document, blob.as_deref(), folder)?,
        visited: vec![false; document.nodes().count()],
        ..Joined::default()
    };
    joined.read_materials(&document, folder)?;
    match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => {
            joined.add_nodes(scene.nodes().collect())?;
            let others = document.scenes().count() - 1;
            if others > 0 {
                joined.notes.push(format!("{others} other scene(s) of the file left aside"));
            }
        }
        // A file without a scene is a library of meshes.
        None => {
            for primitive in document.meshes().flat_map(|m| m.primitives().collect::<Vec<_>>()) {
                joined.add_primitive(&primitive, &Matrix4::identity())?;
            }
        }
    }
    let mut parsed = joined.finish();
    parsed.mesh.unit = ours.then_some(1.0);
    Ok(parsed)
}

/// Bounds of positions are asked for by the format, left out by some programs, and not needed here; a missing accessor is an index
/// out of bounds in the validation of `gltf` (1.4.1).
fn prepare_positions(json: &mut ::gltf::json::Root) -> Result<(), Fault> {
    let positions = Checked::Valid(Semantic::Positions);
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let used: Vec<usize> =
        primitives.filter_map(|p| p.attributes.get(&positions)).map(::gltf::json::Index::value).collect();
    for k in used {
        let accessor = json.accessors.get_mut(k).ok_or_else(|| Fault {
            place: format!("accessor {k}"),
            what: "does not exist, but a mesh uses it: export it again".into(),
        })?;
        accessor.min.get_or_insert_with(|| vec![0; 3].into());
        accessor.max.get_or_insert_with(|| vec![0; 3].into());
    }
    Ok(())
}

/// A picture in a buffer must say what it is and a picture must be somewhere: `gltf` (1.4.1) panics where one does not. What it is its bytes
/// tell as well.
fn prepare_images(json: &mut ::gltf::json::Root) -> Result<(), Fault> {
    for (k, image) in json.images.iter_mut().enumerate() {
        if image.buffer_view.is_some() {
            image.mime_type.get_or_insert_with(|| ::gltf::json::image::MimeType("image/png".into()));
        } else if image.uri.is_none() {
            let what = "is neither in the file nor beside it: export it again".to_owned();
            return Err(Fault { place: format!("image {k}"), what });
        }
    }
    Ok(())
}

fn check_extensions(required: &[String]) -> Result<(), Fault> {
    let unknown = |name: &&String| {
        let shading = name.starts_with(SHADING) && *name != OTHER_COLOUR;
        !shading && !KNOWN.contains(&name.as_str())
    };
    let Some(name) = required.iter().find(unknown) else { return Ok(()) };
    let what = if name.contains("draco") || name.contains("meshopt") {
        format!("is compressed with {name}, which is not read: export it without compression")
    } else {
        format!("needs {name}, which is not read: export it without")
    };
    Err(Fault { place: "document".into(), what })
}

/// The meshes of a document while they become one.
#[derive(Default)]
struct Joined {
    buffers: Vec<Vec<u8>>,
    visited: Vec<bool>,
    mesh: TriangleMesh,
    points: Vec<[f64; 3]>,
    uv: MeshUv,
    /// Per vertex, where the primitive had colours.
    colours: Vec<Option<[f32; 3]>>,
    materials: MeshMaterials,
    /// Texture coordinate set of every material, and how its extension moves it.
    coordinates: Vec<(u32, [[f64; 3]; 2])>,
    primitives: usize,
    /// Faces without texture coordinates; primitives that are no triangles; skinned or morphed meshes.
    bare_faces: usize,
    lines: usize,
    posed: usize,
    notes: Vec<String>,
}

impl Joined {
    /// The materials of the document, a plain white one behind them.
    fn read_materials(&mut self, document: &Document, folder: &Path) -> Result<(), Fault> {
        for material in document.materials() {
            let pbr = material.pbr_metallic_roughness();
            let [r, g, b, _] = pbr.base_color_factor();
            let (mut texture, mut set, mut motion) = (None, 0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
            if let Some(info) = pbr.base_color_texture() {
                texture = Some(buffers::picture(&info.texture().source(), &self.buffers, folder)?);
                set = info.tex_coord();
                if let Some(moved) = info.texture_transform() {
                    set = moved.tex_coord().unwrap_or(set);
                    let (sin, cos) = f64::from(moved.rotation()).sin_cos();
                    let ([ox, oy], [sx, sy]) = (moved.offset().map(f64::from), moved.scale().map(f64::from));
                    motion = [[cos * sx, -sin * sy, ox], [sin * sx, cos * sy, oy]];
                }
            }
            let opaque = material.alpha_mode() == ::gltf::material::AlphaMode::Opaque;
            self.materials.materials.push(MeshMaterial { colour: [r, g, b], texture, opaque });
            self.coordinates.push((set, motion));
        }
        self.materials.materials.push(MeshMaterial::default());
        self.coordinates.push((0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
        Ok(())
    }

    /// Nodes and what hangs below them, each before its children. Without recursion: a file may nest as deep as it likes.
    fn add_nodes(&mut self, roots: Vec<Node>) -> Result<(), Fault> {
        let mut open: Vec<(Node, Matrix4<f64>)> = roots.into_iter().rev().map(|n| (n, Matrix4::identity())).collect();
        while let Some((node, world_from_parent)) = open.pop() {
            // A node with two parents, or its own ancestor, would be walked for ever.
            if std::mem::replace(&mut self.visited[node.index()], true) {
                let what = "has more than one parent: export it again".to_owned();
                return Err(Fault { place: format!("node {}", node.index()), what });
            }
            let world_from_node =
                world_from_parent * Matrix4::from(node.transform().matrix().map(|column| column.map(f64::from)));
            if let Some(mesh) = node.mesh() {
                for primitive in mesh.primitives() {
                    self.posed += usize::from(node.skin().is_some() || primitive.morph_targets().next().is_some());
                    self.add_primitive(&primitive, &world_from_node)?;
                }
            }
            let children: Vec<Node> = node.children().collect();
            open.extend(children.into_iter().rev().map(|child| (child, world_from_node)));
        }
        Ok(())
    }

    fn add_primitive(&mut self, primitive: &Primitive, world_from_node: &Matrix4<f64>) -> Result<(), Fault> {
        let Some(accessor) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.lines += 1;
            return Ok(());
        }
        self.primitives += 1;
        let (first, positions) = (self.points.len(), numbers(&accessor, &self.buffers, &[3])?);
        let count = positions.len() / 3;
        let placed = positions.chunks_exact(3).map(|p| world_from_node.transform_point(&Point3::new(p[0], p[1], p[2])));
        self.points.extend(placed.map(|p| [p.x, p.y, p.z]));
        let material = primitive.material().index().unwrap_or(self.materials.materials.len() - 1);
        let found = self.add_coordinates(primitive, material, count)?;
        self.add_colours(primitive, count)?;

        let indices: Vec<u32> = match primitive.indices() {
            Some(accessor) => numbers(&accessor, &self.buffers, &[1])?.into_iter().map(|i| i as u32).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&i| i as usize >= count) {
            let what = format!("vertex {index} does not exist ({count} vertices): export it again");
            return Err(Fault { place: format!("primitive {}", primitive.index()), what });
        }
        // A mirrored node turns the winding about.
        let mirrored = world_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for [a, b, c] in triangles(primitive.mode(), &indices) {
            let face = if mirrored { [a, c, b] } else { [a, b, c] }.map(|i| i + first as u32);
            self.mesh.faces.push(face);
            // Coordinate 0 belongs to nobody.
            self.uv.faces.push(if found { face.map(|i| i + 1) } else { [0; 3] });
            self.bare_faces += usize::from(!found);
            let plain = self.materials.materials.len() - 1;
            self.materials.faces.push(if found || self.materials.materials[material].texture.is_none() {
                material as u32
            } else {
                plain as u32
            });
        }
        Ok(())
    }

    /// Coordinates of a primitive's vertices, moved as its material says; whether it has any.
    fn add_coordinates(&mut self, primitive: &Primitive, material: usize, count: usize) -> Result<bool, Fault> {
        let (set, [row_u, row_v]) = self.coordinates[material];
        self.uv.coordinates.resize(self.points.len() + 1 - count, [0.0; 2]);
        let accessor = primitive.get(&Semantic::TexCoords(set));
        if let Some(accessor) = &accessor {
            let values = numbers(accessor, &self.buffers, &[2])?;
            check_count(accessor.index(), values.len() / 2, count)?;
            let along = |row: [f64; 3], uv: &[f64]| row[0] * uv[0] + row[1] * uv[1] + row[2];
            // The first row of a picture is v = 0 there and v = 1 here.
            let moved = values.chunks_exact(2).map(|uv| [along(row_u, uv), 1.0 - along(row_v, uv)].map(|c| c as f32));
            self.uv.coordinates.extend(moved);
        } else {
            self.uv.coordinates.resize(self.points.len() + 1, [0.0; 2]);
        }
        Ok(accessor.is_some())
    }

    /// Colours of vertices: linear in the file, sRGB in the mesh.
    fn add_colours(&mut self, primitive: &Primitive, count: usize) -> Result<(), Fault> {
        let Some(accessor) = primitive.get(&Semantic::Colors(0)) else {
            self.colours.resize(self.points.len(), None);
            return Ok(());
        };
        let values = numbers(&accessor, &self.buffers, &[3, 4])?;
        let width = accessor.dimensions().multiplicity();
        check_count(accessor.index(), values.len() / width, count)?;
        let colour = |c: &[f64]| Some([c[0], c[1], c[2]].map(|c| encode_srgb(c.clamp(0.0, 1.0)) as f32));
        self.colours.extend(values.chunks_exact(width).map(colour));
        Ok(())
    }

    fn finish(self) -> Parsed {
        let Self { mut mesh, points, uv, colours, materials, bare_faces, mut notes, .. } = self;
        notes.insert(0, format!("glTF of {} primitive(s), y up", self.primitives));
        if bare_faces < mesh.faces.len() {
            mesh.uv = Some(uv);
            if bare_faces > 0 {
                notes.push(format!("{bare_faces} faces without texture coordinates take their material's colour"));
            }
        }
        if self.lines > 0 {
            notes.push(format!("{} primitive(s) of points or lines left aside", self.lines));
        }
        if self.posed > 0 {
            notes.push(format!("{} skinned or morphed primitive(s) taken at rest", self.posed));
        }
        let coloured = colours.iter().flatten().count();
        if coloured == colours.len() && coloured > 0 {
            mesh.colours = colours.into_iter().collect();
        } else if coloured > 0 {
            notes.push(format!("vertex colours left aside: only {coloured} of {} vertices have them", colours.len()));
        }
        mesh.materials = Some(materials);
        mesh.notes = notes;
        mesh.up = Some([0.0, 1.0, 0.0]);
        Parsed { mesh, points }
    }
}

fn check_count(accessor: usize, found: usize, vertices: usize) -> Result<(), Fault> {
    if found == vertices {
        return Ok(());
    }
    let what = format!("has {found} elements for {vertices} vertices: export it again");
    Err(Fault { place: format!("accessor {accessor}"), what })
}

/// Corners of the triangles of a list, a strip or a fan.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(k, w): (usize, &[u32])| if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => indices.windows(2).skip(1).map(|w| [w[0], w[1], indices[0]]).collect(),
        _ => indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}
