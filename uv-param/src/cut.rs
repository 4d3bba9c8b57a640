//! Cuts to where a layout is distorted most, so that surfaces far from flat become paintable charts.

mod paths;
mod tips;

use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::unwrap::{Layout, Method, Progress, Settings, Stage, check, lay_out, relax};
use paths::Paths;

/// Tips that are tried for every cut; the one that gains most is cut (ours).
const CANDIDATES: usize = 4;
/// How many times so many are tried before giving up (ours).
const ROUNDS: usize = 3;
/// Newton iterations that show what a cut is worth (ours).
const TRIAL: usize = 4;
/// Newton iterations from one cut to the next (ours).
const SETTLE: usize = 10;
/// Newton iterations of a layout from the start (ours).
const FRESH: usize = 30;
/// Tolerance of all three: the next cut moves everything again (ours).
const ROUGH: f64 = 1e-3;
/// A cut must take away at least this fraction of the cost (ours).
const GAIN: f64 = 0.01;
/// Cost of an overlap of the whole chart, in units of the energy of an isometry (ours): paint goes to the wrong place
/// there, which is worse than stretch.
const OVERLAP: f64 = 10.0;

/// When and how far to cut.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct CutSettings {
    /// Stretch `max(s1, 1 / s2)` that a face should not exceed, above 1. Default 1.5 (ours).
    pub max_stretch: f64,
    /// Share of the area, 0 to 1, that may exceed it or lie on other parts of the chart. Default 0.03 (ours).
    pub share: f64,
    /// Most cuts. Default 24 (ours).
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
    check(settings)?;
    check_cuts(cuts)?;
    let progress: &mut dyn FnMut(Progress) = &mut progress;
    let settings =
        Settings { method: if settings.method == Method::Arap { Method::Auto } else { settings.method }, ..*settings };
    let mut best = Opened::start(disk, &settings, cuts, progress)?;
    while best.unfit(cuts) > cuts.share && best.chart.disk().cuts() < cuts.max_cuts {
        let Some(next) = best.best_cut()? else { break };
        best = next;
        best.report(progress);
    }
    if best.chart.disk().cuts() > 0 {
        best = best.relaxed(&settings, progress)?;
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

/// Settings that tell which cut is better, no more.
fn rough(iterations: usize) -> Settings {
    Settings { iterations, tolerance: ROUGH, method: Method::SymmetricDirichlet, up: None }
}

/// A surface, cut as far as it is, with its layout and the chart that judges it.
struct Opened {
    chart: Chart,
    layout: Layout,
}

impl Opened {
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
            let collapsed = match lay_out(&disk, settings, progress) {
                Ok(layout) => return Self::new(disk, layout),
                Err(error @ Error::CollapsedStart { .. }) if disk.cuts() < cuts.max_cuts => error,
                Err(error) => return Err(error),
            };
            let paths = Paths::new(&disk);
            disk = disk.cut(&paths.from(paths.farthest().ok_or(collapsed)?))?;
        }
    }

    /// What cuts are to lower: 0 for an isometry that does not overlap itself.
    fn cost(&self) -> f64 {
        let quality = self.chart.quality();
        quality.symmetric_dirichlet - 1.0 + OVERLAP * quality.overlap_share
    }

    /// Share of the area that cannot be painted: stretched beyond the bound or overlapping.
    fn unfit(&self, cuts: &CutSettings) -> f64 {
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
        let paths = Paths::new(self.chart.disk());
        if let Some(hole) = tips::hole(self.chart.disk(), &paths) {
            let joined = self.better(self.joined(&paths.from(hole)))?;
            if joined.is_some() {
                return Ok(joined);
            }
        }
        for tips in tips::tips(&self.chart, &paths, ROUNDS * CANDIDATES).chunks(CANDIDATES) {
            let mut best: Option<Self> = None;
            for &tip in tips {
                let trial = self.cut(&paths.from(tip))?.relaxed(&rough(TRIAL), &mut |_| ());
                let trial = self.better(trial)?;
                best = trial.filter(|trial| best.as_ref().is_none_or(|best| trial.cost() < best.cost())).or(best);
            }
            if let Some(best) = best {
                let settled = self.better(best.relaxed(&rough(SETTLE), &mut |_| ()))?;
                if settled.is_some() {
                    return Ok(settled);
                }
            }
        }
        Ok(None)
    }

    /// A trial that pays. One that drowns in rounding does not.
    fn better(&self, trial: Result<Self, Error>) -> Result<Option<Self>, Error> {
        match trial {
            Err(Error::Singular | Error::CollapsedStart { .. }) => Ok(None),
            trial => trial.map(|trial| (trial.cost() <= (1.0 - GAIN) * self.cost()).then_some(trial)),
        }
    }

    /// Cut to a hole and laid out from the start: a ring that overlaps itself is wound up, and unwinds only slowly.
    fn joined(&self, path: &[u32]) -> Result<Self, Error> {
        let disk = self.chart.disk().cut(path)?;
        let layout = lay_out(&disk, &rough(FRESH), &mut |_| ())?;
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
    fn relaxed(self, settings: &Settings, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        let Self { chart, mut layout } = self;
        relax(chart.disk(), &mut layout, settings, progress)?;
        Self::new(chart.into_disk(), layout)
    }

    fn report(&self, progress: &mut dyn FnMut(Progress)) {
        let quality = self.chart.quality();
        progress(Progress { stage: Stage::Cut, iteration: quality.cuts, energy: quality.symmetric_dirichlet });
    }
}
