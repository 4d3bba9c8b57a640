//! Texels of the pages: which point of the surface each one is, in the gutters as well.

use crate::atlas::Atlas;
use crate::chart::{SurfacePoint, inside};
use crate::unfold::{MAX_REACH, Nearest, across, for_texels, note_edge};

/// What a texel of a page is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TexelKind {
    /// Nothing is near.
    Empty,
    /// Its centre lies in a chart.
    Inside,
    /// Its centre lies beside a chart; the point is where the surface goes on there, in the neighbouring chart, or at an open
    /// border the nearest point.
    Gutter,
}

/// The texels of one page, row-major, row 0 at the TOP (largest v).
#[derive(Debug, Clone, PartialEq)]
pub struct PageTexels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Point of the surface (a face of [`Atlas::surface`] and weights) of every texel; `None` where nothing is near.
    pub points: Vec<Option<SurfacePoint>>,
    /// What the texel is.
    pub kinds: Vec<TexelKind>,
}

impl PageTexels {
    /// The texels of every page of an atlas, with `gutter` texels around the charts. A gutter texel is the point of the surface
    /// that lies there when the surface is unfolded across the seam, so that what is sampled (bilinearly) at the rim of a
    /// chart agrees with what is sampled on the other side.
    pub fn of(atlas: &Atlas, gutter: usize) -> Vec<Self> {
        let gutter = gutter.min(MAX_REACH);
        (0..atlas.pages().len()).map(|page| texels_of_page(atlas, page, gutter)).collect()
    }

    /// Fills an image: `sample` is asked once per texel that is not empty.
    pub fn fill<T: Clone>(&self, empty: T, mut sample: impl FnMut(SurfacePoint) -> T) -> Vec<T> {
        self.points.iter().map(|point| point.map_or_else(|| empty.clone(), &mut sample)).collect()
    }
}

/// The texels of one page.
fn texels_of_page(atlas: &Atlas, page: usize, gutter: usize) -> PageTexels {
    let [width, height] = atlas.pages()[page];
    let mut texels =
        PageTexels { width, height, points: vec![None; width * height], kinds: vec![TexelKind::Empty; width * height] };
    let mut nearest: Vec<Option<Nearest>> = vec![None; width * height];
    for (number, (chart, placement)) in atlas.charts().iter().zip(atlas.placements()).enumerate() {
        if placement.page != page {
            continue;
        }
        let on_page: Vec<[f64; 2]> =
            chart.uv().iter().map(|&uv| placement.apply(uv).map(|x| x / atlas.texel_m())).collect();
        for (local, face) in chart.disk().faces().iter().enumerate() {
            let corners = face.map(|v| on_page[v as usize]);
            let f = atlas.chart_faces(number)[local];
            for_texels(corners, 0, [width, height], |texel, centre| {
                if texels.points[texel].is_none()
                    && let Some(barycentric) = inside(corners, centre)
                {
                    texels.points[texel] = Some(SurfacePoint { face: f, barycentric });
                    texels.kinds[texel] = TexelKind::Inside;
                }
            });
            for k in (0..3).filter(|&k| chart.disk().twin(3 * local + k).is_none()) {
                let ends = [corners[k], corners[(k + 1) % 3]];
                note_edge(ends, 3 * f + k as u32, gutter, [width, height], &mut nearest);
            }
        }
    }
    for (texel, nearest) in nearest.into_iter().enumerate() {
        if let (None, Some(nearest)) = (texels.points[texel], nearest) {
            let centre = [(texel % width) as f64 + 0.5, (height - 1 - texel / width) as f64 + 0.5];
            texels.points[texel] = Some(beyond(atlas, nearest, centre.map(|x| x * atlas.texel_m())));
            texels.kinds[texel] = TexelKind::Gutter;
        }
    }
    texels
}

/// The point of the surface at a place of a page just beyond an edge of a chart.
fn beyond(atlas: &Atlas, nearest: Nearest, at: [f64; 2]) -> SurfacePoint {
    let (h, surface) = (nearest.half_edge as usize, atlas.surface());
    let clamped = || {
        let mut barycentric = [0.0; 3];
        barycentric[h % 3] = 1.0 - nearest.along;
        barycentric[(h + 1) % 3] = nearest.along;
        SurfacePoint { face: (h / 3) as u32, barycentric }
    };
    let Some(twin) = surface.twin(h) else { return clamped() };
    let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
    let corner = |h: usize| {
        let (chart, local) = atlas.chart_of_face(h / 3);
        let v = atlas.charts()[chart].disk().faces()[local][h % 3];
        atlas.charts()[chart].uv()[v as usize]
    };
    let placed = |h: usize| {
        let (chart, _) = atlas.chart_of_face(h / 3);
        atlas.placements()[chart].apply(corner(h))
    };
    let place = across([placed(h), placed(next(h))], [corner(next(twin)), corner(twin)], at);
    let (chart, _) = atlas.chart_of_face(twin / 3);
    atlas.charts()[chart]
        .locate(place)
        .map_or_else(clamped, |found| SurfacePoint { face: atlas.chart_faces(chart)[found.face as usize], ..found })
}
