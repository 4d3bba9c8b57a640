//! What to spray: the wanted picture into layers.

use paint_net::painters::{AdaptiveRows, AreaFill, Centrelines, LayerPlanning, Layered, MatchingPursuit};
use paint_net::path::{Stroke, StrokeSettings};
use paint_net::problem::ink_ceiling;
use paint_net::thesis::ThesisPainter;
use paint_net::{Deconvolution, Feedback, Image, Observer, OnSurface, PaintProblem, Painter, Painting};

use super::error::MissionError;
use super::footprints::Footprints;
use super::nozzle::kernel;
use super::settings::{MissionSettings, PainterChoice};
use crate::appearance::Appearance;
use crate::progress::Stage;
use crate::surface::PaintSurface;

/// Weight of texels out of reach against those in reach: what nobody can spray must not pull paint from its neighbours, but a little weight
/// keeps overspray off it.
const UNPAINTABLE_WEIGHT: f64 = 0.02;
/// Weight of what stays clean.
const CLEAN_WEIGHT: f64 = 10.0;

/// What there is to paint on, and with.
#[derive(Clone, Copy)]
pub(super) struct Canvas<'a> {
    pub(super) surface: &'a PaintSurface,
    /// 1 on pixels of the surface, 0 beside it.
    pub(super) coverage: &'a Image,
    /// Pixels that the robot can serve.
    pub(super) in_reach: &'a [bool],
    /// Pixels that stay clean.
    pub(super) clean: &'a [bool],
    pub(super) appearance: &'a Appearance,
    pub(super) settings: &'a MissionSettings,
}

/// Layers of sprays for the wanted picture; no spray lies on what is out of reach. Paint that falls beyond a seam counts where it lies,
/// and volumes are those for what every spray leaves on the surface.
pub(super) fn decide(wanted: &Image, canvas: &Canvas) -> Result<Vec<Painting>, MissionError> {
    let stage = Stage::start("decide");
    let &Canvas { surface, in_reach: paintable, appearance, settings, .. } = canvas;
    let weight = canvas.weights();
    let ceiling = ceiling(wanted, surface)?;
    let kernel = kernel(settings)?;
    let problem = PaintProblem::new(wanted)
        .with_weight(&weight)
        .with_ceiling(&ceiling)
        .with_paintable(paintable)
        .with_ghosts(&surface.beyond_seams)
        .with_kernel(&kernel)
        .with_saturation(appearance.ink())
        .with_limits(&settings.limits);
    let mut progress = |share: f64| stage.share(share);
    let painter: Box<dyn Painter> = match settings.painter {
        PainterChoice::Feedback => Box::new(Feedback { threads: settings.threads, ..Feedback::shipped()? }),
        PainterChoice::Deconvolution => Box::new(Deconvolution::default()),
        PainterChoice::Centrelines => Box::new(Centrelines::default()),
        PainterChoice::Fill => Box::new(AreaFill::default()),
        PainterChoice::Pursuit => Box::new(MatchingPursuit::default()),
        PainterChoice::AdaptiveRows => Box::new(AdaptiveRows::default()),
        PainterChoice::Thesis => {
            Box::new(ThesisPainter { strokes: Some(StrokeSettings::default()), ..ThesisPainter::shipped()? })
        }
    };
    let footprints = Footprints::new(surface, settings)?;
    let on_surface = |strokes: &[Stroke]| footprints.of(strokes);
    let painted = match settings.painter {
        // The doses of a coat are corrected when the nozzle's poses are known.
        PainterChoice::Fill => paint(painter, settings.layered, &problem, &mut progress),
        _ => paint(OnSurface::new(painter, &on_surface), settings.layered, &problem, &mut progress),
    };
    let layers = footprints.checked(painted)?;
    let sprays: usize = layers.iter().map(|l| l.sprays.len()).sum();
    if sprays == 0 {
        return Err(MissionError::NothingToPaint("no place of it is darker than the bare wall"));
    }
    stage.done(&format!("{} layer(s), {sprays} sprays", layers.len()));
    Ok(layers)
}

/// Ink that no texel shall exceed.
pub(super) fn ceiling(wanted: &Image, surface: &PaintSurface) -> Result<Image, paint_net::Error> {
    let (texels, pixels) = surface.film_texels();
    let points: Vec<[f64; 3]> = texels.iter().map(|texel| texel.point.coords.into()).collect();
    ink_ceiling(wanted, &points, &pixels)
}

impl Canvas<'_> {
    /// How much a pixel of the surface matters.
    pub(super) fn weight(&self, pixel: usize) -> f64 {
        match (self.clean[pixel], self.in_reach[pixel]) {
            (true, _) => CLEAN_WEIGHT,
            (_, true) => 1.0,
            (_, false) => UNPAINTABLE_WEIGHT,
        }
    }

    /// The same of all pixels, those beside the surface too.
    pub(super) fn weights(&self) -> Image {
        let mut weights = self.coverage.clone();
        for (pixel, covered) in weights.data_mut().iter_mut().enumerate() {
            *covered *= self.weight(pixel);
        }
        for (ghost, _) in self.surface.beyond_seams.ghosts() {
            weights.data_mut()[*ghost] = 0.0;
        }
        weights
    }
}

/// One painting, or one for each layer.
fn paint<P: Painter>(
    painter: P,
    layered: Option<LayerPlanning>,
    problem: &PaintProblem,
    progress: &mut dyn Observer,
) -> Result<Vec<Painting>, paint_net::Error> {
    if let Some(planning) = layered {
        Layered { planning, ..Layered::new(painter) }.paint_observed(problem, progress).map(Painting::into_layers)
    } else {
        painter.paint_observed(problem, progress).map(|painting| vec![painting])
    }
}
