//! Flights between strokes: straight where that is clear, else backed off from the surface, else around whatever is in the way.

use std::collections::HashMap;

use nalgebra::{Point3, Rotation3, Vector3};

use crate::angle::nearest_equivalent;
use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::lattice::{Cell, Space, shortest_way};
use crate::world::VehicleState;

/// Greatest motion between two collision checks of a flight, m and (scaled by one metre) rad.
const CHECK_STEP: f64 = 0.05;
/// What a leg may come nearer between two looks, m: half of the shortest step of the certificate, and its ends are just clear.
const LEG_SLACK: f64 = 0.002;
/// Retreats tried, m.
const RETREAT_DISTANCES: [f64; 4] = [0.15, 0.3, 0.6, 1.2];
/// Edge of the cells in which a way from the surface to the open is looked for, m.
const ESCAPE_STEP: f64 = 0.1;
/// Cells looked at for that.
const ESCAPE_CELLS: usize = 500;
/// Edge of the cells in the open, m.
const OPEN_STEP: f64 = 0.15;
/// Half the longest step between two cells, in edges; a point lies no farther from the nearest cell either.
const HALF_DIAGONAL: f64 = 0.866_025_403_784_438_7;
/// Cells looked at in the open.
const OPEN_CELLS: usize = 30_000;
/// Cells beyond this are not told apart: their numbers, and those of their neighbours, are integers of 32 bits.
const FARTHEST_CELL: f64 = 1e9;
/// Distances beyond this are not resolved, m.
const FAR: f64 = 50.0;
/// Headings tried on either side where a tool does not permit one, by 5 degrees.
const TURNS: i32 = 36;

/// Plans flights. What it learns about the room is kept from one flight to the next.
pub(crate) struct TransitPlanner {
    /// Axes of the cells in the open: those of the first vehicle, so that a plan turns with the world it is made in.
    origin: Point3<f64>,
    axes: Rotation3<f64>,
    /// Distance of the middles of cells from the surface.
    distances: HashMap<Cell, f64>,
    /// The last state from which there was no way to the open, and the clearance that it was to keep.
    stuck: Option<(VehicleState, f64)>,
}

impl TransitPlanner {
    /// With cells that lie about a vehicle.
    pub(crate) fn new(at: &VehicleState) -> Self {
        Self { origin: at.position, axes: axes(at), distances: HashMap::new(), stuck: None }
    }

    /// The corners of a flight that keeps `clearance`, both ends included: two where it is straight. `None` where none is found.
    pub(crate) fn corners(
        &mut self,
        from: &VehicleState,
        to: &VehicleState,
        checker: &mut ClearanceChecker<'_>,
        clearance: f64,
    ) -> Option<Vec<VehicleState>> {
        if legs_are_clear(checker, &[*from, *to], clearance) {
            return Some(vec![*from, *to]);
        }
        backed_off(from, to, checker, clearance).or_else(|| self.around(from, to, checker, clearance))
    }

    /// Out to where a ball about the body holds the robot in any pose, around in the open, and back in.
    fn around(
        &mut self,
        from: &VehicleState,
        to: &VehicleState,
        checker: &mut ClearanceChecker<'_>,
        clearance: f64,
    ) -> Option<Vec<VehicleState>> {
        let radius = checker.radius((0..=8).map(|k| between(from, to, f64::from(k) / 8.0)));
        // On the way between two cells, and to the first one, the surface may be that much nearer.
        let slack = HALF_DIAGONAL * OPEN_STEP;
        let open = radius + clearance + slack;
        if self.stuck.is_some_and(|(state, kept)| state == *from && clearance >= kept) {
            return None;
        }
        let Some(out) = escape(from, checker, clearance, open + slack) else {
            self.stuck = Some((*from, clearance));
            return None;
        };
        let home = escape(to, checker, clearance, open + slack)?;
        let (gate, end) = (out[out.len() - 1], home[home.len() - 1]);
        let (start, goal) = (self.cell(&gate.position), self.cell(&end.position));
        let way = shortest_way(start, OPEN_CELLS, &mut Open { planner: self, checker, goal, least: open })?;
        let turned = |(k, cell): (usize, &Cell)| {
            let share = k as f64 / (way.len() - 1).max(1) as f64;
            permitted(VehicleState { position: self.middle(*cell), ..between(&gate, &end, share) }, checker)
        };
        let inner: Vec<VehicleState> = way.iter().enumerate().map(turned).collect::<Option<_>>()?;
        let corners: Vec<VehicleState> = out.into_iter().chain(inner).chain(home.into_iter().rev()).collect();
        shortened(&corners, checker, clearance)
    }

    fn cell(&self, point: &Point3<f64>) -> Cell {
        let offset = self.axes.inverse_transform_vector(&(point - self.origin)) / OPEN_STEP;
        [offset.x, offset.y, offset.z].map(|c| c.round().clamp(-FARTHEST_CELL, FARTHEST_CELL) as i32)
    }

