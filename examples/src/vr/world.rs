//! The surface before which the person stands.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_planner::teleop::PaintHit;
use paint_planner::{Hit, Surface, VehicleState};
use paint_sim::Substrate;
use ptu_kinematics::{Ptu, PtuSettings};
use tsdf_hash::Map;
use uv_param::SurfacePoint;

use super::error::VrError;
use super::palette::{PaletteEntry, palette};
use super::settings::VrSettings;
use crate::adapters::{MeshSurface, Robot};
use crate::mesh_io::TriangleMesh;
use crate::mission_file::MissionFile;
use crate::progress::Stage;
use crate::surface::PaintSurface;

/// The gun's ray ends here, m.
const RAY: f64 = 30.0;
/// Largest side of the atlas, texels: what every headset's GPU takes.
const LARGEST_ATLAS: usize = 4096;
/// Where the person stands in the beginning, metres before the surface.
const STAND: f64 = 1.8;
/// Where the robot waits beside the person's view: metres before the surface, to the person's right, and up.
const WAIT: [f64; 3] = [1.2, 0.75, 0.3];

/// Surface, paints and robot.
pub struct VrWorld {
    pub(super) name: String,
    pub(super) surface: PaintSurface,
    pub(super) ground: Substrate,
    pub(super) palette: Vec<PaletteEntry>,
    pub(super) robot: Robot,
    pub(super) ptu: PtuSettings,
    /// Where the robot is in the beginning.
    pub(super) home: VehicleState,
    /// Where the person stands in the beginning: before the middle, looking along the same heading.
    pub(super) stand: Point3<f64>,
}

impl VrWorld {
    /// Reads the surface and lays it out in texels.
    ///
    /// # Errors
    /// Files that cannot be read, surfaces that cannot be laid out or whose atlas is too large.
    pub fn new(settings: &VrSettings) -> Result<Self, VrError> {
        settings.check()?;
        let (name, mesh) = read_mesh(settings)?;
        let stage = Stage::start("unwrap");
        let refused = |source| VrError::Surface { name: name.clone(), source };
        let surface = PaintSurface::new(&mesh, settings.texel, &|share| stage.share(share)).map_err(refused)?;
        stage.done(&format!(
            "{} faces, {} x {} texels",
            surface.disk().faces().len(),
            surface.width(),
            surface.height()
        ));
        let largest = surface.width().max(surface.height());
        if largest > LARGEST_ATLAS {
            return Err(VrError::AtlasTooLarge { side: largest, most: LARGEST_ATLAS });
        }
        let ptu = PtuSettings::default();
        let (home, stand) = beginning(&surface);
        Ok(Self {
            name,
            surface,
            ground: paint_sim::Substrate::sandstone(),
            palette: palette()?,
            robot: Robot::new(Ptu::new(ptu)?),
            ptu,
            home,
            stand,
        })
    }

    /// Where the gun's ray (x of the nozzle) meets the part of the surface that is painted, with its smooth normal.
    pub(super) fn hit(&self, nozzle: &Isometry3<f64>) -> Option<PaintHit> {
        let origin = Point3::from(nozzle.translation.vector);
        self.hit_along(&origin, &(nozzle.rotation * Vector3::x_axis()))
    }

    /// The same for any ray.
    pub(super) fn hit_along(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>) -> Option<PaintHit> {
        let Hit { point, normal, .. } = self.cast(origin, direction, RAY)?;
        Some(PaintHit { point, normal })
    }
}

/// The part that is painted, with its smooth normals.
impl Surface for VrWorld {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max_distance: f64) -> Option<Hit> {
        let hit = paint_sim::Surface::cast(&self.surface.world, origin, direction, max_distance)?;
        // The back of the surface and what stands beside it are not painted.
        if hit.face as usize >= self.surface.disk().faces().len() || hit.normal.dot(direction) >= 0.0 {
            return None;
        }
        let [a, b] = hit.barycentric;
        let at = SurfacePoint { face: hit.face, barycentric: [1.0 - a - b, a, b] };
        let normal = self.surface.chart.smooth_normal(at);
        Some(Hit { point: origin + direction.into_inner() * hit.distance, normal, distance: hit.distance })
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        MeshSurface(&self.surface.world).distance(point, max)
    }
}

