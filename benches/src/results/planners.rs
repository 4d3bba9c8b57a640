//! The planners of the VR letter, its Figs. 2 and 7 (thesis, Figs. 7.2 and 7.7), and the planning times beside its Fig. 6.

use std::error::Error;

use paint_planner::plan::SmoothingPlanner;
use paint_planner::{OptimalPlanner, Planner};
use paint_sim::FlightSettings;
use paint_sim::flight::{FlightLog, FlightSample};
use paintcopter::adapters::MeshSurface;

use super::excerpt::excerpt;
use super::extent::Extent;
use super::table::{Table, number};
use crate::cpu::median_seconds;
use crate::planned_stroke::{PlannedStroke, hose};

/// Runs of which the median is taken; of a quick run.
const RUNS: [usize; 2] = [9, 3];

struct Column {
    stroke: PlannedStroke,
    flight: FlightLog,
    /// Planning of a segment of 1 m and of 0.5 m, ms.
    segment_ms: [f64; 2],
}

impl Column {
    fn new(planner: &dyn Planner, extent: Extent) -> Result<Self, Box<dyn Error>> {
        let stroke = PlannedStroke::new(planner)?;
        let settings = FlightSettings { hose: Some(hose()), ..FlightSettings::default() };
        let flight = stroke.fly_plan(&settings)?;
        let mesh = MeshSurface(&stroke.surface.world);
        let [metre, half] = [1.0, 0.5].map(|length| {
            let mut arc_length = 0.0;
            let steps = stroke.targets.windows(2).take_while(|pair| {
                arc_length += (pair[1].point - pair[0].point).norm();
                arc_length < length
            });
            let targets = &stroke.targets[..=steps.count()];
            let plan = || planner.plan(targets, &mesh, &stroke.robot, &stroke.settings.planner);
            1e3 * median_seconds(RUNS[extent as usize], plan)
        });
        Ok(Self { stroke, flight, segment_ms: [metre, half] })
    }

    fn open(&self) -> impl Iterator<Item = &FlightSample> {
        self.flight.samples.iter().filter(|s| s.flow > 0.0)
    }

    /// RMS and largest value of pan (0) or tilt (1) as flown, degrees.
    fn joint(&self, joint: usize) -> [f64; 2] {
        let count = self.open().count().max(1) as f64;
        let rms = (self.open().map(|s| s.pan_tilt[joint].powi(2)).sum::<f64>() / count).sqrt();
        [rms, self.open().map(|s| s.pan_tilt[joint].abs()).fold(0.0, f64::max)].map(f64::to_degrees)
    }

    /// Largest planned angle of pan (0) or tilt (1), degrees.
    fn planned(&self, joint: usize) -> f64 {
        let angles = self.stroke.plan.vehicle.iter().map(|v| [v.pan, v.tilt][joint].abs());
        angles.fold(0.0, f64::max).to_degrees()
    }

    /// Least and largest distance of the planned nozzle from its target, cm.
    fn distances(&self) -> [f64; 2] {
        let pairs = self.stroke.targets.iter().zip(&self.stroke.plan.nozzle);
        pairs
            .map(|(target, nozzle)| 100.0 * (target.point - nozzle.position).norm())
            .fold([f64::INFINITY, 0.0], |[least, most], d| [least.min(d), most.max(d)])
    }
}

/// The table, and the curves of Fig. 7.
///
/// # Errors
/// What planner and simulator refuse.
pub fn tables(extent: Extent) -> Result<Vec<Table>, Box<dyn Error>> {
    let columns = [Column::new(&SmoothingPlanner, extent)?, Column::new(&OptimalPlanner::default(), extent)?];
    let mut table = Table::new(
        "planners",
        &["figure", "smoothing; printed", "smoothing; here", "optimal; printed", "optimal; here"],
    );
    let mut row = |figure: &str, printed: [&str; 2], here: [String; 2]| {
        let ([a, b], [c, d]) = (printed, here);
        table.row([figure.into(), a.into(), c, b.into(), d]);
    };
    let of = |value: &dyn Fn(&Column) -> String| columns.each_ref().map(value);
    let report = |c: &Column| c.stroke.plan.report.clone();
    row("off the normal; mean; cm", ["4.5", "0.4"], of(&|c| number(100.0 * report(c).normal_deviation_mean, 2)));
    let largest = of(&|c| number(100.0 * report(c).normal_deviation_max, 2));
    row("off the normal; largest; cm", ["10", "\"less than\" 2"], largest);
    let distance = of(&|c| c.distances().map(|d| number(d, 1)).join(" to "));
    row("planned distance from the target; cm", ["-", "-"], distance);
    for (joint, name) in ["pan", "tilt"].into_iter().enumerate() {
        row(
            &format!("planned {name}; largest; degrees"),
            ["0", "\"greater extent\""],
            of(&|c| number(c.planned(joint), 1)),
        );
        row(
            &format!("flown {name}; RMS and largest; degrees"),
            ["-", "-"],
            of(&|c| c.joint(joint).map(|angle| number(angle, 1)).join("; ")),
        );
    }
    for (k, (name, printed)) in [("1 m", "356"), ("0.5 m", "189")].into_iter().enumerate() {
        row(
            &format!("planning a segment of {name}; CPU time; ms"),
            ["-", printed],
            of(&|c| number(c.segment_ms[k], 2)),
        );
    }
    row("least clearance of the plan; cm", ["-", "-"], of(&|c| number(100.0 * report(c).clearance, 1)));
    Ok(vec![table, curves(&columns)])
}

/// Pan and tilt over half a minute of flight.
fn curves([smoothing, optimal]: &[Column; 2]) -> Table {
    let head = ["time_s", "smoothing_pan_deg", "smoothing_tilt_deg", "optimal_pan_deg", "optimal_tilt_deg"];
    let mut table = Table::new("fig_7_7", &head);
    for (a, b) in excerpt(&smoothing.flight, &optimal.flight) {
        let angles = [a.pan_tilt[0], a.pan_tilt[1], b.pan_tilt[0], b.pan_tilt[1]];
        let [a_pan, a_tilt, b_pan, b_tilt] = angles.map(|angle| number(angle.to_degrees(), 2));
        table.row([number(a.time, 2), a_pan, a_tilt, b_pan, b_tilt]);
    }
    table
}
