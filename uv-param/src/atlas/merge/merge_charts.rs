//! Seams are closed again, the most useful first, as long as what they join can still be laid out within the bounds.

use std::collections::HashSet;

use crate::atlas::charts::Charts;
use crate::atlas::cut::seam_cost::SeamCosts;
use crate::atlas::cut::seam_graph::{Arc, arcs};
use crate::atlas::parametrize::fit::{Bounds, fit};
use crate::atlas::parametrize::procrustes::seam_alignment;
use crate::min_area_rectangle::min_area_rectangle;
use crate::parametrizer::{Parametrizer, Progress, Stage};

/// Longest side of a chart that merging may make, relative to the square root of the area: longer ones waste the page.
const MAX_EXTENT: f64 = 1.3;
/// Share of an arc's length by which its two sides differ in shape at which closing it is half as attractive.
const MISFIT: f64 = 0.03;
/// Misfit beyond which it is not tried.
const MAX_MISFIT: f64 = 0.12;
/// Faces from which on looking for seams takes so long that half of what was found is tried before they are looked for again.
const BATCHES_FROM: usize = 40_000;
/// Rounds after which nothing much is left to do.
const MAX_ROUNDS: usize = 1000;
/// Parts of an arc that are tried where the whole cannot be closed: first and last edge, as shares of its length.
const PARTS: [[f64; 2]; 10] = [
    [0.0, 0.8],
    [0.2, 1.0],
    [0.1, 0.9],
    [0.0, 0.6],
    [0.4, 1.0],
    [0.2, 0.8],
    [0.0, 0.4],
    [0.6, 1.0],
    [0.3, 0.7],
    [0.0, 0.2],
];
/// How far an end of a part may move to a sharp vertex, as a share of the arc.
const SNAP: f64 = 0.12;
/// How many of them at most.
const TRIED_PARTS: usize = 3;
/// Length of a part below which closing it is not worth a layout, relative to the square root of the area.
const MIN_PART: f64 = 0.03;

/// Closes seams of charts within bounds.
pub(in crate::atlas) struct ChartMerger<'a, 'b> {
    pub(in crate::atlas) charts: &'b mut Charts<'a>,
    pub(in crate::atlas) costs: &'b SeamCosts<'b>,
    pub(in crate::atlas) bounds: Bounds,
    pub(in crate::atlas) parametrizer: Option<&'b dyn Parametrizer>,
    progress: &'b mut dyn FnMut(Progress),
    /// Charts that must stay as they are, and the first of those that are new; `None`: all are. Only seams of new ones are closed.
    pub(in crate::atlas) only: Option<(HashSet<u32>, u32)>,
    /// Faces that may still be laid out for trials.
    pub(in crate::atlas) work: usize,
    /// Seams that were tried.
    tried: usize,
    /// Longest side of a chart, metres.
    longest: f64,
    /// Arcs (first and last half-edge) that could not be closed.
    refused: HashSet<(u32, u32)>,
    /// The same, of which no part could.
    refused_parts: HashSet<(u32, u32)>,
}

impl<'a, 'b> ChartMerger<'a, 'b> {
    pub(in crate::atlas) fn new(
        charts: &'b mut Charts<'a>,
        costs: &'b SeamCosts<'b>,
        bounds: Bounds,
        parametrizer: Option<&'b dyn Parametrizer>,
        progress: &'b mut dyn FnMut(Progress),
    ) -> Self {
        let longest = MAX_EXTENT * charts.surface.area().sqrt();
        let (refused, refused_parts) = (HashSet::new(), HashSet::new());
        let (only, work, tried) = (None, usize::MAX, 0);
        Self { charts, costs, bounds, parametrizer, progress, only, work, tried, longest, refused, refused_parts }
    }

    /// Neither tries these arcs (first and last half-edge) nor parts of them.
    pub(in crate::atlas) fn refuse(&mut self, arcs: &HashSet<(u32, u32)>) {
        self.refused.extend(arcs);
        self.refused_parts.extend(arcs);
    }

