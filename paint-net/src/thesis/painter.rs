//! The thesis' network as a painter.

use super::network::Network;
use super::step::Step;
use crate::error::Error;
use crate::image::Image;
use crate::model::{Spray, SprayKernel};
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::PaintProblem;

/// The thesis' painter: pictures larger than its network are painted tile by tile.
///
/// Every tile is given the canvas as it is, with what its neighbours left there, and sprays reach over its border. Tiles are
/// painted in four rounds, none of which holds two that touch. Places, spreads and their number are the network's: of the
/// limits only the volumes and the number of sprays hold (the largest stay), of the kernel only the cut (in units of each
/// spray's own spread), of the problem's weights nothing. Deterministic: the network paints its mean.
#[derive(Debug, Clone, PartialEq)]
pub struct ThesisPainter {
    /// The weights; there are none in the crate, as they are too large.
    pub network: Network,
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
        let mut sprays = Vec::new();
        for (round, (right, down)) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            observer.progress(round as f64 / 4.0);
            let corners =
                (down..rows).step_by(2).flat_map(|j| (right..columns).step_by(2).map(move |i| (i * side, j * side)));
            let corners: Vec<(usize, usize)> = corners.collect();
            let pictures: Vec<_> =
                corners.iter().map(|&at| (part(&wanted, at, side), Some(part(&canvas, at, side)))).collect();
            for (corner, steps) in corners.iter().zip(self.network.paint(&pictures)?) {
                sprays.extend(steps.iter().filter_map(|step| spray(step, *corner, problem)));
            }
            canvas = painted(&initial, &sprays, kernel);
        }
        if limits.max_sprays.is_some_and(|most| most < sprays.len()) {
            keep_largest(&mut sprays, limits.max_sprays.unwrap_or_default());
            canvas = painted(&initial, &sprays, kernel);
        }
        observer.progress(1.0);
        Ok(Painting::new(sprays, canvas, saturation))
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
fn keep_largest(sprays: &mut Vec<Spray>, most: usize) {
    let mut order: Vec<usize> = (0..sprays.len()).collect();
    order.sort_by(|&a, &b| sprays[b].volume.total_cmp(&sprays[a].volume));
    order.truncate(most);
    order.sort_unstable();
    *sprays = order.into_iter().map(|k| sprays[k]).collect();
}

fn painted(initial: &Image, sprays: &[Spray], kernel: &SprayKernel) -> Image {
    let mut canvas = initial.clone();
    for spray in sprays {
        kernel.stamp(spray, &mut canvas);
    }
    canvas
}
