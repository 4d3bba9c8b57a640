//! Which directions of a pose a frame fixes, and the pose along those that only outlines fix.

use nalgebra::{Isometry3, Vector6};

use crate::ray_cast::view::View;
use crate::tracking::direct_search::{DirectSearch, STEPS};
use crate::tracking::directions::{Directions, LEAST_SHARE};
use crate::tracking::model_points::{Model, model_points};
use crate::tracking::pose::{moved, step};
use crate::tracking::registration::Registration;
use crate::tracking::residuals::{Comparison, Evaluation};

/// Iterations of the linear system after each step of the search.
const ITERATIONS: usize = 3;
/// The search takes noise for at least this multiple of the noise model's (ours).
const LEAST_SCALE: f32 = 0.3;

/// The end of a registration.
pub(crate) struct Observed {
    /// The cost at the end.
    pub(crate) last: Evaluation,
    pub(crate) directions: Directions,
    /// Those that the frame says nothing about.
    pub(crate) unknown: [bool; 6],
}

/// A registration that came to its end at the finest level.
pub(crate) struct Observation<'a> {
    pub(crate) comparison: &'a Comparison<'a>,
    pub(crate) view: &'a View,
    /// Variance of the model's normals, radians squared.
    pub(crate) scatter: f64,
    /// Whether the pose is moved to where the cost is least.
    pub(crate) searches: bool,
}

impl Observation<'_> {
    /// Which directions are fixed. Along those that the linear system does not see, the pose is first moved to where the cost is least; what
    /// is not fixed there, either, stays as it was. `None` if nothing says anything.
    pub(crate) fn observe(&self, search: &mut Registration, last: Evaluation) -> Option<Observed> {
        let mut all = Model::default();
        let mut seen = self.fixed_nearby(search, last, &mut all)?;
        if !self.searches || !seen.unknown.contains(&true) {
            return Some(seen);
        }
        self.fill(&mut all);
        seen.fixed_by_cost(search, [self.comparison.model, &all].map(|model| self.direct_search(search, model)));
        let start = search.clone();
        let mut axes: Vec<Vector6<f64>> =
            (0..6).filter(|&k| seen.unknown[k]).map(|k| seen.directions.step(k)).collect();
        let weak = seen.directions.clone();
        while !axes.is_empty() {
            *search = start.clone();
            let mut last = seen.last.clone();
            for step in STEPS {
                let coarse = self.direct_search(search, self.comparison.model);
                coarse.descend(&mut search.pose, &axes, step);
                last = search.refine(self.comparison, ITERATIONS, LEAST_SHARE);
            }
            let mut found = self.fixed_nearby(search, last, &mut all)?;
            found.fixed_by_cost(search, [self.comparison.model, &all].map(|model| self.direct_search(search, model)));
            let open: Vec<_> = (0..6).filter(|&k| found.unknown[k]).map(|k| found.directions.step(k)).collect();
            seen = found;
            if open.is_empty() {
                return Some(seen);
            }
            // Again, but not along what is open: there the cost rises and falls by chance.
            let left = weak.without(&axes, &open);
            if left.len() == axes.len() {
                break;
            }
            axes = left;
        }
        if search.pose != start.pose {
            let wandered = seen.directions.part(&step(&search.pose, &start.pose), |k| seen.unknown[k]);
            search.pose = moved(&search.pose, &wandered);
        }
        Some(seen)
    }

    fn direct_search<'b>(&'b self, search: &Registration, model: &'b Model) -> DirectSearch<'b> {
        DirectSearch {
            comparison: Comparison { model, ..*self.comparison },
            scale: search.scales.depth.max(LEAST_SCALE),
        }
    }

    fn fixed_nearby(&self, search: &Registration, last: Evaluation, all: &mut Model) -> Option<Observed> {
        let directions = Directions::new(&last.equations, last.mean_depth(), LEAST_SHARE)?;
        let mut dense = |pose: &Isometry3<f64>| {
            self.fill(all);
            Comparison { model: all, ..*self.comparison }.evaluate(pose, search.scales, search.brightness)
        };
        // Where a search follows, what the linear system says is not trusted even if the cost rises nearby: the cost must rise far away.
        let unknown = if self.searches {
            directions.weak(self.scatter)
        } else {
            directions.degenerate(&mut dense, &search.pose, self.scatter)
        };
        Some(Observed { last, directions, unknown })
    }

    /// Takes all points of the view, once.
    fn fill(&self, all: &mut Model) {
        if all.points.is_empty() {
            model_points(self.view, self.comparison.rim_width, 1, 0, all);
        }
    }
}

impl Observed {
    /// What slopes leave open and the cost does not, by few points and by all.
    fn fixed_by_cost(&mut self, search: &Registration, [few, all]: [DirectSearch; 2]) {
        let open: Vec<usize> = (0..6).filter(|&k| self.unknown[k]).collect();
        if open.is_empty() {
            return;
        }
        let axes: Vec<_> = open.iter().map(|&k| self.directions.step(k)).collect();
        self.directions.combine(&open, &few.principal(&search.pose, &axes));
        for k in open {
            if let Some(deviation) = all.deviation(&search.pose, &self.directions.step(k)) {
                self.directions.fix(k, deviation);
                self.unknown[k] = false;
            }
        }
    }
}
