//! The colours of what stands around the painted surface: those of the mesh.

use paint_sim::colour::decode_srgb;
use paint_sim::surface::Hit;
use uv_param::Disk;

use crate::colour_picture::ColourPicture;
use crate::mesh_io::{MeshMaterials, TriangleMesh};
use crate::region::Scene;
use crate::say;

/// What has no colour of its own, linear RGB.
const GREY: [f32; 3] = [0.4; 3];

/// Colours of the faces of a [`PaintSurface::world`](crate::surface::PaintSurface::world) that are not painted.
#[derive(Debug, Clone, Default)]
pub struct Surroundings {
    /// Faces that are painted, which come first.
    painted: usize,
    faces: Vec<FaceColour>,
    pictures: Vec<ColourPicture>,
}

#[derive(Debug, Clone, Copy)]
enum FaceColour {
    Grey,
    /// Linear RGB of its corners.
    Corners([[f32; 3]; 3]),
    /// Which picture, and where its corners lie on it.
    Picture(usize, [[f32; 2]; 3]),
}

impl Surroundings {
    /// Of a scene of which the disk is painted. A picture that cannot be read is said, and its faces are grey.
    pub fn new(disk: &Disk, scene: &Scene) -> Self {
        let mut found = Self { painted: disk.faces().len(), ..Self::default() };
        let mut beside = vec![true; scene.canvas.faces.len()];
        for &source in disk.face_source() {
            beside[source as usize] = false;
        }
        found.add(&scene.canvas, &beside);
        found.add(&scene.obstacles, &vec![true; scene.obstacles.faces.len()]);
        found
    }

    /// Linear RGB of a face that is not painted.
    pub fn albedo(&self, hit: &Hit) -> [f32; 3] {
        let [b, c] = hit.barycentric;
        let weights = [1.0 - b - c, b, c];
        let face = (hit.face as usize).checked_sub(self.painted).and_then(|face| self.faces.get(face));
        match face {
            None | Some(FaceColour::Grey) => GREY,
            Some(FaceColour::Corners(colours)) => {
                std::array::from_fn(|k| (0..3).map(|i| weights[i] as f32 * colours[i][k]).sum())
            }
            Some(FaceColour::Picture(picture, uv)) => {
                let at = [0, 1].map(|k| (0..3).map(|i| weights[i] * f64::from(uv[i][k])).sum());
                let [r, g, b, opacity] = self.pictures[*picture].repeated(at);
                // White shows through, as where pictures are painted.
                [r, g, b].map(|c| c + 1.0 - opacity)
            }
        }
    }

    /// The faces of a mesh that are wanted.
    fn add(&mut self, mesh: &TriangleMesh, wanted: &[bool]) {
        if !wanted.contains(&true) {
            return;
        }
        let first = self.pictures.len();
        let textured = self.read_pictures(mesh);
        let colour = |face: usize| match (textured, &mesh.colours) {
            (Some((materials, uv)), _) => {
                let uv = uv.faces[face].map(|corner| uv.coordinates[corner as usize]);
                FaceColour::Picture(first + materials.faces[face] as usize, uv)
            }
            (None, Some(colours)) => FaceColour::Corners(
                mesh.faces[face].map(|corner| colours[corner as usize].map(|c| decode_srgb(f64::from(c)) as f32)),
            ),
            (None, None) => FaceColour::Grey,
        };
        self.faces.extend((0..mesh.faces.len()).filter(|face| wanted[*face]).map(colour));
    }

