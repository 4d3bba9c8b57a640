//! What lies beyond the seams of a chart, texel by texel: for everything that works on the plane and must not end at a cut.

use std::collections::BTreeMap;

use crate::chart::{Chart, SurfacePoint};
use crate::texture::texel_map::TexelMap;
use crate::unfold::{MAX_REACH, Nearest, note_edge};

/// What lies beyond the seams of a chart, no farther than a reach: the ghost cells of a domain that is computed in parts. Open borders of
/// the surface have none.
///
/// A picture goes on in [`Gutter::texels`], which show what lies on the other side. What is computed on the plane beside a seam, as the part of a
/// spray that falls there, belongs to the [`Gutter::rim`] of the other side.
#[derive(Debug, Clone, PartialEq)]
pub struct Gutter {
    /// Texels whose centres lie beside the chart, in their order.
    pub texels: Vec<GutterTexel>,
    /// Texels whose centres lie in the chart, in their order: each with the texels, of the gutter mostly, between which it lies when the
    /// other side is continued to it.
    pub rim: Vec<(usize, WeightedTexels)>,
}

/// Texels and weights that sum to 1: bilinear interpolation.
pub type WeightedTexels = Vec<(usize, f64)>;

/// A texel just beyond a seam.
#[derive(Debug, Clone, PartialEq)]
pub struct GutterTexel {
    /// Its index in the [`TexelMap`].
    pub texel: usize,
    /// The point of the surface that lies there when the surface is unfolded across the seam.
    pub point: SurfacePoint,
    /// Texels around that point whose centres lie in the chart.
    pub sources: WeightedTexels,
}

impl Gutter {
    /// The gutter of a chart, `reach` texels wide (64 at most). Where a cut is narrower than two gutters, each side has the texels that are
    /// nearer to it.
    pub fn new(chart: &Chart, map: &TexelMap, reach: usize) -> Self {
        let nearest = nearest_borders(chart, map, reach.min(MAX_REACH));
        Self { texels: beyond_seams(chart, map, &nearest), rim: continued(chart, map, &nearest) }
    }
}

/// The border of the chart that is nearest to each texel: seams, and open borders of the surface.
fn nearest_borders(chart: &Chart, map: &TexelMap, reach: usize) -> Vec<Option<Nearest>> {
    let mut nearest = vec![None; map.width * map.height];
    for h in (0..3 * chart.disk().faces().len()).filter(|&h| chart.disk().twin(h).is_none()) {
        let ends = chart.edge_uv(h).map(|p| p.map(|x| x / map.texel_m));
        note_edge(ends, h as u32, reach, [map.width, map.height], &mut nearest);
    }
    nearest
}

/// Centre of a texel in the chart.
fn centre(map: &TexelMap, texel: usize) -> [f64; 2] {
    map.uv_of_texel(texel % map.width, texel / map.width)
}

fn beyond_seams(chart: &Chart, map: &TexelMap, nearest: &[Option<Nearest>]) -> Vec<GutterTexel> {
    let beyond = |texel: usize| {
        let (at, near) = (centre(map, texel), nearest[texel]?);
        if chart.locate(at).is_some() {
            return None;
        }
        let [a, b] = chart.edge_uv(near.half_edge as usize);
        let rim = [0, 1].map(|k| a[k] + near.along * (b[k] - a[k]));
        chart.straight_across(near.half_edge as usize, [rim, at])
    };
    let points: BTreeMap<usize, SurfacePoint> =
        (0..nearest.len()).filter_map(|texel| Some((texel, beyond(texel)?))).collect();
    let itself = |k: usize| (map.cells[k].is_some() && chart.locate(centre(map, k)).is_some()).then(|| vec![(k, 1.0)]);
    // A point near the other side's rim lies between texels of which some are gutter themselves: those stand for what they show.
    let shown: BTreeMap<usize, WeightedTexels> =
        points.iter().map(|(&texel, &point)| (texel, interpolation(map, chart.uv_of(point), itself))).collect();
    let known = |k: usize| itself(k).or_else(|| shown.get(&k).cloned());
    let texel = |(&texel, &point)| GutterTexel { texel, point, sources: interpolation(map, chart.uv_of(point), known) };
    points.iter().map(texel).filter(|t| !t.sources.is_empty()).collect()
}

/// The texels of the chart near a seam, where they lie on the plane of the other side.
fn continued(chart: &Chart, map: &TexelMap, nearest: &[Option<Nearest>]) -> Vec<(usize, WeightedTexels)> {
    let place = |texel: usize| {
        let (at, near) = (centre(map, texel), nearest[texel]?);
        chart.locate(at)?;
        let (_, [place, _]) = chart.over_seam(near.half_edge as usize, [at, at])?;
        let around = between(map, place);
        // In a narrow cut it may lie on this side again, or nearer to it: what is computed there is this side's own.
        let free = |&(k, _): &(usize, f64)| nearest[k].is_none_or(|there| there.distance > near.distance - 1.5);
        (chart.locate(place).is_none() && around.iter().all(free)).then_some((texel, around))
    };
    (0..nearest.len()).filter_map(place).collect()
}

/// The texels around a place, with bilinear weights.
fn between(map: &TexelMap, [u, v]: [f64; 2]) -> WeightedTexels {
    let place = [u / map.texel_m - 0.5, map.height as f64 - v / map.texel_m - 0.5];
    let mut texels = Vec::with_capacity(4);
    for corner in 0..4_usize {
        let at = [corner % 2, corner / 2];
        let [column, row] = [0, 1].map(|k| place[k].floor() + at[k] as f64);
        let [x, y] = [0, 1].map(|k| {
            let share = place[k] - place[k].floor();
            if at[k] == 1 { share } else { 1.0 - share }
        });
        let held = column >= 0.0 && row >= 0.0 && column < map.width as f64 && row < map.height as f64;
        if held && x * y > 0.0 {
            texels.push((row as usize * map.width + column as usize, x * y));
        }
    }
    texels
}

/// What the texels around a place stand for; those that `known` has nothing for are left out.
fn interpolation(map: &TexelMap, place: [f64; 2], known: impl Fn(usize) -> Option<WeightedTexels>) -> WeightedTexels {
    let mut sources = BTreeMap::new();
    for (texel, share) in between(map, place) {
        for (source, weight) in known(texel).into_iter().flatten() {
            *sources.entry(source).or_insert(0.0) += share * weight;
        }
    }
    let sum: f64 = sources.values().sum();
    sources.into_iter().map(|(texel, weight)| (texel, weight / sum)).collect()
}
