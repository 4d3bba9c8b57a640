//! Distances that targets ask for.

use crate::walls::{Arm, Wall};
use paint_planner::plan::SmoothingPlanner;
use paint_planner::{Error, OptimalPlanner, Plan, Planner, Settings, Target};

/// A row of 1 m whose second half is sprayed from farther off.
fn row(wall: &Wall, near: f64, far: f64) -> Vec<Target> {
    let mut targets = wall.rows(1.0, 1, 0.2);
    let half = targets.len() / 2;
    for (k, target) in targets.iter_mut().enumerate() {
        target.stand_off = Some(if k < half { near } else { far });
    }
    targets
}

fn heights(plan: &Plan, targets: &[Target]) -> Vec<f64> {
    plan.nozzle
        .iter()
        .zip(targets)
        .map(|(nozzle, target)| (nozzle.position - target.point).dot(&target.normal))
        .collect()
}

/// The printed program only bounds distances; the others hold them, but for a step, where no planner can jump.
#[test]
fn the_nozzle_keeps_the_distances_of_its_targets() {
    let (wall, settings) = (Wall::flat(), Settings::default());
    let planners: [&dyn Planner; 2] = [&OptimalPlanner::default(), &SmoothingPlanner];
    let off = |part: &[f64], wanted: f64| part.iter().map(|h| (h - wanted).abs()).fold(0.0, f64::max);
    for planner in planners {
        let even = row(&wall, 0.07, 0.07);
        let plan = planner.plan(&even, &wall, &Arm::default(), &settings).unwrap();
        assert!(off(&heights(&plan, &even), 0.07) < 2e-3, "{}: {:?}", planner.name(), heights(&plan, &even));
        let step = row(&wall, 0.07, 0.13);
        let plan = planner.plan(&step, &wall, &Arm::default(), &settings).unwrap();
        let heights = heights(&plan, &step);
        let (near, far) = (off(&heights[..4], 0.07), off(&heights[heights.len() - 4..], 0.13));
        assert!(near < 0.01 && far < 0.01, "{}: {heights:?}", planner.name());
    }
}

#[test]
fn targets_that_ask_for_the_usual_distance_are_as_those_that_ask_for_none() {
    let (wall, settings) = (Wall::bumpy(0.1), Settings::default());
    let asked = row(&wall, settings.nozzle.stand_off, settings.nozzle.stand_off);
    let none: Vec<Target> = asked.iter().map(|target| Target { stand_off: None, ..*target }).collect();
    let plan = |targets: &[Target]| OptimalPlanner::default().plan(targets, &wall, &Arm::default(), &settings).unwrap();
    assert_eq!(plan(&asked).nozzle, plan(&none).nozzle);
}

#[test]
fn distances_that_the_nozzle_may_not_keep_are_refused() {
    let (wall, settings) = (Wall::flat(), Settings::default());
    for wrong in [settings.nozzle.min, settings.nozzle.max, -0.1, f64::NAN] {
        let mut targets = row(&wall, 0.07, 0.13);
        targets[5].stand_off = Some(wrong);
        let refused = OptimalPlanner::default().plan(&targets, &wall, &Arm::default(), &settings);
        let Err(Error::Target { index, what }) = refused else { panic!("{wrong}") };
        assert_eq!(index, 5);
        assert!(what.contains("nozzle.min and nozzle.max"), "{what}");
    }
}
