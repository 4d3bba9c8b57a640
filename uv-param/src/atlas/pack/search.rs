//! Local search over the order of the charts, their turns and the width of the page: threshold accepting (Dueck and Scheuer 1990)
//! with a fixed budget of work, so that the result depends on the charts alone.

use super::bottom_left::{Pages, Place, Step};
use super::shape::Shapes;
use crate::random::Random;

/// How much worse than the present arrangement a new one may be at the start of the search; nothing at its end.
const THRESHOLD: f64 = 0.04;
/// How far the width of a page is moved at most in one step, as a share of it.
const WIDTH_STEP: f64 = 0.12;
/// Widths that are tried before the search, relative to the side of a square that the charts would fill.
const WIDTHS: [f64; 5] = [0.95, 1.05, 1.15, 1.25, 1.4];

/// What is searched for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal {
    /// The one page of the least area.
    Smallest,
    /// The fewest pages of this size, cells, and the last of them as low as can be.
    Pages([usize; 2]),
}

impl Goal {
    fn most(self) -> usize {
        match self {
            Self::Smallest => 1,
            Self::Pages(_) => usize::MAX,
        }
    }

    /// Area that the pages take.
    fn cost(self, pages: &Pages) -> usize {
        let last = pages.used.last().copied().unwrap_or([1; 2]);
        match self {
            Self::Smallest => last[0] * last[1],
            Self::Pages([width, height]) => width * (height * (pages.used.len() - 1) + last[1]),
        }
    }
}

/// The charts in an order, their turns, and the width of a page, cells.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) steps: Vec<Step>,
    pub(super) width: usize,
}

/// A plan carried out.
#[derive(Clone)]
pub(super) struct Packed {
    /// In the order of the plan.
    pub(super) places: Vec<Place>,
    /// The pages before every chart, where they are kept.
    stages: Vec<Pages>,
    /// Columns and rows that are used of every page.
    pub(super) used: Vec<[usize; 2]>,
    pub(super) cost: usize,
}

/// What of an earlier arrangement a new one begins with, and what is kept of it.
#[derive(Clone, Copy)]
pub(super) enum Stages<'a> {
    /// It begins with empty pages, and nothing is kept for others.
    Drop,
    /// It begins with empty pages.
    Keep,
    /// It begins with what another one held before this step.
    From(&'a Packed, usize),
}

/// Carries a plan out; `None` where it does not fit or costs more than `limit`.
pub(super) fn carry_out(
    shapes: &Shapes,
    plan: &Plan,
    goal: Goal,
    limit: usize,
    kept: Stages,
    work: &mut u64,
) -> Option<Packed> {
    let rows = match goal {
        Goal::Smallest => limit / plan.width.max(1),
        Goal::Pages(size) => size[1],
    };
    let (mut pages, mut stages, mut places) = if let Stages::From(packed, first) = kept {
        (packed.stages[first].clone(), packed.stages[..first].to_vec(), packed.places[..first].to_vec())
    } else {
        let size = match goal {
            Goal::Smallest => [plan.width, rows],
            Goal::Pages(size) => size,
        };
        (Pages::new(size), Vec::new(), Vec::new())
    };
    pages.work = 0;
    for &step in &plan.steps[places.len()..] {
        if !matches!(kept, Stages::Drop) {
            stages.push(pages.clone());
        }
        let place = pages.add(shapes, step, goal.most(), rows);
        if place.is_none() || goal.cost(&pages) > limit {
            *work += pages.work;
            return None;
        }
        places.extend(place);
    }
    *work += pages.work;
    let cost = goal.cost(&pages);
    Some(Packed { places, stages, used: pages.used, cost })
}

/// Carries a plan out on a page as high as it takes.
pub(super) fn carry_out_unlimited(shapes: &Shapes, plan: &Plan, goal: Goal, kept: Stages) -> Option<Packed> {
    if matches!(goal, Goal::Pages(_)) {
        return carry_out(shapes, plan, goal, usize::MAX, kept, &mut 0);
    }
    // Twice their cells is enough for most; a pile of all of them for any, if the widest fits at all.
    let (mut rows, pile) = (2 * shapes.cells / plan.width.max(1) + 1, shapes.pile());
    loop {
        let packed = carry_out(shapes, plan, goal, rows * plan.width, kept, &mut 0);
        if packed.is_some() || rows >= pile {
            return packed;
        }
        rows = (2 * rows).min(pile);
    }
}

