//! Distance between a moving collision body and the surface, with as few queries as the triangle inequality permits.

use crate::error::Error;
use crate::target::NozzleState;
use crate::world::{Surface, Tool, VehicleState};
use nalgebra::{Matrix2, Point3, Vector2};

/// Shortest motion between two looks along a curve, m: a curve that is certified keeps half of it more.
const LEAST_STEP: f64 = 0.002;
/// Longest motion between two looks, m.
const GREATEST_STEP: f64 = 0.1;
/// Steps to the joints that point at an aim, and the difference that gives their slopes, rad.
const AIM_STEPS: usize = 6;
const AIM_DIFFERENCE: f64 = 1e-5;
/// How far distances are resolved, m: spheres farther off than this need no query for a long way.
const QUERY_MARGIN: f64 = 1.0;

/// What was known about one sphere at the last query.
#[derive(Debug, Clone, Copy)]
struct CachedDistance {
    centre: Point3<f64>,
    distance: f64,
}

/// The last queries of every sphere of one body; a body moving along a path asks the surface only when the motion since
/// has used up the slack.
#[derive(Debug, Clone, Default)]
pub(crate) struct DistanceCache {
    spheres: Vec<CachedDistance>,
}

/// Collision checks of one tool against one surface. What a caller's surface or tool answers is checked here: the first answer
/// that cannot be is kept, and told by [`check_answers`](Self::check_answers).
pub(crate) struct ClearanceChecker<'a> {
    surface: &'a dyn Surface,
    tool: &'a dyn Tool,
    spheres: Vec<(Point3<f64>, f64)>,
    fault: Option<Error>,
}

impl<'a> ClearanceChecker<'a> {
    pub(crate) fn new(surface: &'a dyn Surface, tool: &'a dyn Tool) -> Self {
        Self { surface, tool, spheres: Vec::new(), fault: None }
    }

    /// The tool's answer for a nozzle state and a heading.
    pub(crate) fn vehicle(&mut self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let vehicle = self.tool.vehicle(nozzle, heading)?;
        let [x, y, z] = vehicle.position.into();
        if [x, y, z, vehicle.heading, vehicle.pan, vehicle.tilt].iter().all(|v| v.is_finite()) {
            return Some(vehicle);
        }
        let at = nozzle.position.into();
        self.fault.get_or_insert(Error::World { what: "the tool's vehicle state has numbers that are not finite", at });
        None
    }

    /// Fails if the surface or the tool has answered what cannot be.
    pub(crate) fn check_answers(&self) -> Result<(), Error> {
        self.fault.clone().map_or(Ok(()), Err)
    }

    /// Whether the tool permits a state, collisions aside.
    pub(crate) fn permits(&self, state: &VehicleState) -> bool {
        self.tool.permits(state)
    }

    /// Radius of a ball about the body's origin that holds the vehicle in all of some states, m.
    pub(crate) fn radius(&mut self, states: impl Iterator<Item = VehicleState>) -> f64 {
        states.fold(0.0, |most, state| {
            self.spheres.clear();
            self.tool.spheres(&state, &mut self.spheres);
            self.spheres.iter().map(|(centre, radius)| (centre - state.position).norm() + radius).fold(most, f64::max)
        })
    }

    /// How far the spray of a vehicle misses its aim on the surface, m: infinite where it meets nothing there. `None` for a tool that cannot
    /// tell.
    pub(crate) fn miss(&self, state: &VehicleState, aim: &Point3<f64>) -> Option<f64> {
        let nozzle = self.tool.nozzle(state)?;
        let reach = 2.0 * (aim - nozzle.position).norm();
        let hit = self.surface.cast(&nozzle.position, &nozzle.direction, reach);
        Some(hit.map_or(f64::INFINITY, |hit| (hit.point - aim).norm()))
    }

