//! A mesh with its texture as files that other programs open: glTF binary, and OBJ with material and picture.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

use gltf::binary::{Glb, Header};
use gltf::json::validation::{Checked::Valid, USize64};
use gltf::json::{self, Index};

use crate::mesh_io::GENERATOR;
use crate::whole_file;

/// Width of the border of a chart that takes the colour of its rim, texels: what bilinear sampling and a few levels of a mipmap
/// reach.
const GUTTER: usize = 8;

/// A mesh with one texture; z up, metres.
pub struct TexturedMesh<'a> {
    /// Vertices.
    pub positions: &'a [[f64; 3]],
    /// Triangles.
    pub faces: &'a [[u32; 3]],
    /// What to add to a vertex in the frame of the mesh; the glTF has it in a node, the OBJ in its vertices.
    pub origin: [f64; 3],
    /// Texture coordinates of every vertex in `[0, 1]`, v up.
    pub uv: Vec<[f64; 2]>,
    /// Texture, first row at v = 1.
    pub texture: image::RgbImage,
}

/// A picture whose missing pixels take the mean of their neighbours, ring by ring, as far as sampling reaches; white beyond.
pub fn with_gutter(width: usize, height: usize, mut pixels: Vec<Option<[u8; 3]>>) -> image::RgbImage {
    for _ in 0..GUTTER {
        let before = pixels.clone();
        for (k, pixel) in pixels.iter_mut().enumerate().filter(|(_, pixel)| pixel.is_none()) {
            let (x, y) = (k % width, k / width);
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            let near = columns.flat_map(|x| (y.saturating_sub(1)..(y + 2).min(height)).map(move |y| y * width + x));
            let known: Vec<[u8; 3]> = near.filter_map(|k| before[k]).collect();
            if !known.is_empty() {
                let mean = |c: usize| known.iter().map(|p| usize::from(p[c])).sum::<usize>() / known.len();
                *pixel = Some([0, 1, 2].map(|c| mean(c) as u8));
            }
        }
    }
    image::RgbImage::from_fn(width as u32, height as u32, |x, y| {
        image::Rgb(pixels[y as usize * width + x as usize].unwrap_or([255; 3]))
    })
}

impl TexturedMesh<'_> {
    /// Writes `NAME.glb`, `NAME.obj`, `NAME.mtl` and `NAME_texture.png`.
    ///
    /// # Errors
    /// What the file system says.
    pub fn save(&self, folder: &Path, name: &str) -> io::Result<()> {
        let png = self.png()?;
        whole_file::write(&folder.join(format!("{name}_texture.png")), &png)?;
        whole_file::write(&folder.join(format!("{name}.glb")), self.glb_with(&png)?)?;
        whole_file::write(&folder.join(format!("{name}.obj")), self.obj(name))?;
        whole_file::write(
            &folder.join(format!("{name}.mtl")),
            format!("newmtl paint\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {name}_texture.png\n"),
        )
    }

    fn obj(&self, name: &str) -> String {
        let mut text = format!("# metres, z up\nmtllib {name}.mtl\nusemtl paint\n");
        for position in self.positions {
            let [x, y, z] = [0, 1, 2].map(|c| position[c] + self.origin[c]);
            let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}");
        }
        for [u, v] in &self.uv {
            let _ = writeln!(text, "vt {u:.7} {v:.7}");
        }
        for [a, b, c] in self.faces.iter().map(|face| face.map(|i| i + 1)) {
            let _ = writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}");
        }
        text
    }

    fn png(&self) -> io::Result<Vec<u8>> {
        let mut png = Vec::new();
        self.texture.write_to(&mut io::Cursor::new(&mut png), image::ImageFormat::Png).map_err(io::Error::other)?;
        Ok(png)
    }

    /// The mesh as a glTF 2.0 binary with the texture in it.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn glb(&self) -> io::Result<Vec<u8>> {
        self.glb_with(&self.png()?)
    }

    /// glTF 2.0: y up, the first row of the texture at v = 0.
    fn glb_with(&self, png: &[u8]) -> io::Result<Vec<u8>> {
        let positions: Vec<[f32; 3]> = self.positions.iter().map(|[x, y, z]| [*x, *z, -*y].map(|c| c as f32)).collect();
        let uv: Vec<[f32; 2]> = self.uv.iter().map(|[u, v]| [*u as f32, (1.0 - v) as f32]).collect();
        let (low, high) = positions.iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
            ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])))
        });
        let mut builder = Builder::default();
        let position = json::Accessor {
            min: Some(json::Value::from(low.to_vec())),
            max: Some(json::Value::from(high.to_vec())),
            ..builder.floats(positions.as_flattened(), positions.len(), json::accessor::Type::Vec3)
        };
        let position = builder.root.push(position);
        let coordinates = builder.floats(uv.as_flattened(), uv.len(), json::accessor::Type::Vec2);
        let coordinates = builder.root.push(coordinates);
        let indices = builder.indices(self.faces.as_flattened());
        let indices = builder.root.push(indices);
        let material = builder.paint(png);
        let primitive = json::mesh::Primitive {
            attributes: [
                (Valid(json::mesh::Semantic::Positions), position),
                (Valid(json::mesh::Semantic::TexCoords(0)), coordinates),
            ]
            .into(),
            indices: Some(indices),
            material: Some(material),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
            extensions: None,
            extras: json::Extras::default(),
        };
        let [x, y, z] = self.origin;
        builder.finish(primitive, [x, z, -y])
    }
}

