//! The part of a mesh that is painted; all the rest stays in the way of the robot and of the spray.

use std::path::PathBuf;
use std::str::FromStr;

use nalgebra::{Point3, Similarity3, Vector3};
use serde::{Deserialize, Serialize};
use uv_param::region::{
    DEFAULT_MEMORY_M, EditableMesh, EditableUv, Sample, divide_at_border, drop_small_parts, grow_to_creases,
    samples_of_face,
};

use crate::mesh_io::TriangleMesh;
use crate::picture_file::open_upright;

/// A plane's region reaches as far off the plane as this share of its radius.
const OFF_PLANE: f64 = 0.1;
/// Cosine of the angle between a plane's normal and those of its faces: 45 degrees.
const SAME_SIDE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// A picked point farther from the mesh than this share of the diagonal of its box was meant for another mesh.
const PICKED: f64 = 0.1;
/// Parts of a region with less area cannot be painted: the footprint of a spray, m².
const SMALLEST_PART: f64 = 0.008;

/// Which part of a mesh is painted. Lengths and axes are those of the mesh file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Region {
    /// `box:x0,y0,z0,x1,y1,z1`: what lies in a box; its corners in any order.
    Box([f64; 6]),
    /// `plane:px,py,pz,nx,ny,nz,RADIUS`: what lies within the radius of a point, near the plane through it, and faces the side of its
    /// normal.
    Plane([f64; 7]),
    /// `pick:px,py,pz`: the face nearest to a point and all that goes on from it without a crease.
    Pick([f64; 3]),
    /// `mask:PNG`: where a picture on the mesh's own texture coordinates is bright; for an atlas of `unwrap` a mask on its page.
    Mask(PathBuf),
}

/// What is wrong with a region.
#[derive(Debug, thiserror::Error)]
pub enum RegionError {
    /// Nothing of the mesh lies in it.
    #[error(
        "--region {region}: holds nothing of the mesh{hint}; the mesh reaches from {:?} to {:?} in the coordinates of its file",
        extent[0], extent[1]
    )]
    Empty {
        /// The region.
        region: String,
        /// What may be wrong.
        hint: String,
        /// Least and largest coordinates of the mesh.
        extent: Box<[[f64; 3]; 2]>,
    },
    /// Nothing is left to paint.
    #[error("--keep-clean {0}: nothing of the mesh is left to paint: give a smaller region")]
    AllClean(String),
    /// A mask without texture coordinates to lie on.
    #[error("--region {0}: the mesh has no texture coordinates; unwrap it first, and give the atlas.obj as the mesh")]
    NoCoordinates(String),
    /// The mask cannot be read.
    #[error("--region {region}: cannot be read as a picture ({why})")]
    Mask {
        /// The region.
        region: String,
        /// Why.
        why: String,
    },
    /// A vertex is not finite.
    #[error("vertex {0} is not finite: repair the mesh")]
    NotFinite(usize),
    /// Its faces name what is not there.
    #[error(transparent)]
    Mesh(#[from] uv_param::Error),
}

/// A mesh of which a part is painted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// What is painted.
    pub canvas: TriangleMesh,
    /// What stands in the way, with vertices of its own.
    pub obstacles: TriangleMesh,
    /// Faces of the canvas that stay clean, windows in a front; empty where there are none.
    pub clean: Vec<bool>,
    /// Where a point of the mesh as it was read (about its origin) stands now.
    pub world_from_mesh: Similarity3<f64>,
}

impl Scene {
    /// A mesh that is painted everywhere.
    pub fn whole(canvas: TriangleMesh) -> Self {
        Self { canvas, ..Self::default() }
    }

    /// What lies in a region, also, stays clean. Faces across its border are divided as by [`Region::split`].
    ///
    /// # Errors
    /// [`RegionError`].
    pub fn keep_clean(&mut self, region: &Region, finest: f64, unit: f64) -> Result<(), RegionError> {
        let Division { inside, source, .. } = region.divided(&mut self.canvas, finest, unit)?;
        if !inside.contains(&true) {
            return Err(region.empty(&self.canvas, String::new()));
        }
        let before = |&face: &u32| self.clean.get(face as usize) == Some(&true);
        self.clean = source.iter().zip(inside).map(|(source, inside)| inside || before(source)).collect();
        if self.clean.contains(&false) { Ok(()) } else { Err(RegionError::AllClean(region.to_string())) }
    }
}

