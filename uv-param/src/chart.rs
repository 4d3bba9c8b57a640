//! A surface laid out in the plane in metres, and the way back.

pub(crate) mod distortion;
mod locate;
mod normals;
mod placement;
mod straight;
mod surface_point;

use std::sync::OnceLock;

use nalgebra::{Point3, Unit, Vector3};

use crate::disk::Disk;
use crate::error::Error;
use crate::triangle::Frame;
pub use distortion::Quality;
use locate::Grid;
pub(crate) use locate::{inside, overlapping_faces, overlapping_pairs};
pub use surface_point::SurfacePoint;

/// The layout of a [`Disk`]: one uv point in metres per vertex, `0 <= u <= width`, `0 <= v <= height`. Not
/// mirrored: seen from the side the normals point to, u runs right and v runs up.
#[derive(Debug, Clone)]
pub struct Chart {
    disk: Disk,
    uv: Vec<[f64; 2]>,
    width: f64,
    height: f64,
    iterations: usize,
    /// Measured when it is first asked for: an atlas that is brought up to date has many charts that nobody asks about.
    quality: OnceLock<Quality>,
    vertex_normals: Vec<Vector3<f64>>,
    grid: Grid,
}

impl Chart {
    /// A chart from a layout of your own (metres, one point per disk vertex): it is turned upright or into its
    /// smallest box, and its distortion is measured. `up` as in [`crate::Settings::up`]; `iterations` is only reported.
    ///
    /// # Errors
    /// [`Error::Length`], [`Error::NonFiniteValue`], or [`Error::FlatPoints`] for a layout on one line.
    pub fn new(disk: Disk, mut uv: Vec<[f64; 2]>, iterations: usize, up: Option<[f64; 3]>) -> Result<Self, Error> {
        if uv.len() != disk.positions.len() {
            return Err(Error::Length { what: "uv", expected: disk.positions.len(), found: uv.len() });
        }
        let size = placement::place(&disk, &mut uv, up)?;
        Ok(Self::placed(disk, uv, size, iterations))
    }

    /// A chart that lies where it is to lie, in a box of this size.
    pub(crate) fn placed(disk: Disk, uv: Vec<[f64; 2]>, [width, height]: [f64; 2], iterations: usize) -> Self {
        let grid = Grid::new(&uv, &disk.faces, [width, height]);
        let vertex_normals = normals::vertex_normals(&disk);
        Self { disk, uv, width, height, iterations, quality: OnceLock::new(), vertex_normals, grid }
    }

    /// The surface.
    pub fn disk(&self) -> &Disk {
        &self.disk
    }

    pub(crate) fn into_disk(self) -> Disk {
        self.disk
    }

    /// Layout, one point per disk vertex, metres.
    pub fn uv(&self) -> &[[f64; 2]] {
        &self.uv
    }

    /// Long side of the box, metres.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Short side of the box, metres.
    pub fn height(&self) -> f64 {
        self.height
    }

    /// Distortion metrics, measured when they are first asked for.
    pub fn quality(&self) -> &Quality {
        self.quality.get_or_init(|| {
            Quality::measure(&self.disk, &self.uv, self.grid.overlap(&self.uv, &self.disk.faces), self.iterations)
        })
    }

    /// The surface point at `uv` (metres); on a common edge the face with the lower index. `None` outside the chart and
    /// for coordinates that are not finite.
    pub fn locate(&self, uv: [f64; 2]) -> Option<SurfacePoint> {
        self.grid.locate(&self.uv, &self.disk.faces, uv)
    }

    /// Place of a surface point in the chart, metres.
    pub fn uv_of(&self, at: SurfacePoint) -> [f64; 2] {
        let corners = self.disk.faces[at.face as usize].map(|v| self.uv[v as usize]);
        let mix = |k: usize| at.barycentric.iter().zip(corners).map(|(b, corner)| b * corner[k]).sum();
        [mix(0), mix(1)]
    }

    /// Position of a surface point in the frame of the mesh, metres (thesis Eq. (8.1), first line).
    pub fn point(&self, at: SurfacePoint) -> Point3<f64> {
        let corners = self.disk.corners(at.face as usize).map(Vector3::from);
        Point3::from(at.interpolate(corners))
    }

    /// Unit normal of a face.
    pub fn face_normal(&self, face: u32) -> Unit<Vector3<f64>> {
        Unit::new_normalize(self.disk.face_cross(face as usize))
    }

    /// Unit normal that changes continuously over the surface: vertex normals weighted by corner angle, interpolated.
    pub fn smooth_normal(&self, at: SurfacePoint) -> Unit<Vector3<f64>> {
        let corners = self.disk.faces[at.face as usize].map(|v| self.vertex_normals[v as usize]);
        Unit::try_new(at.interpolate(corners), f64::EPSILON).unwrap_or_else(|| self.face_normal(at.face))
    }

    /// Unit normal averaged over the disc of `radius` metres around `at` in the chart: what a spray footprint sees of a
    /// rough surface. The disc goes on beyond seams; what lies beyond open borders does not count.
    pub fn footprint_normal(&self, at: SurfacePoint, radius: f64) -> Unit<Vector3<f64>> {
        let centre = self.uv_of(at);
        let mean: Vector3<f64> = normals::disc(radius)
            .filter_map(|[u, v]| self.locate([centre[0] + u, centre[1] + v]).or_else(|| self.straight_on(at, [u, v])))
            .map(|sample| self.face_normal(sample.face).into_inner())
            .sum();
        Unit::try_new(mean, f64::EPSILON).unwrap_or_else(|| self.smooth_normal(at))
    }

    /// Signed singular values `[s1, s2]` of the map from a face to the chart (1 = true length); negative `s2` = flipped.
    pub fn stretch(&self, face: u32) -> [f64; 2] {
        let corners = self.disk.faces[face as usize].map(|v| self.uv[v as usize]);
        Frame::new(self.disk.corners(face as usize)).jacobian(corners).stretch()
    }
}
