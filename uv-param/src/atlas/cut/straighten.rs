//! Seams become shorter: the cheapest path between the same ends takes their place.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

use crate::atlas::charts::Charts;
use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::cut::seam_graph::{Arc, arcs};
use crate::atlas::parametrize::procrustes::seam_alignment;
use crate::disk::Disk;

/// A path must be cheaper than the seam by this share to be worth a layout.
const MIN_GAIN: f64 = 0.01;
/// How far from a seam its new path may run, in faces per edge of the seam, and at least.
const REACH: [usize; 2] = [5, 4];

/// A layout of a chart from a start, if there is one that will do.
pub(in crate::atlas) type Layout<'a> = &'a dyn Fn(&Disk, Vec<[f64; 2]>) -> Option<Vec<[f64; 2]>>;

/// Tries every seam once, the costliest first.
pub(in crate::atlas) fn straighten(charts: &mut Charts, costs: &SeamCosts, layout: Layout) {
    straighten_where(charts, costs, layout, |_| true);
}

/// The same for some of the seams.
pub(in crate::atlas) fn straighten_where(
    charts: &mut Charts,
    costs: &SeamCosts,
    layout: Layout,
    wanted: impl Fn(&Arc) -> bool,
) {
    for (cost, arc) in costliest_first(charts, costs).into_iter().filter(|(_, arc)| wanted(arc)) {
        let rings = (arc.half_edges.len() / REACH[0]).max(REACH[1]);
        if let Some(detour) = Detour::new(charts, costs, cost, &arc, rings) {
            detour.take(charts, layout);
        }
    }
}

/// The same without layouts, within some rings of faces from each seam: what lies between a seam and its path changes sides as it is, corner by
/// corner, and nothing else moves.
pub(in crate::atlas) fn straighten_unlaid(charts: &mut Charts, costs: &SeamCosts, rings: usize) {
    for (cost, arc) in costliest_first(charts, costs) {
        if let Some(detour) = Detour::new(charts, costs, cost, &arc, rings) {
            detour.take_unlaid(charts);
        }
    }
    charts.members.iter_mut().for_each(Vec::clear);
    for (f, &chart) in charts.chart.iter().enumerate() {
        charts.members[chart as usize].push(f as u32);
    }
}

/// All seams that the caller does not want, with their costs.
fn costliest_first(charts: &Charts, costs: &SeamCosts) -> Vec<(f64, Arc)> {
    let mut candidates: Vec<(f64, Arc)> = arcs(charts)
        .into_iter()
        .filter(|arc| !charts.wanted[arc.half_edges[0] as usize])
        .map(|arc| (costs.sum(&arc.half_edges), arc))
        .collect();
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.half_edges[0].cmp(&b.1.half_edges[0])));
    candidates
}

/// A cheaper path for a seam, and what would change its side.
struct Detour<'a> {
    arc: &'a Arc,
    /// Edges of the seam and of the path, both half-edges of each.
    old: HashSet<u32>,
    new: HashSet<u32>,
    /// Faces between the two that lie left of the seam, and right of it.
    lenses: [HashSet<u32>; 2],
}

impl<'a> Detour<'a> {
    fn new(charts: &Charts, costs: &SeamCosts, cost: f64, arc: &'a Arc, rings: usize) -> Option<Self> {
        let surface = charts.surface;
        let [first, _] = surface.ends(arc.half_edges[0] as usize);
        let [_, last] = surface.ends(arc.half_edges[arc.half_edges.len() - 1] as usize);
        if first == last {
            return None;
        }
        let both = |edges: &[u32]| -> HashSet<u32> {
            edges.iter().flat_map(|&h| std::iter::once(h).chain(surface.twin(h as usize).map(|t| t as u32))).collect()
        };
        let old = both(&arc.half_edges);
        let path =
            cheapest_path(charts, costs, band(charts, arc, rings), &old, [first, last], (1.0 - MIN_GAIN) * cost)?;
        let mut detour = Self { arc, new: both(&path), old, lenses: [HashSet::new(), HashSet::new()] };
        for &h in arc.half_edges.iter().filter(|h| !detour.new.contains(h)) {
            let twin = surface.twin(h as usize)?;
            let faces = [h / 3, (twin / 3) as u32];
            if faces.iter().zip(&detour.lenses).any(|(f, lens)| lens.contains(f)) {
                continue;
            }
            let found = [0, 1].into_iter().find_map(|side| detour.lens(charts, faces[side]).map(|lens| (side, lens)));
            let (side, lens) = found?;
            detour.lenses[side].extend(lens);
        }
        Some(detour)
    }

