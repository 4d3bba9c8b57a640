//! From a surface to charts.

use std::collections::{HashMap, HashSet};

use crate::atlas::charts::Charts;
use crate::atlas::cut::cut_graph::cut_graph;
use crate::atlas::cut::seam_cost::{SeamCosts, angle_deficits};
use crate::atlas::cut::straighten::{straighten, straighten_unlaid};
use crate::atlas::merge::merge_charts::ChartMerger;
use crate::atlas::merge::merge_small::merge_small_charts;
use crate::atlas::merge::ruin_and_recreate::{SearchContext, cost_of, ruin_and_recreate};
use crate::atlas::parametrize::add_region::add_region;
use crate::atlas::parametrize::fit::{Bounds, Distortion, POWER, fit};
use crate::atlas::parametrize::refine::{is_small, refine};
use crate::atlas::parametrize::simple_boundary::boundary_is_simple;
use crate::atlas::segment::creases::sides_between_creases;
use crate::atlas::segment::shape_approximation::shape_approximation;
use crate::atlas::segment::transfer::transfer;
use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::parametrizer::symmetric_dirichlet::{Penalty, minimise_penalty};
use crate::parametrizer::tutte::tutte_layout;
use crate::parametrizer::{Parametrizer, Progress, Stage, StoppingCriterion};
use crate::surface::Surface;
use crate::unwrap::{Settings, parametrize};

/// Rounds of closing and straightening seams; parts of seams are closed in the later ones, when seams are straight.
const ROUNDS: usize = 2;
/// Surfaces of more faces are cut on a coarser one: below, the seams that are found without it are shorter and take no longer.
const COARSE_FROM: usize = 40_000;
/// Faces of that one.
const COARSE_TO: usize = 8_000;
/// Stretch beyond 1 that is allowed there, as a share of the bound.
const COARSE_SHARE: f64 = 0.9;
/// Faces that may be laid out in trials to merge small charts of a fine surface: so many, and a part of all.
const MERGING_WORK: [usize; 2] = [100_000, 4];
/// Newton iterations of the last layout of every chart, at most, and those times all faces.
const LAST_ITERATIONS: usize = 4;
const LAST_WORK: usize = 1_000_000;
/// Relative gain at which they stop.
const LAST_TOLERANCE: f64 = 1e-4;

/// Bounds of stretch that are tried one after the other where they may be relaxed. Each is kept if it makes seams and charts cheaper by more than it
/// is larger.
const RELAXED: [f64; 3] = [1.3, 1.6, 2.0];

/// Where a surface is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ChartSettings {
    /// Stretch `max(s1, 1 / s2)` that 99 % of the faces, and of the area, must not exceed, above 1. Default 1.15.
    pub max_stretch: f64,
    /// Stretch that no face may exceed, at least `max_stretch`. Default 1.5.
    pub worst_stretch: f64,
    /// Stretch up to which `max_stretch` may be relaxed where that saves seams, `worst_stretch` in proportion: a rough surface, as of a scan with
    /// noise, is torn to shreds otherwise. Default `None`: not at all.
    pub relaxed_stretch: Option<f64>,
    /// Direction that points up in every chart, as [`Settings::up`].
    pub up: Option<[f64; 3]>,
    /// Whether vertices at exactly the same position are one. Default true.
    pub join: bool,
}

impl Default for ChartSettings {
    fn default() -> Self {
        Self { max_stretch: 1.15, worst_stretch: 1.5, relaxed_stretch: None, up: None, join: true }
    }
}

impl ChartSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        if !(self.max_stretch.is_finite() && self.max_stretch > 1.0) {
            return Err(Error::Setting { name: "max_stretch", value: self.max_stretch, must_be: "above 1" });
        }
        if !(self.worst_stretch.is_finite() && self.worst_stretch >= self.max_stretch) {
            return Err(Error::Setting {
                name: "worst_stretch",
                value: self.worst_stretch,
                must_be: "at least max_stretch",
            });
        }
        if let Some(value) = self.relaxed_stretch
            && !(value.is_finite() && value >= self.max_stretch)
        {
            return Err(Error::Setting { name: "relaxed_stretch", value, must_be: "at least max_stretch" });
        }
        Settings { up: self.up, ..Settings::default() }.check()
    }

    pub(super) fn bounds(&self) -> Bounds {
        Bounds { stretch: self.max_stretch, worst: self.worst_stretch }
    }

    /// The bounds that may be tried beyond, the strictest first.
    fn relaxed_bounds(&self) -> impl Iterator<Item = Bounds> {
        let most = self.relaxed_stretch.unwrap_or(self.max_stretch);
        let worst_per_stretch = (self.worst_stretch - 1.0) / (self.max_stretch - 1.0);
        let within = RELAXED.into_iter().filter(move |s| *s < most).chain([most]);
        let strict = self.max_stretch;
        within
            .filter(move |stretch| *stretch > strict)
            .map(move |stretch| Bounds { stretch, worst: 1.0 + worst_per_stretch * (stretch - 1.0) })
    }
}

