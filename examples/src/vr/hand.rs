//! A hand that follows a way over the surface: the experiments of the VR paper, Section VI, without a person.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use paint_planner::teleop::{CradlePose, PaintHit, RATE, VERSION, VrMode, VrState};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::event::Event;
use super::world::VrWorld;

/// Rows of the area fill: 5 of 1.35 m, joined by 4 of 0.25 m, are the 7.75 m of the paper.
const ROWS: (usize, f64, f64) = (5, 1.35, 0.25);
/// Half width and half height of the contour, m.
const CONTOUR: [f64; 2] = [0.9, 0.45];
/// Distance of the gun, m.
const GUN: f64 = 0.1;
/// Distance of the person, m.
const ARM: f64 = 0.9;
/// Flow, m^3/s.
const FLOW: f64 = 2e-7;
/// The hand taps the beginning and waits until the robot is there; then it paints. Both in s.
const TAP: f64 = 0.1;
const PAUSE: f64 = 10.0;
/// Waves of a hand beside its way: size, m, and rate, Hz.
const WOBBLE: [(f64, f64); 3] = [(0.004, 0.3), (0.002, 0.8), (0.001, 1.7)];

/// What a hand paints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Rows of 7.75 m in all.
    AreaFill,
    /// A closed contour with a trembling hand.
    Contour,
}

/// The states of a hand that paints `what` at `speed` metres per second.
pub(super) fn hand(world: &VrWorld, what: Way, speed: f64, seed: u64) -> Vec<Event> {
    let way = way(what);
    let length: f64 = way.windows(2).map(|pair| step(pair[0], pair[1])).sum();
    let painting = (length / speed * RATE).ceil() as u64;
    let (tap, pause) = ((TAP * RATE) as u64, (PAUSE * RATE) as u64);
    let mut random = SplitMix64::seed_from_u64(seed);
    let mut phase = || TAU * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let phases: [[f64; 2]; 3] = std::array::from_fn(|_| [phase(), phase()]);
    let state = |tick: u64| {
        let painted = tick.saturating_sub(pause) as f64 / RATE * speed;
        let pressed = (1..=tap).contains(&tick) || (pause..pause + painting).contains(&tick);
        let mode = if pressed { VrMode::Painting } else { VrMode::Idle };
        let [right, up] = along(&way, painted.min(length));
        let [aside, over] = match what {
            Way::Contour => wobble(&phases, tick as f64 / RATE),
            Way::AreaFill => [0.0; 2],
        };
        state(world, tick, mode, [right + aside, up + over])
    };
    (0..painting + pause + 2 * tap).map(|tick| Event::State(state(tick))).collect()
}

/// The way in a picture before the middle of the surface: metres to the right and up.
pub(super) fn way(what: Way) -> Vec<[f64; 2]> {
    match what {
        Way::AreaFill => {
            let (rows, width, height) = ROWS;
            let row = |k: usize| {
                let up = height * ((rows - 1) as f64 / 2.0 - k as f64);
                let side = if k.is_multiple_of(2) { -0.5 * width } else { 0.5 * width };
                [[side, up], [-side, up]]
            };
            (0..rows).flat_map(row).collect()
        }
        Way::Contour => {
            let [wide, high] = CONTOUR;
            let at = |k: u32| {
                let turn = TAU * f64::from(k) / 400.0;
                let wave = 1.0 + 0.12 * (3.0 * turn).sin();
                [wide * wave * turn.cos(), high * wave * turn.sin()]
            };
            (0..=400).map(at).collect()
        }
    }
}

/// The surface under a place of that picture.
pub(super) fn place(world: &VrWorld, [right, up]: [f64; 2]) -> Option<PaintHit> {
    let ahead = UnitVector3::new_unchecked(Vector3::new(world.home.heading.cos(), world.home.heading.sin(), 0.0));
    let aside = ahead.cross(&Vector3::z());
    world.hit_along(&(world.stand + aside * right + Vector3::z() * up), &ahead)
}

fn state(world: &VrWorld, tick: u64, mode: VrMode, at: [f64; 2]) -> VrState {
    let heading = world.home.heading;
    let level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    // The person stands an arm's length before what is painted.
    let (nozzle, stand) = match place(world, at) {
        Some(hit) => (facing(&hit), hit.point + hit.normal.into_inner() * ARM),
        None => (Isometry3::from_parts(Translation3::from(world.stand), level), world.stand),
    };
    VrState {
        version: VERSION,
        sequence: tick,
        time: tick as f64 / RATE,
        mode,
        nozzle,
        cradle: CradlePose { position: stand, heading },
        hit: None,
        colour: 0,
        flow: FLOW,
    }
}

/// A gun on the normal of the place.
fn facing(hit: &PaintHit) -> Isometry3<f64> {
    let forward = -hit.normal.into_inner();
    let side = Vector3::z().cross(&forward).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    let rotation = Rotation3::from_basis_unchecked(&[forward, side, forward.cross(&side)]);
    let tip: Point3<f64> = hit.point - forward * GUN;
    Isometry3::from_parts(Translation3::from(tip), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn along(way: &[[f64; 2]], mut painted: f64) -> [f64; 2] {
    for pair in way.windows(2) {
        let length = step(pair[0], pair[1]);
        if painted <= length {
            let share = if length > 0.0 { painted / length } else { 0.0 };
            return [0, 1].map(|k| pair[0][k] + share * (pair[1][k] - pair[0][k]));
        }
        painted -= length;
    }
    way[way.len() - 1]
}

fn step(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// How far a hand is beside its way at a time (s), metres: slow waves whose phases the seed gives.
fn wobble(phases: &[[f64; 2]; 3], time: f64) -> [f64; 2] {
    let wave = |axis: usize| {
        WOBBLE.iter().zip(phases).map(|((size, rate), phase)| size * (TAU * rate * time + phase[axis]).sin()).sum()
    };
    [wave(0), wave(1)]
}
