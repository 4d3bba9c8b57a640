//! Which of two inertial sensors on one body is believed (ours).

use std::collections::VecDeque;

use nalgebra::UnitQuaternion;

use super::inertial_check::InertialCheck;
use crate::error::Error;
use crate::samples::Imu;
use crate::stamp::Stamp;

/// The gyroscopes are compared by the turns in so long, s.
const WINDOW_S: f64 = 0.1;
/// A sensor that was not believed has to be sound for so long, s, before it is joined again.
const SOUND_S: f64 = 1.0;
/// So much of what the other one errs less is no proof, rad: the map errs too.
const MAP_ERROR: f64 = 3e-3;
/// Share of a gyroscope's squared error that counts after the next pose in the map.
const FORGETTING: f64 = 0.5;

/// Looks for a sensor that fails: by itself, if an axis stands still; beside the other, if their gyroscopes turn by more than biases explain. Which
/// of those two errs is told by the turns between poses in a map. One sensor alone is believed as long as it is sound.
#[derive(Debug, Clone)]
pub(super) struct FaultIsolation {
    sensors: [Sensor; 2],
    body_from_second: UnitQuaternion<f64>,
    /// Gyroscopes that differ by more contradict each other, rad/s.
    difference: f64,
    /// Until when the gyroscopes have been compared, and when they contradicted each other last.
    compared: Option<Stamp>,
    contradicted: Option<Stamp>,
    /// Which one is believed where they contradict each other.
    chosen: usize,
}

#[derive(Debug, Clone, Default)]
struct Sensor {
    check: InertialCheck,
    /// Its samples, for as long as a pose in the map may be late.
    recent: VecDeque<Imu>,
    /// When an axis of it stood still last.
    unsound: Option<Stamp>,
    /// Squared differences of its turns from the map's, rad², the latest counting most.
    error: f64,
}

impl Sensor {
    fn take(&mut self, sample: &Imu, kept_s: f64) {
        if !self.check.moves(sample) {
            self.unsound = Some(sample.stamp);
        }
        self.recent.push_back(*sample);
        while self.recent.get(1).is_some_and(|second| sample.stamp.secs_since(second.stamp) > kept_s) {
            self.recent.pop_front();
        }
    }

    fn last(&self) -> Option<Stamp> {
        self.recent.back().map(|sample| sample.stamp)
    }

    fn is_sound(&self, for_s: f64) -> bool {
        let Some(last) = self.last() else { return false };
        self.unsound.is_none_or(|unsound| last.secs_since(unsound) > for_s)
    }

    /// Rotation of its axes from one time to another; `None` where its samples do not reach, or have a gap.
    fn turn(&self, from: Stamp, to: Stamp) -> Option<UnitQuaternion<f64>> {
        let reach = self.recent.front()?.stamp <= from && self.last()? >= to;
        let mut turn = UnitQuaternion::identity();
        for (before, after) in self.recent.iter().zip(self.recent.iter().skip(1)) {
            let dt = after.stamp.min(to).secs_since(before.stamp.max(from));
            if dt > WINDOW_S {
                return None;
            }
            turn *= UnitQuaternion::from_scaled_axis(0.5 * (before.gyro + after.gyro) * dt.max(0.0));
        }
        reach.then_some(turn)
    }
}

impl FaultIsolation {
    /// Nothing has come yet.
    pub(super) fn new(body_from_second: UnitQuaternion<f64>, difference: f64) -> Self {
        let sensors = Default::default();
        Self { sensors, body_from_second, difference, compared: None, contradicted: None, chosen: 1 }
    }

    /// Takes a sample of a sensor in its own axes, to be kept for so long, s; refuses one that is not finite or not after the one before.
    pub(super) fn take(&mut self, which: usize, sample: &Imu, kept_s: f64) -> Result<(), Error> {
        let sensor = &mut self.sensors[which];
        sample.check_after(sensor.recent.back())?;
        sensor.take(sample, kept_s);
        self.compare();
        Ok(())
    }

    /// Which sensors are believed: one that has failed not before it has been sound for a while, unless there is no other.
    pub(super) fn believed(&self) -> [bool; 2] {
        let quiet = |from: Stamp| self.compared.is_none_or(|now| now.secs_since(from) > SOUND_S);
        let contradict = self.contradicted.is_some_and(|when| !quiet(when));
        [0, 1].map(|which| {
            let [own, other] = [which, 1 - which].map(|k| &self.sensors[k]);
            let silent = own.last().zip(other.last()).is_none_or(|(own, other)| own.secs_since(other) > WINDOW_S);
            let alone = silent || !other.is_sound(0.0);
            own.is_sound(if alone { 0.0 } else { SOUND_S }) && (alone || !contradict || self.chosen == which)
        })
    }

