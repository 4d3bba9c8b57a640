//! Small charts become parts of large neighbours where these can take them as they lie.

use std::collections::{BTreeMap, HashSet};

use super::add_region::add_region;
use super::fit::Bounds;
use super::layout::Charts;
use super::mend::mend;
use super::motion::motion;
use super::price::SeamPrices;
use super::refine::{is_small, keep};
use super::seams::{Arc, arcs};

/// Share of a seam's length by which its two sides may differ in shape.
const MAX_MISFIT: f64 = 0.12;
/// Times that every small chart is offered to a neighbour.
const ROUNDS: usize = 2;

/// Offers every small chart to the large one with which it has the longest seam, then to the next; charts for which `stays` holds are not
/// touched.
pub(super) fn absorb(charts: &mut Charts, prices: &SeamPrices, bounds: Bounds, stays: &HashSet<u32>) {
    // First face of the guest, and host.
    let mut refused: HashSet<(u32, u32)> = HashSet::new();
    for _ in 0..ROUNDS {
        let guests = invitations(charts, prices, stays, &refused);
        if guests.is_empty() {
            return;
        }
        for (host, arcs) in guests {
            refused.extend(arcs.iter().map(|(guest, _)| (charts.members[*guest as usize][0], host)));
            take(charts, host, &arcs, bounds);
        }
    }
}

/// For every host the guests, and the seams (half-edges of the host) that are to close.
fn invitations(
    charts: &Charts,
    prices: &SeamPrices,
    stays: &HashSet<u32>,
    refused: &HashSet<(u32, u32)>,
) -> BTreeMap<u32, Vec<(u32, Vec<u32>)>> {
    let is_small = |c: u32| is_small(charts, charts.members[c as usize].len());
    let mut best: BTreeMap<u32, (f64, u32, Vec<u32>)> = BTreeMap::new();
    for Arc { half_edges, left, right } in arcs(charts) {
        if left == right || charts.wanted[half_edges[0] as usize] || stays.contains(&left) || stays.contains(&right) {
            continue;
        }
        let price = prices.sum(&half_edges);
        for (guest, host) in [(left, right), (right, left)] {
            let known = best.get(&guest).is_some_and(|(found, ..)| *found >= price);
            let barred = refused.contains(&(charts.members[guest as usize][0], host));
            if is_small(guest) && !is_small(host) && !known && !barred {
                let twin = |&h: &u32| charts.surface.twin(h as usize).map(|twin| twin as u32);
                let own = if host == left { half_edges.clone() } else { half_edges.iter().filter_map(twin).collect() };
                let length: f64 = half_edges.iter().map(|&h| charts.surface.edge(h as usize).norm()).sum();
                if motion(charts, &own, false).residual < MAX_MISFIT * length {
                    best.insert(guest, (price, host, own));
                }
            }
        }
    }
    let mut by_host: BTreeMap<u32, Vec<(u32, Vec<u32>)>> = BTreeMap::new();
    for (guest, (_, host, seam)) in best {
        by_host.entry(host).or_default().push((guest, seam));
    }
    by_host
}

/// Brings the guests into the plane of the host, and mends what comes of it; what cannot be held becomes charts of its own again.
fn take(charts: &mut Charts, host: u32, guests: &[(u32, Vec<u32>)], bounds: Bounds) {
    let before: Vec<(u32, Vec<[f64; 2]>)> = guests
        .iter()
        .flat_map(|(guest, _)| charts.members[*guest as usize].iter().copied())
        .map(|f| (f, charts.corner_uv[3 * f as usize..3 * f as usize + 3].to_vec()))
        .collect();
    for (guest, seam) in guests {
        bring(charts, *guest, host, seam);
    }
    let coming: HashSet<u32> = before.iter().map(|(f, _)| *f).collect();
    let mut faces = charts.members[host as usize].clone();
    faces.extend(&coming);
    faces.sort_unstable();
    let mended = charts.disk(&faces).and_then(|disk| {
        let start = charts.vertex_uv(&faces, &disk, |_, at| at);
        let is_guest: Vec<bool> = faces.iter().map(|f| coming.contains(f)).collect();
        let found = mend(&disk, start, &is_guest, bounds)?;
        // As many charts as before are no gain.
        let is_gain = !found.parted.contains(&true) || charts.pieces(&faces, &found.parted).len() <= guests.len();
        is_gain.then_some((disk, found))
    });
    let Some((disk, layout)) = mended else {
        for (f, uv) in before {
            charts.corner_uv[3 * f as usize..3 * f as usize + 3].copy_from_slice(&uv);
        }
        return;
    };
    charts.members[host as usize].clear();
    for (guest, _) in guests {
        charts.members[*guest as usize].clear();
    }
    for piece in keep(charts, faces, &disk, &layout, bounds) {
        add_region(charts, piece, bounds, None);
    }
}

/// Moves a guest to the host so that one seam closes; all other edges that they have in common stay open.
fn bring(charts: &mut Charts, guest: u32, host: u32, seam: &[u32]) {
    let surface = charts.surface;
    let to_host = motion(charts, seam, false);
    let corners = charts.members[guest as usize].iter().flat_map(|&f| 3 * f as usize..3 * f as usize + 3);
    for h in corners {
        charts.corner_uv[h] = to_host.apply(charts.corner_uv[h]);
        if let Some(twin) = surface.twin(h).filter(|twin| charts.chart[twin / 3] == host) {
            (charts.cut[h], charts.cut[twin]) = (true, true);
        }
    }
    for &h in seam {
        if let Some(twin) = surface.twin(h as usize) {
            (charts.cut[h as usize], charts.cut[twin]) = (false, false);
        }
    }
}