/// Charts and the faces of the surface in each.
pub(super) fn compute_charts(
    surface: &Surface,
    seams: &[[u32; 2]],
    settings: &ChartSettings,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Vec<Chart>, Vec<Vec<u32>>), Error> {
    settings.check()?;
    let wanted = wanted_seams(surface, seams)?;
    let (costs, mut bounds) = (SeamCosts::new(surface), settings.bounds());
    let (mut charts, mut whole) = search(surface, &wanted, bounds, parametrizer, progress);
    let mut cost = cost_of(&charts, &costs);
    for relaxed in settings.relaxed_bounds() {
        if whole.len() == surface.part_count() {
            break;
        }
        let (other, other_whole) = search(surface, &wanted, relaxed, parametrizer, progress);
        let other_cost = cost_of(&other, &costs);
        if other_cost * relaxed.stretch < cost * bounds.stretch {
            (charts, whole, cost, bounds) = (other, other_whole, other_cost, relaxed);
        }
    }
    finish(charts, &Kept { whole: &whole, sizes: &HashMap::new() }, (bounds, settings.up), parametrizer, progress)
}

/// Charts within the bounds, and which of them are whole parts.
fn search<'a>(
    surface: &'a Surface,
    wanted: &[bool],
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> (Charts<'a>, Vec<u32>) {
    let mut charts = Charts::new(surface, wanted.to_vec());
    let whole = if surface.faces().len() > COARSE_FROM && parametrizer.is_none() {
        by_coarse(&mut charts, bounds, progress)
    } else {
        let whole = cut_open(&mut charts, bounds, parametrizer, progress);
        // On a coarse surface this would not pay: what it gains is less than what the fine one changes.
        let (costs, deficits) = (SeamCosts::new(surface), angle_deficits(surface));
        let tools = SearchContext { costs: &costs, deficits: &deficits, bounds, parametrizer };
        ruin_and_recreate(&mut charts, tools, &whole.iter().copied().collect(), progress);
        whole
    };
    (charts, whole)
}

