use crate::walls::{Arm, Wall};
use paint_planner::{OptimalPlanner, Planner, Settings};
#[test]
fn scratch() {
    for (rows, width, amp, wl) in [(5, 4.0, 0.12, 1.6), (12, 4.0, 0.2, 1.1), (20, 20.0, 0.2, 1.5),(12, 4.0, 0.25, 0.9)] {
        let wall = Wall { bumps: amp, wavelength: wl, turn: 0.0 };
        let targets = wall.rows(width, rows, 0.12);
        let start = std::time::Instant::now();
        let plan = OptimalPlanner::default().plan(&targets, &wall, &Arm::default(), &Settings::default());
        match plan {
            Ok(plan) => {
                let r = &plan.report;
                let metres = targets.len() as f64 * 0.025;
                eprintln!("n {} served {} {:.2} ms/m mean {:.2}mm max {:.2}mm v {:.3} m/s {:?} stretch {} dev {} clear {} steps {} rounds {}", targets.len(), r.served, start.elapsed().as_secs_f64()*1e3/metres, r.normal_deviation_mean*1e3, r.normal_deviation_max*1e3, metres/plan.trajectory.duration(), r.extrema, r.stretch, r.path_deviation, r.clearance, r.steps, r.rounds);
            }
            Err(e) => eprintln!("ERR {e}"),
        }
    }
}
