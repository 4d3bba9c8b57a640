//! Starting states, and which targets can be served at all (VR paper, Eq. (1)).

use crate::settings::NozzleSettings;
use crate::target::{NozzleState, Target};
use nalgebra::{Point3, UnitVector3, Vector3};

/// Room kept between a start and the hard rows of the program, rad: interior-point methods need an inside.
const MARGIN: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Share of the greatest deviation at which a leaning start is still inside the octagon of rows.
const INSIDE: f64 = 0.8;

/// A start strictly inside the hard rows, and the tangent frame of its target.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InitialState {
    pub(crate) state: NozzleState,
    /// Tangent directions; the first points uphill where the surface has an uphill.
    pub(crate) tangents: [Vector3<f64>; 2],
    /// Greatest normal deviation, m; `None` where the spray must lean so far that only the incidence bounds it.
    pub(crate) deviation: Option<f64>,
    /// Corners of the mesh's triangle at the target, where it is asked for and known.
    pub(crate) facet: Option<[Point3<f64>; 3]>,
}

/// Eq. (1) with the spray axis clamped into the elevations the tilt joint has. `None` where that asks for more than the
/// permitted incidence.
pub(crate) fn initial_states(targets: &[Target], settings: &NozzleSettings) -> Vec<Option<InitialState>> {
    targets.iter().map(|target| start(target, settings)).collect()
}

fn start(target: &Target, settings: &NozzleSettings) -> Option<InitialState> {
    let (n, stand_off) = (target.normal.into_inner(), target.stand_off_or(settings.stand_off));
    let ideal = -n;
    let elevation = ideal.z.clamp(-1.0, 1.0).asin();
    let limit = settings.max_elevation - MARGIN;
    let tilted = (elevation.abs() - limit).max(0.0);
    let flat = Vector3::new(ideal.x, ideal.y, 0.0);
    let direction = if tilted == 0.0 {
        ideal
    } else {
        if tilted > settings.incidence - MARGIN {
            return None;
        }
        // Below a level ceiling every side serves; there the plan depends on the world's x axis, as its tangents do.
        flat.try_normalize(1e-9).unwrap_or_else(Vector3::x) * limit.cos()
            + Vector3::z() * limit.sin().copysign(elevation)
    };
    let position = target.point - direction * (stand_off / tilted.cos());
    let state = NozzleState { position, direction: UnitVector3::new_normalize(direction) };
    // A cylinder about the normal that lies inside the cone of the incidence down to the least distance.
    let deviation = settings.deviation.min(settings.min * settings.incidence.tan());
    let deviation = (stand_off * tilted.tan() < INSIDE * deviation).then_some(deviation);
    Some(InitialState { state, tangents: tangents(&n, &Vector3::z()), deviation, facet: None })
}

/// An orthonormal pair perpendicular to `axis`; the first is the part of `up` that is.
pub(crate) fn tangents(axis: &Vector3<f64>, up: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let rise = up - axis * axis.dot(up);
    let first = if rise.norm() > 1e-6 {
        rise.normalize()
    } else {
        // Any pair serves a floor or a ceiling; there the plan may depend on the world's x axis.
        let side = Vector3::x() - axis * axis.x;
        side.normalize()
    };
    [first, axis.cross(&first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facing(elevation_degrees: f64) -> Target {
        let e = elevation_degrees.to_radians();
        let normal = UnitVector3::new_normalize(Vector3::new(-e.cos(), 0.0, -e.sin()));
        Target { point: Point3::new(1.0, 2.0, 3.0), normal, dose: 1e-6, time: None, stand_off: None }
    }

    #[test]
    fn steep_targets_get_a_tilted_spray_until_the_incidence_runs_out() {
        let settings = NozzleSettings::default();
        let plain = start(&facing(30.0), &settings).unwrap();
        assert!((plain.state.position - facing(30.0).point).cross(&facing(30.0).normal).norm() < 1e-12);
        let steep = start(&facing(60.0), &settings).unwrap();
        assert!((steep.state.direction.z.asin().to_degrees() - 43.5).abs() < 1e-9);
        let offset = steep.state.position - facing(60.0).point;
        assert!((offset.dot(&facing(60.0).normal) - 0.1).abs() < 1e-12);
        assert!((offset.normalize() + steep.state.direction.into_inner()).norm() < 1e-12);
        assert!(start(&facing(70.0), &settings).is_none());
        assert!(start(&facing(-90.0), &settings).is_none());
    }
}
