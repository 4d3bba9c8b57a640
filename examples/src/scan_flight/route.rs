//! The way of a scan: rows along the front of a surface, from rest to rest.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use paint_planner::onboard::minimum_jerk;
use paint_sim::TriangleSurface;
use paint_sim::flight::{Reference, ReferenceState};
use vio_ekf::Stamp;
use vio_ekf::trajectory::Spline;

use super::error::ScanFlightError;

/// Distance of the robot from the foremost point of the surface in a scan, metres.
pub(super) const STAND_OFF: f64 = 1.5;
/// Distance between rows, metres: the camera sees twice that.
const ROW: f64 = 0.8;
/// The robot stays this far inside the edges, metres.
const INSIDE: f64 = 0.4;
/// Shortest row, metres: without motion there is no scale.
const SHORTEST: f64 = 0.6;
/// Lowest flight, metres.
const LOWEST: f64 = 0.4;
/// Top speed, m/s.
const SPEED: f64 = 1.2;
/// Shortest time between two turns, seconds.
const LEAST_LEG: f64 = 1.5;
/// Rest before take-off, in which the odometry starts, seconds.
const REST: f64 = 2.5;
/// The robot looks left and right on its way: angle (rad) and period (s). Grooves are seen from both sides.
const SWAY: (f64, f64) = (0.2, 5.0);
/// Knots of the spline per second.
const KNOTS_PER_SECOND: f64 = 10.0;
/// A surface has a front if its mean normal is at least this long and level; a sphere's has no length.
const FRONT: f64 = 0.4;

/// A flight along a surface.
pub(crate) struct Route {
    /// The motion of the body.
    pub(super) spline: Spline,
    /// Level unit vector from the robot towards the surface.
    pub(super) towards: Vector3<f64>,
}

/// Along a surface with a mean normal (not of unit length: a sphere's has none), metres from its foremost point.
pub(crate) fn along(
    surface: &TriangleSurface,
    facing: &Vector3<f64>,
    stand_off: f64,
) -> Result<Route, ScanFlightError> {
    let level = Vector3::new(facing.x, facing.y, 0.0);
    let front = level.try_normalize(FRONT).ok_or(ScanFlightError::NoFront)?;
    let up = Vector3::z();
    let side = front.cross(&up);
    let [(left, right), (bottom, top), (_, foremost)] = [&side, &up, &front].map(|axis| surface.extent(axis));
    let (width, height) = (right - left, top - bottom);
    if !(0.5..=30.0).contains(&width) || !(0.5..=30.0).contains(&height) {
        return Err(ScanFlightError::Size { width, height });
    }
    let middle = 0.5 * (left + right);
    let half = (0.5 * width - INSIDE).max(0.5 * SHORTEST);
    let rows = (height / ROW).ceil().max(2.0) as usize;
    let corners: Vec<Vector3<f64>> = (0..rows)
        .flat_map(|row| {
            let level = (bottom + (row as f64 + 0.5) / rows as f64 * height).max(LOWEST);
            let ends = if row % 2 == 0 { [-half, half] } else { [half, -half] };
            ends.map(|end| side * (middle + end) + up * level + front * (foremost + stand_off))
        })
        .collect();

    let legs: Vec<f64> = corners.windows(2).map(|c| (1.875 * (c[1] - c[0]).norm() / SPEED).max(LEAST_LEG)).collect();
    let duration = REST + legs.iter().sum::<f64>();
    let heading =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_basis_unchecked(&[-front, -front.cross(&-up), up]));
    let knots = (0..=(duration * KNOTS_PER_SECOND).ceil() as usize + 3)
        .map(|k| {
            // The first knots lie before the start of the motion that they make.
            let t = (k as f64 - 1.0) / KNOTS_PER_SECOND - REST;
            let sway = SWAY.0 * (std::f64::consts::TAU * t.max(0.0) / SWAY.1).sin();
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sway) * heading;
            Isometry3::from_parts(Translation3::from(position_at(&corners, &legs, t)), rotation)
        })
        .collect();
    let spline = Spline::new(Stamp::from_nanos(0), (1e9 / KNOTS_PER_SECOND) as i64, knots)?;
    Ok(Route { spline, towards: -front })
}

