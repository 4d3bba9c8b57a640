//! Swaying while the robot looks for its place: what it sees from a few poses tells more than what it sees from one.

use nalgebra::{UnitQuaternion, Vector3};
use paint_planner::onboard::minimum_jerk;
use paint_sim::flight::Vehicle;

/// It stands for so long at first, and at every place of its sway, and moves from one to the next, milliseconds.
pub(super) const FIRST_MS: i64 = 1000;
const REST_MS: i64 = 200;
const LEG_MS: i64 = 600;
/// Places beside the first: to the left and up, m, with a heading, rad. The last is the first.
const PLACES: [[f64; 3]; 6] =
    [[0.12, 0.0, -0.05], [0.06, 0.1, 0.0], [-0.08, 0.08, 0.06], [-0.12, -0.04, 0.05], [0.02, -0.08, 0.0], [0.0; 3]];

/// Milliseconds until it is back.
pub(super) const SWAY_MS: i64 = FIRST_MS + PLACES.len() as i64 * (LEG_MS + REST_MS);

/// Whether it has not swayed yet, or is back.
pub(super) fn in_its_place(ms: i64) -> bool {
    !(FIRST_MS..SWAY_MS - REST_MS).contains(&ms)
}

/// The vehicle at a time after it began to look, as it sways about where it stood, and whether it stands there.
pub(super) fn sway(stood: &Vehicle, ms: i64) -> (Vehicle, bool) {
    let place = |leg: i64| usize::try_from(leg).ok().and_then(|leg| PLACES.get(leg)).copied();
    let since = ms - FIRST_MS;
    let (leg, into) = (since.div_euclid(LEG_MS + REST_MS), since.rem_euclid(LEG_MS + REST_MS));
    let (from, to) = (place(leg - 1).unwrap_or_default(), place(leg).unwrap_or_default());
    let [share, rate, _] = if since < 0 { [0.0; 3] } else { minimum_jerk(into as f64 / LEG_MS as f64) };
    let off = [0, 1, 2].map(|k| from[k] + (to[k] - from[k]) * share);
    let speed = [0, 1, 2].map(|k| (to[k] - from[k]) * rate / (1e-3 * LEG_MS as f64));
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stood.attitude[2]);
    let [roll, pitch, yaw] = stood.attitude;
    let moved = Vehicle {
        position: stood.position + heading * Vector3::new(0.0, off[0], off[1]),
        velocity: heading * Vector3::new(0.0, speed[0], speed[1]),
        attitude: [roll, pitch, yaw + off[2]],
        yaw_rate: speed[2],
        ..*stood
    };
    (moved, speed.iter().all(|speed| *speed == 0.0))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn it_sways_smoothly_from_where_it_stood_and_back() {
        let stood = Vehicle { attitude: [0.02, -0.03, 0.7], ..Vehicle::at_rest(Point3::new(1.0, 2.0, 3.0), 0.7) };
        assert_eq!([0, 500, FIRST_MS, SWAY_MS, SWAY_MS + 500].map(|ms| sway(&stood, ms)), [(stood, true); 5]);
        let (mut farthest, mut rests) = (0.0_f64, 0);
        for ms in 1..SWAY_MS {
            let [(before, _), (now, stands), (after, _)] = [-1, 0, 1].map(|step| sway(&stood, ms + step));
            assert!(((after.position - before.position) / 2e-3 - now.velocity).norm() < 5e-3, "{ms}");
            assert!(((after.attitude[2] - before.attitude[2]) / 2e-3 - now.yaw_rate).abs() < 5e-3, "{ms}");
            assert!(!stands || now.velocity.norm() < 1e-9, "{ms}");
            farthest = farthest.max((now.position - stood.position).norm());
            rests += i64::from(stands);
        }
        assert!((0.1..0.2).contains(&farthest), "{farthest}");
        // And a millisecond before each leg after the first.
        assert_eq!(rests, FIRST_MS + 6 * REST_MS + 5);
    }
}
