//! The nozzle as a painter imagines it: upright over the surface, at the stand-off.

use crate::target::{NozzleState, Target};
use nalgebra::UnitVector3;

/// A nozzle that stands upright, and what it sprays from there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UprightSpray {
    /// Where it is and where it sprays.
    pub nozzle: NozzleState,
    /// Paint, m³.
    pub volume: f64,
}

/// The nozzle over a share of the way from a target to the next, at their own stand-offs, else at `stand_off`, m.
pub fn upright([from, to]: [&Target; 2], share: f64, stand_off: f64) -> NozzleState {
    let normal = UnitVector3::try_new(from.normal.lerp(&to.normal, share), 1e-9).unwrap_or(from.normal);
    let point = from.point + (to.point - from.point) * share;
    let [near, far] = [from, to].map(|target| target.stand_off_or(stand_off));
    NozzleState { position: point + normal.into_inner() * (near + (far - near) * share), direction: -normal }
}

/// The way from a target to the next with the nozzle upright all along, in steps of `step` metres at most; none where nothing is sprayed.
pub fn upright_steps(from: &Target, to: &Target, stand_off: f64, step: f64) -> impl Iterator<Item = UprightSpray> {
    let length = (to.point - from.point).norm();
    let steps = if from.dose > 0.0 { (length / step).ceil() } else { 0.0 };
    let volume = from.dose * length / steps;
    let (from, to) = (*from, *to);
    (0..steps as usize)
        .map(move |k| UprightSpray { nozzle: upright([&from, &to], (k as f64 + 0.5) / steps, stand_off), volume })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    #[test]
    fn steps_share_the_paint_and_stand_upright() {
        let target = |x: f64, normal: Vector3<f64>| Target {
            point: Point3::new(x, 0.0, 0.0),
            normal: UnitVector3::new_normalize(normal),
            dose: 2.0,
            time: None,
            stand_off: None,
        };
        let (from, to) = (target(0.0, Vector3::z()), target(0.1, Vector3::new(1.0, 0.0, 1.0)));
        let steps: Vec<UprightSpray> = upright_steps(&from, &to, 0.3, 0.03).collect();
        assert_eq!(steps.len(), 4);
        assert!((steps.iter().map(|s| s.volume).sum::<f64>() - 0.2).abs() < 1e-15);
        for (k, step) in steps.iter().enumerate() {
            // The axis meets the way where the step is.
            let hit = step.nozzle.position + step.nozzle.direction.into_inner() * 0.3;
            assert!((hit - Point3::new(0.1 * (k as f64 + 0.5) / 4.0, 0.0, 0.0)).norm() < 1e-15);
        }
        let [from_near, to_far] = [(from, 0.1), (to, 0.2)].map(|(t, d)| Target { stand_off: Some(d), ..t });
        let between = upright([&from_near, &to_far], 0.25, 0.3);
        let way = Point3::new(0.025, 0.0, 0.0) - between.position;
        assert!((way.norm() - 0.125).abs() < 1e-15 && way.cross(&between.direction).norm() < 1e-15);
        assert!((upright([&from_near, &to], 1.0, 0.3).position - to.point).norm() - 0.3 < 1e-15);
        assert!(upright_steps(&Target { dose: 0.0, ..from }, &to, 0.3, 0.03).next().is_none());
    }
}