    fn middle(&self, cell: Cell) -> Point3<f64> {
        self.origin + self.axes * Vector3::from(cell.map(f64::from)) * OPEN_STEP
    }

    fn distance(&mut self, cell: Cell, checker: &mut ClearanceChecker<'_>) -> f64 {
        let middle = self.middle(cell);
        *self.distances.entry(cell).or_insert_with(|| checker.distance(&middle, FAR))
    }
}

/// Back off from the surface on both sides, along with the spray or with the body.
fn backed_off(
    from: &VehicleState,
    to: &VehicleState,
    checker: &mut ClearanceChecker<'_>,
    clearance: f64,
) -> Option<Vec<VehicleState>> {
    // Against the spray; or against the heading, along which the body came in.
    let directions: [fn(&VehicleState) -> Vector3<f64>; 2] = [VehicleState::spray_azimuth, VehicleState::forward];
    let back = |state: &VehicleState, direction: Vector3<f64>, distance: f64| VehicleState {
        position: state.position - direction * distance,
        ..*state
    };
    for retreat in RETREAT_DISTANCES {
        for forward in directions {
            let corners = vec![*from, back(from, forward(from), retreat), back(to, forward(to), retreat), *to];
            if legs_are_clear(checker, &corners, clearance) {
                return Some(corners);
            }
        }
    }
    None
}

/// The shortest way that a vehicle can be shifted, as it is turned, to where its middle is as far as `open` from the surface. The legs between its
/// corners are not looked at yet.
fn escape(
    state: &VehicleState,
    checker: &mut ClearanceChecker<'_>,
    clearance: f64,
    open: f64,
) -> Option<Vec<VehicleState>> {
    let mut space = Escape {
        state,
        axes: axes(state),
        checker,
        clearance,
        open,
        clear: HashMap::new(),
        cache: DistanceCache::default(),
    };
    let way = shortest_way([0; 3], ESCAPE_CELLS, &mut space)?;
    Some(way.into_iter().map(|cell| space.shifted(cell)).collect())
}

/// The room about a vehicle that is shifted as it is turned, away from the surface.
struct Escape<'a, 'b> {
    state: &'a VehicleState,
    axes: Rotation3<f64>,
    checker: &'a mut ClearanceChecker<'b>,
    clearance: f64,
    /// Distance of the body's middle from the surface at a goal.
    open: f64,
    /// What is known of cells.
    clear: HashMap<Cell, bool>,
    cache: DistanceCache,
}

impl Escape<'_, '_> {
    fn shifted(&self, cell: Cell) -> VehicleState {
        let shift = self.axes * Vector3::from(cell.map(f64::from)) * ESCAPE_STEP;
        VehicleState { position: self.state.position + shift, ..*self.state }
    }
}

impl Space for Escape<'_, '_> {
    fn left(&mut self, cell: Cell) -> f64 {
        // A distance grows no faster than the way.
        (self.open - self.checker.distance(&self.shifted(cell).position, self.open)) / ESCAPE_STEP
    }

    fn passable(&mut self, _: Cell, to: Cell) -> bool {
        if let Some(clear) = self.clear.get(&to) {
            return *clear;
        }
        let state = self.shifted(to);
        let clear = self.checker.is_clear(&state, self.clearance, &mut self.cache);
        self.clear.insert(to, clear);
        clear
    }
}

/// The room in which a ball about the body fits, with the way to a goal in it.
struct Open<'a, 'b> {
    planner: &'a mut TransitPlanner,
    checker: &'a mut ClearanceChecker<'b>,
    goal: Cell,
    /// Least distance of a cell from the surface.
    least: f64,
}

impl Space for Open<'_, '_> {
    fn left(&mut self, cell: Cell) -> f64 {
        Vector3::from(self.goal.map(f64::from)).metric_distance(&Vector3::from(cell.map(f64::from)))
    }

    fn passable(&mut self, _: Cell, to: Cell) -> bool {
        self.planner.distance(to, self.checker) >= self.least
    }
}

/// The state, turned no more than it must be for the tool to permit it.
fn permitted(state: VehicleState, checker: &ClearanceChecker<'_>) -> Option<VehicleState> {
    let turned = |k: i32| VehicleState { heading: state.heading + f64::from(k) * 5.0_f64.to_radians(), ..state };
    (0..=TURNS).flat_map(|k| [turned(k), turned(-k)]).find(|state| checker.permits(state))
}