impl Region {
    /// Splits a mesh. Faces across the border of the region are divided there until their sides are at most `finest` (units of the
    /// file); parts smaller than the footprint of a spray become obstacles, which is noted. `unit`: metres per unit of the file.
    ///
    /// # Errors
    /// [`RegionError`].
    pub fn split(&self, mut mesh: TriangleMesh, finest: f64, unit: f64) -> Result<Scene, RegionError> {
        let before = mesh.faces.len();
        let Division { mut inside, mut hint, .. } = self.divided(&mut mesh, finest, unit)?;
        let divided = mesh.faces.len() - before;
        if divided > 0 {
            mesh.notes.push(format!("{divided} faces more where the border of the region divides them"));
        }
        let small = drop_small_parts(&mesh.positions, &mesh.faces, &mut inside, SMALLEST_PART / (unit * unit))?;
        if small.parts > 0 {
            mesh.notes.push(format!(
                "{} parts of the region ({} faces) are smaller than a spray and stay bare",
                small.parts, small.faces
            ));
        }
        if !inside.contains(&true) {
            if small.parts > 0 {
                hint = format!(" but {} parts smaller than a spray", small.parts);
            }
            return Err(self.empty(&mesh, hint));
        }
        Ok(separated(mesh, &inside))
    }

    /// Divides the faces across the border; which of them lie inside.
    fn divided(&self, mesh: &mut TriangleMesh, finest: f64, unit: f64) -> Result<Division, RegionError> {
        if let Some(k) = mesh.positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(RegionError::NotFinite(k));
        }
        // A texel that is none is refused by those who lay it out.
        let finest = if finest > 0.0 { finest } else { f64::INFINITY };
        let mut hint = String::new();
        let here = self.relative_to(mesh.origin);
        let division = match &here {
            Self::Pick(point) => Division {
                inside: self.picked(mesh, Point3::from(*point), finest, DEFAULT_MEMORY_M / unit)?,
                source: (0..mesh.faces.len() as u32).collect(),
                hint: String::new(),
            },
            Self::Box(corners) => {
                let (low, high) = sides(corners);
                divide(mesh, finest, &|s| (0..3).all(|c| (low[c]..=high[c]).contains(&s.point[c])))?
            }
            Self::Plane([px, py, pz, nx, ny, nz, radius]) => {
                let (centre, normal) = (Point3::new(*px, *py, *pz), Vector3::new(*nx, *ny, *nz).normalize());
                let near = |s: &Sample| {
                    let way = s.point - centre;
                    way.norm() <= *radius && way.dot(&normal).abs() <= OFF_PLANE * radius
                };
                let behind = |s: &Sample| near(s) && s.normal.dot(&normal) <= -SAME_SIDE;
                if (0..mesh.faces.len()).any(|f| samples_of_face(mesh.corners(f), finest).iter().any(behind)) {
                    hint = " on the side of its normal, but something on the other: turn the normal about".into();
                }
                divide(mesh, finest, &|s| near(s) && s.normal.dot(&normal) >= SAME_SIDE)?
            }
            Self::Mask(path) => {
                if mesh.uv.is_none() {
                    return Err(RegionError::NoCoordinates(self.to_string()));
                }
                let picture = open_upright(path)
                    .map_err(|e| RegionError::Mask { region: self.to_string(), why: e.to_string() })?
                    .to_luma8();
                let side = |c: f64, n: u32| ((c.rem_euclid(1.0) * f64::from(n)) as u32).min(n - 1);
                divide(mesh, finest, &|s| {
                    let [u, v] = s.uv;
                    picture.get_pixel(side(u, picture.width()), side(1.0 - v, picture.height())).0[0] > 127
                })?
            }
        };
        Ok(Division { hint, ..division })
    }

    /// The region about another origin.
    fn relative_to(&self, [x, y, z]: [f64; 3]) -> Self {
        match *self {
            Self::Box([x0, y0, z0, x1, y1, z1]) => Self::Box([x0 - x, y0 - y, z0 - z, x1 - x, y1 - y, z1 - z]),
            Self::Plane([px, py, pz, nx, ny, nz, radius]) => Self::Plane([px - x, py - y, pz - z, nx, ny, nz, radius]),
            Self::Pick([px, py, pz]) => Self::Pick([px - x, py - y, pz - z]),
            Self::Mask(ref path) => Self::Mask(path.clone()),
        }
    }

    /// The same with the file that it names, if it does, at another place.
    #[must_use]
    pub fn with_file(self, place: impl FnOnce(PathBuf) -> PathBuf) -> Self {
        match self {
            Self::Mask(path) => Self::Mask(place(path)),
            other => other,
        }
    }

    fn picked(
        &self,
        mesh: &TriangleMesh,
        point: Point3<f64>,
        finest: f64,
        memory: f64,
    ) -> Result<Vec<bool>, RegionError> {
        let mut nearest = (f64::INFINITY, 0);
        for face in 0..mesh.faces.len() {
            for sample in samples_of_face(mesh.corners(face), finest) {
                let distance = (sample.point - point).norm();
                if distance < nearest.0 {
                    nearest = (distance, face);
                }
            }
        }
        let (low, high) = mesh.bounds();
        let diagonal = (Vector3::from(high) - Vector3::from(low)).cast::<f64>().norm();
        if nearest.0 > PICKED * diagonal {
            return Err(self.empty(mesh, format!(", the nearest point is {:.3} units away", nearest.0)));
        }
        Ok(grow_to_creases(&mesh.positions, &mesh.faces, nearest.1, memory)?)
    }

    fn empty(&self, mesh: &TriangleMesh, hint: String) -> RegionError {
        let (low, high) = mesh.bounds_in_file();
        RegionError::Empty { region: self.to_string(), hint, extent: Box::new([low, high]) }
    }
}

