//! The wind that the rotors make.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use super::AIR_DENSITY;
use super::carried::Air;
use crate::error::{Error, check_positive, check_range};

/// Length of a jet's core, in diameters, over which its middle keeps its speed (Rajaratnam 1976).
const CORE: f64 = 6.3;
/// Speed of a radial wall jet, in those of its nozzle, at a distance of a nozzle's diameter (Beltaos and Rajaratnam 1974).
const WALL_JET: f64 = 1.03;
/// Where it begins, in heights of the nozzle above the wall (ibid.).
const STAGNATION: f64 = 0.2;
/// Fluctuations in a jet, in its speed (Hussein, Capp and George 1994).
const INTENSITY: f64 = 0.25;

/// All rotors of a hovering vehicle as one: a disc whose wake is a round jet straight down.
///
/// Momentum theory (Froude) gives the speed at the disc, `v = sqrt(T / 2 rho A)`; the wake contracts to half of its area and twice the speed.
/// Then it is a turbulent jet (Albertson, Dai, Jensen and Rouse 1950; Rajaratnam 1976): a core keeps its speed and narrows over 6.3 diameters,
/// then the middle slows down as one over the distance; a Gaussian profile around it holds the momentum `T`. On a floor it turns into a radial
/// wall jet, `u = 1.03 u_0 d / r` from a fifth of the height on, within which it rises in proportion to the distance from the middle. On an
/// inclined wall the part of the momentum that meets it turns so, and the rest goes on.
///
/// One disc is a bound from above: wakes of single rotors are mixed sooner. Air that the rotors draw in from the side, and the wash that comes
/// back from a wall ahead, are left out: beside the wake the air is still.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct RotorWash {
    /// Thrust of all rotors, N. Default 41.2: Paper II's vehicle of 4.2 kg in hover.
    pub thrust: f64,
    /// Radius of a rotor, m. Default 0.19 (15 inches across; ours).
    pub radius: f64,
    /// How many there are. Default 6 (ours).
    pub rotors: u32,
}

impl Default for RotorWash {
    fn default() -> Self {
        Self { thrust: 41.2, radius: 0.19, rotors: 6 }
    }
}

impl RotorWash {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// The first value out of range, by its name.
    pub fn check(&self) -> Result<(), Error> {
        check_range("wash.thrust", self.thrust, 0.0, 1e5, "between 0 and 1e5 N")?;
        check_positive("wash.radius", self.radius)?;
        check_range("wash.rotors", f64::from(self.rotors), 1.0, 100.0, "between 1 and 100")
    }

    /// Speed of the air through the discs in hover, m/s.
    pub fn induced_speed(&self) -> f64 {
        let area = f64::from(self.rotors) * PI * self.radius * self.radius;
        (self.thrust / (2.0 * AIR_DENSITY * area)).sqrt()
    }

    /// Speed and diameter of the wake where it has contracted.
    fn nozzle(&self) -> [f64; 2] {
        [2.0 * self.induced_speed(), 2.0 * self.radius * (0.5 * f64::from(self.rotors)).sqrt()]
    }

    /// Speed of the wake, m/s, at a depth below the disc and a distance from its axis, m, in free air; none above.
    pub fn wake(&self, depth: f64, distance: f64) -> f64 {
        let [speed, diameter] = self.nozzle();
        if depth <= 0.0 || speed <= 0.0 {
            return 0.0;
        }
        let (radius, core) = (0.5 * diameter, CORE * diameter);
        let middle = speed * (core / depth).min(1.0);
        // Of the core, whose air has not mixed yet, and of the Gaussian around it: both hold the momentum,
        // u_0² (r² + sqrt(pi) r s + s²) = u_0² R² before the core ends, u² s² = u_0² R² after.
        let unmixed = radius * (1.0 - depth / core).max(0.0);
        let half = 0.5 * PI.sqrt() * unmixed;
        let deviation = (half * half + (radius * speed / middle).powi(2) - unmixed * unmixed).sqrt() - half;
        // At the disc there is no mixing yet.
        let deviation = deviation.max(f64::MIN_POSITIVE);
        middle * (-0.5 * ((distance - unmixed).max(0.0) / deviation).powi(2)).exp()
    }

    /// Speed of the air along a floor, m/s, at a distance from the point below the disc, which is `height` metres above.
    pub fn floor_jet(&self, height: f64, distance: f64) -> f64 {
        let [speed, diameter] = self.nozzle();
        let begins = (WALL_JET * diameter).max(STAGNATION * height);
        let outside = distance.max(begins);
        WALL_JET * speed * diameter * distance / (outside * outside)
    }

    /// The air at a point of a wall with the unit normal `normal`, below a disc whose middle is `disc`.
    pub fn at(&self, disc: &Point3<f64>, point: &Point3<f64>, normal: &Vector3<f64>) -> Air {
        let from_disc = point - disc;
        let wake = self.wake(-from_disc.z, from_disc.x.hypot(from_disc.y));
        let mut velocity = -Vector3::z() * wake;
        velocity -= normal * velocity.dot(normal);
        // Where the axis of the wake meets the plane of the wall.
        let height = from_disc.dot(normal) / -normal.z;
        if normal.z > 0.0 && height > 0.0 {
            let outwards = from_disc + Vector3::z() * height;
            let distance = outwards.norm();
            if distance > 0.0 {
                velocity += outwards * (normal.z.sqrt() * self.floor_jet(height, distance) / distance);
            }
        }
        Air { velocity, turbulence: INTENSITY * velocity.norm() }
    }
}