    /// The vehicle with the joints turned so that its spray points at `aim`: Gauss-Newton steps with slopes by differences. `None` where
    /// that needs what the joints do not give, and for a tool that cannot tell where it sprays.
    pub(crate) fn aimed(&self, state: &VehicleState, aim: &Point3<f64>) -> Option<VehicleState> {
        let off = |pan: f64, tilt: f64| {
            let nozzle = self.tool.nozzle(&VehicleState { pan, tilt, ..*state })?;
            let way = aim - nozzle.position;
            Some(way - nozzle.direction.into_inner() * way.dot(&nozzle.direction))
        };
        let (mut pan, mut tilt) = (state.pan, state.tilt);
        for _ in 0..AIM_STEPS {
            let here = off(pan, tilt)?;
            let slopes = [off(pan + AIM_DIFFERENCE, tilt)?, off(pan, tilt + AIM_DIFFERENCE)?];
            let [a, b] = slopes.map(|there| (there - here) / AIM_DIFFERENCE);
            let normal = Matrix2::new(a.dot(&a), a.dot(&b), a.dot(&b), b.dot(&b));
            let step = normal.try_inverse()? * Vector2::new(a.dot(&here), b.dot(&here));
            (pan, tilt) = (pan - step.x, tilt - step.y);
        }
        let found = VehicleState { pan, tilt, ..*state };
        // The inverse kinematics know the limits.
        self.tool.vehicle(&self.tool.nozzle(&found)?, state.heading).map(|_| found)
    }

    /// Distance from a point to the surface, clipped at `max`, m. What is no distance counts as a touch.
    pub(crate) fn distance(&mut self, centre: &Point3<f64>, max: f64) -> f64 {
        let distance = self.surface.distance(centre, max);
        if distance >= 0.0 {
            return distance;
        }
        let what = "the distance to the surface is negative or not a number";
        self.fault.get_or_insert(Error::World { what, at: (*centre).into() });
        0.0
    }

    /// Whether the tool permits the state and every sphere keeps `clearance` from the surface.
    pub(crate) fn is_clear(&mut self, state: &VehicleState, clearance: f64, cache: &mut DistanceCache) -> bool {
        if !self.tool.permits(state) {
            return false;
        }
        self.spheres.clear();
        self.tool.spheres(state, &mut self.spheres);
        for k in 0..self.spheres.len() {
            let (centre, radius) = self.spheres[k];
            let need = radius + clearance;
            match cache.spheres.get(k) {
                Some(last) if last.distance - (centre - last.centre).norm() >= need => continue,
                Some(last) if last.distance + (centre - last.centre).norm() < need => return false,
                _ => {}
            }
            let distance = self.distance(&centre, need + QUERY_MARGIN);
            let fresh = CachedDistance { centre, distance };
            if k < cache.spheres.len() {
                cache.spheres[k] = fresh;
            } else if k == cache.spheres.len() {
                cache.spheres.push(fresh);
            }
            if distance < need {
                return false;
            }
        }
        true
    }

    /// The least clearance seen along a motion, clipped at `below`, m, and how much is missing at most anywhere between, where that is
    /// more than nothing. `motion` bounds how far a point of the body moves in all, and `state` is even along it, shares from 0 to 1.
    ///
    /// Distances change no faster than the body moves: between two looks a motion `L` apart the clearance is at least
    /// `(d0 + d1 - L) / 2`. Looks lie the closer the nearer the surface is (conservative advancement, Mirtich 1996).
    pub(crate) fn along(
        &mut self,
        state: &dyn Fn(f64) -> VehicleState,
        motion: f64,
        wanted: f64,
        below: f64,
        cache: &mut DistanceCache,
    ) -> (f64, f64) {
        let below = below.max(wanted + 0.5 * GREATEST_STEP);
        let (mut share, mut here) = (0.0, self.clearance(&state(0.0), below, cache));
        let (mut least, mut missing) = (here, wanted - here);
        while share < 1.0 {
            let mut step = (1.6 * (here - wanted)).clamp(LEAST_STEP, GREATEST_STEP);
            loop {
                let next = if motion > step { (share + step / motion).min(1.0) } else { 1.0 };
                let there = self.clearance(&state(next), below, cache);
                let short = wanted - 0.5 * (here + there - motion * (next - share));
                least = least.min(there);
                if short <= 0.0 || step <= LEAST_STEP {
                    missing = missing.max(short);
                    (share, here) = (next, there);
                    break;
                }
                step = (0.5 * step).max(LEAST_STEP);
            }
        }
        (least, missing.max(0.0))
    }