    /// Reads the pictures of a mesh that has some, all of them or none.
    fn read_pictures<'a>(&mut self, mesh: &'a TriangleMesh) -> Option<(&'a MeshMaterials, &'a crate::mesh_io::MeshUv)> {
        let (materials, uv) = (mesh.materials.as_ref().filter(|m| m.textured())?, mesh.uv.as_ref()?);
        match ColourPicture::of_materials(materials) {
            Ok(pictures) => self.pictures.extend(pictures),
            Err(error) => {
                say!("what is not painted stays without its pictures: {error}");
                return None;
            }
        }
        Some((materials, uv))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_io::{MeshMaterial, MeshUv, TextureSource};
    use crate::region::Region;
    use crate::surface::PaintSurface;
    use nalgebra::{Point3, Vector3};
    use paint_sim::Surface as _;

    /// A wall of 2 m by 1 m at x = 0, and a plate beside it at y < -1.
    fn scene(obstacles: TriangleMesh) -> Scene {
        let corner = |k: u32| [0.0, 1.0 - 0.25 * (k % 9) as f32, 1.0 + 0.25 * (k / 9) as f32];
        let quad = |a: u32| [[a, a + 1, a + 10], [a, a + 10, a + 9]];
        let faces = (0..32).flat_map(|k| quad(9 * (k / 8) + k % 8)).collect();
        let canvas = TriangleMesh { positions: (0..45).map(corner).collect(), faces, ..TriangleMesh::default() };
        let positions = vec![[0.0, -2.0, 1.0], [0.0, -3.0, 1.0], [0.0, -3.0, 2.0], [0.0, -2.0, 2.0]];
        Scene {
            canvas,
            obstacles: TriangleMesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]], ..obstacles },
            ..Scene::default()
        }
    }

    fn seen(scene: &Scene, y: f64, z: f64) -> [f32; 3] {
        let surface = PaintSurface::of_scene(scene, 0.05, &|_| ()).unwrap();
        let hit = surface.world.cast(&Point3::new(-1.0, y, z), &Vector3::x_axis(), 2.0).unwrap();
        Surroundings::new(surface.disk(), scene).albedo(&hit)
    }

    #[test]
    fn what_is_not_painted_has_the_colours_of_its_vertices() {
        assert_eq!(seen(&scene(TriangleMesh::default()), -2.5, 1.5), GREY);
        // Red towards the right, black to the left: linear sRGB in between by where the corners lie.
        let colours = Some(vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]]);
        let scene = scene(TriangleMesh { colours, ..TriangleMesh::default() });
        for (y, red) in [(-2.1, 0.1), (-2.5, 0.5), (-2.9, 0.9)] {
            let albedo = seen(&scene, y, 1.3);
            assert!((albedo[0] - red).abs() < 1e-5 && albedo[1] == 0.0, "{albedo:?}");
        }
    }

    #[test]
    fn the_rest_of_a_mesh_of_which_a_part_is_painted_keeps_its_colours() {
        let mesh = TriangleMesh { colours: Some(vec![[0.0, 1.0, 0.0]; 45]), ..scene(TriangleMesh::default()).canvas };
        let scene = Region::Box([-1.0, 0.0, 0.9, 1.0, 1.1, 2.1]).split(mesh, 0.1, 1.0).unwrap();
        let albedo = seen(&scene, -0.5, 1.5);
        assert!((albedo[1] - 1.0).abs() < 1e-6 && albedo[0] == 0.0, "{albedo:?}");
    }

    #[test]
    fn what_is_not_painted_has_its_picture() {
        // Two by two pixels: blue at the upper left.
        let mut picture = image::RgbImage::from_pixel(2, 2, image::Rgb([255, 255, 0]));
        picture.put_pixel(0, 0, image::Rgb([0, 0, 255]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let texture = Some(TextureSource::Bytes(bytes.into_inner()));
        let materials =
            MeshMaterials { materials: vec![MeshMaterial { texture, ..MeshMaterial::default() }], faces: vec![0; 2] };
        let uv = MeshUv {
            coordinates: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
        };
        let textured = TriangleMesh { uv: Some(uv), materials: Some(materials), ..TriangleMesh::default() };
        let scene = scene(textured);
        assert_eq!(seen(&scene, -2.1, 1.9), [0.0, 0.0, 1.0]);
        assert_eq!(seen(&scene, -2.9, 1.1), [1.0, 1.0, 0.0]);
    }
}