/// A glTF document and its binary part, grown together.
#[derive(Default)]
struct Builder {
    root: json::Root,
    bytes: Vec<u8>,
}

impl Builder {
    /// A view of new bytes at the end of the buffer, which starts at a multiple of four.
    fn view(&mut self, bytes: &[u8]) -> Index<json::buffer::View> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let byte_offset = Some(USize64::from(self.bytes.len()));
        self.bytes.extend_from_slice(bytes);
        self.root.push(json::buffer::View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset,
            byte_stride: None,
            target: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    fn floats(&mut self, values: &[f32], count: usize, type_: json::accessor::Type) -> json::Accessor {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, count, type_, json::accessor::ComponentType::F32)
    }

    fn indices(&mut self, values: &[u32]) -> json::Accessor {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, values.len(), json::accessor::Type::Scalar, json::accessor::ComponentType::U32)
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        type_: json::accessor::Type,
        component: json::accessor::ComponentType,
    ) -> json::Accessor {
        json::Accessor {
            buffer_view: Some(self.view(bytes)),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(json::accessor::GenericComponentType(component)),
            type_: Valid(type_),
            min: None,
            max: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        }
    }

    /// A matt material with a picture as its colour.
    fn paint(&mut self, png: &[u8]) -> Index<json::Material> {
        let view = self.view(png);
        let source = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".into())),
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let texture =
            self.root.push(json::Texture { sampler: None, source, extensions: None, extras: json::Extras::default() });
        self.root.push(json::Material {
            pbr_metallic_roughness: json::material::PbrMetallicRoughness {
                base_color_texture: Some(json::texture::Info {
                    index: texture,
                    tex_coord: 0,
                    extensions: None,
                    extras: json::Extras::default(),
                }),
                metallic_factor: json::material::StrengthFactor(0.0),
                ..json::material::PbrMetallicRoughness::default()
            },
            double_sided: true,
            ..json::Material::default()
        })
    }

    /// One mesh of one primitive in one scene, moved by `origin`.
    fn finish(mut self, primitive: json::mesh::Primitive, origin: [f64; 3]) -> io::Result<Vec<u8>> {
        self.root.asset.generator = Some(GENERATOR.into());
        let mesh = self.root.push(json::Mesh {
            primitives: vec![primitive],
            weights: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let mut node = self.root.push(json::Node { mesh: Some(mesh), ..json::Node::default() });
        if origin != [0.0; 3] {
            // Numbers of a node are of single precision: what the first leaves, the second adds.
            let most = origin.map(|c| c as f32);
            let rest = [0, 1, 2].map(|c| (origin[c] - f64::from(most[c])) as f32);
            for translation in [rest, most] {
                let parent =
                    json::Node { translation: Some(translation), children: Some(vec![node]), ..json::Node::default() };
                node = self.root.push(parent);
            }
        }
        let scene =
            self.root.push(json::Scene { nodes: vec![node], extensions: None, extras: json::Extras::default() });
        self.root.scene = Some(scene);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let mut json = json::serialize::to_vec(&self.root).map_err(io::Error::other)?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let glb = Glb {
            header: Header { magic: *b"glTF", version: 2, length: 0 },
            json: Cow::Owned(json),
            bin: Some(Cow::Owned(self.bytes)),
        };
        glb.to_vec().map_err(io::Error::other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of 2 x 1 m whose left half is red and whose upper right quarter is blue.
    fn wall() -> (Vec<[f64; 3]>, image::RgbImage) {
        let corners = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 1.0, 1.0]];
        let texture = image::RgbImage::from_fn(40, 20, |x, y| {
            image::Rgb(if x < 20 {
                [200, 0, 0]
            } else if y < 10 {
                [0, 0, 200]
            } else {
                [255; 3]
            })
        });
        (corners, texture)
    }

    #[test]
    fn missing_pixels_take_the_mean_of_their_neighbours() {
        let mut pixels = vec![None; 40 * 30];
        (pixels[10 * 40 + 5], pixels[12 * 40 + 5]) = (Some([100, 0, 0]), Some([200, 0, 80]));
        let picture = with_gutter(40, 30, pixels);
        assert_eq!(picture.get_pixel(5, 11).0, [150, 0, 40]);
        assert_eq!((picture.get_pixel(4, 9).0, picture.get_pixel(6, 13).0), ([100, 0, 0], [200, 0, 80]));
        assert_eq!(picture.get_pixel(39, 29).0, [255; 3]);
    }

    #[test]
    fn the_files_hold_mesh_coordinates_and_picture() {
        let folder = std::env::temp_dir().join(format!("paintcopter-textured-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (positions, texture) = wall();
        let mesh = TexturedMesh {
            positions: &positions,
            faces: &[[0, 1, 2], [0, 2, 3]],
            origin: [0.0; 3],
            uv: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            texture,
        };
        mesh.save(&folder, "wall").unwrap();
        let bytes = std::fs::read(folder.join("wall.glb")).unwrap();
        // The parser of the library checks the document against the specification.
        let glb = gltf::Gltf::from_slice(&bytes).unwrap();
        let blob = glb.blob.clone().unwrap();
        let primitive = glb.meshes().next().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&blob));
        let found: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        assert_eq!(found, [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0]]);
        assert_eq!(reader.read_indices().unwrap().into_u32().collect::<Vec<_>>(), [0, 1, 2, 0, 2, 3]);
        let coordinates: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
        // The upper right corner looks up the first row at its right end, which is blue.
        assert_eq!(coordinates[2], [1.0, 0.0]);
        let gltf::image::Source::View { view, .. } = glb.images().next().unwrap().source() else { panic!("no view") };
        let png = image::load_from_memory(&blob[view.offset()..view.offset() + view.length()]).unwrap().to_rgb8();
        assert_eq!(png.get_pixel(39, 0).0, [0, 0, 200]);
        let obj = crate::mesh_io::read_mesh(&folder.join("wall.obj")).unwrap();
        assert_eq!((obj.positions.len(), obj.faces.len()), (4, 2));
        assert_eq!(obj.uv.unwrap().coordinates[2], [1.0, 1.0]);
        assert!(std::fs::read_to_string(folder.join("wall.mtl")).unwrap().contains("wall_texture.png"));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_gutter_continues_the_rim() {
        let mut pixels = vec![None; 30];
        pixels[3] = Some([9, 8, 7]);
        let filled = with_gutter(30, 1, pixels);
        assert_eq!(filled.get_pixel(11, 0).0, [9, 8, 7]);
        assert_eq!(filled.get_pixel(0, 0).0, [9, 8, 7]);
        assert_eq!(filled.get_pixel(12, 0).0, [255; 3]);
    }
}
