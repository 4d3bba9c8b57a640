//! A mesh made ready for painting: unwrapped, cut into texels, searchable for rays.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_net::Image;
use paint_net::problem::GhostPixels;
use paint_sim::{Texel, TriangleSurface};
use uv_param::atlas::{ChartSettings, PackSettings, Turns};
use uv_param::cut::CutSettings;
use uv_param::disk::RepairReport;
use uv_param::nozzle::{NormalMode, NozzleSettings};
use uv_param::texture::{Gutter, TexelMap};
use uv_param::{AtlasSettings, Chart, Disk, Error, Settings};

use crate::mesh_io::TriangleMesh;
use crate::region::Scene;

/// A chart is stretched too much to paint where a length changes by more than this factor: spots would be ellipses.
const MAX_STRETCH: f64 = 1.6;
/// Radius over which the normal is averaged for the robot, metres: the footprint of a spray (Paper IV, section 3.3).
const FOOTPRINT: f64 = 0.05;

/// A surface with its texture plane.
pub struct PaintSurface {
    /// The part of the mesh that is painted, laid out in the plane.
    pub chart: Chart,
    /// Texel to surface.
    pub texels: TexelMap,
    /// Texels beside the charts that show where the surface goes on beyond a seam, as far as a spray reaches.
    pub beyond_seams: GhostPixels,
    /// Everything there is to hit: the disk's faces first, in their order, then the rest of the mesh.
    pub world: TriangleSurface,
    /// What was left out of the disk.
    pub repair_report: RepairReport,
    /// Charts that `chart` consists of: 1 for a disk, more for a surface that is painted all around.
    pub charts: usize,
}

