//! Cuts to where a layout is distorted most, so that surfaces far from flat become paintable charts.

mod candidates;
mod paths;

use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::parametrizer::{Layout, Progress, Stage};
use crate::trace::span;
use crate::unwrap::{Method, Settings, parametrize, relax};
use paths::BoundaryPaths;

/// Candidates that are tried for every cut; the one that gains most is cut.
const CANDIDATES_PER_ROUND: usize = 4;
/// How many times so many are tried before giving up.
const MAX_ROUNDS: usize = 3;
/// Newton iterations that show what a cut is worth.
const TRIAL_ITERATIONS: usize = 4;
/// Newton iterations from one cut to the next.
const SETTLE_ITERATIONS: usize = 10;
/// Newton iterations of a layout from the start.
const FRESH_ITERATIONS: usize = 30;
/// Tolerance of all three: the next cut moves everything again.
const TRIAL_TOLERANCE: f64 = 1e-3;
/// A cut must take away at least this fraction of the cost.
const MIN_GAIN: f64 = 0.01;
/// Cost of an overlap of the whole chart, in units of the energy of an isometry: paint goes to the wrong place
/// there, which is worse than stretch.
const OVERLAP_WEIGHT: f64 = 10.0;

/// When and how far to cut.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct CutSettings {
    /// Stretch `max(s1, 1 / s2)` that a face should not exceed, above 1. Default 1.5.
    pub max_stretch: f64,
    /// Share of the area, 0 to 1, that may exceed it or lie on other parts of the chart. Default 0.03.
    pub share: f64,
    /// Most cuts. Default 24.
    pub max_cuts: usize,
}

impl Default for CutSettings {
    fn default() -> Self {
        Self { max_stretch: 1.5, share: 0.03, max_cuts: 24 }
    }
}

/// As [`crate::unwrap`], but a surface whose chart would be distorted too much is cut open first (thesis, chapter 8: "cuts
/// along high distortion areas"; the way is that of Gu et al. 2002, repeated): from the places of the worst distortion to
/// the outer boundary along the shortest edges, rather in creases than on ridges. Holes on the way are joined to the outer
/// boundary. Of some possible cuts the one that lowers the symmetric Dirichlet energy most, without overlaps, is made,
/// until [`CutSettings::share`] is kept, no cut helps any more, or [`CutSettings::max_cuts`] are made.
///
/// The chart holds the whole surface. [`Chart::disk`] is the cut one: same faces, vertices on seams doubled, copies at the
/// end. A surface that needs no cut comes out as from [`crate::unwrap`]; a cut one is laid out with the flip-free energy,
/// whatever [`Settings::method`], and [`Method::Arap`] counts as [`Method::Auto`], because cuts start from a layout without
/// flips. `progress` hears of every cut ([`Stage::Cut`]) but not of the trials.
///
/// # Errors
/// As [`crate::unwrap`], but long tubes are cut open instead of refused; [`Error::Setting`] for cut settings out of range.
pub fn unwrap_with_cuts(
    disk: &Disk,
    settings: &Settings,
    cuts: &CutSettings,
    mut progress: impl FnMut(Progress),
) -> Result<Chart, Error> {
    span!("unwrap_with_cuts");
    settings.check()?;
    check_cuts(cuts)?;
    let progress: &mut dyn FnMut(Progress) = &mut progress;
    let settings =
        Settings { method: if settings.method == Method::Arap { Method::Auto } else { settings.method }, ..*settings };
    let mut best = CutLayout::start(disk, &settings, cuts, progress)?;
    while best.unpaintable_share(cuts) > cuts.share && best.chart.disk().cuts() < cuts.max_cuts {
        let Some(next) = best.best_cut()? else { break };
        best = next;
        best.report(progress);
    }
    if best.chart.disk().cuts() > 0 {
        best = best.relax(&settings, progress)?;
    }
    Chart::new(best.chart.into_disk(), best.layout.uv, best.layout.iterations, settings.up)
}

fn check_cuts(cuts: &CutSettings) -> Result<(), Error> {
    if !(cuts.max_stretch.is_finite() && cuts.max_stretch > 1.0) {
        return Err(Error::Setting { name: "max_stretch", value: cuts.max_stretch, must_be: "above 1" });
    }
    if !(0.0..=1.0).contains(&cuts.share) {
        return Err(Error::Setting { name: "share", value: cuts.share, must_be: "in [0, 1]" });
    }
    Ok(())
}

/// Settings that tell whether a cut improves the chart, no more.
fn trial_settings(iterations: usize) -> Settings {
    Settings { iterations, tolerance: TRIAL_TOLERANCE, method: Method::SymmetricDirichlet, up: None }
}

/// A surface, cut as far as it is, with its layout and the chart that measures it.
struct CutLayout {
    chart: Chart,
    layout: Layout,
}