    /// Closes whole arcs until none can be closed any more.
    pub(in crate::atlas) fn close_arcs(&mut self) {
        let face_areas: Vec<f64> =
            (0..self.charts.surface.faces().len()).map(|f| self.charts.surface.face_area(f)).collect();
        for _ in 0..MAX_ROUNDS {
            let areas = self.charts.areas(&face_areas);
            let mut candidates: Vec<(f64, Arc)> = arcs(self.charts)
                .into_iter()
                .filter(|arc| self.may_change(arc) && !self.refused.contains(&arc.key()))
                .filter_map(|arc| self.score(&arc, &areas).map(|score| (score, arc)))
                .collect();
            candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.half_edges[0].cmp(&b.1.half_edges[0])));
            // Once one is closed others wait: better ones may have come up.
            let enough = if self.charts.surface.faces().len() > BATCHES_FROM { candidates.len() / 2 } else { 0 };
            let mut touched = HashSet::new();
            let (mut closed, mut tried) = (0, 0);
            for (i, (_, arc)) in candidates.into_iter().enumerate() {
                if i > enough && closed > 0 {
                    break;
                }
                if touched.contains(&arc.left) || touched.contains(&arc.right) {
                    continue;
                }
                tried += 1;
                if self.close(&arc.half_edges, arc.left, arc.right) {
                    touched.extend([arc.left, arc.right]);
                    closed += 1;
                } else {
                    self.refused.insert(arc.key());
                }
            }
            if closed == 0 && tried == 0 {
                break;
            }
        }
    }

    fn may_change(&self, arc: &Arc) -> bool {
        self.only.as_ref().is_none_or(|(kept, first_new)| {
            let sides = [arc.left, arc.right];
            sides.iter().all(|side| !kept.contains(side)) && sides.iter().any(|side| side >= first_new)
        })
    }

    /// Closes parts of arcs, the longest first, until no more can be closed; `deficits` are the [`angle_deficits`].
    ///
    /// [`angle_deficits`]: crate::atlas::cut::seam_cost::angle_deficits
    pub(in crate::atlas) fn close_parts(&mut self, deficits: &[f64]) {
        let least = MIN_PART * self.charts.surface.area().sqrt();
        for _ in 0..MAX_ROUNDS {
            let mut candidates: Vec<(f64, Arc)> = arcs(self.charts)
                .into_iter()
                .filter(|arc| self.may_change(arc) && !self.charts.wanted[arc.half_edges[0] as usize])
                .filter(|arc| !self.refused_parts.contains(&arc.key()))
                .map(|arc| (self.cost(&arc.half_edges), arc))
                .filter(|(cost, _)| *cost > least)
                .collect();
            candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.half_edges[0].cmp(&b.1.half_edges[0])));
            let mut touched = HashSet::new();
            let mut closed = 0;
            for (_, arc) in candidates {
                if touched.contains(&arc.left) || touched.contains(&arc.right) {
                    continue;
                }
                if self.close_part(&arc, deficits, least) {
                    touched.extend([arc.left, arc.right]);
                    closed += 1;
                } else {
                    self.refused_parts.insert(arc.key());
                }
            }
            if closed == 0 {
                break;
            }
        }
    }

    /// Closes the longest part of an arc that can be closed.
    fn close_part(&mut self, arc: &Arc, deficits: &[f64], least: f64) -> bool {
        let count = arc.half_edges.len();
        // The seam that is left over ends inside a chart: at the sharpest vertex near.
        let vertex = |i: usize| {
            let h = arc.half_edges[i.min(count - 1)] as usize;
            self.charts.surface.ends(h)[usize::from(i == count)]
        };
        let reach = (SNAP * count as f64).ceil() as usize;
        let index = |t: f64| {
            let middle = (t * count as f64).round() as usize;
            if middle == 0 || middle == count {
                return middle;
            }
            let near = middle.saturating_sub(reach).max(1)..=(middle + reach).min(count - 1);
            near.max_by(|&a, &b| {
                let deficit = |i: usize| deficits[vertex(i) as usize];
                deficit(a).total_cmp(&deficit(b)).then(b.abs_diff(middle).cmp(&a.abs_diff(middle)))
            })
            .unwrap_or(middle)
        };
        let part = |[from, to]: [f64; 2]| index(from)..index(to);
        let mut parts: Vec<(f64, std::ops::Range<usize>)> = PARTS
            .iter()
            .map(|&shares| part(shares))
            .filter(|range| !range.is_empty() && range.len() < count)
            .filter_map(|range| {
                let edges = &arc.half_edges[range.clone()];
                let misfit = seam_alignment(self.charts, edges, arc.left == arc.right).residual / self.length(edges);
                let gain = self.cost(edges);
                (misfit < MAX_MISFIT && gain > least).then(|| (gain * (-misfit / MISFIT).exp2(), range))
            })
            .collect();
        parts.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.start.cmp(&b.1.start)));
        parts.into_iter().take(TRIED_PARTS).any(|(_, range)| self.close(&arc.half_edges[range], arc.left, arc.right))
    }

    fn cost(&self, half_edges: &[u32]) -> f64 {
        self.costs.sum(half_edges)
    }

    /// How much closing an arc would help; `None` if it cannot.
    fn score(&self, arc: &Arc, areas: &[f64]) -> Option<f64> {
        if self.charts.wanted[arc.half_edges[0] as usize] {
            return None;
        }
        let gain = self.cost(&arc.half_edges);
        let length = self.length(&arc.half_edges);
        let misfit = seam_alignment(self.charts, &arc.half_edges, arc.left == arc.right).residual / length;
        if misfit > MAX_MISFIT {
            return None;
        }
        let area = areas[arc.left as usize].min(areas[arc.right as usize]);
        Some(gain / area.sqrt() * (-misfit / MISFIT).exp2())
    }

    fn length(&self, half_edges: &[u32]) -> f64 {
        half_edges.iter().map(|&h| self.charts.surface.edge(h as usize).norm()).sum()
    }

    /// Closes the seam along some half-edges if that can be laid out.
    fn close(&mut self, half_edges: &[u32], left: u32, right: u32) -> bool {
        let surface = self.charts.surface;
        let same = left == right;
        let faces = if same {
            self.charts.members[left as usize].clone()
        } else {
            merged(&self.charts.members[left as usize], &self.charts.members[right as usize])
        };
        let Some(work) = self.work.checked_sub(faces.len()) else { return false };
        self.work = work;
        self.tried += 1;
        (self.progress)(Progress { stage: Stage::Seam, iteration: self.tried, energy: 0.0 });
        let both = |h: u32| std::iter::once(h as usize).chain(surface.twin(h as usize));
        // Between two charts every other common edge stays open.
        let opened: Vec<usize> = if same { Vec::new() } else { self.common_edges(left, right) };
        let before: Vec<bool> = opened.iter().map(|&h| self.charts.cut[h]).collect();
        for &h in &opened {
            self.charts.cut[h] = true;
        }
        for h in half_edges.iter().flat_map(|&h| both(h)) {
            self.charts.cut[h] = false;
        }
        let to_left = seam_alignment(self.charts, half_edges, same);
        let laid_out = self.charts.disk(&faces).and_then(|disk| {
            let chart = &self.charts.chart;
            let moved = |f: usize, at| if !same && chart[f] == right { to_left.apply(at) } else { at };
            let start = self.charts.vertex_uv(&faces, &disk, moved);
            fit(&disk, start, self.bounds, self.parametrizer)
                .filter(|uv| extent(uv) < self.longest)
                .map(|uv| (disk, uv))
        });
        let Some((disk, uv)) = laid_out else {
            for h in half_edges.iter().flat_map(|&h| both(h)) {
                self.charts.cut[h] = same;
            }
            for (&h, before) in opened.iter().zip(before) {
                self.charts.cut[h] = before;
            }
            return false;
        };
        self.charts.place(&faces, &disk, &uv);
        if same {
            return true;
        }
        for &f in &self.charts.members[right as usize] {
            self.charts.chart[f as usize] = left;
        }
        self.charts.members[right as usize] = Vec::new();
        self.charts.members[left as usize] = faces;
        true
    }

    /// Half-edges, on both sides, between two charts.
    fn common_edges(&self, left: u32, right: u32) -> Vec<usize> {
        let surface = self.charts.surface;
        let (one, other) = if self.charts.members[left as usize].len() <= self.charts.members[right as usize].len() {
            (left, right)
        } else {
            (right, left)
        };
        let members = &self.charts.members[one as usize];
        let around = members.iter().flat_map(|&f| 3 * f as usize..3 * f as usize + 3);
        around
            .filter_map(|h| surface.twin(h).filter(|&twin| self.charts.chart[twin / 3] == other).map(|twin| [h, twin]))
            .flatten()
            .collect()
    }
}

/// Longer side of the smallest rectangle around a layout, metres.
fn extent(uv: &[[f64; 2]]) -> f64 {
    min_area_rectangle(uv).map_or(f64::INFINITY, |rectangle| rectangle.width.max(rectangle.height))
}

/// Two ascending lists as one.
fn merged(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut all = [a, b].concat();
    all.sort_unstable();
    all
}
