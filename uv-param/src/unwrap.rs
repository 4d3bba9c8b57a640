//! The one call: a disk in, a metric chart out.

use crate::arap::arap;
use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::layout::Laplacian;
use crate::symmetric_dirichlet::symmetric_dirichlet;
use crate::triangle::{self, Frame};

/// Which energy shapes the chart.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// ARAP as the thesis uses it; where that flips a face, the flip-free energy instead (ours).
    #[default]
    Auto,
    /// ARAP only; [`crate::Quality::flips`] tells whether the chart is usable.
    Arap,
    /// The symmetric Dirichlet energy, which no flipped face can enter.
    SymmetricDirichlet,
}

/// How to unwrap.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Settings {
    /// Most iterations of each minimiser. Default 100 (ours; the thesis gives none).
    pub iterations: usize,
    /// Stop when an iteration lowers the energy by less than this fraction of it. Default 1e-6 (ours).
    pub tolerance: f64,
    /// Energy. Default [`Method::Auto`].
    pub method: Method,
    /// Direction in the input's frame that should point up (towards larger v) in the chart: of the two turns that keep
    /// the long side of the box horizontal the one that obeys it better is taken. Default `None`: the smaller turn.
    pub up: Option<[f64; 3]>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { iterations: 100, tolerance: 1e-6, method: Method::Auto, up: None }
    }
}

/// What [`unwrap`] is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The injective start on a circle; one report, energy 0.
    Start,
    /// Local/global iterations.
    Arap,
    /// A cut was made by [`crate::unwrap_with_cuts`]; the iteration is the number of cuts so far.
    Cut,
    /// Newton iterations on the symmetric Dirichlet energy.
    SymmetricDirichlet,
}

/// One report of [`unwrap`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// Iteration of this stage, from 1.
    pub iteration: usize,
    /// Energy per area: ARAP (0 = isometry) or symmetric Dirichlet over 4 (1 = isometry).
    pub energy: f64,
}

/// Lays the surface out in the plane in its own scale (metres) and turns it into its smallest box. `progress` is called
/// once per iteration.
///
/// # Errors
/// [`Error::Setting`] for settings out of range; [`Error::Singular`] and [`Error::CollapsedStart`] for surfaces whose
/// layout drowns in rounding.
pub fn unwrap(disk: &Disk, settings: &Settings, mut progress: impl FnMut(Progress)) -> Result<Chart, Error> {
    check(settings)?;
    let layout = lay_out(disk, settings, &mut progress)?;
    Chart::new(disk.clone(), layout.uv, layout.iterations, settings.up)
}

/// A layout as the minimisers leave it. A chart's uv is turned into its box, and rounding while turning may flip a needle;
/// what is to be improved further starts from here.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) uv: Vec<[f64; 2]>,
    pub(crate) iterations: usize,
}

/// Start and minimisers, as `settings` ask for.
pub(crate) fn lay_out(disk: &Disk, settings: &Settings, progress: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
    let unit = disk.area().sqrt();
    let frames = frames(disk);
    let mut laplacian = Laplacian::new(disk)?;
    let start = metric(laplacian.tutte(disk)?, disk, unit);
    progress(Progress { stage: Stage::Start, iteration: 1, energy: 0.0 });

    let mut layout = Layout { uv: start.clone(), iterations: 0 };
    if settings.method != Method::SymmetricDirichlet {
        layout.iterations += arap(disk, &frames, &mut laplacian, &mut layout.uv, settings, progress)?;
    }
    let flipped = settings.method == Method::Auto && triangle::flips(&layout.uv, &disk.faces) > 0;
    if flipped || settings.method == Method::SymmetricDirichlet {
        layout.uv = start;
        layout.iterations += symmetric_dirichlet(disk, &frames, &mut layout.uv, settings, progress)?;
    }
    Ok(layout)
}

/// Goes on from a layout without flips, flip-free.
pub(crate) fn relax(
    disk: &Disk,
    layout: &mut Layout,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), Error> {
    layout.iterations += symmetric_dirichlet(disk, &frames(disk), &mut layout.uv, settings, progress)?;
    Ok(())
}

fn frames(disk: &Disk) -> Vec<Frame> {
    (0..disk.faces.len()).map(|f| Frame::new(disk.corners(f))).collect()
}

pub(crate) fn check(settings: &Settings) -> Result<(), Error> {
    let up_is_direction = |up: [f64; 3]| up.iter().all(|x| x.is_finite()) && up.iter().any(|&x| x != 0.0);
    if settings.iterations == 0 {
        return Err(Error::Setting { name: "iterations", value: 0.0, must_be: "at least 1" });
    }
    if !(0.0..1.0).contains(&settings.tolerance) {
        return Err(Error::Setting { name: "tolerance", value: settings.tolerance, must_be: "in [0, 1)" });
    }
    if settings.up.is_some_and(|up| !up_is_direction(up)) {
        return Err(Error::Setting { name: "up", value: f64::NAN, must_be: "finite and not zero" });
    }
    Ok(())
}

/// The layout in the scale in which its area is that of the surface.
fn metric(mut uv: Vec<[f64; 2]>, disk: &Disk, unit: f64) -> Vec<[f64; 2]> {
    let plane: f64 = disk.faces.iter().map(|face| 0.5 * triangle::orientation(face.map(|v| uv[v as usize]))).sum();
    let scale = unit / plane.sqrt();
    for at in uv.iter_mut().flatten() {
        *at *= scale;
    }
    uv
}
