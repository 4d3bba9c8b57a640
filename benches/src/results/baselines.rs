//! The flights of Paper II, section 7.2 (thesis, Fig. 6.9): its planner with the gun turning and locked, and ours.

use std::error::Error;

use nalgebra::UnitVector3;
use paint_planner::plan::SmoothingPlanner;
use paint_planner::{OptimalPlanner, Plan, Planner};
use paint_sim::FlightSettings;
use paint_sim::flight::{FlightLog, FlightSample, FlightStatistics, Interlock, Valve};

use super::excerpt::excerpt;
use super::extent::Extent;
use super::table::{Table, number};
use crate::planned_stroke::{PlannedStroke, hose};

/// Flights of each column; of a quick run.
const FLIGHTS: [u64; 2] = [8, 1];

/// A plan, and flights along it in as many winds.
struct Column {
    stroke: PlannedStroke,
    flights: Vec<FlightLog>,
    /// The same with the interlock.
    held: Vec<FlightLog>,
}

impl Column {
    fn fly(planner: &dyn Planner, ptu_locked: bool, flights: u64) -> Result<Self, Box<dyn Error>> {
        let stroke = PlannedStroke::new(planner)?;
        let fly = |interlock: Option<Interlock>| {
            let flight = |seed| {
                let valve = Valve { interlock, ..Valve::default() };
                let settings =
                    FlightSettings { valve, ptu_locked, hose: Some(hose()), seed, ..FlightSettings::default() };
                stroke.fly_plan(&settings)
            };
            (0..flights).map(flight).collect::<Result<Vec<_>, _>>()
        };
        let (flights, held) = (fly(None)?, fly(Some(Interlock::default()))?);
        Ok(Self { stroke, flights, held })
    }

    fn statistics(&self) -> FlightStatistics {
        statistics(&self.flights)
    }

    /// Yaw and pitch of the gun off those of the plan, RMS over the samples with paint, degrees.
    fn gun_errors(&self) -> [f64; 2] {
        let open: Vec<[f64; 2]> = self
            .flights
            .iter()
            .flat_map(|log| &log.samples)
            .filter(|s| s.flow > 0.0)
            .map(|s| gun_error(&self.stroke.plan, s))
            .collect();
        [0, 1].map(|k| (open.iter().map(|e| e[k] * e[k]).sum::<f64>() / open.len().max(1) as f64).sqrt())
    }

    /// Share of the time for paint in which the interlock kept the valve shut.
    fn held_share(&self) -> f64 {
        let statistics = statistics(&self.held);
        statistics.held_samples as f64 / (statistics.held_samples + statistics.open_samples).max(1) as f64
    }
}

fn statistics(flights: &[FlightLog]) -> FlightStatistics {
    FlightStatistics::of(&flights.iter().map(|log| log.samples.as_slice()).collect::<Vec<_>>())
}

/// Yaw and pitch of the gun's axis off those that the plan has at this time, degrees.
fn gun_error(plan: &Plan, sample: &FlightSample) -> [f64; 2] {
    let angles = |axis: &UnitVector3<f64>| [axis.y.atan2(axis.x), axis.z.asin()];
    let (is, planned) = (angles(&sample.axis), angles(&plan.setpoint(sample.time).nozzle.direction));
    [0, 1].map(|k| {
        let off = is[k] - planned[k];
        off.sin().atan2(off.cos()).to_degrees()
    })
}

/// The table, and the curves of the figure.
///
/// # Errors
/// What planner and simulator refuse.
pub fn tables(extent: Extent) -> Result<Vec<Table>, Box<dyn Error>> {
    let flights = FLIGHTS[extent as usize];
    let columns = [
        Column::fly(&SmoothingPlanner, false, flights)?,
        Column::fly(&SmoothingPlanner, true, flights)?,
        Column::fly(&OptimalPlanner::default(), false, flights)?,
    ];
    let figures = columns.each_ref().map(Column::statistics);
    let guns = columns.each_ref().map(Column::gun_errors);
    let mut table = Table::new(
        "flown_baselines",
        &["figure", "Paper II (its planner)", "smoothing planner", "the same; gun locked at 0", "optimal planner"],
    );
    let mut row = |figure: &str, printed: &str, cells: [String; 3]| {
        let [a, b, c] = cells;
        table.row([figure.into(), printed.into(), a, b, c]);
    };
    let cm = |of: &dyn Fn(&FlightStatistics) -> f64| figures.each_ref().map(|s| number(100.0 * of(s), 2));
    let degrees = |of: &dyn Fn(&FlightStatistics) -> f64| figures.each_ref().map(|s| number(of(s).to_degrees(), 2));
    row("hit error; RMS; cm", "2.12", cm(&|s| s.hit_error_rms));
    row("hit error; 95 %; cm", "\"almost always\" 4", cm(&|s| s.hit_error_p95));
    let ratio = figures[1].hit_error_rms / figures[0].hit_error_rms;
    row("locked over turning; hit error", "\"almost 4 times\"", ["1".into(), number(ratio, 1), "-".into()]);
    row("gun off the planned yaw; RMS; degrees", "2.05", guns.map(|gun| number(gun[0], 2)));
    row("gun off the planned pitch; RMS; degrees", "3.94", guns.map(|gun| number(gun[1], 2)));
    row("pan off what would hit; RMS; degrees", "-", degrees(&|s| s.pan_error_rms));
    row("tilt off what would hit; RMS; degrees", "-", degrees(&|s| s.tilt_error_rms));
    row("distance from the surface; deviation; cm", "1.88", cm(&|s| s.nozzle_distance_std));
    let shut = columns.each_ref().map(|column| number(100.0 * column.held_share(), 1));
    row(
        "valve shut by the interlock (1.5 cm; 5 cm); % of the paint's time",
        "by distance alone; share not printed",
        shut,
    );
    Ok(vec![table, curves(&columns)])
}

/// Errors over half a minute of the first flight, as the figure has them.
fn curves([turning, locked, _]: &[Column; 3]) -> Table {
    let mut table =
        Table::new("fig_6_9", &["time_s", "hit_cm", "locked_hit_cm", "yaw_deg", "pitch_deg", "distance_cm"]);
    let hit = |s: &FlightSample| s.hit.zip(s.aim).map(|(hit, aim)| 100.0 * (hit - aim).norm());
    for (s, locked) in excerpt(&turning.flights[0], &locked.flights[0]) {
        let (Some(error), Some(locked)) = (hit(s), hit(locked)) else { continue };
        let [yaw, pitch] = gun_error(&turning.stroke.plan, s);
        let cells = [error, locked, yaw, pitch, 100.0 * (s.distance - s.wanted_distance)];
        let [a, b, c, d, e] = cells.map(|cell| number(cell, 3));
        table.row([number(s.time, 2), a, b, c, d, e]);
    }
    table
}
