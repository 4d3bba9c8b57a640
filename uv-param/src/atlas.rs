//! Any surface as charts: cut where it must be, each chart laid out within a bound of stretch, all in one scale.
//!
//! 1. Every part that is a disk already and can be laid out within the bounds is one chart.
//! 2. The rest is taken apart into regions of similar normals, more than are needed, each of which is laid out.
//! 3. Seams are closed again, the most useful first, as long as what they join can really be laid out within the bounds.
//! 4. Patches around seams change charts where that makes all seams together cheaper.

mod charts;
mod compute_charts;
mod cut;
mod merge;
mod pack;
mod parametrize;
mod quality;
mod segment;
mod texels;
mod update;

use cut::box_cutter::cut_and_pack;

use crate::chart::{Chart, SurfacePoint};
use crate::error::Error;
use crate::parametrizer::{Parametrizer, Progress};
use crate::surface::{FaceLookup, Surface, SurfaceReport};
use crate::trace::{event, span};
use crate::triangle;
pub use compute_charts::ChartSettings;
pub use pack::{PackSettings, Page, Placement, Turns};
pub use quality::AtlasQuality;
pub use texels::{PageTexels, TexelKind};
pub use update::{AtlasLayout, AtlasUpdate, update_atlas};

/// How a mesh becomes an atlas.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct AtlasSettings {
    /// Where to cut.
    pub charts: ChartSettings,
    /// Where to put the charts.
    pub pack: PackSettings,
}

/// A surface as charts on pages. Charts are in metres, all in the same scale, none mirrored, none overlapping itself.
#[derive(Debug, Clone)]
pub struct Atlas {
    surface: Surface,
    report: SurfaceReport,
    charts: Vec<Chart>,
    /// Chart of every face of the surface, and the face's number there.
    place_of_face: Vec<[u32; 2]>,
    /// Face of the surface for every face of every chart.
    members: Vec<Vec<u32>>,
    placements: Vec<Placement>,
    pages: Vec<Page>,
    texel_m: f64,
}

/// Lays a mesh (metres) out as an atlas: `seams` are edges, as pairs of vertices, at which the caller wants it open. `progress` hears
/// of every chart.
///
/// # Errors
/// As [`Surface::new`]; [`Error::Setting`]; [`Error::Seam`] for a seam that is no edge; [`Error::TooManyTexels`] where a chart is
/// larger than a page; [`Error::CollapsedOnPage`] where parts are so much smaller than the page that rounding flips faces.
pub fn unwrap_atlas(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    seams: &[[u32; 2]],
    settings: &AtlasSettings,
    progress: impl FnMut(Progress),
) -> Result<Atlas, Error> {
    let (surface, report) = Surface::new(positions, faces, settings.charts.join)?;
    Atlas::new(surface, report, seams, settings, None, progress)
}

impl Atlas {
    /// As [`unwrap_atlas`] for a surface that was checked before, with a parametrizer of choice for every chart.
    ///
    /// # Errors
    /// As there.
    pub fn new(
        surface: Surface,
        report: SurfaceReport,
        seams: &[[u32; 2]],
        settings: &AtlasSettings,
        parametrizer: Option<&dyn Parametrizer>,
        mut progress: impl FnMut(Progress),
    ) -> Result<Self, Error> {
        span!("atlas");
        event!(
            debug,
            degenerate_faces_dropped = report.degenerate_faces_dropped,
            duplicate_faces_dropped = report.duplicate_faces_dropped,
            non_manifold_edges_opened = report.non_manifold_edges_opened,
            "surface checked"
        );
        pack::check(&settings.pack, surface.area())?;
        let (charts, members) =
            compute_charts::compute_charts(&surface, seams, &settings.charts, parametrizer, &mut progress)?;
        let turned = settings.charts.up.is_none() && settings.pack.turns != Turns::None;
        let (charts, members, placements, pages) = cut_and_pack(&surface, charts, members, &settings.pack, turned)?;
        Self::of_parts(surface, report, charts, members, placements, pages, settings.pack.texel_m)
    }

