//! Seams become shorter by ruin and recreate (Schrimpf et al. 2000): a patch around a seam is taken out of its charts and becomes one
//! of its own, seams are closed and straightened again around it, and what comes of it is kept if its seams are cheaper.

use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

use nalgebra::Vector3;

use crate::atlas::charts::Charts;
use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::cut::seam_graph::{Arc, arcs};
use crate::atlas::cut::straighten::straighten_where;
use crate::atlas::merge::merge_charts::ChartMerger;
use crate::atlas::parametrize::add_region::add_region;
use crate::atlas::parametrize::fit::{Bounds, fit};
use crate::atlas::parametrize::refine::keeps;
use crate::disk::Disk;
use crate::parametrizer::{Parametrizer, Progress};
use crate::random::Random;

/// Faces that may be laid out by the search: so many times all, and at most.
const WORK: usize = 60;
const MAX_WORK: usize = 800_000;
/// Faces that one trial may lay out to close seams, times those of the charts that it takes apart.
const TRIAL_WORK: usize = 6;
/// Least work that a trial counts as, as a part of all faces: looking for seams takes time too.
const LEAST_WORK: usize = 100;
/// Area of a patch, as a share of the whole: least and most, drawn so that equal ratios are equally likely.
const PATCH: [f64; 2] = [0.004, 0.12];
/// Cost after whole seams were closed, relative to that before, beyond which closing parts would not make up for it.
const HOPELESS: f64 = 1.03;
/// The same after parts were closed: beyond, straightening would not.
const TOO_COSTLY: f64 = 1.02;
/// Cost of a chart besides that of its seams, relative to the square root of the area: otherwise patches that close nowhere would pile up.
const EACH: f64 = 0.05;
/// Smallest relative gain that counts.
const MIN_GAIN: f64 = 1e-6;

/// What is needed to close seams and to compare them.
#[derive(Clone, Copy)]
pub(in crate::atlas) struct SearchContext<'a> {
    pub(in crate::atlas) costs: &'a SeamCosts<'a>,
    /// [`angle_deficits`](crate::atlas::cut::seam_cost::angle_deficits).
    pub(in crate::atlas) deficits: &'a [f64],
    pub(in crate::atlas) bounds: Bounds,
    pub(in crate::atlas) parametrizer: Option<&'a dyn Parametrizer>,
}

/// Searches until its budget is spent; charts of `stays` are not touched.
pub(in crate::atlas) fn ruin_and_recreate(
    charts: &mut Charts,
    tools: SearchContext,
    stays: &HashSet<u32>,
    progress: &mut dyn FnMut(Progress),
) {
    let faces = charts.surface.faces().len();
    let mut work = (WORK * faces).min(MAX_WORK);
    let mut random = Random(0);
    let mut cost = cost_of(charts, tools.costs);
    while work > 0 {
        let Some(patch) = draw_patch(charts, tools.costs, stays, &mut random) else { break };
        let before = State::of(charts);
        let spent = Trial { tools, stays, cost }.make(charts, &patch, progress);
        work = work.saturating_sub(spent.max(1 + faces / LEAST_WORK));
        let after = cost_of(charts, tools.costs);
        if after < cost * (1.0 - MIN_GAIN) {
            cost = after;
        } else {
            before.restore(charts);
        }
    }
}

/// One patch taken out, and everything around it closed again.
struct Trial<'a> {
    tools: SearchContext<'a>,
    stays: &'a HashSet<u32>,
    /// Cost of all seams and charts before.
    cost: f64,
}

impl Trial<'_> {
    /// Returns the faces that were laid out.
    fn make(&self, charts: &mut Charts, patch: &[u32], progress: &mut dyn FnMut(Progress)) -> usize {
        let SearchContext { costs, deficits, bounds, parametrizer } = self.tools;
        // What could not be closed before is not tried again, nor straightened.
        let known: HashSet<(u32, u32)> = arcs(charts).iter().map(Arc::key).collect();
        let touched = ruin(charts, self.tools, patch);
        let limit = TRIAL_WORK * touched;
        let mut merging = ChartMerger::new(charts, costs, bounds, parametrizer, progress);
        merging.only = Some((self.stays.clone(), 0));
        merging.work = limit;
        merging.refuse(&known);
        merging.close_arcs();
        // A patch is laid out twice at most: from its shadow, and from Tutte's embedding.
        let mut spent = 2 * patch.len() + limit - merging.work;
        if cost_of(merging.charts, costs) > HOPELESS * self.cost {
            return spent;
        }
        let left = merging.work;
        merging.close_parts(deficits);
        spent += left - merging.work;
        if cost_of(charts, costs) > TOO_COSTLY * self.cost {
            return spent;
        }
        let laid_out = Cell::new(0);
        let layout = |disk: &Disk, start| {
            laid_out.set(laid_out.get() + disk.faces.len());
            fit(disk, start, bounds, parametrizer)
        };
        let may_move =
            |arc: &Arc| !known.contains(&arc.key()) && ![arc.left, arc.right].iter().any(|c| self.stays.contains(c));
        straighten_where(charts, costs, &layout, may_move);
        spent + laid_out.get()
    }
}