    /// The faces around `start` that seam and path shut in; `None` if they do not.
    fn lens(&self, charts: &Charts, start: u32) -> Option<HashSet<u32>> {
        let mut lens = HashSet::from([start]);
        let mut stack = vec![start];
        let most = charts.members[charts.chart[start as usize] as usize].len() / 2;
        while let Some(f) = stack.pop() {
            for h in 3 * f..3 * f + 3 {
                if self.old.contains(&h) || self.new.contains(&h) {
                    continue;
                }
                let twin = charts.surface.twin(h as usize)?;
                if charts.is_seam(h as usize) {
                    return None;
                }
                if lens.insert((twin / 3) as u32) {
                    stack.push((twin / 3) as u32);
                }
            }
            if lens.len() > most {
                return None;
            }
        }
        Some(lens)
    }

    /// Moves the seam, and what lies between: each face is unfolded over an edge into the plane of the side that it comes to.
    fn take_unlaid(&self, charts: &mut Charts) {
        let surface = charts.surface;
        let twin = |h: u32| surface.twin(h as usize).map_or(h, |twin| twin as u32);
        let [left, right] = &self.lenses;
        let sides = [(left, self.arc.right, false), (right, self.arc.left, true)];
        for (lens, side, from_left) in sides {
            let mut waiting = lens.clone();
            let along = self.arc.half_edges.iter().map(|&h| if from_left { twin(h) } else { h });
            let mut front: std::collections::VecDeque<u32> = along.filter(|h| lens.contains(&(h / 3))).collect();
            while let Some(h) = front.pop_front() {
                let f = h / 3;
                if !waiting.remove(&f) {
                    continue;
                }
                charts.chart[f as usize] = side;
                charts.unfold(h as usize, twin(h) as usize);
                front.extend(
                    (3 * f..3 * f + 3).map(twin).filter(|&h| lens.contains(&(h / 3)) && !self.old.contains(&h)),
                );
            }
        }
        if self.arc.left == self.arc.right {
            for &h in self.old.union(&self.new) {
                charts.cut[h as usize] = self.new.contains(&h);
            }
        }
    }

    /// Moves the seam if both sides can be laid out then.
    fn take(&self, charts: &mut Charts, layout: Layout) {
        let Arc { left, right, .. } = *self.arc;
        let to_left = seam_alignment(charts, &self.arc.half_edges, false);
        let moved = |f: usize, at| match self.lenses.each_ref().map(|lens| lens.contains(&(f as u32))) {
            [true, _] => to_left.undo(at),
            [_, true] => to_left.apply(at),
            _ => at,
        };
        if left == right {
            let edges: Vec<usize> = self.old.union(&self.new).map(|&h| h as usize).collect();
            for &h in &edges {
                charts.cut[h] = self.new.contains(&(h as u32));
            }
            let faces = charts.members[left as usize].clone();
            let Some((disk, uv)) = laid_out(charts, &faces, moved, layout) else {
                for &h in &edges {
                    charts.cut[h] = self.old.contains(&(h as u32));
                }
                return;
            };
            charts.place(&faces, &disk, &uv);
            return;
        }
        let without = |name: u32, out: &HashSet<u32>, more: &HashSet<u32>| {
            let stay = charts.members[name as usize].iter().copied().filter(|f| !out.contains(f));
            let mut faces: Vec<u32> = stay.chain(more.iter().copied()).collect();
            faces.sort_unstable();
            faces
        };
        let [from_left, from_right] = &self.lenses;
        let sides = [without(left, from_left, from_right), without(right, from_right, from_left)];
        let layouts = sides.each_ref().map(|faces| laid_out(charts, faces, moved, layout));
        let [Some(one), Some(other)] = layouts else { return };
        for ((name, faces), (disk, uv)) in [left, right].into_iter().zip(sides).zip([one, other]) {
            charts.place(&faces, &disk, &uv);
            for &f in &faces {
                charts.chart[f as usize] = name;
            }
            charts.members[name as usize] = faces;
        }
    }
}