/// The best plan found: the charts by size first, each in its best turn, then local moves until `budget` words were looked at.
pub(super) fn search(shapes: &Shapes, order: &[usize], goal: Goal, budget: u64) -> Option<(Plan, Packed)> {
    let free: Vec<Step> = order.iter().map(|&chart| (chart, None)).collect();
    let side = (shapes.cells as f64).sqrt();
    let widths: Vec<usize> = match goal {
        Goal::Smallest => WIDTHS.iter().map(|w| (w * side).ceil() as usize).collect(),
        Goal::Pages(size) => vec![size[0]],
    };
    let mut best: Option<(Plan, Packed)> = None;
    for width in widths {
        let plan = Plan { steps: free.clone(), width: width.max(shapes.narrowest()) };
        let packed = match &best {
            None => carry_out_unlimited(shapes, &plan, goal, Stages::Keep),
            Some((_, least)) => carry_out(shapes, &plan, goal, least.cost - 1, Stages::Keep, &mut 0),
        };
        if let Some(packed) = packed {
            let steps = order.iter().zip(&packed.places).map(|(&chart, place)| (chart, Some(place.1))).collect();
            let width = if matches!(goal, Goal::Smallest) { packed.used[0][0] } else { plan.width };
            best = Some((Plan { steps, width }, packed));
        }
    }
    let (plan, packed) = best?;
    Some(improve(shapes, plan, packed, goal, budget))
}

/// Local moves from a plan on.
fn improve(shapes: &Shapes, plan: Plan, packed: Packed, goal: Goal, budget: u64) -> (Plan, Packed) {
    let mut random = Random(0);
    let (mut best, mut now) = ((plan.clone(), packed.clone()), (plan, packed));
    let mut work = 0;
    while work < budget {
        // A move that changes nothing must end as well.
        work += 1000;
        let (plan, first) = moved(shapes, &now.0, goal, &mut random);
        let Some(first) = first else { continue };
        let threshold = 1.0 + THRESHOLD * (1.0 - work as f64 / budget as f64).max(0.0);
        let limit = (now.1.cost as f64 * threshold) as usize;
        // Another width needs other pages.
        let same_page = plan.width == now.0.width;
        let kept = if same_page && first > 0 { Stages::From(&now.1, first) } else { Stages::Keep };
        if let Some(packed) = carry_out(shapes, &plan, goal, limit, kept, &mut work) {
            now = (plan, packed);
            if now.1.cost < best.1.cost {
                best = now.clone();
            }
        }
    }
    best
}

/// A plan with one thing changed, and the first step that is.
fn moved(shapes: &Shapes, plan: &Plan, goal: Goal, random: &mut Random) -> (Plan, Option<usize>) {
    let mut plan = plan.clone();
    let count = plan.steps.len();
    let kind = random.below(10);
    let first = if kind < 2 && matches!(goal, Goal::Smallest) {
        let step = WIDTH_STEP * (2.0 * random.unit() - 1.0);
        let width = ((1.0 + step) * plan.width as f64).round() as usize;
        let changed = width != plan.width;
        plan.width = width.max(1);
        changed.then_some(0)
    } else if kind < 6 || count < 2 {
        let at = random.below(count);
        let (chart, turn) = plan.steps[at];
        let turns = shapes.turned[chart].len();
        let new = random.below(turns);
        plan.steps[at].1 = Some(new);
        (turn != Some(new)).then_some(at)
    } else {
        let (from, to) = (random.below(count), random.below(count));
        if kind < 8 {
            plan.steps.swap(from, to);
        } else {
            let step = plan.steps.remove(from);
            plan.steps.insert(to, step);
        }
        (from != to).then_some(from.min(to))
    };
    (plan, first)
}