    /// Smallest distance between a sphere and the surface, negative where they overlap, clipped at `below`, m.
    pub(crate) fn clearance(&mut self, state: &VehicleState, below: f64, cache: &mut DistanceCache) -> f64 {
        self.spheres.clear();
        self.tool.spheres(state, &mut self.spheres);
        let mut least = below;
        for k in 0..self.spheres.len() {
            let (centre, radius) = self.spheres[k];
            if cache.spheres.get(k).is_some_and(|last| last.distance - (centre - last.centre).norm() - radius >= least)
            {
                continue;
            }
            let distance = self.distance(&centre, radius + below.max(0.0) + QUERY_MARGIN);
            let fresh = CachedDistance { centre, distance };
            if k < cache.spheres.len() {
                cache.spheres[k] = fresh;
            } else if k == cache.spheres.len() {
                cache.spheres.push(fresh);
            }
            least = least.min(distance - radius);
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Hit;
    use nalgebra::{UnitVector3, Vector3};

    /// A point in the room.
    struct Tip;

    impl Surface for Tip {
        fn cast(&self, _: &Point3<f64>, _: &UnitVector3<f64>, _: f64) -> Option<Hit> {
            None
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            point.coords.norm().min(max)
        }
    }

    /// A ball of 10 cm.
    struct Ball;

    impl Tool for Ball {
        fn vehicle(&self, _: &NozzleState, _: f64) -> Option<VehicleState> {
            None
        }

        fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
            out.push((vehicle.position, 0.1));
        }
    }

    #[test]
    fn what_is_near_for_a_moment_only_is_seen_between_two_looks() {
        for (side, clear) in [(0.115, false), (0.128, false), (0.132, true), (0.3, true)] {
            for begin in [-0.93, -0.512, -0.4] {
                let mut checker = ClearanceChecker::new(&Tip, &Ball);
                let position = |share: f64| Point3::new(begin + share, side, 0.0);
                let state = |share: f64| VehicleState { position: position(share), heading: 0.0, pan: 0.0, tilt: 0.0 };
                let (least, missing) = checker.along(&state, 1.0, 0.03, 1.0, &mut DistanceCache::default());
                assert_eq!(missing == 0.0, clear, "{side} {begin}");
                assert!((least - (side - 0.1)).abs() < 0.01 || clear, "{least}");
                let truly = 0.13 - side;
                assert!(clear || (truly - 1e-9..truly + LEAST_STEP).contains(&missing), "{missing} {truly}");
            }
        }
    }

    /// The plane x = 1, seen along x by a nozzle in the body's origin.
    struct Screen;

    impl Surface for Screen {
        fn cast(&self, origin: &Point3<f64>, _: &UnitVector3<f64>, max: f64) -> Option<Hit> {
            let (distance, normal) = (1.0 - origin.x, -Vector3::x_axis());
            let point = Point3::new(1.0, origin.y, origin.z);
            (distance <= max).then_some(Hit { point, normal, distance })
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            (1.0 - point.x).abs().min(max)
        }
    }

    impl Tool for Screen {
        fn vehicle(&self, _: &NozzleState, _: f64) -> Option<VehicleState> {
            None
        }

        fn spheres(&self, _: &VehicleState, _: &mut Vec<(Point3<f64>, f64)>) {}

        fn nozzle(&self, vehicle: &VehicleState) -> Option<NozzleState> {
            Some(NozzleState { position: vehicle.position, direction: Vector3::x_axis() })
        }
    }

    /// A spray is followed behind its aim for as far as it has come, and no farther.
    #[test]
    fn a_spray_misses_by_where_it_meets_the_surface() {
        let checker = ClearanceChecker::new(&Screen, &Screen);
        let miss = |x: f64, aim: f64| {
            let state = VehicleState { position: Point3::new(x, 0.0, 0.0), heading: 0.0, pan: 0.0, tilt: 0.0 };
            checker.miss(&state, &Point3::new(aim, 0.03, 0.0)).unwrap()
        };
        assert!((miss(0.7, 1.0) - 0.03).abs() < 1e-12);
        assert!((miss(0.5, 0.8) - 0.2_f64.hypot(0.03)).abs() < 1e-12);
        assert!(miss(0.0, 0.45).is_infinite());
    }

    #[test]
    fn rest_is_one_look() {
        let mut checker = ClearanceChecker::new(&Tip, &Ball);
        let state = VehicleState { position: Point3::from(Vector3::x() * 0.12), heading: 0.0, pan: 0.0, tilt: 0.0 };
        let (least, missing) = checker.along(&|_| state, 0.0, 0.03, 1.0, &mut DistanceCache::default());
        assert!((least - 0.02).abs() < 1e-12 && (missing - 0.01).abs() < 1e-12, "{least} {missing}");
    }
}