fn laid_out(
    charts: &mut Charts,
    faces: &[u32],
    moved: impl Fn(usize, [f64; 2]) -> [f64; 2],
    layout: Layout,
) -> Option<(Disk, Vec<[f64; 2]>)> {
    let disk = charts.disk(faces)?;
    let start = charts.vertex_uv(faces, &disk, moved);
    layout(&disk, start).map(|uv| (disk, uv))
}

/// Faces near a seam, in its two charts.
fn band(charts: &Charts, arc: &Arc, rings: usize) -> HashSet<u32> {
    let surface = charts.surface;
    let mut found = HashSet::new();
    let mut front: Vec<u32> = arc
        .half_edges
        .iter()
        .flat_map(|&h| std::iter::once(h / 3).chain(surface.twin(h as usize).map(|t| t as u32 / 3)))
        .collect();
    found.extend(front.iter().copied());
    for _ in 0..rings {
        let mut next = Vec::new();
        for h in front.iter().flat_map(|&f| 3 * f..3 * f + 3).filter(|&h| !charts.is_seam(h as usize)) {
            if let Some(twin) = surface.twin(h as usize)
                && found.insert((twin / 3) as u32)
            {
                next.push((twin / 3) as u32);
            }
        }
        front = next;
    }
    found
}

/// The edges (as half-edges, one of each) of the cheapest path near the seam that touches no other.
fn cheapest_path(
    charts: &Charts,
    costs: &SeamCosts,
    band: HashSet<u32>,
    old: &HashSet<u32>,
    [first, last]: [u32; 2],
    limit: f64,
) -> Option<Vec<u32>> {
    let surface = charts.surface;
    let mut near: Vec<u32> = band.into_iter().collect();
    near.sort_unstable();
    let mut edges_at: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut barred: HashSet<u32> = HashSet::new();
    for h in near.into_iter().flat_map(|f| 3 * f..3 * f + 3) {
        let open = surface.twin(h as usize).is_none() || charts.is_seam(h as usize);
        if open && !old.contains(&h) {
            barred.extend(surface.ends(h as usize));
        } else {
            for v in surface.ends(h as usize) {
                edges_at.entry(v).or_default().push(h);
            }
        }
    }
    let mut best: HashMap<u32, (f64, u32)> = HashMap::from([(first, (0.0, u32::MAX))]);
    let mut queue = BinaryHeap::from([Reverse((0_u64, first))]);
    while let Some(Reverse((bits, v))) = queue.pop() {
        let distance = f64::from_bits(bits);
        if v == last {
            break;
        }
        if distance > best[&v].0 {
            continue;
        }
        for &h in edges_at.get(&v)? {
            let [a, b] = surface.ends(h as usize);
            let other = if a == v { b } else { a };
            if other != last && barred.contains(&other) {
                continue;
            }
            let through = distance + costs.of(h);
            if through < limit && best.get(&other).is_none_or(|(found, _)| through < *found) {
                best.insert(other, (through, h));
                queue.push(Reverse((through.to_bits(), other)));
            }
        }
    }
    let mut path = Vec::new();
    let mut at = last;
    while at != first {
        let h = best.get(&at)?.1;
        path.push(h);
        let [a, b] = surface.ends(h as usize);
        at = if a == at { b } else { a };
    }
    Some(path)
}
