//! The camera's way through a room: smooth, of a given length and turning speed.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::Rng;

/// Sines of each coordinate, with frequencies that have no common period.
const SINES: usize = 3;
/// Steps per second by which lengths are measured.
const FINE: f64 = 200.0;
/// Halvings of what the frequencies are found by.
const HALVINGS: usize = 40;
/// Bounds of the frequencies' scale, 1/s.
const FREQUENCIES: [f64; 2] = [1e-4, 2.0];

/// A sum of sines that stays within -1 and 1.
#[derive(Debug, Clone)]
struct Wave([[f64; 3]; SINES]);

impl Wave {
    fn new(rng: &mut Rng) -> Self {
        let sine = |k: usize, rng: &mut Rng| {
            [0.62 * 0.42_f64.powi(k as i32), rng.between(0.8, 1.2) * 1.7_f64.powi(k as i32), rng.unit()]
        };
        Self(std::array::from_fn(|k| sine(k, rng)))
    }

    fn at(&self, turns: f64) -> f64 {
        self.0.iter().map(|[size, rate, phase]| size * (TAU * (rate * turns + phase)).sin()).sum()
    }
}

/// Where the camera is allowed, and how it looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    /// Middle and half extent of its positions, m.
    pub(super) middle: [f64; 3],
    pub(super) half: [f64; 3],
    /// Half extent of its heading and of its pitch, rad.
    pub(super) turns: [f64; 2],
    /// It looks at this point, and turns about that; otherwise along y.
    pub(super) at: Option<[f64; 3]>,
}

/// A way through a room.
#[derive(Debug, Clone)]
pub(super) struct Flight {
    range: Range,
    place: [Wave; 3],
    look: [Wave; 2],
    /// Scales of the frequencies of place and look, 1/s.
    scales: [f64; 2],
}

impl Flight {
    /// Of so many seconds, so long, m, and with so much turning in the mean, rad/s.
    pub(super) fn new(range: Range, seconds: f64, length: f64, turning: f64, seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let place = std::array::from_fn(|_| Wave::new(&mut rng));
        let look = std::array::from_fn(|_| Wave::new(&mut rng));
        let mut flight = Self { range, place, look, scales: [0.0; 2] };
        // Both grow with the frequencies but for details; the turning also with those of the place.
        for k in 0..2 {
            let wanted = [length, turning * seconds][k];
            let (mut low, mut high) = (FREQUENCIES[0], FREQUENCIES[1]);
            for _ in 0..HALVINGS {
                flight.scales[k] = f64::midpoint(low, high);
                if flight.covered(seconds)[k] < wanted { low = flight.scales[k] } else { high = flight.scales[k] }
            }
        }
        flight
    }

    /// Metres and radians on the way.
    pub(super) fn covered(&self, seconds: f64) -> [f64; 2] {
        let mut last = self.at(0.0);
        let mut sums = [0.0; 2];
        for k in 1..=(seconds * FINE) as usize {
            let next = self.at(k as f64 / FINE);
            sums[0] += (next.translation.vector - last.translation.vector).norm();
            sums[1] += last.rotation.angle_to(&next.rotation);
            last = next;
        }
        sums
    }

    /// World from camera, z ahead and y down, at a time.
    pub(super) fn at(&self, time: f64) -> Isometry3<f64> {
        let Range { middle, half, turns, at } = &self.range;
        let place = Vector3::from_fn(|k, _| middle[k] + half[k] * self.place[k].at(self.scales[0] * time));
        let [heading, pitch] = std::array::from_fn(|k| turns[k] * self.look[k].at(self.scales[1] * time));
        let towards = at.map_or(Vector3::y(), |at| Vector3::from(at) - place);
        let heading = heading + towards.y.atan2(towards.x);
        let pitch = pitch + towards.z.atan2(towards.x.hypot(towards.y));
        let forward = Vector3::new(heading.cos() * pitch.cos(), heading.sin() * pitch.cos(), pitch.sin());
        let right = forward.cross(&Vector3::z()).normalize();
        let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Isometry3::from_parts(Translation3::from(place), rotation)
    }

    /// What a gyroscope in the camera says at a time, rad/s.
    pub(super) fn rate(&self, time: f64) -> Vector3<f64> {
        const STEP: f64 = 1e-3;
        let [before, after] = [-STEP, STEP].map(|step| self.at(time + step / 2.0).rotation);
        (before.inverse() * after).scaled_axis() / STEP
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_is_as_long_as_asked_and_its_rates_turn_it() {
        let range = Range { middle: [0.0, 0.0, 1.4], half: [1.5, 1.0, 0.3], turns: [2.5, 0.3], at: None };
        let flight = Flight::new(range, 30.0, 16.7, 0.62, 5);
        let [length, turned] = flight.covered(30.0);
        assert!((length / 16.7 - 1.0).abs() < 0.01 && (turned / 30.0 / 0.62 - 1.0).abs() < 0.02, "{length} {turned}");
        let mut rotation = flight.at(0.0).rotation;
        for k in 0..3000 {
            rotation *= UnitQuaternion::from_scaled_axis(flight.rate((f64::from(k) + 0.5) / 1e3) / 1e3);
        }
        assert!(rotation.angle_to(&flight.at(3.0).rotation) < 1e-4);
    }
}
