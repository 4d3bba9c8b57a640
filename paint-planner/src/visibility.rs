//! Whether a nozzle sees its target, and whether there is a surface where the target says.

use nalgebra::Point3;

use crate::error::Error;
use crate::not_served::NotServed;
use crate::target::{NozzleState, Target};
use crate::world::Surface;

/// How far before or behind the target a ray from the nozzle may hit, m: surfaces are meshes, targets need not lie exactly on
/// them.
const TOLERANCE: f64 = 0.03;

/// What a ray from the nozzle to its target meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sight {
    /// The surface, at the target.
    Target,
    /// The surface at the target, from behind: one of the two normals points inwards.
    Back,
    /// Something in front of the target.
    Obstacle,
    /// Nothing, as beside the rim of a sheet.
    Nothing,
}

/// Casts the ray.
///
/// # Errors
/// [`Error::World`] if the hit is not a point with a distance.
pub(crate) fn look(target: &Target, nozzle: &NozzleState, surface: &dyn Surface) -> Result<Sight, Error> {
    let distance = (target.point - nozzle.position).norm();
    let Some(hit) = surface.cast(&nozzle.position, &nozzle.direction, distance + TOLERANCE) else {
        return Ok(Sight::Nothing);
    };
    if !(hit.distance >= 0.0 && hit.normal.iter().all(|c| c.is_finite())) {
        let at: Point3<f64> = nozzle.position;
        let what = "a ray's hit has a distance or a normal that is negative or not a number";
        return Err(Error::World { what, at: at.into() });
    }
    Ok(if hit.distance < distance - TOLERANCE {
        Sight::Obstacle
    } else if hit.normal.dot(&target.normal) < 0.0 {
        Sight::Back
    } else {
        Sight::Target
    })
}

/// Looks at every target that has a nozzle state. Those with something in front of them lose it.
///
/// # Errors
/// [`Error::World`] for answers that are no hits, where no ray meets anything at all, and where most of the targets are seen
/// from behind: then targets and surface do not belong together, and a plan would paint the air or the inside of a wall.
pub(crate) fn drop_hidden(
    targets: &[Target],
    states: &mut [Result<NozzleState, NotServed>],
    surface: &dyn Surface,
) -> Result<(), Error> {
    let (mut seen, mut back, mut nothing) = (0_usize, 0_usize, None);
    for (target, state) in targets.iter().zip(states) {
        let Ok(nozzle) = state else { continue };
        match look(target, nozzle, surface)? {
            Sight::Target => seen += 1,
            Sight::Back => back += 1,
            Sight::Nothing => nothing = nothing.or(Some(target.point)),
            Sight::Obstacle => {
                seen += 1;
                *state = Err(NotServed::Hidden);
            }
        }
    }
    let refuse = |what, at: Point3<f64>| Err(Error::World { what, at: at.into() });
    match nothing {
        _ if back > seen => refuse(
            "most targets are seen from behind: their normals point against those of the surface, turn one of the two",
            targets[0].point,
        ),
        Some(at) if seen + back == 0 => refuse(
            "no ray from a nozzle meets the surface: targets and surface lie in different places, frames or units",
            at,
        ),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::world::Hit;

    /// The plane x = 0: its front where y is 0, its back where it is 1, a hole where it is 2.
    struct Sheet;

    impl Surface for Sheet {
        fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
            let (distance, y) = (origin.x.abs(), origin.y.round());
            let normal = if y == 1.0 { Vector3::x_axis() } else { -Vector3::x_axis() };
            let point = origin + direction.into_inner() * distance;
            (y != 2.0 && distance <= max).then_some(Hit { point, normal, distance })
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            point.x.abs().min(max)
        }
    }

    /// Whether targets at these places, each sprayed at from the front, are refused.
    fn refused(places: &[f64]) -> bool {
        let normal = -Vector3::x_axis();
        let target =
            |&y: &f64| Target { point: Point3::new(0.0, y, 0.0), normal, dose: 1e-6, time: None, stand_off: None };
        let targets: Vec<Target> = places.iter().map(target).collect();
        let from = |t: &Target| NozzleState { position: t.point - Vector3::x() * 0.3, direction: Vector3::x_axis() };
        let mut states: Vec<_> = targets.iter().map(|t| Ok(from(t))).collect();
        drop_hidden(&targets, &mut states, &Sheet).is_err()
    }

    #[test]
    fn targets_that_are_mostly_behind_or_all_in_holes_are_refused() {
        for (places, expected) in [
            (&[0.0][..], false),
            (&[2.0], true),
            (&[2.0, 2.0, 2.0], true),
            (&[2.0, 0.0], false),
            (&[2.0, 0.0, 1.0], false),
            (&[2.0, 1.0], true),
            (&[0.0, 1.0], false),
            (&[0.0, 1.0, 1.0], true),
        ] {
            assert_eq!(refused(places), expected, "{places:?}");
        }
    }
}