/// Where the way has come to after `t` seconds: each leg from rest to rest with the least jerk.
fn position_at(corners: &[Vector3<f64>], legs: &[f64], mut t: f64) -> Vector3<f64> {
    for (ends, &duration) in corners.windows(2).zip(legs) {
        if t < duration {
            return ends[0] + (ends[1] - ends[0]) * minimum_jerk(t / duration)[0];
        }
        t -= duration;
    }
    corners[corners.len() - 1]
}

impl Reference for Route {
    fn duration(&self) -> f64 {
        let (first, last) = self.spline.span();
        last.secs_since(first)
    }

    fn at(&self, t: f64) -> ReferenceState {
        let (first, last) = self.spline.span();
        let stamp = Stamp::from_nanos(first.nanos() + (1e9 * t) as i64).clamp(first, last);
        let hover = ReferenceState {
            // The flight ends with an error at a position that is none.
            position: Vector3::repeat(f64::NAN).into(),
            velocity: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            heading: 0.0,
            heading_rate: 0.0,
            lever: Vector3::zeros(),
            aim: None,
            nozzle_distance: 0.0,
            flow: 0.0,
        };
        let Ok(motion) = self.spline.sample(stamp) else { return hover };
        let ahead = motion.world_from_body * Vector3::x();
        ReferenceState {
            position: motion.world_from_body.translation.vector.into(),
            velocity: motion.velocity_in_world,
            acceleration: motion.acceleration_in_world,
            heading: ahead.y.atan2(ahead.x),
            heading_rate: (motion.world_from_body * motion.rate_in_body).z,
            ..hover
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_io::TriangleMesh;
    use crate::mesh_placement::mean_normal;
    use crate::world::rock_wall;

    fn along(mesh: &TriangleMesh) -> Result<Route, ScanFlightError> {
        super::along(&TriangleSurface::new(&mesh.positions, &mesh.faces).unwrap(), &mean_normal(mesh), STAND_OFF)
    }

    #[test]
    fn the_robot_keeps_its_distance_and_looks_at_the_wall() {
        let mesh = rock_wall(1);
        let route = along(&mesh).unwrap();
        assert!((route.towards - Vector3::x()).norm() < 0.1);
        let foremost = mesh.positions.iter().map(|p| f64::from(p[0])).fold(f64::MAX, f64::min);
        let (first, last) = route.spline.span();
        let mut seen = (f64::MAX, f64::MIN);
        for k in 0..=1000 {
            let t = first.nanos() + (last.nanos() - first.nanos()) / 1000 * k;
            let pose = route.spline.sample(Stamp::from_nanos(t)).unwrap().world_from_body;
            let p = pose.translation.vector;
            assert!((foremost - p.x - STAND_OFF).abs() < 0.3 && p.z > 1.5 && p.z < 3.7);
            assert!((pose * Vector3::x()).x > 0.9 && (pose * Vector3::z() - Vector3::z()).norm() < 1e-9);
            seen = (seen.0.min(p.y), seen.1.max(p.y));
        }
        assert!(seen.1 - seen.0 > 3.5, "from end to end: {seen:?}");
        let start = route.spline.sample(Stamp::from_secs(0.5).unwrap()).unwrap();
        assert!(start.velocity_in_world.norm() < 1e-9, "the odometry starts at rest");
    }

    #[test]
    fn what_cannot_be_flown_along_is_refused() {
        let mut mesh = rock_wall(1);
        for face in mesh.faces.clone() {
            mesh.faces.push([face[0], face[2], face[1]]);
        }
        assert!(matches!(along(&mesh), Err(ScanFlightError::NoFront)));
        let mut mesh = rock_wall(1);
        for position in &mut mesh.positions {
            *position = position.map(|c| 0.1 * c);
        }
        assert!(matches!(along(&mesh), Err(ScanFlightError::Size { .. })));
    }
}
