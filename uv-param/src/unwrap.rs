//! The one call: a disk in, a metric chart out.

use crate::chart::Chart;
use crate::disk::Disk;
use crate::error::Error;
use crate::parametrizer::arap::minimise_arap;
use crate::parametrizer::symmetric_dirichlet::minimise_symmetric_dirichlet;
use crate::parametrizer::tutte::tutte_layout;
use crate::parametrizer::{Layout, Parametrizer, Progress, StoppingCriterion};
use crate::trace::{event, span};
use crate::triangle::flips;

/// Which energy shapes the chart.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// ARAP as the thesis uses it; where that flips a face, the flip-free energy instead.
    #[default]
    Auto,
    /// ARAP only; [`crate::chart::Quality::flips`] tells whether the chart is usable.
    Arap,
    /// The symmetric Dirichlet energy, which no flipped face can enter.
    SymmetricDirichlet,
}

/// How to unwrap.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Settings {
    /// Most iterations of each minimiser. Default 100 (the thesis gives none).
    pub iterations: usize,
    /// Stop when an iteration lowers the energy by less than this fraction of it. Default 1e-6.
    pub tolerance: f64,
    /// Energy. Default [`Method::Auto`].
    pub method: Method,
    /// Direction in the input's frame that points up (towards larger v) in the chart, so that pictures stand upright. On a
    /// surface that lies level on the whole, and by default (`None`), the long side of the smallest box is horizontal.
    pub up: Option<[f64; 3]>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { iterations: 100, tolerance: 1e-6, method: Method::Auto, up: None }
    }
}

impl Settings {
    pub(crate) fn stopping(&self) -> StoppingCriterion {
        StoppingCriterion { iterations: self.iterations, tolerance: self.tolerance }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        self.stopping().check()?;
        check_up(self.up)
    }
}

/// Lays the surface out in the plane in its own scale (metres) and turns it into its smallest box. `progress` is called
/// once per iteration.
///
/// # Errors
/// [`Error::Setting`] for settings out of range; [`Error::Singular`] and [`Error::CollapsedStart`] for surfaces whose
/// layout drowns in rounding.
pub fn unwrap(disk: &Disk, settings: &Settings, mut progress: impl FnMut(Progress)) -> Result<Chart, Error> {
    settings.check()?;
    let layout = parametrize(disk, settings, &mut progress)?;
    Chart::new(disk.clone(), layout.uv, layout.iterations, settings.up)
}

/// As [`unwrap`] with a parametrizer of choice; `up` as in [`Settings::up`].
///
/// # Errors
/// Those of the parametrizer and of [`Chart::new`]; [`Error::Setting`] for an `up` that is no direction.
pub fn unwrap_by(
    disk: &Disk,
    parametrizer: &dyn Parametrizer,
    up: Option<[f64; 3]>,
    mut progress: impl FnMut(Progress),
) -> Result<Chart, Error> {
    check_up(up)?;
    let layout = parametrizer.parametrize(disk, &mut progress)?;
    Chart::new(disk.clone(), layout.uv, layout.iterations, up)
}

/// The layout that `settings` ask for.
pub(crate) fn parametrize(
    disk: &Disk,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress),
) -> Result<Layout, Error> {
    span!("parametrize");
    let frames = disk.frames();
    let stopping = settings.stopping();
    let (mut laplacian, start) = tutte_layout(disk, progress)?;
    let mut layout = Layout { uv: start.clone(), iterations: 0 };
    if settings.method != Method::SymmetricDirichlet {
        layout.iterations += minimise_arap(disk, &frames, &mut laplacian, &mut layout.uv, &stopping, progress)?;
    }
    let flipped = settings.method == Method::Auto && flips(&layout.uv, disk.faces()) > 0;
    if flipped {
        event!(debug, "triangles turned over: starts again with symmetric Dirichlet energy");
    }
    if flipped || settings.method == Method::SymmetricDirichlet {
        layout.uv = start;
        layout.iterations += minimise_symmetric_dirichlet(disk, &frames, &mut layout.uv, &stopping, progress)?;
    }
    Ok(layout)
}

/// Goes on from a layout without flips, flip-free.
pub(crate) fn relax(
    disk: &Disk,
    layout: &mut Layout,
    stopping: &StoppingCriterion,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), Error> {
    layout.iterations += minimise_symmetric_dirichlet(disk, &disk.frames(), &mut layout.uv, stopping, progress)?;
    Ok(())
}

fn check_up(up: Option<[f64; 3]>) -> Result<(), Error> {
    let is_direction = |up: [f64; 3]| up.iter().all(|x| x.is_finite()) && up.iter().any(|&x| x != 0.0);
    if up.is_some_and(|up| !is_direction(up)) {
        return Err(Error::Setting { name: "up", value: f64::NAN, must_be: "finite and not zero" });
    }
    Ok(())
}