    /// Takes the turn of the body between two poses in the map, in its axes.
    pub(super) fn map_turn(&mut self, [from, to]: [Stamp; 2], turn: &UnitQuaternion<f64>) {
        for which in [0, 1] {
            let Some(by_sensor) = self.turn(which, from, to) else { continue };
            let error = by_sensor.angle_to(turn);
            let sum = &mut self.sensors[which].error;
            *sum = FORGETTING * *sum + error * error;
        }
        let [chosen, other] = [self.chosen, 1 - self.chosen].map(|which| self.sensors[which].error);
        if chosen > 4.0 * other + MAP_ERROR * MAP_ERROR {
            self.chosen = 1 - self.chosen;
        }
    }

    /// In the body's axes.
    fn turn(&self, which: usize, from: Stamp, to: Stamp) -> Option<UnitQuaternion<f64>> {
        let turn = self.sensors[which].turn(from, to)?;
        let axes = if which == 0 { UnitQuaternion::identity() } else { self.body_from_second };
        Some(axes * turn * axes.inverse())
    }

    /// Compares the gyroscopes once both have got a window further.
    fn compare(&mut self) {
        let [Some(first), Some(second)] = [0, 1].map(|which| self.sensors[which].last()) else { return };
        let now = first.min(second);
        let from = *self.compared.get_or_insert(now);
        if now.secs_since(from) < WINDOW_S {
            return;
        }
        self.compared = Some(now);
        let turns = [0, 1].map(|which| self.turn(which, from, now));
        if let [Some(first), Some(second)] = turns
            && first.angle_to(&second) > self.difference * now.secs_since(from)
        {
            self.contradicted = Some(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn at(millis: i64) -> Stamp {
        Stamp::from_nanos(1_000_000 * millis)
    }

    /// A body that turns about x, and rolls back; its two gyroscopes are told apart by a half turn about z, and `which` has x and y swapped.
    fn believed(swapped: Option<usize>, with_map: bool) -> Vec<[bool; 2]> {
        let axes = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::PI);
        let mut isolation = FaultIsolation::new(axes, 0.05);
        let angle = |millis: i64| 0.1 * (3e-3 * millis as f64).sin();
        let rate = |millis: i64| 0.3 * (3e-3 * millis as f64).cos();
        let mut believed = Vec::new();
        for millis in (5..=3000).step_by(5) {
            let hum = 1e-4 * (0.7 * millis as f64).sin();
            for which in [0, 1] {
                let sign = if which == 0 { 1.0 } else { -1.0 };
                let mut gyro = Vector3::new(sign * rate(millis) + hum, hum, hum);
                if swapped == Some(which) && (500..1500).contains(&millis) {
                    gyro.swap_rows(0, 1);
                }
                let accel = Vector3::new(hum, -hum, 9.81 + hum);
                let sample = Imu { stamp: at(millis), gyro, accel };
                isolation.take(which, &sample, 0.5).unwrap();
                // What cannot be leaves no trace.
                let none = Imu { stamp: at(millis + 1), gyro: Vector3::repeat(f64::NAN), accel };
                assert!(isolation.take(which, &none, 0.5).is_err() && isolation.take(which, &sample, 0.5).is_err());
            }
            // Poses in the map are 60 ms late.
            if with_map && millis > 160 && (millis - 60) % 100 == 0 {
                let (from, to) = (millis - 160, millis - 60);
                let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * (angle(to) - angle(from)));
                isolation.map_turn([at(from), at(to)], &turn);
            }
            believed.push(isolation.believed());
        }
        believed
    }

    #[test]
    fn the_gyroscope_that_agrees_with_the_map_is_believed() {
        assert!(believed(None, true).iter().all(|both| *both == [true; 2]));
        for swapped in [0, 1] {
            let believed = believed(Some(swapped), true);
            let at = |millis: usize| believed[millis / 5 - 1];
            let mut only_other = [true; 2];
            only_other[swapped] = false;
            assert_eq!(at(490), [true; 2]);
            // A window, the way to the map, and its latency.
            assert!((800..=1500).step_by(5).all(|millis| at(millis) == only_other), "{swapped}");
            // Alike again for a second and a window.
            assert_eq!((at(2400), at(2700)), (only_other, [true; 2]));
        }
    }

    /// At no time both: that would be neither.
    #[test]
    fn without_a_map_one_of_them_is_believed() {
        for swapped in [0, 1] {
            let believed = believed(Some(swapped), false);
            assert!(believed[800 / 5..2400 / 5].iter().all(|both| *both == [false, true]), "{swapped}");
        }
    }
}