/// What is wrong with a mesh as a surface to paint.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// It cannot be unwrapped.
    #[error(transparent)]
    Unwrap(#[from] uv_param::Error),
    /// Its seams do not fit together in the plane.
    #[error(transparent)]
    Seams(#[from] paint_net::Error),
    /// It cannot be hit.
    #[error(transparent)]
    World(#[from] paint_sim::Error),
}

impl PaintSurface {
    /// Unwraps the largest part of a mesh (metres, z up) into texels of `texel` metres; where that is no disk, all parts into several
    /// charts. `progress` is told the share done.
    pub fn new(mesh: &TriangleMesh, texel: f64, progress: &dyn Fn(f64)) -> Result<Self, SurfaceError> {
        Self::of_parts(mesh, &TriangleMesh::default(), texel, progress)
    }

    /// The same for a place of which a part is painted: all of its pieces, and the rest is there to be hit.
    pub fn of_scene(scene: &Scene, texel: f64, progress: &dyn Fn(f64)) -> Result<Self, SurfaceError> {
        Self::of_parts(&scene.canvas, &scene.obstacles, texel, progress)
    }

    fn of_parts(
        mesh: &TriangleMesh,
        obstacles: &TriangleMesh,
        texel: f64,
        progress: &dyn Fn(f64),
    ) -> Result<Self, SurfaceError> {
        let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(f64::from)).collect();
        let repair = uv_param::disk::Repair { weld: true, split_vertices: true };
        let (disk, repair_report) = match uv_param::disk::largest_disk_with(&positions, &mesh.faces, repair) {
            // A region is painted in all of its pieces.
            Ok((_, report)) if report.components > 1 && !obstacles.faces.is_empty() => {
                return Self::all_around(&positions, mesh, obstacles, texel);
            }
            Ok(found) => found,
            // What is no disk is painted all around, in several charts.
            Err(
                Error::Closed { .. }
                | Error::HigherGenus { .. }
                | Error::NonManifoldEdge { .. }
                | Error::NotOrientable { .. },
            ) => {
                return Self::all_around(&positions, mesh, obstacles, texel);
            }
            Err(error) => return Err(error.into()),
        };
        let settings = Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() };
        let cuts = CutSettings { max_stretch: MAX_STRETCH, ..CutSettings::default() };
        let chart = uv_param::unwrap_with_cuts(&disk, &settings, &cuts, |p| {
            let share = p.iteration as f64 / settings.iterations as f64;
            progress(if p.stage == uv_param::parametrizer::Stage::Cut { 0.0 } else { share });
        })?;
        let texels = TexelMap::new(&chart, texel)?;
        let beyond_seams = beyond_seams(&chart, &texels)?;
        let world = world(&disk, [mesh, obstacles])?;
        Ok(Self { chart, texels, beyond_seams, world, repair_report, charts: 1 })
    }

    /// All parts of a mesh of any topology, as upright charts on one page.
    fn all_around(
        positions: &[[f64; 3]],
        mesh: &TriangleMesh,
        obstacles: &TriangleMesh,
        texel: f64,
    ) -> Result<Self, SurfaceError> {
        let charts = ChartSettings { up: Some([0.0, 0.0, 1.0]), ..ChartSettings::default() };
        // The footprint of a spray must not reach from chart to chart across the page, and what it puts beyond its own seam must not
        // lie where another chart's does.
        let gutter = 2 * reach(texel);
        let pack = PackSettings { texel_m: texel, gutter, turns: Turns::None, ..PackSettings::default() };
        let atlas = uv_param::unwrap_atlas(positions, &mesh.faces, &[], &AtlasSettings { charts, pack }, |_| ())?;
        let chart = atlas.page_chart(0).ok_or(Error::ZeroArea)?;
        let texels = TexelMap::new(&chart, texel)?;
        let beyond_seams = beyond_seams(&chart, &texels)?;
        let world = world(chart.disk(), [mesh, obstacles])?;
        let found = atlas.report();
        let repair_report = RepairReport {
            // Nothing is left out.
            components: 1,
            unreferenced_vertices: found.unreferenced_vertices,
            degenerate_faces_dropped: found.degenerate_faces_dropped,
            duplicate_faces_dropped: found.duplicate_faces_dropped,
            welded_vertices: found.welded_vertices,
            reversed_faces: found.reversed_faces,
            ..RepairReport::default()
        };
        Ok(Self { texels, beyond_seams, world, repair_report, charts: atlas.charts().len(), chart })
    }

    /// The part of the mesh that is painted.
    pub fn disk(&self) -> &Disk {
        self.chart.disk()
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.texels.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.texels.height
    }

    /// 1 on texels of the surface, 0 beside it.
    pub fn coverage(&self) -> Image {
        Image::from_fn(self.width(), self.height(), |x, y| f64::from(u8::from(self.texels.at(x, y).is_some())))
    }

    /// Whether the nozzle can do what the picture plane says: on the surface, not stretched beyond use, and tilted no more
    /// than `steepest` radians from what a level gun sees.
    pub fn paintable(&self, steepest: f64) -> Vec<bool> {
        let steep = |normal: &UnitVector3<f64>| normal.z.abs() > steepest.sin();
        self.pixels()
            .map(|(x, y)| {
                self.texels.at(x, y).is_some_and(|point| {
                    let [s1, s2] = self.chart.stretch(point.face);
                    let even = s1 < MAX_STRETCH && s2 > 1.0 / MAX_STRETCH;
                    // A texel at the rim may hold a sliver of surface beside its centre.
                    let centred = self.chart.locate(self.texels.uv_of_texel(x, y)).is_some();
                    centred && even && !steep(&self.chart.smooth_normal(point))
                })
            })
            .collect()
    }

    /// Which pixels lie on faces of the mesh that are marked; none where there are no marks.
    pub fn clean(&self, marked: &[bool]) -> Vec<bool> {
        let source = self.disk().face_source();
        let on_marked = |point: uv_param::SurfacePoint| marked.get(source[point.face as usize] as usize) == Some(&true);
        self.pixels().map(|(x, y)| self.texels.at(x, y).is_some_and(on_marked)).collect()
    }

    /// The texels that lie on the surface, with the pixel of each.
    pub fn film_texels(&self) -> (Vec<Texel>, Vec<usize>) {
        let mut texels = Vec::new();
        let mut pixels = Vec::new();
        for (x, y) in self.pixels() {
            let area = self.texels.area_m2[y * self.width() + x];
            if let Some(point) = self.texels.at(x, y).filter(|_| area > 0.0) {
                let normal = self.chart.face_normal(point.face);
                texels.push(Texel { point: self.chart.point(point), normal, area });
                pixels.push(y * self.width() + x);
            }
        }
        (texels, pixels)
    }

    /// The point of the surface under a place of the picture (pixels, fractions allowed), and the normal a spray there
    /// should follow (thesis Eq. (8.1) with the footprint's normal); `None` beside the surface.
    pub fn lift(&self, x: f64, y: f64) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        let texel = self.texels.texel_m;
        let uv = [(x + 0.5) * texel, (self.height() as f64 - y - 0.5) * texel];
        let nozzle =
            NozzleSettings { normal: NormalMode::Footprint { radius: FOOTPRINT }, ..NozzleSettings::default() };
        let command = uv_param::nozzle::nozzle_command(&self.chart, uv, &nozzle).ok()?;
        Some((command.point, -command.direction))
    }

    /// The same `offset` pixels on from a place of the picture: beyond a seam the surface goes on in another chart.
    pub fn lift_from(&self, [x, y]: [f64; 2], offset: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        let texel = self.texels.texel_m;
        let from = self.chart.locate([(x + 0.5) * texel, (self.height() as f64 - y - 0.5) * texel])?;
        let point = self.chart.straight_on(from, [offset[0] * texel, -offset[1] * texel])?;
        Some((self.chart.point(point), self.chart.footprint_normal(point, FOOTPRINT)))
    }

    /// Vertices of the disk, metres, as files and recordings hold them.
    pub fn vertices(&self) -> Vec<[f32; 3]> {
        self.disk().positions().iter().map(|p| p.map(|c| c as f32)).collect()
    }

    /// Least and largest coordinates of its vertices, m.
    pub fn corners(&self) -> [Point3<f64>; 2] {
        let positions = self.disk().positions().iter().map(|p| Point3::from(*p));
        positions.fold([Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])], |[low, high], p| {
            [low.inf(&p), high.sup(&p)]
        })
    }

    /// Mean normal over the chart: the side from which a picture of it is taken. Short for surfaces that close in.
    pub fn facing(&self) -> Vector3<f64> {
        let normals = self
            .disk()
            .faces()
            .iter()
            .enumerate()
            .map(|(face, _)| self.chart.face_normal(face as u32).into_inner() * self.disk().face_area(face));
        normals.sum::<Vector3<f64>>() / self.disk().area()
    }

    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> {
        let width = self.width();
        (0..width * self.height()).map(move |k| (k % width, k / width))
    }
}

