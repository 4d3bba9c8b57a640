//! Distortion, seams and pages of a whole atlas.

use crate::atlas::Atlas;

/// Figures of merit of an atlas.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct AtlasQuality {
    /// Number of charts.
    pub charts: usize,
    /// Length of all seams on the surface, metres; the two sides of a seam count once, open borders of the mesh not at all.
    pub seam_length_m: f64,
    /// The same over the square root of the area.
    pub seam_relative: f64,
    /// 99th percentile over all faces of `max(s1, 1 / |s2|)`.
    pub stretch_p99: f64,
    /// Largest of them.
    pub stretch_max: f64,
    /// Faces that are not strictly counter-clockwise on their page (exact predicate on the f64 coordinates).
    pub flips: usize,
    /// The same after rounding the coordinates on the page to f32.
    pub flips_f32: usize,
    /// Area of charts that lies on other parts of the same chart, as a share of the whole.
    pub overlap_share: f64,
    /// Pairs of faces that lie on each other (exact predicate), by more than rounding can make: a few `f64::EPSILON` of the squared diagonal of the
    /// chart.
    pub overlap_pairs: usize,
    /// Area-weighted mean of `max(|s1 - 1|, ||s2| - 1|)`.
    pub length_err_mean: f64,
    /// 99th percentile of the same, weighted by area.
    pub length_err_p99: f64,
    /// Area-weighted mean of `(s1^2 + s2^2 + s1^-2 + s2^-2) / 4`.
    pub symmetric_dirichlet: f64,
    /// Area of the charts over the area of the pages.
    pub utilisation: f64,
    /// Area of the surface, m^2.
    pub area_m2: f64,
}

impl AtlasQuality {
    /// Measures an atlas.
    pub fn of(atlas: &Atlas) -> Self {
        let surface = atlas.surface();
        let mut stretches = Vec::with_capacity(surface.faces().len());
        let mut errors = Vec::with_capacity(surface.faces().len());
        let (mut area, mut flat, mut overlap, mut energy) = (0.0, 0.0, 0.0, 0.0);
        let (mut flips, mut flips_f32, mut overlap_pairs) = (0, 0, 0);
        for (chart, placement) in atlas.charts().iter().zip(atlas.placements()) {
            let on_page: Vec<[f64; 2]> = chart.uv().iter().map(|&uv| placement.apply(uv)).collect();
            let rounded: Vec<[f64; 2]> = on_page.iter().map(|uv| uv.map(|x| f64::from(x as f32))).collect();
            flips += crate::triangle::flips(&on_page, chart.disk().faces());
            flips_f32 += crate::triangle::flips(&rounded, chart.disk().faces());
            let quality = chart.quality();
            energy += quality.symmetric_dirichlet * quality.area_m2;
            for face in 0..chart.disk().faces().len() {
                let [s1, s2] = chart.stretch(face as u32);
                let size = chart.disk().face_area(face);
                area += size;
                flat += size * s1 * s2.max(0.0);
                stretches.push(s1.max(1.0 / s2.abs()));
                errors.push(((s1 - 1.0).abs().max((s2.abs() - 1.0).abs()), size));
            }
            overlap_pairs += quality.overlap_pairs;
            overlap += quality.overlap_share * quality.area_m2;
        }
        stretches.sort_unstable_by(f64::total_cmp);
        errors.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        let p99 = errors.iter().find(|(_, size)| {
            sum += size;
            sum >= 0.99 * area
        });
        let texels: f64 = atlas.pages().iter().map(|[columns, rows]| *columns as f64 * *rows as f64).sum();
        let seam_length_m = seam_length(atlas);
        Self {
            charts: atlas.charts().len(),
            seam_length_m,
            seam_relative: seam_length_m / area.sqrt(),
            stretch_p99: stretches[(0.99 * (stretches.len() - 1) as f64).round() as usize],
            stretch_max: stretches[stretches.len() - 1],
            flips,
            flips_f32,
            overlap_share: overlap / area,
            overlap_pairs,
            length_err_mean: errors.iter().map(|(error, size)| error * size).sum::<f64>() / area,
            length_err_p99: p99.map_or(0.0, |p| p.0),
            symmetric_dirichlet: energy / area,
            utilisation: flat / (texels * atlas.texel_m() * atlas.texel_m()),
            area_m2: area,
        }
    }
}

/// Length of the edges whose two sides lie apart.
fn seam_length(atlas: &Atlas) -> f64 {
    let surface = atlas.surface();
    let is_seam = |h: usize, twin: usize| {
        let ((chart, f), (other, g)) = (atlas.chart_of_face(h / 3), atlas.chart_of_face(twin / 3));
        chart != other || atlas.charts()[chart].disk().twin(3 * f + h % 3) != Some(3 * g + twin % 3)
    };
    let inner = (0..3 * surface.faces().len()).filter_map(|h| surface.twin(h).map(|twin| (h, twin)));
    inner.filter(|&(h, twin)| h < twin && is_seam(h, twin)).map(|(h, _)| surface.edge(h).norm()).sum::<f64>() + 0.0
}
