//! Small charts become parts of large neighbours where these can take them as they lie.

use std::collections::{BTreeMap, HashSet};

use crate::atlas::charts::Charts;
use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::cut::seam_graph::{Arc, arcs};
use crate::atlas::parametrize::add_region::add_region;
use crate::atlas::parametrize::fit::Bounds;
use crate::atlas::parametrize::procrustes::seam_alignment;
use crate::atlas::parametrize::refine::{is_small, keep};
use crate::atlas::parametrize::untangle::untangle;

/// Share of a seam's length by which its two sides may differ in shape.
const MAX_MISFIT: f64 = 0.12;
/// Times that every small chart is offered to a neighbour.
const ROUNDS: usize = 2;

/// Offers every small chart to the large one with which it has the longest seam, then to the next; charts for which `stays` holds are not
/// touched.
pub(in crate::atlas) fn merge_small_charts(
    charts: &mut Charts,
    costs: &SeamCosts,
    bounds: Bounds,
    stays: &HashSet<u32>,
) {
    // First face of the source, and target.
    let mut refused: HashSet<(u32, u32)> = HashSet::new();
    for _ in 0..ROUNDS {
        let sources = merge_candidates(charts, costs, stays, &refused);
        if sources.is_empty() {
            return;
        }
        for (target, arcs) in sources {
            refused.extend(arcs.iter().map(|(source, _)| (charts.members[*source as usize][0], target)));
            merge_into(charts, target, &arcs, bounds);
        }
    }
}

/// For every target the sources, and the seams (half-edges of the target) that are to close.
fn merge_candidates(
    charts: &Charts,
    costs: &SeamCosts,
    stays: &HashSet<u32>,
    refused: &HashSet<(u32, u32)>,
) -> BTreeMap<u32, Vec<(u32, Vec<u32>)>> {
    let is_small = |c: u32| is_small(charts, charts.members[c as usize].len());
    let mut best: BTreeMap<u32, (f64, u32, Vec<u32>)> = BTreeMap::new();
    for Arc { half_edges, left, right } in arcs(charts) {
        if left == right || charts.wanted[half_edges[0] as usize] || stays.contains(&left) || stays.contains(&right) {
            continue;
        }
        let cost = costs.sum(&half_edges);
        for (source, target) in [(left, right), (right, left)] {
            let known = best.get(&source).is_some_and(|(found, ..)| *found >= cost);
            let barred = refused.contains(&(charts.members[source as usize][0], target));
            if is_small(source) && !is_small(target) && !known && !barred {
                let twin = |&h: &u32| charts.surface.twin(h as usize).map(|twin| twin as u32);
                let own =
                    if target == left { half_edges.clone() } else { half_edges.iter().filter_map(twin).collect() };
                let length: f64 = half_edges.iter().map(|&h| charts.surface.edge(h as usize).norm()).sum();
                if seam_alignment(charts, &own, false).residual < MAX_MISFIT * length {
                    best.insert(source, (cost, target, own));
                }
            }
        }
    }
    let mut by_target: BTreeMap<u32, Vec<(u32, Vec<u32>)>> = BTreeMap::new();
    for (source, (_, target, seam)) in best {
        by_target.entry(target).or_default().push((source, seam));
    }
    by_target
}

/// Brings the sources into the plane of the target, and repairs the layout that comes of it; what cannot be held becomes charts of its own again.
fn merge_into(charts: &mut Charts, target: u32, sources: &[(u32, Vec<u32>)], bounds: Bounds) {
    let before: Vec<(u32, Vec<[f64; 2]>)> = sources
        .iter()
        .flat_map(|(source, _)| charts.members[*source as usize].iter().copied())
        .map(|f| (f, charts.corner_uv[3 * f as usize..3 * f as usize + 3].to_vec()))
        .collect();
    for (source, seam) in sources {
        align(charts, *source, target, seam);
    }
    let added: HashSet<u32> = before.iter().map(|(f, _)| *f).collect();
    let mut faces = charts.members[target as usize].clone();
    faces.extend(&added);
    faces.sort_unstable();
    let laid_out = charts.disk(&faces).and_then(|disk| {
        let start = charts.vertex_uv(&faces, &disk, |_, at| at);
        let is_added: Vec<bool> = faces.iter().map(|f| added.contains(f)).collect();
        let found = untangle(&disk, start, &is_added, bounds)?;
        // As many charts as before are no gain.
        let is_gain = !found.parted.contains(&true) || charts.pieces(&faces, &found.parted).len() <= sources.len();
        is_gain.then_some((disk, found))
    });
    let Some((disk, layout)) = laid_out else {
        for (f, uv) in before {
            charts.corner_uv[3 * f as usize..3 * f as usize + 3].copy_from_slice(&uv);
        }
        return;
    };
    charts.members[target as usize].clear();
    for (source, _) in sources {
        charts.members[*source as usize].clear();
    }
    for piece in keep(charts, faces, &disk, &layout, bounds) {
        add_region(charts, piece, bounds, None);
    }
}

/// Moves a source to the target so that one seam closes; all other edges that they have in common stay open.
fn align(charts: &mut Charts, source: u32, target: u32, seam: &[u32]) {
    let surface = charts.surface;
    let to_target = seam_alignment(charts, seam, false);
    let corners = charts.members[source as usize].iter().flat_map(|&f| 3 * f as usize..3 * f as usize + 3);
    for h in corners {
        charts.corner_uv[h] = to_target.apply(charts.corner_uv[h]);
        if let Some(twin) = surface.twin(h).filter(|twin| charts.chart[twin / 3] == target) {
            (charts.cut[h], charts.cut[twin]) = (true, true);
        }
    }
    for &h in seam {
        if let Some(twin) = surface.twin(h as usize) {
            (charts.cut[h as usize], charts.cut[twin]) = (false, false);
        }
    }
}
