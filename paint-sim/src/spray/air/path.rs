//! The way of one droplet to the wall.

use super::droplets::{DropletSettings, drag_factor, relaxation_time};
use super::jet::Jet;
use super::{AIR_DENSITY, AIR_VISCOSITY};

/// Parts of the way, at least.
const PARTS: f64 = 64.0;
/// Longest step where the air turns, in radii of the jet.
const LONGEST: f64 = 0.1;
/// A droplet that has been in the turning air for longer than this, in radii over its speed, has gone along the wall with it.
const LONGEST_TURN: f64 = 10.0;
/// Steps after which a droplet counts as one that does not arrive.
const MOST_STEPS: usize = 4096;
/// Halvings of the last step.
const HALVINGS: usize = 32;

/// Where and when a droplet meets the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landing {
    /// How far it has drifted across the axis, m.
    pub offset: f64,
    /// Time of flight, s.
    pub time: f64,
    /// Speed towards the wall, m/s.
    pub speed: f64,
}

impl DropletSettings {
    /// Where a droplet of a diameter (m) lands that leaves on the axis, in air of the velocity `[along, across]` the axis (m/s); `None` of one
    /// that does not land.
    ///
    /// It does not where the air takes it along the wall: with the stagnation flow's rate `a = u / b` (speed and radius of the jet) and
    /// `S = tau a`, a droplet at the distance `y` with the speed `w` towards the wall arrives unless
    ///
    /// ```text
    /// S <= 1/4  and  w tau <= y (1 + sqrt(1 - 4 S)) / 2
    /// ```
    ///
    /// (`tau y'' + y' + a y = 0`, whose limit of 1/4 is Taylor's of 1940; impactors with round jets are measured to have 0.24: Marple and Liu
    /// 1974). As drag never falls below Stokes', one that meets this on its way never lands; nor does one that takes ten times `1 / a`: the air
    /// has swept it out of the jet.
    pub fn path(&self, diameter: f64, jet: &Jet, [along, across]: [f64; 2]) -> Option<Landing> {
        let droplet = Droplet {
            time: relaxation_time(diameter, self.density),
            reynolds: AIR_DENSITY * diameter / AIR_VISCOSITY,
            jet,
            along,
            across,
        };
        droplet.fly([self.speed, 0.0])
    }
}

struct Droplet<'a> {
    /// Stokes' relaxation time.
    time: f64,
    /// Reynolds number per speed.
    reynolds: f64,
    jet: &'a Jet,
    along: f64,
    across: f64,
}

impl Droplet<'_> {
    fn fly(&self, velocity: [f64; 2]) -> Option<Landing> {
        let wall = self.jet.stand_off;
        let mut state = State { place: [0.0; 2], velocity, time: 0.0 };
        let mut turned = 0.0;
        for _ in 0..MOST_STEPS {
            if turned > LONGEST_TURN || !self.arrives(&state) {
                return None;
            }
            let speed = state.velocity[0].max(self.free_speed(state.place[0]));
            let before_turning = (wall - state.place[0] - self.jet.radius).max(0.0);
            let step = (wall / PARTS).min(before_turning + LONGEST * self.jet.radius) / speed;
            // The air and the drag of the middle of the step.
            let middle = state.after(0.5 * step, self.air(state.place[0]), self.relaxation(&state));
            let (air, relaxation) = (self.air(middle.place[0]), self.relaxation(&middle));
            if before_turning <= 0.0 {
                turned += step * self.free_speed(state.place[0]) / self.jet.radius;
            }
            let next = state.after(step, air, relaxation);
            if next.place[0] < wall {
                state = next;
                continue;
            }
            let (mut before, mut beyond) = (0.0, step);
            for _ in 0..HALVINGS {
                let half = 0.5 * (before + beyond);
                let short = state.after(half, air, relaxation).place[0] < wall;
                *(if short { &mut before } else { &mut beyond }) = half;
            }
            let landed = state.after(beyond, air, relaxation);
            return Some(Landing { offset: landed.place[1], time: landed.time, speed: landed.velocity[0] });
        }
        None
    }

    /// Speed of the air towards the wall, as if there were none.
    fn free_speed(&self, depth: f64) -> f64 {
        self.jet.speed(depth) + self.jet.drawn_in(depth) * self.along
    }

    fn air(&self, depth: f64) -> [f64; 2] {
        [self.free_speed(depth) * self.jet.left(depth), self.jet.drawn_in(depth) * self.across]
    }

    fn relaxation(&self, state: &State) -> f64 {
        let [u, v] = self.air(state.place[0]);
        let slip = (u - state.velocity[0]).hypot(v - state.velocity[1]);
        self.time / drag_factor(self.reynolds * slip)
    }

    /// False where it certainly does not.
    fn arrives(&self, state: &State) -> bool {
        let (distance, way) = (self.jet.stand_off - state.place[0], state.velocity[0] * self.time);
        let free = self.free_speed(state.place[0]);
        if way <= 0.0 {
            return false;
        }
        if free > 0.0 && distance > self.jet.radius {
            return true;
        }
        let stokes = self.time * free.max(0.0) / self.jet.radius;
        stokes > 0.25 || way > 0.5 * distance * (1.0 + (1.0 - 4.0 * stokes).sqrt())
    }
}

#[derive(Debug, Clone, Copy)]
struct State {
    /// Along and across the axis, m.
    place: [f64; 2],
    velocity: [f64; 2],
    time: f64,
}

impl State {
    /// After a time in which air and drag stay as they are: exact in Stokes' regime.
    fn after(&self, step: f64, air: [f64; 2], relaxation: f64) -> Self {
        let gone = -(-step / relaxation).exp_m1();
        let slip = [0, 1].map(|k| self.velocity[k] - air[k]);
        Self {
            place: [0, 1].map(|k| self.place[k] + air[k] * step + slip[k] * relaxation * gone),
            velocity: [0, 1].map(|k| self.velocity[k] - slip[k] * gone),
            time: self.time + step,
        }
    }
}
