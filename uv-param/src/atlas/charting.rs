//! From a surface to charts.

use std::collections::HashMap;

use super::fit::{Bounds, Distortion, POWER, fit, projection};
use super::layout::Charts;
use super::price::{angle_deficits, seam_prices};
use super::regions::{halves, regions};
use super::sew::Sewing;
use super::straighten::straighten;
use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::parametrizer::{Parametrizer, Progress, Stage, StoppingCriterion};
use crate::surface::Surface;
use crate::symmetric_dirichlet::{Penalty, minimise_penalty};
use crate::tutte::tutte_layout;
use crate::unwrap::{Settings, parametrize};

/// Rounds of closing and straightening seams; parts of seams are closed in the later ones, when seams are straight.
const ROUNDS: usize = 2;
/// Newton iterations of the last layout of every chart.
const LAST_ITERATIONS: usize = 12;
/// Relative gain at which they stop.
const LAST_TOLERANCE: f64 = 1e-4;

/// Where a surface is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ChartSettings {
    /// Stretch `max(s1, 1 / s2)` that 99 % of the faces, and of the area, must not exceed, above 1. Default 1.15.
    pub max_stretch: f64,
    /// Stretch that no face may exceed, at least `max_stretch`. Default 1.5.
    pub worst_stretch: f64,
    /// Direction that points up in every chart, as [`Settings::up`].
    pub up: Option<[f64; 3]>,
    /// Whether vertices at exactly the same position are one. Default true.
    pub join: bool,
}

impl Default for ChartSettings {
    fn default() -> Self {
        Self { max_stretch: 1.15, worst_stretch: 1.5, up: None, join: true }
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
        Settings { up: self.up, ..Settings::default() }.check()
    }

    pub(super) fn bounds(&self) -> Bounds {
        Bounds { stretch: self.max_stretch, worst: self.worst_stretch }
    }
}

/// Charts and the faces of the surface in each.
pub(super) fn charts(
    surface: &Surface,
    seams: &[[u32; 2]],
    settings: &ChartSettings,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Vec<Chart>, Vec<Vec<u32>>), Error> {
    settings.check()?;
    let bounds = settings.bounds();
    let mut charts = Charts::new(surface, wanted_seams(surface, seams)?);
    let region = regions(surface, &charts.wanted);
    let mut whole = Vec::new();
    let mut pending = Vec::new();
    for faces in by_number(&(0..region.len()).map(|f| surface.part(f) as u32).collect::<Vec<_>>()) {
        if let Some(disk) = charts.disk(&faces)
            && let Some(uv) = whole_part(&disk, bounds, parametrizer)
        {
            whole.push(charts.add(faces, &disk, &uv));
        } else {
            pending.push(faces);
        }
    }
    let is_pending: Vec<bool> = charts.chart.iter().map(|&c| c == u32::MAX).collect();
    if !pending.is_empty() {
        let mut numbers = region;
        for (number, pending) in numbers.iter_mut().zip(&is_pending) {
            if !pending {
                *number = u32::MAX;
            }
        }
        for faces in by_number(&numbers) {
            add_region(&mut charts, faces, bounds, parametrizer);
        }
        let (prices, deficits) = (seam_prices(surface), angle_deficits(surface));
        for round in 0..ROUNDS {
            let mut sewing = Sewing::new(&mut charts, &prices, &deficits, bounds, parametrizer);
            sewing.close_arcs();
            if round > 0 {
                sewing.close_parts();
            }
            straighten(&mut charts, &prices, bounds, parametrizer);
        }
    }
    finish(charts, &Kept { whole: &whole, sizes: &HashMap::new() }, settings, parametrizer, progress)
}

/// The layout that [`crate::unwrap`] makes, if it keeps the bounds.
fn whole_part(disk: &Disk, bounds: Bounds, parametrizer: Option<&dyn Parametrizer>) -> Option<Vec<[f64; 2]>> {
    let (_, start) = tutte_layout(disk, &mut |_| ()).ok()?;
    let quick = fit(disk, start, bounds, parametrizer)?;
    if parametrizer.is_some() {
        return Some(quick);
    }
    let usual = parametrize(disk, &Settings::default(), &mut |_| ()).ok()?.uv;
    let kept = Distortion::measure(disk, &disk.frames(), &usual, bounds).within(bounds)
        && super::simple_boundary::boundary_is_simple(disk, &usual);
    Some(if kept { usual } else { quick })
}

/// A region as one chart, or, as long as it cannot be laid out, its halves. A single face always can.
pub(super) fn add_region(
    charts: &mut Charts,
    faces: Vec<u32>,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
) {
    let mut stack = vec![faces];
    while let Some(faces) = stack.pop() {
        let laid_out = charts.disk(&faces).and_then(|disk| {
            let flat = fit(&disk, projection(&disk), bounds, parametrizer);
            flat.or_else(|| {
                let (_, start) = tutte_layout(&disk, &mut |_| ()).ok()?;
                fit(&disk, start, bounds, parametrizer)
            })
            .map(|uv| (disk, uv))
        });
        if let Some((disk, uv)) = laid_out {
            charts.add(faces, &disk, &uv);
        } else {
            let member: std::collections::HashSet<u32> = faces.iter().copied().collect();
            let surface = charts.surface;
            let joined = |h: usize| {
                !charts.wanted[h] && surface.twin(h).is_some_and(|twin| member.contains(&((twin / 3) as u32)))
            };
            stack.extend(halves(surface, &faces, joined));
        }
    }
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
    settings: &ChartSettings,
    parametrizer: Option<&dyn Parametrizer>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Vec<Chart>, Vec<Vec<u32>>), Error> {
    let bounds = settings.bounds();
    let names: Vec<u32> =
        (0..charts.members.len() as u32).filter(|&c| !charts.members[c as usize].is_empty()).collect();
    let mut done = (Vec::with_capacity(names.len()), Vec::with_capacity(names.len()));
    for name in names {
        let faces = charts.members[name as usize].clone();
        let Some(disk) = charts.disk(&faces) else { continue };
        let mut uv = charts.uv(&faces, &disk);
        if parametrizer.is_none() && !kept.whole.contains(&name) && !kept.sizes.contains_key(&name) {
            let mut better = uv.clone();
            let frames = disk.frames();
            let stopping = StoppingCriterion { iterations: LAST_ITERATIONS, tolerance: LAST_TOLERANCE };
            let within = minimise_penalty(
                &disk,
                &frames,
                &mut better,
                Penalty::beyond(bounds.stretch, POWER),
                &stopping,
                &mut |_| (),
                &mut |_| false,
            )
            .is_ok()
                && Distortion::measure(&disk, &frames, &better, bounds).within(bounds)
                && super::simple_boundary::boundary_is_simple(&disk, &better);
            if within {
                uv = better;
            }
        }
        let chart = match kept.sizes.get(&name) {
            Some(&size) => Chart::placed(disk, uv, size, 0),
            None => Chart::new(disk, uv, 0, settings.up)?,
        };
        progress(Progress {
            stage: Stage::Chart,
            iteration: done.0.len() + 1,
            energy: chart.quality().symmetric_dirichlet,
        });
        done.0.push(chart);
        done.1.push(faces);
    }
    Ok(done)
}