/// The mesh file, the map or the rock.
fn read_mesh(settings: &VrSettings) -> Result<(String, TriangleMesh), VrError> {
    let Some(path) = &settings.map else {
        let mut file = MissionFile {
            mesh: settings.mesh.clone(),
            scale: settings.scale,
            up: settings.up,
            ..MissionFile::default()
        };
        file.settings.seed = settings.seed;
        let (name, scene) = file.read_surface()?;
        return Ok((name, scene.canvas));
    };
    let stage = Stage::start("map");
    let mesh = Map::open(path).map_err(|source| VrError::Map { path: path.clone(), source })?.mesh();
    stage.done(&format!("{} faces", mesh.faces.len()));
    let name = path.file_stem().map_or("Map".into(), |stem| stem.to_string_lossy().into_owned());
    Ok((name, TriangleMesh { positions: mesh.positions, faces: mesh.faces, ..TriangleMesh::default() }))
}

/// Where robot and person are in the beginning, looking at the surface.
fn beginning(surface: &PaintSurface) -> (VehicleState, Point3<f64>) {
    let points = || surface.disk().positions().iter().map(|p| Vector3::from(*p));
    let (low, high) =
        points().fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p), h.sup(&p)));
    let facing = surface.facing();
    let front: Vector3<f64> = Vector3::new(facing.x, facing.y, 0.0).try_normalize(0.1).unwrap_or(-Vector3::x());
    let middle = (low + high) / 2.0;
    // How far anything of it stands out to the front.
    let depth = points().map(|p| front.dot(&(p - middle))).fold(0.0, f64::max);
    let right = Vector3::z().cross(&front);
    let position = Point3::from(middle + front * (depth + WAIT[0]) + right * WAIT[1] + Vector3::z() * WAIT[2]);
    let home = VehicleState { position, heading: (-front.y).atan2(-front.x), pan: 0.0, tilt: 0.0 };
    (home, Point3::from(middle + front * (depth + STAND)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh_frame::MeshScale;
    use crate::mesh_placement::UpAxis;

    /// A wall of 2 m by 1 m at x = 0 that faces smaller x: as it is hung, from 1.5 to 2.5 metres up.
    pub(in crate::vr) fn wall(texel: f64) -> VrWorld {
        let folder = std::env::temp_dir().join(format!("paintcopter-vr-wall-{texel}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mesh = folder.join("wall.obj");
        std::fs::write(&mesh, "v 0 1 1\nv 0 -1 1\nv 0 -1 2\nv 0 1 2\nf 1 2 3\nf 1 3 4\n").unwrap();
        let (scale, up) = (Some(MeshScale::Factor(1.0)), Some(UpAxis::Z));
        let world = VrWorld::new(&VrSettings { mesh: Some(mesh), scale, up, texel, ..VrSettings::default() });
        std::fs::remove_dir_all(&folder).unwrap();
        world.unwrap()
    }

    #[test]
    fn distances_are_those_from_the_wall() {
        let world = wall(0.0401);
        for (point, expected) in [([-0.3, 0.0, 2.0], 0.3), ([0.2, -0.9, 1.6], 0.2), ([-0.3, 1.4, 2.0], 0.5)] {
            assert!((world.distance(&Point3::from(point), 5.0) - expected).abs() < 1e-6, "{point:?}");
        }
    }

    /// Whichever way a wall faces, the robot waits before it to the person's right, looking at it, and the person stands farther back.
    #[test]
    fn robot_and_person_look_at_the_wall() {
        for degrees in [0.0_f64, 50.0, 140.0, 230.0, 320.0] {
            let front = Vector3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
            let along = Vector3::z().cross(&front);
            let corner = |k: usize| {
                let [y, z] = [(k % 5) as f64 - 2.0, (k / 5) as f64];
                Vector3::new(3.0, -7.0, 1.0) + along * (0.5 * y) + Vector3::z() * (0.5 * z)
            };
            let positions = (0..15).map(|k| corner(k).cast::<f32>().into()).collect();
            let quad = |a: u32| [[a, a + 1, a + 6], [a, a + 6, a + 5]];
            let faces = (0..8).flat_map(|k| quad(5 * (k / 4) + k % 4)).collect();
            let mesh = TriangleMesh { positions, faces, ..TriangleMesh::default() };
            let (home, stand) = beginning(&PaintSurface::new(&mesh, 0.05, &|_| ()).unwrap());
            let middle = Point3::from(corner(7));
            // Who looks against the normal has the wall's z cross n to the right.
            let expected = middle + front * WAIT[0] + along * WAIT[1] + Vector3::z() * WAIT[2];
            assert!((home.position - expected).norm() < 1e-3, "{degrees}: {}", home.position - expected);
            let forward = Vector3::new(home.heading.cos(), home.heading.sin(), 0.0);
            assert!((forward + front).norm() < 1e-3, "{degrees}: {}", home.heading.to_degrees());
            assert!((stand - (middle + front * STAND)).norm() < 1e-3, "{degrees}: {stand}");
        }
    }
}