/// How far a spray reaches, texels: all but a ten-thousandth of its paint.
fn reach(texel: f64) -> usize {
    (2.0 * FOOTPRINT / texel).ceil() as usize
}

/// What lies beyond the seams of a chart, for the painter.
fn beyond_seams(chart: &Chart, texels: &TexelMap) -> Result<GhostPixels, paint_net::Error> {
    let gutter = Gutter::new(chart, texels, reach(texels.texel_m));
    let ghosts = gutter.texels.into_iter().map(|t| (t.texel, t.sources)).collect();
    GhostPixels::new(ghosts, gutter.rim, (texels.width, texels.height))
}

/// The disk's faces, then the faces of its mesh that are not in it, then the obstacles.
fn world(disk: &Disk, [mesh, obstacles]: [&TriangleMesh; 2]) -> Result<TriangleSurface, SurfaceError> {
    let mut positions: Vec<[f32; 3]> = disk.positions().iter().map(|p| p.map(|c| c as f32)).collect();
    let mut faces = disk.faces().to_vec();
    let offset = positions.len() as u32;
    let mut in_disk = vec![false; mesh.faces.len()];
    for &source in disk.face_source() {
        in_disk[source as usize] = true;
    }
    positions.extend_from_slice(&mesh.positions);
    faces.extend(mesh.faces.iter().zip(in_disk).filter(|(_, inside)| !inside).map(|(f, _)| f.map(|i| i + offset)));
    let offset = positions.len() as u32;
    positions.extend_from_slice(&obstacles.positions);
    faces.extend(obstacles.faces.iter().map(|f| f.map(|i| i + offset)));
    Ok(TriangleSurface::new(&positions, &faces)?)
}