impl CutLayout {
    fn new(disk: Disk, layout: Layout) -> Result<Self, Error> {
        let chart = Chart::new(disk, layout.uv.clone(), layout.iterations, None)?;
        Ok(Self { chart, layout })
    }

    /// The first layout. Where it drowns in rounding, as in long tubes, the surface is cut from the vertex that is
    /// farthest from the boundary, which needs no layout.
    fn start(
        disk: &Disk,
        settings: &Settings,
        cuts: &CutSettings,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Self, Error> {
        let mut disk = disk.clone();
        loop {
            let collapsed = match parametrize(&disk, settings, progress) {
                Ok(layout) => return Self::new(disk, layout),
                Err(error @ Error::CollapsedStart { .. }) if disk.cuts() < cuts.max_cuts => error,
                Err(error) => return Err(error),
            };
            let paths = BoundaryPaths::new(&disk);
            disk = disk.cut(&paths.from(paths.farthest().ok_or(collapsed)?))?;
        }
    }

    /// What cuts are to lower: 0 for an isometry that does not overlap itself.
    fn cost(&self) -> f64 {
        let quality = self.chart.quality();
        quality.symmetric_dirichlet - 1.0 + OVERLAP_WEIGHT * quality.overlap_share
    }

    /// Share of the area that cannot be painted: stretched beyond the bound or overlapping.
    fn unpaintable_share(&self, cuts: &CutSettings) -> f64 {
        let disk = self.chart.disk();
        let beyond = |&f: &usize| {
            let [s1, s2] = self.chart.stretch(f as u32);
            s1.max(1.0 / s2.abs()) > cuts.max_stretch
        };
        let area: f64 = (0..disk.faces.len()).filter(beyond).map(|f| disk.face_area(f)).sum();
        area / disk.area() + self.chart.quality().overlap_share
    }

    /// The cut to a large hole if it pays, because no number of other cuts does what joining it does; else of the cuts to the
    /// worst places the one that lowers the cost most; if none pays in the end, of those to the next places.
    fn best_cut(&self) -> Result<Option<Self>, Error> {
        let paths = BoundaryPaths::new(self.chart.disk());
        if let Some(hole) = candidates::hole_to_join(self.chart.disk(), &paths) {
            let joined = self.if_improved(self.joined(&paths.from(hole)))?;
            if joined.is_some() {
                return Ok(joined);
            }
        }
        for candidates in candidates::cut_candidates(&self.chart, &paths, MAX_ROUNDS * CANDIDATES_PER_ROUND)
            .chunks(CANDIDATES_PER_ROUND)
        {
            let mut best: Option<Self> = None;
            for &candidate in candidates {
                let trial = self.cut(&paths.from(candidate))?.relax(&trial_settings(TRIAL_ITERATIONS), &mut |_| ());
                let trial = self.if_improved(trial)?;
                best = trial.filter(|trial| best.as_ref().is_none_or(|best| trial.cost() < best.cost())).or(best);
            }
            if let Some(best) = best {
                let settled = self.if_improved(best.relax(&trial_settings(SETTLE_ITERATIONS), &mut |_| ()))?;
                if settled.is_some() {
                    return Ok(settled);
                }
            }
        }
        Ok(None)
    }

    /// A trial that pays. One that drowns in rounding does not.
    fn if_improved(&self, trial: Result<Self, Error>) -> Result<Option<Self>, Error> {
        match trial {
            Err(Error::Singular | Error::CollapsedStart { .. }) => Ok(None),
            trial => trial.map(|trial| (trial.cost() <= (1.0 - MIN_GAIN) * self.cost()).then_some(trial)),
        }
    }

    /// Cut to a hole and laid out from the start: a ring that overlaps itself is wound up, and unwinds only slowly.
    fn joined(&self, path: &[u32]) -> Result<Self, Error> {
        let disk = self.chart.disk().cut(path)?;
        let layout = parametrize(&disk, &trial_settings(FRESH_ITERATIONS), &mut |_| ())?;
        Self::new(disk, layout)
    }

    /// Cut along a path, both sides of the seam still where they were.
    fn cut(&self, path: &[u32]) -> Result<Self, Error> {
        let disk = self.chart.disk().cut(path)?;
        let mut layout = self.layout.clone();
        layout.uv.extend(disk.copied_after(self.layout.uv.len()).iter().map(|&v| self.layout.uv[v as usize]));
        Self::new(disk, layout)
    }

    /// Some flip-free iterations further.
    fn relax(self, settings: &Settings, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        let Self { chart, mut layout } = self;
        relax(chart.disk(), &mut layout, &settings.stopping(), progress)?;
        Self::new(chart.into_disk(), layout)
    }

    fn report(&self, progress: &mut dyn FnMut(Progress)) {
        let quality = self.chart.quality();
        progress(Progress { stage: Stage::Cut, iteration: quality.cuts, energy: quality.symmetric_dirichlet });
    }
}
