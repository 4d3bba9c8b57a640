//! The figures of an atlas.

use serde::Serialize;
use uv_param::Atlas;
use uv_param::atlas::{AtlasQuality, AtlasUpdate, ChartSettings};

/// What `report.json` of `unwrap` holds. Flat, SI units in the names; every number is finite.
#[derive(Debug, Clone, Serialize)]
pub struct UnwrapReport {
    /// Version of the program.
    pub version: &'static str,
    /// Faces that were laid out.
    pub faces: usize,
    /// Parts of the mesh that share no edge.
    pub parts: usize,
    /// Charts.
    pub charts: usize,
    /// Area of the surface.
    pub area_m2: f64,
    /// Length of the seams on the surface.
    pub seam_length_m: f64,
    /// The same over the square root of the area.
    pub seam_relative: f64,
    /// 99th percentile over the faces of the stretch `max(s1, 1 / s2)`.
    pub stretch_p99: f64,
    /// Whether that is more than the usual bound, relaxed to save seams.
    pub stretch_relaxed: bool,
    /// Largest stretch.
    pub stretch_max: f64,
    /// Area-weighted mean of the symmetric Dirichlet energy over its minimum: 1 is an isometry.
    pub symmetric_dirichlet: f64,
    /// Faces that are turned over or flat, in double precision.
    pub flips: usize,
    /// The same after rounding to single precision.
    pub flips_f32: usize,
    /// Pairs of faces that lie on each other.
    pub overlaps: usize,
    /// Area of the charts over the area of the pages.
    pub utilisation: f64,
    /// Pages.
    pub pages: usize,
    /// Columns of a page.
    pub page_width_px: usize,
    /// Rows of a page.
    pub page_height_px: usize,
    /// Side of a texel.
    pub texel_m: f64,
    /// Area-weighted mean of the relative error of lengths.
    pub length_error_mean: f64,
    /// 99th percentile of the same.
    pub length_error_p99: f64,
    /// Faces left out because they have no area or a repeated corner.
    pub repaired_degenerate_faces: usize,
    /// Faces left out because they were there twice.
    pub repaired_duplicate_faces: usize,
    /// Vertices that no face uses; they stay in the file.
    pub repaired_unreferenced_vertices: usize,
    /// Vertices that count as one with another at the same position; both stay in the file.
    pub repaired_joined_vertices: usize,
    /// Edges with more than two faces, opened.
    pub repaired_non_manifold_edges: usize,
    /// Edges opened because the surface would have one side only.
    pub repaired_one_sided_edges: usize,
    /// Faces whose winding was turned to agree with their part.
    pub repaired_windings: usize,
    /// With `--previous`: faces that were there before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_faces: Option<usize>,
    /// Charts that are the same to the bit, at the same texels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept_charts: Option<usize>,
    /// Charts that lost or won faces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed_charts: Option<usize>,
    /// Charts that were not there before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub new_charts: Option<usize>,
    /// Wall-clock time of the run.
    pub wall_s: f64,
    /// Processor time of cutting, laying out and packing.
    pub cpu_s: f64,
}

impl UnwrapReport {
    pub(super) fn new(
        atlas: &Atlas,
        charts: &ChartSettings,
        update: Option<AtlasUpdate>,
        wall_s: f64,
        cpu_s: f64,
    ) -> Self {
        let (quality, repairs) = (AtlasQuality::of(atlas), atlas.report());
        let [page_width_px, page_height_px] = atlas.pages()[0];
        Self {
            version: env!("CARGO_PKG_VERSION"),
            faces: atlas.surface().faces().len(),
            parts: repairs.parts,
            charts: quality.charts,
            area_m2: quality.area_m2,
            seam_length_m: quality.seam_length_m,
            seam_relative: quality.seam_relative,
            stretch_p99: quality.stretch_p99,
            stretch_relaxed: charts.relaxed_stretch.is_some() && quality.stretch_p99 > charts.max_stretch,
            stretch_max: quality.stretch_max,
            symmetric_dirichlet: quality.symmetric_dirichlet,
            flips: quality.flips,
            flips_f32: quality.flips_f32,
            overlaps: quality.overlap_pairs,
            utilisation: quality.utilisation,
            pages: atlas.pages().len(),
            page_width_px,
            page_height_px,
            texel_m: atlas.texel_m(),
            length_error_mean: quality.length_err_mean,
            length_error_p99: quality.length_err_p99,
            repaired_degenerate_faces: repairs.degenerate_faces_dropped,
            repaired_duplicate_faces: repairs.duplicate_faces_dropped,
            repaired_unreferenced_vertices: repairs.unreferenced_vertices,
            repaired_joined_vertices: repairs.welded_vertices,
            repaired_non_manifold_edges: repairs.non_manifold_edges_opened,
            repaired_one_sided_edges: repairs.one_sided_edges_opened,
            repaired_windings: repairs.reversed_faces,
            kept_faces: update.map(|u| u.kept_faces),
            kept_charts: update.map(|u| u.kept_charts),
            changed_charts: update.map(|u| u.changed_charts),
            new_charts: update.map(|u| u.new_charts),
            wall_s,
            cpu_s,
        }
    }
}
