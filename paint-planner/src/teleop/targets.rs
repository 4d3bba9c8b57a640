//! From a painted segment to targets (ours: the paper prints no conversion).

use nalgebra::{Point3, UnitVector3, Vector3};

use super::settings::TargetSettings;
use super::state::{PaintHit, RATE};
use super::task::Segment;
use crate::target::Target;
use crate::world::Surface;

/// Height above a hit from which its neighbourhood is looked at, m.
const LOOK: f64 = 0.05;
/// Directions in which the normal is sampled.
const RING: usize = 6;
/// Length of a dab, m: a planner needs a way.
const DAB: f64 = 0.005;

/// Where a hand has been, and what it has sprayed until there.
struct Place {
    hit: PaintHit,
    time: f64,
    /// Way along the hits, m, and paint given on it, m^3.
    way: f64,
    volume: f64,
}

/// Targets along the hits of a painted segment, evenly spaced, with the time stamps of the hand. The dose of each is what the hand
/// sprayed on the way to the next one, per metre: volume and gradients of the session are kept, pauses included. Normals are the mean
/// over a footprint, since a robot must not follow every facet.
///
/// Empty for a segment without hits; a dab that has no length becomes two targets 5 mm apart.
pub fn targets(segment: &Segment, surface: &dyn Surface, settings: &TargetSettings) -> Vec<Target> {
    let mut places = places(segment, settings.merge);
    if let [dab] = &places[..] {
        let [side, _] = tangents(&dab.hit.normal);
        let at = |offset: f64| PaintHit { point: dab.hit.point + side * offset, normal: dab.hit.normal };
        let (time, volume) = (dab.time, dab.volume);
        places = vec![
            Place { hit: at(-0.5 * DAB), time, way: 0.0, volume: 0.0 },
            Place { hit: at(0.5 * DAB), time: time + 1.0 / RATE, way: DAB, volume },
        ];
    }
    let Some(last) = places.last() else { return Vec::new() };
    let steps = (last.way / settings.spacing).round().max(1.0) as usize;
    let spacing = last.way / steps as f64;
    let samples: Vec<Place> = (0..=steps).map(|k| sample(&places, spacing * k as f64)).collect();
    let dose = |k: usize| samples.get(k + 1).map_or(0.0, |next| (next.volume - samples[k].volume) / spacing);
    let target = |(k, place): (usize, &Place)| Target {
        point: place.hit.point,
        normal: footprint_normal(&place.hit, surface, settings.footprint),
        dose: dose(k).max(0.0),
        time: Some(place.time),
        stand_off: None,
    };
    samples.iter().enumerate().map(target).collect()
}

/// The hits that are apart, each with the paint of the time since the one before: that of a pause goes onto the way that follows it,
/// of the last one onto the way before.
fn places(segment: &Segment, merge: f64) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    let mut volume = 0.0;
    let mut before: Option<f64> = None;
    for state in &segment.states {
        let Some(hit) = state.hit else { continue };
        volume += before.map_or(0.0, |time| state.flow * (state.time - time).max(0.0));
        before = Some(state.time);
        let way = places.last().map_or(0.0, |last| (hit.point - last.hit.point).norm());
        if places.is_empty() || way >= merge {
            let way = places.last().map_or(0.0, |last| last.way) + way;
            places.push(Place { hit, time: state.time, way, volume });
        }
    }
    // A single state sprays for one tick.
    if let (1, Some(only)) = (segment.states.len(), segment.states.first()) {
        volume = only.flow / RATE;
    }
    if let Some(last) = places.last_mut() {
        last.volume = volume;
    }
    places
}

/// The place at a way, between the hits before and after.
fn sample(places: &[Place], way: f64) -> Place {
    let after = places.partition_point(|place| place.way < way).clamp(1, places.len() - 1);
    let (a, b) = (&places[after - 1], &places[after]);
    let share = ((way - a.way) / (b.way - a.way)).clamp(0.0, 1.0);
    let mix = |x: f64, y: f64| x + share * (y - x);
    let normal = UnitVector3::try_new(a.hit.normal.lerp(&b.hit.normal, share), 1e-9).unwrap_or(a.hit.normal);
    let point: Point3<f64> = a.hit.point + share * (b.hit.point - a.hit.point);
    Place { hit: PaintHit { point, normal }, time: mix(a.time, b.time), way, volume: mix(a.volume, b.volume) }
}

/// Mean of the normals under a small disk about the hit; faces that look away are left out.
fn footprint_normal(hit: &PaintHit, surface: &dyn Surface, radius: f64) -> UnitVector3<f64> {
    let [u, v] = tangents(&hit.normal);
    let down = -hit.normal;
    let mut sum = hit.normal.into_inner();
    for k in 0..RING {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / RING as f64).sin_cos();
        let origin = hit.point + hit.normal.into_inner() * LOOK + (u * cos + v * sin) * radius;
        if let Some(near) = surface.cast(&origin, &down, 2.0 * LOOK).filter(|near| near.normal.dot(&hit.normal) > 0.0) {
            sum += near.normal.into_inner();
        }
    }
    UnitVector3::try_new(sum, 1e-9).unwrap_or(hit.normal)
}

/// Two unit vectors perpendicular to the normal and to each other.
fn tangents(normal: &UnitVector3<f64>) -> [Vector3<f64>; 2] {
    let axis = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let side = axis.cross(normal).normalize();
    [side, normal.cross(&side)]
}
