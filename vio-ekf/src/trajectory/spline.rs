//! Smooth motions: uniform cumulative cubic B-splines (Sommer et al. 2020).

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::error::Error;
use crate::lie::so3;
use crate::stamp::InvalidStamp;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;
use crate::trajectory::check_poses;

/// Six days at 50 ms: more is a mistaken unit, and would exhaust the memory.
const MAX_SAMPLED_KNOTS: f64 = 1e7;

/// What is left between poses and curve shrinks to two thirds or less each time: to a millionth.
const THROUGH_ITERATIONS: usize = 35;

/// A smooth motion with exact derivatives: a uniform cumulative cubic B-spline on `SO(3) × R³`.
///
/// With `B_i(u)` the cumulative basis on a segment, `u ∈ [0, 1]`, and `d_i = Log(R_{i−1}ᵀ R_i)`,
/// `R(u) = R_0 Exp(B_1 d_1) Exp(B_2 d_2) Exp(B_3 d_3)`, the position likewise with differences. Acceleration and angular
/// acceleration are continuous. The curve does not pass through its knots: where it serves as truth, it is the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Spline {
    first_knot: Stamp,
    interval_ns: i64,
    knots: Vec<Isometry3<f64>>,
}

/// Motion of the body at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// Pose.
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body's origin in world axes, m/s.
    pub velocity_in_world: Vector3<f64>,
    /// Acceleration of the body's origin in world axes, m/s², without gravity.
    pub acceleration_in_world: Vector3<f64>,
    /// Angular rate in body axes, rad/s: what an ideal gyroscope reads.
    pub rate_in_body: Vector3<f64>,
    /// Time derivative of the angular rate in body axes, rad/s².
    pub angular_acceleration_in_body: Vector3<f64>,
}

impl Motion {
    /// What an ideal accelerometer at the body's origin reads, m/s²: `Rᵀ(a + g e_z)`, with `gravity` = g > 0 and z up.
    pub fn specific_force(&self, gravity: f64) -> Vector3<f64> {
        self.world_from_body.rotation.inverse() * (self.acceleration_in_world + Vector3::z() * gravity)
    }
}

impl Spline {
    /// From at least four knots `world_from_body`, `interval_ns` nanoseconds apart.
    pub fn new(first_knot: Stamp, interval_ns: i64, knots: Vec<Isometry3<f64>>) -> Result<Self, Error> {
        if interval_ns <= 0 {
            let rule = "must be positive";
            return Err(Error::InvalidSetting { name: "interval_ns", value: interval_ns as f64, rule });
        }
        if knots.len() < 4 {
            return Err(Error::TooFew { what: "knots of a cubic spline", got: knots.len(), need: 4 });
        }
        check_poses("knot", &knots)?;
        // Neither the duration nor the last knot's time may overflow: `sample` then needs no checks.
        let duration = knots.len() as i128 * i128::from(interval_ns);
        let last = i128::from(first_knot.nanos()) + duration;
        if last.max(duration) > i128::from(i64::MAX) {
            return Err(InvalidStamp { text: (last.max(duration) as f64 / 1e9).to_string() }.into());
        }
        Ok(Self { first_knot, interval_ns, knots })
    }

    /// With knots sampled from a trajectory every `interval_ns` nanoseconds, starting at its first pose. Smooths what is
    /// faster than the interval; 50 ms suits hand-held and flying recordings.
    pub fn from_trajectory(trajectory: &Trajectory, interval_ns: i64) -> Result<Self, Error> {
        if interval_ns <= 0 {
            let rule = "must be positive";
            return Err(Error::InvalidSetting { name: "interval_ns", value: interval_ns as f64, rule });
        }
        let (first, last) = trajectory.span().ok_or(Error::TooFew { what: "poses of a spline", got: 0, need: 1 })?;
        if last.secs_since(first) * 1e9 / interval_ns as f64 > MAX_SAMPLED_KNOTS {
            let rule = "must leave at most ten million knots";
            return Err(Error::InvalidSetting { name: "interval_ns", value: interval_ns as f64, rule });
        }
        let stamps = std::iter::successors(Some(first.nanos()), |nanos| nanos.checked_add(interval_ns))
            .take_while(|&nanos| nanos <= last.nanos());
        let knots = stamps.map(|nanos| trajectory.pose_at(Stamp::from_nanos(nanos))).collect::<Result<_, _>>()?;
        Self::new(first, interval_ns, knots)
    }