/// The same way with corners left out where the straight leg past them is clear; `None` where a leg is not.
fn shortened(
    corners: &[VehicleState],
    checker: &mut ClearanceChecker<'_>,
    clearance: f64,
) -> Option<Vec<VehicleState>> {
    let (mut kept, mut at) = (vec![corners[0]], 0);
    while at + 1 < corners.len() {
        let mut ahead = corners.len() - 1 - at;
        while !legs_are_clear(checker, &[corners[at], corners[at + ahead]], clearance) {
            if ahead == 1 {
                return None;
            }
            ahead /= 2;
        }
        at += ahead;
        kept.push(corners[at]);
    }
    Some(kept)
}

/// Forwards, to the left, up.
fn axes(state: &VehicleState) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), state.heading)
}

/// State between two, every coordinate linear, the heading by the shorter way.
pub(crate) fn between(from: &VehicleState, to: &VehicleState, share: f64) -> VehicleState {
    let mix = |a: f64, b: f64| a + (b - a) * share;
    VehicleState {
        position: from.position + (to.position - from.position) * share,
        heading: mix(from.heading, nearest_equivalent(to.heading, from.heading)),
        pan: mix(from.pan, to.pan),
        tilt: mix(from.tilt, to.tilt),
    }
}

/// Whether the body keeps clear along the straight legs between the corners: certified but for [`LEG_SLACK`].
fn legs_are_clear(checker: &mut ClearanceChecker<'_>, corners: &[VehicleState], clearance: f64) -> bool {
    let mut cache = DistanceCache::default();
    corners.windows(2).all(|leg| {
        let turn = nearest_equivalent(leg[1].heading, leg[0].heading) - leg[0].heading;
        let joints = Vector3::new(turn, leg[1].pan - leg[0].pan, leg[1].tilt - leg[0].tilt).abs().sum();
        let way = (leg[1].position - leg[0].position).norm();
        let steps = ((way + joints) / CHECK_STEP).ceil().clamp(1.0, 1e5) as usize;
        let state = |share: f64| between(&leg[0], &leg[1], share);
        let looks_clear = (0..=steps).all(|k| checker.is_clear(&state(k as f64 / steps as f64), clearance, &mut cache));
        looks_clear && {
            let lever = checker.radius(leg.iter().copied());
            let wanted = (clearance - LEG_SLACK).max(0.0);
            checker.along(&state, way + lever * joints, wanted, wanted, &mut cache).1 == 0.0
        }
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitVector3;

    use super::*;
    use crate::target::NozzleState;
    use crate::world::{Hit, Surface, Tool};

    /// A wall at x = 0, and a robot of one ball that goes anywhere.
    struct Wall;

    impl Surface for Wall {
        fn cast(&self, _: &Point3<f64>, _: &UnitVector3<f64>, _: f64) -> Option<Hit> {
            None
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            point.x.abs().min(max)
        }
    }

    impl Tool for Wall {
        fn vehicle(&self, _: &NozzleState, _: f64) -> Option<VehicleState> {
            None
        }

        fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
            out.push((vehicle.position, 0.2));
        }
    }

    /// What is left of a way, in cells: the straight line to a goal in the open, and the gap that is missing from the wall. A greater estimate
    /// would lead the search astray, a smaller one would make it long.
    #[test]
    fn what_is_left_of_a_way_is_its_straight_line() {
        let state = VehicleState { position: Point3::new(0.3, 1.0, 2.0), heading: 0.4, pan: 0.0, tilt: 0.0 };
        let mut checker = ClearanceChecker::new(&Wall, &Wall);
        let mut planner = TransitPlanner::new(&state);
        let mut open = Open { planner: &mut planner, checker: &mut checker, goal: [2, -1, 7], least: 0.5 };
        for (cell, left) in [([2, -1, 7], 0.0), ([2, 3, 4], 5.0), ([1, 1, 5], 3.0), ([2, -2, 7], 1.0)] {
            assert!((open.left(cell) - left).abs() < 1e-12, "{cell:?}: {}", open.left(cell));
        }
        // Forwards is along the heading: 0.15 m on are 0.138 m farther from the wall.
        assert_eq!([open.passable([0; 3], [1, 0, 0]), open.passable([0; 3], [2, 0, 0])], [false, true]);

        let (axes, clear, cache) = (axes(&state), HashMap::new(), DistanceCache::default());
        let mut escape =
            Escape { state: &state, axes, checker: &mut checker, clearance: 0.05, open: 0.8, clear, cache };
        for (cell, left) in [([0; 3], 5.0), ([0, 0, 9], 5.0), ([2, 0, 0], 5.0 - 2.0 * 0.4_f64.cos())] {
            assert!((escape.left(cell) - left).abs() < 1e-9, "{cell:?}: {}", escape.left(cell));
        }
        assert!(escape.left([6, 0, 0]) <= 0.0 && escape.left([5, 0, 0]) > 0.0);
        // The ball of 0.2 m keeps 5 cm: one cell of 0.1 m nearer to the wall it touches.
        assert_eq!([escape.passable([0; 3], [0; 3]), escape.passable([0; 3], [-1, 0, 0])], [true, false]);
    }
}
