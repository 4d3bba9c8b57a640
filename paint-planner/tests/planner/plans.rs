//! Whole plans on analytic walls.

use crate::walls::{Arm, Wall};
use paint_planner::{OptimalPlanner, Plan, Planner, Settings, SmoothingPlanner, Tool};

fn assert_sound(plan: &Plan, settings: &Settings) {
    let e = plan.report.extrema;
    assert!(e.speed <= settings.timing.max_speed);
    assert!(e.acceleration <= settings.timing.max_acceleration);
    assert!(e.heading_rate <= settings.timing.max_heading_rate);
    for &flow in &plan.flow {
        assert!((0.0..=settings.timing.max_flow * (1.0 + 1e-12)).contains(&flow));
    }
    let arm = Arm::default();
    for i in (0..plan.nozzle.len()).filter(|&i| plan.reachable[i]) {
        let sample = plan.trajectory.sample(plan.target_time[i]);
        assert!((sample.position - plan.vehicle[i].position).norm() <= plan.report.path_deviation + 1e-9);
        assert!(arm.vehicle(&plan.nozzle[i], plan.vehicle[i].heading).is_some());
    }
}

#[test]
fn bumpy_wall_meets_the_published_deviations() {
    let wall = Wall::bumpy(0.12);
    let targets = wall.rows(4.0, 5, 0.2);
    let settings = Settings::default();
    let start = std::time::Instant::now();
    let plan = OptimalPlanner::default().plan(&targets, &wall, &Arm::default(), &settings).unwrap();
    eprintln!("{:?}", start.elapsed());
    let report = &plan.report;
    eprintln!(
        "n {} mean {} max {} T {} {:?} stretch {} dev {} clear {} steps {} slack {} knots {}",
        targets.len(),
        report.normal_deviation_mean,
        report.normal_deviation_max,
        plan.trajectory.duration(),
        report.extrema,
        report.stretch,
        report.path_deviation,
        report.clearance,
        report.steps,
        report.slack,
        plan.trajectory.knots().len()
    );
    assert_eq!(report.served, targets.len());
    assert_sound(&plan, &settings);
    assert!(report.normal_deviation_mean <= 0.004 && report.normal_deviation_max <= 0.02);
    assert!(report.clearance > 0.0);
    let baseline = SmoothingPlanner.plan(&targets, &wall, &Arm::default(), &settings).unwrap();
    eprintln!("baseline mean {} T {}", baseline.report.normal_deviation_mean, baseline.trajectory.duration());
    assert!(baseline.report.normal_deviation_mean >= 5.0 * report.normal_deviation_mean);
}