    /// The same through the sampled poses instead of near them: what the knots' interval can show of the motion keeps its size. The
    /// knots are found by adding, again and again, what is left between pose and curve.
    pub fn through_trajectory(trajectory: &Trajectory, interval_ns: i64) -> Result<Self, Error> {
        let mut spline = Self::from_trajectory(trajectory, interval_ns)?;
        let poses = spline.knots.clone();
        for _ in 0..THROUGH_ITERATIONS {
            let curve: Vec<Isometry3<f64>> =
                spline.knots.windows(4).map(|knots| on_segment(knots, 0.0, 1.0).world_from_body).collect();
            // The curve passes the second of four knots; the two ends stay as they are.
            for (k, at) in curve.iter().enumerate() {
                let (knot, pose) = (&mut spline.knots[k + 1], &poses[k + 1]);
                knot.translation.vector += pose.translation.vector - at.translation.vector;
                let left = pose.rotation * at.rotation.inverse();
                knot.rotation = UnitQuaternion::new_normalize((left * knot.rotation).into_inner());
            }
        }
        Ok(spline)
    }

    /// First and last time at which the spline is defined: from the second to the last but one knot.
    pub fn span(&self) -> (Stamp, Stamp) {
        let at = |knot: usize| Stamp::from_nanos(self.first_knot.nanos() + knot as i64 * self.interval_ns);
        (at(1), at(self.knots.len() - 2))
    }

    /// Pose and derivatives at a time inside the [`span`](Self::span).
    pub fn sample(&self, stamp: Stamp) -> Result<Motion, Error> {
        let (first, last) = self.span();
        if stamp < first || stamp > last {
            return Err(Error::OutOfRange { stamp, first, last });
        }
        let since = stamp.nanos() - first.nanos();
        // The very end belongs to the last segment.
        let segment = ((since / self.interval_ns) as usize).min(self.knots.len() - 4);
        let u = (since - segment as i64 * self.interval_ns) as f64 / self.interval_ns as f64;
        Ok(on_segment(&self.knots[segment..segment + 4], u, self.interval_ns as f64 / 1e9))
    }
}

/// The cumulative basis at `u` and its derivatives with respect to time.
fn basis(u: f64, dt: f64) -> [[f64; 3]; 3] {
    let (u2, u3) = (u * u, u * u * u);
    let value = [(5.0 + 3.0 * u - 3.0 * u2 + u3) / 6.0, (1.0 + 3.0 * u + 3.0 * u2 - 2.0 * u3) / 6.0, u3 / 6.0];
    let first = [(1.0 - u) * (1.0 - u) / 2.0, 0.5 + u - u2, u2 / 2.0];
    let second = [u - 1.0, 1.0 - 2.0 * u, u];
    [value, first.map(|b| b / dt), second.map(|b| b / (dt * dt))]
}

fn on_segment(knots: &[Isometry3<f64>], u: f64, dt: f64) -> Motion {
    let [value, first, second] = basis(u, dt);
    let mut position = knots[0].translation.vector;
    let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
    let mut rotation = knots[0].rotation;
    let (mut rate, mut angular_acceleration) = (Vector3::zeros(), Vector3::zeros());
    for (i, step) in knots.windows(2).enumerate() {
        let shift = step[1].translation.vector - step[0].translation.vector;
        position += shift * value[i];
        velocity += shift * first[i];
        acceleration += shift * second[i];

        // Each factor turns what the factors before it contributed into its own frame and adds its own rate.
        let turn: Vector3<f64> = so3::log(&(step[0].rotation.inverse() * step[1].rotation));
        let factor = so3::exp(&(turn * value[i]));
        let carried = factor.inverse() * rate;
        angular_acceleration =
            factor.inverse() * angular_acceleration + (carried.cross(&turn)) * first[i] + turn * second[i];
        rate = carried + turn * first[i];
        rotation *= factor;
    }
    Motion {
        world_from_body: Isometry3::from_parts(
            Translation3::from(position),
            UnitQuaternion::new_normalize(rotation.into_inner()),
        ),
        velocity_in_world: velocity,
        acceleration_in_world: acceleration,
        rate_in_body: rate,
        angular_acceleration_in_body: angular_acceleration,
    }
}
