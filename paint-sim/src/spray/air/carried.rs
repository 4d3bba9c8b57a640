//! Shots whose sprays the air has bent.

use std::array::from_fn;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use nalgebra::{Point3, Vector3};

use super::drift::{Drift, Spot, drift};
use super::droplets::DropletSettings;
use crate::error::{Error, check_not_negative};
use crate::spray::ellipse::left_of;
use crate::spray::{QUANTUM, Shot, SprayModel};
use crate::surface::{Hit, Surface};

/// Stand-offs and speeds this near to one another have one drift, m and m/s: drifts are proportional to neither, but nearly.
const STEPS: [f64; 4] = [1e-3, 0.02, 0.02, 0.02];

/// The air before the wall, where a shot meets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Mean velocity in the world, m/s. What of it goes into the wall is left out: there the air has turned.
    pub velocity: Vector3<f64>,
    /// Standard deviation of its fluctuations per axis, m/s.
    pub turbulence: f64,
}

impl Air {
    /// Air at rest.
    pub fn still() -> Self {
        Self { velocity: Vector3::zeros(), turbulence: 0.0 }
    }
}

/// Where a shot meets the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPoint {
    /// Number of the shot.
    pub shot: usize,
    /// The point in the world, m.
    pub point: Point3<f64>,
    /// Unit normal of the wall, towards the nozzle.
    pub normal: Vector3<f64>,
}

/// The shots with sprays as `air` bends them, for [`Film::deposit_each`](crate::Film::deposit_each): one for each shot, or two where fine
/// droplets land so far downwind that they are a wide, weak spot of their own. Their volumes add up to the shot's, in whole femtolitres; what
/// is lost on the way is taken from the efficiency. `air` is asked for the air where a shot meets the wall. A shot that meets none within the
/// spray's range, or still air, is handed on as it is, to the last bit.
///
/// # Errors
/// Settings out of range; shots or air that are not finite.
pub fn drifted(
    shots: &[Shot],
    spray: &SprayModel,
    droplets: &DropletSettings,
    surface: &dyn Surface,
    air: &mut dyn FnMut(&WallPoint) -> Air,
) -> Result<Vec<(Shot, SprayModel)>, Error> {
    spray.check()?;
    droplets.check()?;
    let mut known = BTreeMap::new();
    let mut sprays = Vec::with_capacity(shots.len());
    for (number, shot) in shots.iter().enumerate() {
        if !shot.origin.iter().chain(shot.axis.iter()).all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "shot", index: number });
        }
        check_not_negative("shot volume", shot.volume)?;
        let hit = surface.cast(&shot.origin, &shot.axis, spray.range).filter(|hit| hit.distance > 0.0);
        let seen = hit.map(|hit| Seen::new(shot, number, &hit, air)).transpose()?;
        let Some(seen) = seen.filter(Seen::moves) else {
            sprays.push((*shot, *spray));
            continue;
        };
        let drift = match known.entry(seen.key) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => *entry.insert(seen.drift(spray, droplets)?),
        };
        sprays.extend(divided(shot, spray, &drift, seen.stand_off, seen.towards));
    }
    Ok(sprays)
}

/// A wall and its air as a nozzle sees them.
struct Seen {
    stand_off: f64,
    /// Where the air goes across the axis, from the nozzle's left towards up, rad.
    towards: f64,
    /// Stand-off, speeds along and across the axis and of the fluctuations, in [`STEPS`].
    key: [i64; 4],
}

impl Seen {
    fn new(shot: &Shot, number: usize, hit: &Hit, air: &mut dyn FnMut(&WallPoint) -> Air) -> Result<Self, Error> {
        let normal = hit.normal * -hit.normal.dot(&shot.axis).signum();
        let point = shot.origin + shot.axis.as_ref() * hit.distance;
        let Air { velocity, turbulence } = air(&WallPoint { shot: number, point, normal });
        if !(velocity.iter().all(|v| v.is_finite()) && turbulence.is_finite()) {
            return Err(Error::NotFinite { what: "air at shot", index: number });
        }
        let velocity = velocity - normal * velocity.dot(&normal);
        let left = left_of(&shot.axis);
        let across = [left, shot.axis.cross(&left)].map(|side| velocity.dot(&side));
        let parts = [hit.distance, velocity.dot(&shot.axis), across[0].hypot(across[1]), turbulence];
        let key = from_fn(|k| (parts[k] / STEPS[k]).round() as i64);
        Ok(Self { stand_off: hit.distance, towards: across[1].atan2(across[0]), key })
    }

    fn moves(&self) -> bool {
        self.key[1..] != [0; 3]
    }

    fn drift(&self, spray: &SprayModel, droplets: &DropletSettings) -> Result<Drift, Error> {
        let [stand_off, along, across, turbulence] = from_fn(|k| self.key[k] as f64 * STEPS[k]);
        drift(droplets, spray, stand_off.max(STEPS[0]), [along, across], turbulence)
    }
}

/// The spots of a shot: its volume as whole quanta, split by their shares.
fn divided<'a>(
    shot: &'a Shot,
    spray: &'a SprayModel,
    drift: &'a Drift,
    stand_off: f64,
    towards: f64,
) -> impl Iterator<Item = (Shot, SprayModel)> + 'a {
    let quanta = (shot.volume / QUANTUM).round();
    let fine = drift.fog.map_or(0.0, |fog| (fog.share * quanta).round());
    let spot = move |spot: Spot, volume: f64| {
        let bent = spot.bend(spray, stand_off, towards);
        (Shot { volume, ..*shot }, SprayModel { efficiency: spray.efficiency * drift.kept(), ..bent })
    };
    let volume = if fine > 0.0 { (quanta - fine) * QUANTUM } else { shot.volume };
    std::iter::once(spot(drift.main, volume)).chain(drift.fog.map(|fog| spot(fog, fine * QUANTUM)))
}