/// Every face in a chart within the bounds. Returns the charts that are whole parts, in the layout that [`crate::unwrap`] makes.
fn cut_open(
    charts: &mut Charts,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Vec<u32> {
    let surface = charts.surface;
    let shapes = shape_approximation(surface, &charts.wanted);
    let mut whole = cut_open_from(charts, shapes.clone(), bounds, parametrizer, progress);
    if whole.len() == surface.part_count() {
        return whole;
    }
    // Other beginnings, which are better for some surfaces.
    let costs = SeamCosts::new(surface);
    let mut cost = cost_of(charts, &costs);
    let mut opened = Charts::new(surface, charts.wanted.clone());
    if open_parts(&mut opened, &costs, bounds, parametrizer) {
        let opened_whole = cut_open_from(&mut opened, shapes, bounds, parametrizer, progress);
        let opened_cost = cost_of(&opened, &costs);
        if opened_cost < cost {
            (*charts, whole, cost) = (opened, opened_whole, opened_cost);
        }
    }
    if let Some(sides) = sides_between_creases(surface, &charts.wanted) {
        let mut other = Charts::new(surface, charts.wanted.clone());
        let other_whole = cut_open_from(&mut other, sides, bounds, parametrizer, progress);
        if cost_of(&other, &costs) < cost {
            (*charts, whole) = (other, other_whole);
        }
    }
    whole
}

/// Charts for those parts that can be laid out whole once the shortest cuts open them. Whether there are any.
fn open_parts(charts: &mut Charts, costs: &SeamCosts, bounds: Bounds, parametrizer: Option<&dyn Parametrizer>) -> bool {
    let surface = charts.surface;
    for faces in by_number(&(0..surface.faces().len()).map(|f| surface.part(f) as u32).collect::<Vec<_>>()) {
        let cut = cut_graph(surface, &faces, costs);
        let sides = |h: u32| std::iter::once(h as usize).chain(surface.twin(h as usize));
        for side in cut.iter().flat_map(|&h| sides(h)) {
            charts.cut[side] = true;
        }
        let laid_out = charts.disk(&faces).filter(|_| !cut.is_empty()).and_then(|disk| {
            let (_, start) = tutte_layout(&disk, &mut |_| ()).ok()?;
            fit(&disk, start, bounds, parametrizer).map(|uv| (disk, uv))
        });
        if let Some((disk, uv)) = laid_out {
            charts.add(faces, &disk, &uv);
        } else {
            cut.iter().flat_map(|&h| sides(h)).for_each(|side| charts.cut[side] = false);
        }
    }
    !charts.members.is_empty()
}

/// The same from first regions.
fn cut_open_from(
    charts: &mut Charts,
    mut region: Vec<u32>,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Vec<u32> {
    let surface = charts.surface;
    let whole = whole_parts(charts, bounds, parametrizer, |_| true);
    for (number, _) in region.iter_mut().zip(&charts.chart).filter(|(_, chart)| **chart != u32::MAX) {
        *number = u32::MAX;
    }
    let lists = by_number(&region);
    if lists.is_empty() {
        return whole;
    }
    for faces in lists {
        add_region(charts, faces, bounds, parametrizer);
    }
    let (costs, deficits) = (SeamCosts::new(surface), angle_deficits(surface));
    for round in 0..ROUNDS {
        let mut merging = ChartMerger::new(charts, &costs, bounds, parametrizer, progress);
        merging.close_arcs();
        if round > 0 {
            merging.close_parts(&deficits);
        }
        straighten(charts, &costs, &|disk, start| fit(disk, start, bounds, parametrizer));
    }
    whole
}

/// Charts for those of the wanted parts that can be laid out as they are.
fn whole_parts(
    charts: &mut Charts,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
    wanted: impl Fn(usize) -> bool,
) -> Vec<u32> {
    let surface = charts.surface;
    let mut whole = Vec::new();
    for faces in by_number(&(0..surface.faces().len()).map(|f| surface.part(f) as u32).collect::<Vec<_>>()) {
        if charts.chart[faces[0] as usize] == u32::MAX
            && wanted(surface.part(faces[0] as usize))
            && let Some(disk) = charts.disk(&faces)
            && let Some(uv) = whole_part(&disk, bounds, parametrizer)
        {
            whole.push(charts.add(faces, &disk, &uv));
        }
    }
    whole
}

/// As [`cut_open`] for surfaces of many faces: seams are found on a coarser one, and the charts laid out anew on the fine one.
fn by_coarse(charts: &mut Charts, bounds: Bounds, progress: &mut dyn FnMut(Progress)) -> Vec<u32> {
    let surface = charts.surface;
    let (coarse, half_edges, roots) = surface.coarser(|h| charts.wanted[h], COARSE_TO);
    let wanted = half_edges.iter().map(|&h| charts.wanted[h as usize]).collect();
    let mut model = Charts::new(&coarse, wanted);
    // What is finer than the coarse faces bends the charts as well.
    let stricter = Bounds { stretch: 1.0 + COARSE_SHARE * (bounds.stretch - 1.0), worst: bounds.worst };
    let whole = cut_open(&mut model, stricter, None, progress);
    let flat: HashSet<usize> = whole.iter().map(|&c| coarse.part(model.members[c as usize][0] as usize)).collect();
    let whole = whole_parts(charts, bounds, None, |part| flat.contains(&part));

    let costs = SeamCosts::new(surface);
    let first = charts.members.len();
    transfer(&model, &roots, charts);
    let faces_per_edge = (surface.faces().len() as f64 / coarse.faces().len() as f64).sqrt();
    straighten_unlaid(charts, &costs, faces_per_edge.ceil() as usize);
    let found = charts.members.split_off(first);
    let mut laid_out = 0;
    let mut heard = || {
        laid_out += 1;
        progress(Progress { stage: Stage::Level, iteration: laid_out, energy: 0.0 });
    };
    let left: Vec<Vec<u32>> = found.iter().flat_map(|faces| refine(charts, faces, bounds, &mut heard)).collect();
    for faces in left {
        add_region(charts, faces, bounds, None);
    }
    let is_large = |c: &u32| !is_small(charts, charts.members[*c as usize].len());
    let kept: HashSet<u32> = (0..charts.members.len() as u32).filter(is_large).chain(whole.iter().copied()).collect();
    let mut merging = ChartMerger::new(charts, &costs, bounds, None, progress);
    merging.only = Some((kept, 0));
    merging.work = MERGING_WORK[0] + surface.faces().len() / MERGING_WORK[1];
    merging.close_arcs();
    merge_small_charts(charts, &costs, bounds, &whole.iter().copied().collect());
    whole
}

/// The layout that [`crate::unwrap`] makes, if it keeps the bounds.
fn whole_part(disk: &Disk, bounds: Bounds, parametrizer: Option<&dyn Parametrizer>) -> Option<Vec<[f64; 2]>> {
    let (_, start) = tutte_layout(disk, &mut |_| ()).ok()?;
    let quick = fit(disk, start, bounds, parametrizer)?;
    if parametrizer.is_some() {
        return Some(quick);
    }
    let usual = parametrize(disk, &Settings::default(), &mut |_| ()).ok()?.uv;
    let kept =
        Distortion::measure(disk, &disk.frames(), &usual, bounds).within(bounds) && boundary_is_simple(disk, &usual);
    Some(if kept { usual } else { quick })
}

/// Lists of faces by number, in the order of the numbers; `u32::MAX` stands for none.
pub(super) fn by_number(numbers: &[u32]) -> Vec<Vec<u32>> {
    let count = numbers.iter().filter(|&&n| n != u32::MAX).max().map_or(0, |&n| n as usize + 1);
    let mut lists = vec![Vec::new(); count];
    for (f, &n) in numbers.iter().enumerate().filter(|(_, n)| **n != u32::MAX) {
        lists[n as usize].push(f as u32);
    }
    lists.retain(|list| !list.is_empty());
    lists
}

/// Half-edges, on both sides, of the seams that the caller wants.
pub(super) fn wanted_seams(surface: &Surface, seams: &[[u32; 2]]) -> Result<Vec<bool>, Error> {
    let mut wanted = vec![false; 3 * surface.faces().len()];
    if seams.is_empty() {
        return Ok(wanted);
    }
    let mut edges: Vec<([u32; 2], usize)> =
        seams.iter().enumerate().map(|(i, &[a, b])| ([a.min(b), a.max(b)], i)).collect();
    edges.sort_unstable();
    let mut found = vec![false; seams.len()];
    for (h, wanted) in wanted.iter_mut().enumerate() {
        let [a, b] = surface.ends(h);
        let edge = [a.min(b), a.max(b)];
        let from = edges.partition_point(|(other, _)| *other < edge);
        for (_, i) in edges[from..].iter().take_while(|(other, _)| *other == edge) {
            found[*i] = true;
            *wanted = surface.twin(h).is_some();
        }
    }
    match found.iter().position(|found| !found) {
        Some(index) => Err(Error::Seam { index, edge: seams[index] }),
        None => Ok(wanted),
    }
}

/// Charts that are not laid out once more.
pub(super) struct Kept<'a> {
    /// Those in their last layout already.
    pub(super) whole: &'a [u32],
    /// Those that are not even turned, with their width and height.
    pub(super) sizes: &'a HashMap<u32, [f64; 2]>,
}

/// Every chart in its last layout.
pub(super) fn finish(
    mut charts: Charts,
    kept: &Kept,
    (bounds, up): (Bounds, Option<[f64; 3]>),
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Vec<Chart>, Vec<Vec<u32>>), Error> {
    let iterations = (LAST_WORK / charts.surface.faces().len()).min(LAST_ITERATIONS);
    let names: Vec<u32> =
        (0..charts.members.len() as u32).filter(|&c| !charts.members[c as usize].is_empty()).collect();
    let mut done = (Vec::with_capacity(names.len()), Vec::with_capacity(names.len()));
    for name in names {
        let faces = charts.members[name as usize].clone();
        let Some(disk) = charts.disk(&faces) else { continue };
        let mut uv = charts.uv(&faces, &disk);
        if parametrizer.is_none() && iterations > 0 && !kept.whole.contains(&name) && !kept.sizes.contains_key(&name) {
            let mut better = uv.clone();
            let frames = disk.frames();
            let stopping = StoppingCriterion { iterations, tolerance: LAST_TOLERANCE };
            let within = minimise_penalty(
                &disk,
                &frames,
                &mut better,
                Penalty::beyond(bounds.stretch, POWER),
                &[],
                &stopping,
                &mut |_, _| false,
            )
            .is_ok()
                && Distortion::measure(&disk, &frames, &better, bounds).within(bounds)
                && boundary_is_simple(&disk, &better);
            if within {
                uv = better;
            }
        }
        let chart = match kept.sizes.get(&name) {
            Some(&size) => Chart::placed(disk, uv, size, 0),
            None => Chart::new(disk, uv, 0, up)?,
        };
        progress(Progress { stage: Stage::Chart, iteration: done.0.len() + 1, energy: 0.0 });
        done.0.push(chart);
        done.1.push(faces);
    }
    Ok(done)
}
