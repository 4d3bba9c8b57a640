//! Stretches that a plan gives up although a pose reaches them: they become strokes of a flight of their own.

use std::ops::Range;

use paint_planner::{Plan, Target, reachable_targets};

use super::error::MissionError;
use super::settings::MissionSettings;
use crate::adapters::{MeshSurface, Robot};
use crate::surface::PaintSurface;
use crate::targets::Route;

/// Shortest stretch worth a flight, in deviations of a spot: one spot is wider.
const SHORTEST: f64 = 2.0;

/// Takes out of `targets` what `plan` does not serve but a pose reaches, and returns it as strokes in the order in which they are
/// flown after `from`; `None` where there is nothing. What was taken has no dose any more.
pub(super) fn take_given_up(
    targets: &mut [Target],
    plan: &Plan,
    from: Option<&Target>,
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
) -> Result<Option<Route>, MissionError> {
    let lost: Vec<usize> = (0..targets.len() - 1).filter(|&k| targets[k].dose > 0.0 && plan.flow[k] == 0.0).collect();
    let asked: Vec<Target> = lost.iter().flat_map(|&k| [targets[k], targets[k + 1]]).collect();
    if asked.is_empty() {
        return Ok(None);
    }
    let mesh = MeshSurface(&surface.world);
    let reached = reachable_targets(&asked, &settings.constraints.around(&mesh), robot, &settings.planner)?;
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (&k, _) in lost.iter().zip(reached.chunks(2)).filter(|(_, ends)| ends.iter().all(|reached| *reached)) {
        match runs.last_mut().filter(|run| run.end == k) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    let length =
        |run: &Range<usize>| run.clone().map(|k| (targets[k + 1].point - targets[k].point).norm()).sum::<f64>();
    runs.retain(|run| length(run) >= SHORTEST * settings.spot);
    if runs.is_empty() {
        return Ok(None);
    }
    let stroke = |run: &Range<usize>| {
        let end = Target { dose: 0.0, ..targets[run.end] };
        targets[run.clone()].iter().copied().chain([end]).collect()
    };
    let strokes: Vec<Vec<Target>> = runs.iter().map(stroke).collect();
    for target in runs.into_iter().flatten() {
        targets[target].dose = 0.0;
    }
    Ok(Some(Route::ordered(&strokes, from, &settings.planner)?))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use ptu_kinematics::Ptu;

    use super::super::test_panel;
    use super::*;

    #[test]
    fn what_a_plan_gives_up_becomes_strokes_of_their_own() {
        let settings = MissionSettings::default();
        let (surface, mut targets) = (test_panel::surface(), test_panel::targets());
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let mut plan = test_panel::plan(&surface, &robot, &settings);
        let take = |targets: &mut [Target], plan: &Plan| {
            take_given_up(targets, plan, None, &surface, &robot, &settings).unwrap()
        };
        assert!(take(&mut targets, &plan).is_none(), "all of it is served");
        let paint = |targets: &[Target]| -> f64 {
            targets.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum()
        };
        let whole = paint(&targets);
        // Ten centimetres, a piece shorter than a spot, and one that no pose reaches as it faces upwards.
        for k in (10..14).chain([20]).chain(30..34) {
            plan.flow[k] = 0.0;
        }
        for target in &mut targets[30..35] {
            target.normal = nalgebra::Vector3::z_axis();
        }
        let route = take(&mut targets, &plan).unwrap();
        assert_eq!((route.strokes, route.targets.len()), (1, 5));
        assert!((route.paint() - paint(&test_panel::targets()[10..15])).abs() < 1e-15);
        assert!((route.paint() + paint(&targets) - whole).abs() < 1e-15, "paint is lost or doubled");
        assert!((0..39).all(|k| (targets[k].dose == 0.0) == (10..14).contains(&k)));
    }
}