/// Faces divided at a border.
struct Division {
    inside: Vec<bool>,
    /// The face that each was before.
    source: Vec<u32>,
    /// What may be wrong where nothing lies inside.
    hint: String,
}

/// Divides the faces across a border; says which faces lie inside.
fn divide(mesh: &mut TriangleMesh, finest: f64, inside: &dyn Fn(&Sample) -> bool) -> Result<Division, RegionError> {
    let TriangleMesh { positions, faces, colours, uv, materials, .. } = mesh;
    let uv = uv.as_mut().map(|uv| EditableUv { coordinates: &mut uv.coordinates, faces: &mut uv.faces });
    let division = divide_at_border(EditableMesh { positions, faces, colours: colours.as_mut(), uv }, finest, inside)?;
    if let Some(materials) = materials {
        materials.faces = division.source.iter().map(|&face| materials.faces[face as usize]).collect();
    }
    Ok(Division { inside: division.inside, source: division.source, hint: String::new() })
}

fn sides(corners: &[f64; 6]) -> ([f64; 3], [f64; 3]) {
    let pick = |choose: fn(f64, f64) -> f64| [0, 1, 2].map(|c| choose(corners[c], corners[c + 3]));
    (pick(f64::min), pick(f64::max))
}

/// The two halves; both keep all vertices, so that what belongs to vertices needs no new numbers.
fn separated(mut mesh: TriangleMesh, inside: &[bool]) -> Scene {
    let TriangleMesh { positions, faces, colours, uv, materials, .. } = mesh.clone();
    let mut obstacles = TriangleMesh { positions, faces, colours, uv, materials, ..TriangleMesh::default() };
    keep_faces(&mut obstacles, &|face| !inside[face]);
    keep_faces(&mut mesh, &|face| inside[face]);
    Scene { canvas: mesh, obstacles, ..Scene::default() }
}

fn keep_faces(mesh: &mut TriangleMesh, wanted: &dyn Fn(usize) -> bool) {
    fn keep<T>(list: &mut Vec<T>, wanted: &dyn Fn(usize) -> bool) {
        let mut k = 0..;
        list.retain(|_| k.next().is_some_and(wanted));
    }
    keep(&mut mesh.faces, wanted);
    if let Some(uv) = &mut mesh.uv {
        keep(&mut uv.faces, wanted);
    }
    if let Some(materials) = &mut mesh.materials {
        keep(&mut materials.faces, wanted);
    }
}

const USAGE: &str = "give box:x0,y0,z0,x1,y1,z1, plane:px,py,pz,nx,ny,nz,RADIUS, pick:px,py,pz or mask:PNG, in the coordinates of the \
                     mesh file";

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let usage = || format!("region \"{text}\": {USAGE}");
        let (kind, rest) = text.split_once(':').ok_or_else(usage)?;
        if kind == "mask" && !rest.is_empty() {
            return Ok(Self::Mask(rest.into()));
        }
        let numbers: Option<Vec<f64>> =
            rest.split(',').map(|word| word.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
        let numbers = numbers.ok_or_else(usage)?;
        match (kind, &numbers[..]) {
            ("box", &[a, b, c, d, e, f]) => Ok(Self::Box([a, b, c, d, e, f])),
            ("plane", &[px, py, pz, nx, ny, nz, radius])
                if radius > 0.0 && Vector3::new(nx, ny, nz).try_normalize(0.0).is_some() =>
            {
                Ok(Self::Plane([px, py, pz, nx, ny, nz, radius]))
            }
            ("pick", &[x, y, z]) => Ok(Self::Pick([x, y, z])),
            _ => Err(usage()),
        }
    }
}

impl TryFrom<String> for Region {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Region> for String {
    fn from(region: Region) -> Self {
        region.to_string()
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        match self {
            Self::Box(numbers) => write!(f, "box:{}", list(numbers)),
            Self::Plane(numbers) => write!(f, "plane:{}", list(numbers)),
            Self::Pick(numbers) => write!(f, "pick:{}", list(numbers)),
            Self::Mask(path) => write!(f, "mask:{}", path.display()),
        }
    }
}
