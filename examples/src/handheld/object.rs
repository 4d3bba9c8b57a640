//! The object to paint: mesh, texture and the paint that is wanted on it.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::TriangleSurface;
use paint_sim::droplets::{Coverage, TexelFace, TexelSurface};
use uv_param::atlas::{ChartSettings, PackSettings, Turns};
use uv_param::texture::TexelMap;
use uv_param::{Atlas, AtlasSettings, Chart, unwrap_atlas};

use super::error::HandheldError;
use crate::mesh_io::TriangleMesh;

/// Texels between two charts: hits are looked up, not interpolated, so that one would do.
const GUTTER: usize = 2;

/// An object with its texture.
pub struct PaintObject {
    /// Surface with texels, for droplets.
    pub surface: TexelSurface,
    /// The same for single rays.
    pub world: TriangleSurface,
    /// The atlas as one chart.
    pub chart: Chart,
    /// What each texel is.
    pub texels: TexelMap,
    /// Wanted thickness of each texel, m.
    pub thickness: Vec<f64>,
    /// What is unusual about the mesh, in words.
    pub remarks: Vec<String>,
}

/// A point of the surface with its normal.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceSample {
    /// In the world, m.
    pub point: Point3<f64>,
    /// Outward.
    pub normal: UnitVector3<f64>,
}

impl PaintObject {
    /// Lays a mesh (m, z up) out with texels of `texel` metres, cut along the edges `seams` (vertex pairs), and asks `wanted` for the thickness
    /// at each texel's point.
    ///
    /// # Errors
    /// A mesh that cannot be laid out or that takes more than one page.
    pub fn new(
        mesh: &TriangleMesh,
        seams: &[[u32; 2]],
        texel: f64,
        wanted: &mut dyn FnMut(&SurfaceSample) -> f64,
    ) -> Result<Self, HandheldError> {
        Self::laid_out(mesh, seams, texel, |_, samples| {
            Ok(samples.iter().map(|s| s.as_ref().map_or(0.0, &mut *wanted)).collect())
        })
    }

    /// As [`new`](Self::new), the thickness of all texels from a function of the texture's size (columns, rows) and the texels' points.
    ///
    /// # Errors
    /// As [`new`](Self::new), and what the function refuses.
    pub fn laid_out(
        mesh: &TriangleMesh,
        seams: &[[u32; 2]],
        texel: f64,
        wanted: impl FnOnce([usize; 2], &[Option<SurfaceSample>]) -> Result<Vec<f64>, HandheldError>,
    ) -> Result<Self, HandheldError> {
        let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(f64::from)).collect();
        let charts = ChartSettings { up: Some([0.0, 0.0, 1.0]), ..ChartSettings::default() };
        let pack = PackSettings { texel_m: texel, gutter: GUTTER, turns: Turns::None, ..PackSettings::default() };
        let atlas = unwrap_atlas(&positions, &mesh.faces, seams, &AtlasSettings { charts, pack }, |_| ())?;
        let chart = atlas.page_chart(0).ok_or(uv_param::Error::ZeroArea)?;
        let texels = TexelMap::new(&chart, texel)?;
        let surface = TexelSurface::new(&texel_faces(&chart, &texels), [texels.width, texels.height], &texels.area_m2)?;
        let corners: Vec<[f32; 3]> = chart.disk().positions().iter().map(|p| p.map(|c| c as f32)).collect();
        let world = TriangleSurface::new(&corners, chart.disk().faces())?;
        let samples: Vec<_> = texels
            .cells
            .iter()
            .map(|cell| cell.map(|at| SurfaceSample { point: chart.point(at), normal: chart.face_normal(at.face) }))
            .collect();
        let thickness = wanted([texels.width, texels.height], &samples)?;
        let remarks = remarks(mesh, &atlas, &surface);
        Ok(Self { surface, world, chart, texels, thickness, remarks })
    }

    /// A bare surface.
    ///
    /// # Errors
    /// A target that is empty or of another size than the texture.
    pub fn bare(&self) -> Result<Coverage, HandheldError> {
        Ok(Coverage::new(&self.surface, &self.thickness)?)
    }

    /// Middle of the box around the object, m.
    pub fn middle(&self) -> Point3<f64> {
        let positions = || self.chart.disk().positions().iter().map(|p| Vector3::from(*p));
        let (low, high) = positions()
            .fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(low, high), p| (low.inf(&p), high.sup(&p)));
        Point3::from(0.5 * (low + high))
    }

    /// The texels where paint is wanted: points, normals and areas.
    pub fn wanted_points(&self) -> impl Iterator<Item = (SurfaceSample, f64)> + '_ {
        let cells = self.texels.cells.iter().zip(&self.texels.area_m2).zip(&self.thickness);
        cells.filter(|(_, thickness)| **thickness > 0.0).filter_map(|((cell, area), _)| {
            let at = (*cell)?;
            Some((SurfaceSample { point: self.chart.point(at), normal: self.chart.face_normal(at.face) }, *area))
        })
    }
}

fn texel_faces(chart: &Chart, texels: &TexelMap) -> Vec<TexelFace> {
    let (disk, uv) = (chart.disk(), chart.uv());
    let place = |v: u32| {
        let [x, y] = uv[v as usize].map(|c| c / texels.texel_m);
        [x as f32, (texels.height as f64 - y) as f32]
    };
    disk.faces()
        .iter()
        .map(|face| TexelFace {
            corners: face.map(|v| disk.positions()[v as usize].map(|c| c as f32)),
            texels: Some(face.map(place)),
        })
        .collect()
}

/// What the user of such a mesh should know.
fn remarks(mesh: &TriangleMesh, atlas: &Atlas, surface: &TexelSurface) -> Vec<String> {
    let report = atlas.report();
    let mut remarks = Vec::new();
    let left_out = report.degenerate_faces_dropped + report.duplicate_faces_dropped + surface.faces_left_out();
    if left_out > 0 {
        remarks.push(format!("{left_out} of {} faces have no area or stand twice: left out", mesh.faces.len()));
    }
    let thin = mesh.faces.iter().filter(|face| is_thin(&face.map(|v| mesh.positions[v as usize]))).count();
    if thin > 0 {
        remarks
            .push(format!("{thin} faces are thinner than 1 : 100: they are painted, but their texels are stretched"));
    }
    let open = open_edges(mesh);
    if open > 0 {
        remarks.push(format!("{open} edges have one face only: paint that goes through such a hole counts as lost"));
    }
    remarks
}

fn is_thin(corners: &[[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    let doubled = (b - a).cross(&(c - a)).norm();
    doubled > 0.0 && doubled < 0.01 * longest * longest
}

/// Edges between positions that belong to one face only.
fn open_edges(mesh: &TriangleMesh) -> usize {
    let key = |v: u32| mesh.positions[v as usize].map(|c| (c + 0.0).to_bits());
    let mut count = std::collections::BTreeMap::new();
    for face in &mesh.faces {
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (key(face[a]), key(face[b]));
            *count.entry(if a < b { (a, b) } else { (b, a) }).or_insert(0_usize) += 1;
        }
    }
    count.values().filter(|faces| **faces == 1).count()
}
