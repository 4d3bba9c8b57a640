//! Stretches that a plan gives up although a pose reaches them: they become strokes of a flight of their own.

use std::ops::Range;

use super::reach::reachable_targets;
use crate::error::Error;
use crate::plan::Plan;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

/// Takes out of `targets` what `plan` does not serve but a pose reaches, in stretches of at least `shortest` metres, and returns them as
/// strokes. What was taken has no dose any more.
pub(super) fn take_unserved(
    targets: &mut [Target],
    plan: &Plan,
    shortest: f64,
    surface: &dyn Surface,
    tool: &dyn Tool,
    settings: &Settings,
) -> Result<Vec<Vec<Target>>, Error> {
    let lost: Vec<usize> = (0..targets.len() - 1).filter(|&k| targets[k].dose > 0.0 && plan.flow[k] == 0.0).collect();
    let asked: Vec<Target> = lost.iter().flat_map(|&k| [targets[k], targets[k + 1]]).collect();
    if asked.is_empty() {
        return Ok(Vec::new());
    }
    let reached = reachable_targets(&asked, surface, tool, settings)?;
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (&k, _) in lost.iter().zip(reached.chunks(2)).filter(|(_, ends)| ends.iter().all(|reached| *reached)) {
        match runs.last_mut().filter(|run| run.end == k) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    let length =
        |run: &Range<usize>| run.clone().map(|k| (targets[k + 1].point - targets[k].point).norm()).sum::<f64>();
    runs.retain(|run| length(run) >= shortest);
    let stroke = |run: &Range<usize>| {
        let end = Target { dose: 0.0, ..targets[run.end] };
        targets[run.clone()].iter().copied().chain([end]).collect()
    };
    let strokes: Vec<Vec<Target>> = runs.iter().map(stroke).collect();
    for target in runs.into_iter().flatten() {
        targets[target].dose = 0.0;
    }
    Ok(strokes)
}
#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};

    use super::*;
    use crate::plan::plan;
    use crate::target::NozzleState;
    use crate::world::{Hit, VehicleState};

    /// The plane x = 0, seen from smaller x.
    struct Plane;

    impl Surface for Plane {
        fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
            let distance = -origin.x / direction.x;
            let point = origin + direction.into_inner() * distance;
            (0.0..max).contains(&distance).then(|| Hit { point, normal: -Vector3::x_axis(), distance })
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            point.x.abs().min(max)
        }
    }

    /// A gimbal in a ball.
    struct Gimbal;

    impl Tool for Gimbal {
        fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
            let pan = (nozzle.direction.y.atan2(nozzle.direction.x) - heading).sin().asin();
            Some(VehicleState { position: nozzle.position, heading, pan, tilt: nozzle.direction.z.asin() })
        }

        fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
            out.push((vehicle.position, 0.02));
        }
    }

    #[test]
    fn what_a_plan_gives_up_becomes_strokes_of_their_own() {
        let (point, normal) = (|k: usize| Point3::new(0.0, 0.025 * k as f64, 1.0), -Vector3::x_axis());
        let stroke: Vec<Target> =
            (0..40).map(|k| Target { point: point(k), normal, dose: 1e-6, time: None, stand_off: None }).collect();
        let (mut targets, settings) = (stroke.clone(), Settings::default());
        let mut plan = plan(&targets, &Plane, &Gimbal, &settings).unwrap();
        let take = |targets: &mut [Target], plan: &Plan| {
            take_unserved(targets, plan, 0.05, &Plane, &Gimbal, &settings).unwrap()
        };
        assert!(take(&mut targets, &plan).is_empty(), "all of it is served");
        // Ten centimetres, a piece that is too short, and one that no pose reaches as it faces upwards.
        for k in (10..14).chain([20]).chain(30..34) {
            plan.flow[k] = 0.0;
        }
        for target in &mut targets[30..35] {
            target.normal = Vector3::z_axis();
        }
        let strokes = take(&mut targets, &plan);
        let last = Target { dose: 0.0, ..stroke[14] };
        assert_eq!(strokes, [[&stroke[10..14], &[last]].concat()]);
        assert!((0..39).all(|k| (targets[k].dose == 0.0) == (10..14).contains(&k)), "paint is lost or doubled");
    }
}
