//! What the autopilot is asked to do.

use mavlink::dialects::common::{
    AttitudeTargetTypemask, MavFrame, MavMessage, PositionTargetTypemask, SET_ATTITUDE_TARGET_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::frames;
use super::telemetry::Identity;

/// A set-point in our frames (ENU, FLU).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setpoint {
    /// A moment of a trajectory: the autopilot's own position controller follows it.
    Trajectory {
        /// Position, m.
        position: Point3<f64>,
        /// Velocity, m/s.
        velocity: Vector3<f64>,
        /// Acceleration, m/s^2.
        acceleration: Vector3<f64>,
        /// Heading from x towards y, rad.
        heading: f64,
    },
    /// Attitude and thrust: the position controller is ours, as in the thesis.
    Attitude {
        /// World from body.
        attitude: UnitQuaternion<f64>,
        /// Thrust, 0 to 1 of what the rotors can give.
        thrust: f64,
    },
}

impl Setpoint {
    /// Attitude and thrust for a thrust direction, given as roll and pitch in the frame of the present yaw, and a heading.
    pub fn leaning(roll: f64, pitch: f64, yaw: f64, heading: f64, thrust: f64) -> Self {
        // The thrust must point there whatever the heading does meanwhile.
        let up = Rotation3::from_euler_angles(roll, pitch, yaw) * Vector3::z();
        let left = up.cross(&Vector3::new(heading.cos(), heading.sin(), 0.0)).normalize();
        let axes = Matrix3::from_columns(&[left.cross(&up), left, up]);
        Self::Attitude { attitude: UnitQuaternion::from_matrix(&axes), thrust: thrust.clamp(0.0, 1.0) }
    }

    /// The message for an autopilot at a time in seconds.
    pub fn message(&self, now: f64, to: &Identity) -> MavMessage {
        let time_boot_ms = (now * 1e3).round() as u32;
        match self {
            Self::Trajectory { position, velocity, acceleration, heading } => {
                let [p, v, a] =
                    [position.coords, *velocity, *acceleration].map(|vector| frames::world(&vector).cast::<f32>());
                MavMessage::SET_POSITION_TARGET_LOCAL_NED(SET_POSITION_TARGET_LOCAL_NED_DATA {
                    time_boot_ms,
                    x: p.x,
                    y: p.y,
                    z: p.z,
                    vx: v.x,
                    vy: v.y,
                    vz: v.z,
                    afx: a.x,
                    afy: a.y,
                    afz: a.z,
                    yaw: frames::heading(*heading) as f32,
                    yaw_rate: 0.0,
                    type_mask: PositionTargetTypemask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE,
                    target_system: to.system,
                    target_component: to.component,
                    coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
                })
            }
            Self::Attitude { attitude, thrust } => MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
                time_boot_ms,
                q: frames::quaternion(&frames::attitude(attitude)),
                body_roll_rate: 0.0,
                body_pitch_rate: 0.0,
                body_yaw_rate: 0.0,
                thrust: *thrust as f32,
                target_system: to.system,
                target_component: to.component,
                type_mask: AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
                    | AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
                    | AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE,
                thrust_body: [0.0; 3],
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leaning_setpoint_keeps_thrust_and_heading_apart() {
        let Setpoint::Attitude { attitude, thrust } = Setpoint::leaning(0.1, -0.2, 0.4, 1.3, 1.7) else {
            panic!("not an attitude")
        };
        let up = Rotation3::from_euler_angles(0.1, -0.2, 0.4) * Vector3::z();
        assert!((attitude * Vector3::z() - up).norm() < 1e-12);
        let forward = attitude * Vector3::x();
        // The body's x lies in the vertical plane of the heading, seen along its own z.
        let side = up.cross(&Vector3::new(1.3_f64.cos(), 1.3_f64.sin(), 0.0));
        assert!(
            forward.dot(&side).abs() < 1e-12 && forward.dot(&Vector3::new(1.3_f64.cos(), 1.3_f64.sin(), 0.0)) > 0.9
        );
        assert_eq!(thrust, 1.0);
    }

    #[test]
    fn messages_say_what_is_ignored() {
        let to = Identity::default();
        let trajectory = Setpoint::Trajectory {
            position: Point3::new(1.0, 2.0, 3.0),
            velocity: Vector3::new(0.1, 0.2, 0.3),
            acceleration: Vector3::new(-0.1, -0.2, -0.3),
            heading: 0.0,
        };
        let MavMessage::SET_POSITION_TARGET_LOCAL_NED(sent) = trajectory.message(1.25, &to) else { panic!("another") };
        assert_eq!(([sent.x, sent.y, sent.z], [sent.vx, sent.vy, sent.vz]), ([2.0, 1.0, -3.0], [0.2, 0.1, -0.3]));
        assert_eq!(([sent.afx, sent.afy, sent.afz], sent.type_mask.bits()), ([-0.2, -0.1, 0.3], 2048));
        assert_eq!((sent.time_boot_ms, sent.yaw), (1250, std::f32::consts::FRAC_PI_2));
        let level = Setpoint::leaning(0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.5);
        let MavMessage::SET_ATTITUDE_TARGET(sent) = level.message(0.0, &to) else { panic!("another") };
        assert_eq!((sent.type_mask.bits(), sent.thrust), (7, 0.5));
        assert!((sent.q[0] - 1.0).abs() < 1e-6, "{:?}", sent.q);
    }
}
