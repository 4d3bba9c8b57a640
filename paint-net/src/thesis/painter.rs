//! The thesis' network as a painter.

use super::network::Network;
use super::step::Step;
use crate::error::Error;
use crate::image::Image;
use crate::model::{Spray, SprayKernel};
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings, in_order};
use crate::problem::PaintProblem;

/// The thesis' painter: pictures larger than its network are painted tile by tile.
///
/// Every tile is given the canvas as it is, with what its neighbours left there, and sprays reach over its border. Tiles are
/// painted in four rounds, none of which holds two that touch. Places, spreads and their number are the network's: of the
/// limits only the volumes and the number of sprays hold (the largest stay), of the kernel only the cut (in units of each
/// spray's own spread), of the problem's weights nothing. Deterministic: the network paints its mean.
#[derive(Debug, Clone, PartialEq)]
pub struct ThesisPainter {
    /// The weights.
    pub network: Network,
    /// How the sprays of a tile are joined to the strokes of [`Painting::strokes`], in the network's order. Default `None`: every spray is as
    /// the network sets it, and there are no strokes.
    pub strokes: Option<StrokeSettings>,
}

impl ThesisPainter {
    /// A painter with a network of one's own.
    pub fn new(network: Network) -> Self {
        Self { network, strokes: None }
    }

    /// A painter with the weights that come with the crate.
    pub fn shipped() -> Result<Self, Error> {
        Network::shipped().map(Self::new)
    }

    /// The sprays of a tile, in one piece where nobody asks for strokes.
    fn joined(&self, sprays: Vec<Spray>, max_volume: f64) -> Result<Vec<Stroke>, Error> {
        let Some(settings) = &self.strokes else { return Ok(vec![Stroke { sprays }]) };
        let mut strokes = in_order(&sprays, settings)?;
        let all = strokes.iter_mut().flat_map(|stroke| &mut stroke.sprays);
        all.for_each(|spray| spray.volume = spray.volume.min(max_volume));
        Ok(strokes)
    }
}

impl Painter for ThesisPainter {
    fn name(&self) -> &'static str {
        "thesis"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        problem.check()?;
        let (kernel, limits, saturation) = (problem.kernel, problem.limits, problem.saturation);
        let side = self.network.architecture().side;
        let initial = problem.initial_canvas();
        // The network knows tanh only: what matters is the depth that an ink asks for.
        let wanted = problem.reference.map(|ink| saturation.inverse(ink).tanh());
        let tiles = |extent: usize| extent.div_ceil(side);
        let (columns, rows) = (tiles(wanted.width()), tiles(wanted.height()));
        let mut canvas = initial.clone();
        let mut strokes = Vec::new();
        for (round, (right, down)) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            observer.progress(round as f64 / 4.0);
            let corners =
                (down..rows).step_by(2).flat_map(|j| (right..columns).step_by(2).map(move |i| (i * side, j * side)));
            let corners: Vec<(usize, usize)> = corners.collect();
            let pictures: Vec<_> =
                corners.iter().map(|&at| (part(&wanted, at, side), Some(part(&canvas, at, side)))).collect();
            for (corner, steps) in corners.iter().zip(self.network.paint(&pictures)?) {
                let sprays: Vec<Spray> = steps.iter().filter_map(|step| spray(step, *corner, problem)).collect();
                strokes.extend(self.joined(sprays, limits.max_volume)?);
            }
            canvas = painted(&initial, &strokes, kernel);
        }
        if let Some(most) = limits.max_sprays {
            keep_largest(&mut strokes, most);
            canvas = painted(&initial, &strokes, kernel);
        }
        observer.progress(1.0);
        let sprays = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        let strokes = if self.strokes.is_some() { strokes } else { Vec::new() };
        Ok(Painting { strokes, ..Painting::new(sprays, canvas, saturation) })
    }
}

/// The part of a picture below and right of a corner; zero beyond the picture.
fn part(image: &Image, (left, top): (usize, usize), side: usize) -> Image {
    Image::from_fn(side, side, |x, y| {
        let (x, y) = (left + x, top + y);
        if x < image.width() && y < image.height() { image.at(x, y) } else { 0.0 }
    })
}

/// A step as a spray, if the nozzle may give it.
fn spray(step: &Step, (left, top): (usize, usize), problem: &PaintProblem) -> Option<Spray> {
    let (x, y) = (left as f64 + step.position.0, top as f64 + step.position.1);
    let volume = step.volume.min(problem.limits.max_volume);
    let (width, height) = problem.reference.size();
    let inside = |at: f64, extent: usize| (-0.5..extent as f64 - 0.5).contains(&at);
    let allowed = inside(x, width)
        && inside(y, height)
        && problem.paintable.is_none_or(|mask| mask[y.round().max(0.0) as usize * width + x.round().max(0.0) as usize]);
    (allowed && volume > 0.0 && volume >= problem.limits.min_volume).then_some(Spray {
        x,
        y,
        volume,
        sigma: step.sigma,
    })
}

/// The earliest of equal volumes stay; the order remains.
fn keep_largest(strokes: &mut Vec<Stroke>, most: usize) {
    let volumes: Vec<f64> = strokes.iter().flat_map(|stroke| &stroke.sprays).map(|spray| spray.volume).collect();
    let mut order: Vec<usize> = (0..volumes.len()).collect();
    order.sort_by(|&a, &b| volumes[b].total_cmp(&volumes[a]));
    let mut kept = vec![false; volumes.len()];
    order.iter().take(most).for_each(|&k| kept[k] = true);
    let mut kept = kept.into_iter();
    for stroke in strokes.iter_mut() {
        stroke.sprays.retain(|_| kept.next() == Some(true));
    }
    strokes.retain(|stroke| !stroke.sprays.is_empty());
}

fn painted(initial: &Image, strokes: &[Stroke], kernel: &SprayKernel) -> Image {
    let mut canvas = initial.clone();
    for spray in strokes.iter().flat_map(|stroke| &stroke.sprays) {
        kernel.stamp(spray, &mut canvas);
    }
    canvas
}