/// Makes a patch a chart of its own. Returns the faces of the charts that it lay in.
fn ruin(charts: &mut Charts, tools: SearchContext, patch: &[u32]) -> usize {
    let surface = charts.surface;
    let inside: HashSet<u32> = patch.iter().copied().collect();
    let mut names: Vec<u32> = patch.iter().map(|&f| charts.chart[f as usize]).collect();
    names.sort_unstable();
    names.dedup();
    let mut touched = 0;
    let mut lost = Vec::new();
    for name in names {
        let faces = std::mem::take(&mut charts.members[name as usize]);
        touched += faces.len();
        let marked: Vec<bool> = faces.iter().map(|f| inside.contains(f)).collect();
        for (piece, is_inside) in charts.pieces(&faces, &marked) {
            if is_inside {
                continue;
            }
            let disk = charts.disk(&piece);
            match disk.map(|disk| (charts.uv(&piece, &disk), disk)) {
                Some((uv, disk)) if keeps(&disk, &uv, tools.bounds) => {
                    charts.add(piece, &disk, &uv);
                }
                _ => lost.push(piece),
            }
        }
        // Between two charts no edge counts as cut.
        for h in faces.iter().flat_map(|&f| 3 * f as usize..3 * f as usize + 3) {
            if let Some(twin) = surface.twin(h) {
                let [one, other] = [h, twin].map(|h| inside.contains(&((h / 3) as u32)));
                if one || other || charts.chart[h / 3] != charts.chart[twin / 3] {
                    (charts.cut[h], charts.cut[twin]) = (false, false);
                }
            }
        }
    }
    lost.push(patch.to_vec());
    for faces in lost {
        add_region(charts, faces, tools.bounds, tools.parametrizer);
    }
    touched
}

/// The faces nearest to a place on a seam; costly seams are more often drawn. `None` where there is no seam.
fn draw_patch(charts: &Charts, costs: &SeamCosts, stays: &HashSet<u32>, random: &mut Random) -> Option<Vec<u32>> {
    let surface = charts.surface;
    let seams: Vec<usize> = (0..3 * surface.faces().len())
        .filter(|&h| surface.twin(h).is_some() && charts.is_seam(h) && !charts.wanted[h])
        .collect();
    let total: f64 = seams.iter().map(|&h| costs.of(h as u32)).sum();
    let mut place = total * random.unit();
    let start = *seams.iter().find(|&&h| {
        place -= costs.of(h as u32);
        place <= 0.0
    })?;
    let [least, most] = PATCH;
    let area = surface.area() * least * (most / least).powf(random.unit());
    let centre = |f: usize| surface.corners(f).map(Vector3::from).iter().sum::<Vector3<f64>>() / 3.0;
    let mut best: HashMap<usize, f64> = HashMap::from([(start / 3, 0.0)]);
    let mut queue = BinaryHeap::from([Reverse((0_u64, start / 3))]);
    let (mut patch, mut covered) = (Vec::new(), 0.0);
    let mut done = HashSet::new();
    while let Some(Reverse((bits, f))) = queue.pop() {
        if !done.insert(f) {
            continue;
        }
        patch.push(f as u32);
        covered += surface.face_area(f);
        if covered > area {
            break;
        }
        for h in (3 * f..3 * f + 3).filter(|&h| !charts.wanted[h]) {
            let Some(twin) = surface.twin(h) else { continue };
            let other = twin / 3;
            if stays.contains(&charts.chart[other]) {
                continue;
            }
            let distance = f64::from_bits(bits) + (centre(other) - centre(f)).norm();
            if best.get(&other).is_none_or(|found| distance < *found) {
                best.insert(other, distance);
                queue.push(Reverse((distance.to_bits(), other)));
            }
        }
    }
    patch.sort_unstable();
    Some(patch)
}

/// Cost of all seams and charts.
pub(in crate::atlas) fn cost_of(charts: &Charts, costs: &SeamCosts) -> f64 {
    let count = charts.members.iter().filter(|faces| !faces.is_empty()).count();
    seam_cost_of(charts, costs) + EACH * charts.surface.area().sqrt() * count as f64
}

/// Cost of all seams.
fn seam_cost_of(charts: &Charts, costs: &SeamCosts) -> f64 {
    let surface = charts.surface;
    let is_seam = |h: &usize| surface.twin(*h).is_some_and(|twin| *h < twin) && charts.is_seam(*h);
    (0..3 * surface.faces().len()).filter(is_seam).map(|h| costs.of(h as u32)).sum()
}

/// All that a trial changes.
struct State {
    chart: Vec<u32>,
    members: Vec<Vec<u32>>,
    corner_uv: Vec<[f64; 2]>,
    cut: Vec<bool>,
}

impl State {
    fn of(charts: &Charts) -> Self {
        Self {
            chart: charts.chart.clone(),
            members: charts.members.clone(),
            corner_uv: charts.corner_uv.clone(),
            cut: charts.cut.clone(),
        }
    }

    fn restore(self, charts: &mut Charts) {
        charts.chart = self.chart;
        charts.members = self.members;
        charts.corner_uv = self.corner_uv;
        charts.cut = self.cut;
    }
}

#[cfg(test)]
mod tests;