    /// Charts with their faces, and where they lie.
    ///
    /// # Errors
    /// [`Error::CollapsedOnPage`].
    fn of_parts(
        surface: Surface,
        report: SurfaceReport,
        charts: Vec<Chart>,
        members: Vec<Vec<u32>>,
        placements: Vec<Placement>,
        pages: Vec<Page>,
        texel_m: f64,
    ) -> Result<Self, Error> {
        // Charts were asked before, but a page that is far larger than a chart rounds its coordinates away.
        let collapsed = |(chart, placement): (&Chart, &Placement)| {
            let on_page: Vec<[f64; 2]> = chart.uv().iter().map(|&uv| placement.apply(uv)).collect();
            triangle::flips(&on_page, chart.disk().faces())
        };
        let faces: usize = charts.iter().zip(&placements).map(collapsed).sum();
        if faces > 0 {
            return Err(Error::CollapsedOnPage { faces });
        }
        let mut place_of_face = vec![[0; 2]; surface.faces().len()];
        for (chart, faces) in members.iter().enumerate() {
            for (local, &f) in faces.iter().enumerate() {
                place_of_face[f as usize] = [chart as u32, local as u32];
            }
        }
        Ok(Self { surface, report, charts, place_of_face, members, placements, pages, texel_m })
    }

    /// The surface that was laid out.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// What was repaired, and left out.
    pub fn report(&self) -> &SurfaceReport {
        &self.report
    }

    /// The charts, each in a box of its own.
    pub fn charts(&self) -> &[Chart] {
        &self.charts
    }

    /// Where every chart lies.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Columns and rows of the pages, texels.
    pub fn pages(&self) -> &[Page] {
        &self.pages
    }

    /// Side of a texel, metres.
    pub fn texel_m(&self) -> f64 {
        self.texel_m
    }

    /// Chart of a face of the surface, and the face's number in it.
    pub fn chart_of_face(&self, face: usize) -> (usize, usize) {
        let [chart, local] = self.place_of_face[face];
        (chart as usize, local as usize)
    }

    /// Faces of the surface that a chart holds, in the order of the chart's faces.
    pub fn chart_faces(&self, chart: usize) -> &[u32] {
        &self.members[chart]
    }

    /// Page and place on it, metres from its lower left corner, of a surface point (a face of the SURFACE and weights).
    pub fn uv_of(&self, at: SurfacePoint) -> (usize, [f64; 2]) {
        let (chart, local) = self.chart_of_face(at.face as usize);
        let placement = &self.placements[chart];
        let uv = self.charts[chart].uv_of(SurfacePoint { face: local as u32, ..at });
        (placement.page, placement.apply(uv))
    }

    /// All charts of a page as one, where they lie on it: for everything that works on a single chart, texels and nozzle commands
    /// included. [`Disk::across_seam`](crate::Disk::across_seam) leads from chart to chart, and smooth normals go on there.
    /// `None` for a page that does not exist.
    pub fn page_chart(&self, page: usize) -> Option<Chart> {
        let size = self.pages.get(page)?.map(|texels| texels as f64 * self.texel_m);
        let on_page = |f: &u32| self.placements[self.place_of_face[*f as usize][0] as usize].page == page;
        let faces: Vec<u32> = (0..self.surface.faces().len() as u32).filter(on_page).collect();
        let is_seam = |h: usize| {
            let (chart, local) = self.chart_of_face(h / 3);
            self.charts[chart].disk().twin(3 * local + h % 3).is_none()
        };
        let disk = self.surface.piece(&faces, is_seam, &mut FaceLookup::new(&self.surface));
        let mut uv = vec![[0.0; 2]; disk.positions().len()];
        for (corners, &f) in disk.faces().iter().zip(&faces) {
            let (chart, local) = self.chart_of_face(f as usize);
            let there = self.charts[chart].disk().faces()[local];
            for (&v, &w) in corners.iter().zip(&there) {
                uv[v as usize] = self.placements[chart].apply(self.charts[chart].uv()[w as usize]);
            }
        }
        Some(Chart::placed(disk, uv, size, 0))
    }
}
