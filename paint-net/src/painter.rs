//! The trait of all painters, and of those who watch them.

use crate::error::Error;
use crate::image::Image;
use crate::model::Spray;
use crate::painting::Painting;
use crate::problem::PaintProblem;
use crate::trace::{event, span};

/// Decides what to spray where.
///
/// A painter of one's own implements `name` and `paint_observed`; it can then be wrapped by [`crate::painters::Layered`],
/// [`crate::painters::SlewLimited`] and [`crate::painters::ClosedLoopPainter`] like any other.
pub trait Painter {
    /// Short name for tables and command lines.
    fn name(&self) -> &'static str;

    /// Solves a problem; the observer follows the work. Deterministic.
    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error>;

    /// Solves a problem that nobody watches.
    fn paint(&self, problem: &PaintProblem) -> Result<Painting, Error> {
        span!("paint");
        let painting = self.paint_observed(problem, &mut ())?;
        event!(debug, painter = self.name(), sprays = painting.sprays.len(), "painted");
        Ok(painting)
    }
}

/// Follows a painter at work. `()` is one that does nothing, and every closure `|share: f64|` one that is told the progress.
pub trait Observer {
    /// Told the share of the work that is done, in `[0, 1]`.
    fn progress(&mut self, share: f64) {
        let _ = share;
    }

    /// Sprays these on the real wall and measures it: its ink afterwards, of the reference's size. `None`, the default: there is
    /// no wall, and the plan is taken as painted. Only painters that close the loop ask for it.
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, Error> {
        let _ = sprays;
        Ok(None)
    }
}

impl Observer for () {}

impl<F: FnMut(f64)> Observer for F {
    fn progress(&mut self, share: f64) {
        self(share);
    }
}

/// The observer of a part of the work: shares of the part are reported as shares of the whole.
pub(crate) struct PartialProgress<'a> {
    pub(crate) observer: &'a mut dyn Observer,
    /// Share done before the part, and share of the part.
    pub(crate) from: f64,
    pub(crate) share: f64,
}

impl Observer for PartialProgress<'_> {
    fn progress(&mut self, share: f64) {
        self.observer.progress(self.from + self.share * share);
    }

    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, Error> {
        self.observer.spray(sprays)
    }
}

/// So that painters that wrap others can wrap one that is chosen while running.
impl<P: Painter + ?Sized> Painter for Box<P> {
    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        (**self).paint_observed(problem, observer)
    }
}

impl<P: Painter + ?Sized> Painter for &P {
    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        (**self).paint_observed(problem, observer)
    }
}
