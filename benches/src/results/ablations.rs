//! What Paper II shows without: headings that are not smoothed (thesis, Fig. 6.6), and a flight that has no model of the surface (section 7.3,
//! Fig. 6.10).

use std::error::Error;

use nalgebra::{Point3, Vector3};
use paint_planner::plan::SmoothingPlanner;
use paint_planner::trajectory::Sample;
use paint_planner::{Plan, Surface as _, Target};
use paint_sim::FlightSettings;
use paint_sim::flight::FlightSample;
use paintcopter::adapters::MeshSurface;
use paintcopter::mission::MissionSettings;

use super::table::{Table, number};
use crate::planned_stroke::{PlannedStroke, hose};

/// A span of LOWESS that holds no neighbour, m.
const RAW: f64 = 1e-3;
/// Beyond any limit of the vehicle.
const UNLIMITED: f64 = 1e6;

/// The table.
///
/// # Errors
/// What planner and simulator refuse.
pub fn tables() -> Result<Vec<Table>, Box<dyn Error>> {
    let mut table = Table::new("paper_ii_ablations", &["figure", "with", "without"]);
    let mut row = |figure: &str, values: [f64; 2], digits: usize| {
        let [with, without] = values.map(|value| number(value, digits));
        table.row([figure.into(), with, without]);
    };
    let usual = MissionSettings::default().planner.lowess.span;
    let plans = [heading_smoothing(usual)?, heading_smoothing(RAW)?];
    let of = |value: &dyn Fn(&Plan) -> f64| [value(&plans[0]), value(&plans[1])];
    row("Fig. 6.6; smoothing: rate of the heading; RMS; rad/s", of(&|p| rms(p, &|s| s.heading_rate)), 2);
    row("greatest; rad/s", of(&|p| p.report.extrema.heading_rate), 2);
    row("acceleration at the stroke's speed; RMS; m/s²", of(&|p| rms(p, &|s| s.acceleration.norm())), 2);
    row("way of the vehicle; m", of(&Plan::path_length), 1);
    let flights = [before_the_wall(true)?, before_the_wall(false)?];
    let names = [
        "Fig. 6.10; model of the surface: hit beside the pattern; RMS; cm",
        "distance of the nozzle; least; cm",
        "distance of the nozzle; largest; cm",
        "spray off the normal; RMS; degrees",
        "paint's time out of 5 to 15 cm; %",
    ];
    for (k, name) in names.into_iter().enumerate() {
        row(name, flights.map(|flight| flight[k]), 1);
    }
    Ok(vec![table])
}

/// Root mean square over the time of a plan.
fn rms(plan: &Plan, of: &dyn Fn(&Sample) -> f64) -> f64 {
    let squares: Vec<f64> = plan.setpoints(0.01).map(|(_, setpoint)| of(&setpoint.sample).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// The plan of the smoothing planner with such a span, its speed limited by nothing.
fn heading_smoothing(span: f64) -> Result<Plan, Box<dyn Error>> {
    let mut settings = MissionSettings::default();
    settings.planner.lowess.span = span;
    let timing = &mut settings.planner.timing;
    for limit in [
        &mut timing.max_speed,
        &mut timing.max_acceleration,
        &mut timing.max_spray_acceleration,
        &mut timing.max_heading_rate,
        &mut timing.max_joint_rate,
    ] {
        *limit = UNLIMITED;
    }
    Ok(PlannedStroke::with(&SmoothingPlanner, settings, &|_| ())?.plan)
}

/// A flight by the smoothing planner before the wall as it is, or with the gun forward before the plane through its foremost point: hits
/// beside the pattern as the wall shows it from the front, RMS, cm; least and largest distance of the nozzle, cm; spray off the normal, RMS,
/// degrees; share of the time for paint with the nozzle out of the range of section 7.1, %.
fn before_the_wall(modelled: bool) -> Result<[f64; 5], Box<dyn Error>> {
    let flat = |targets: &mut Vec<Target>| {
        let foremost = targets.iter().map(|target| target.point.x).fold(f64::INFINITY, f64::min);
        for target in targets.iter_mut().filter(|_| !modelled) {
            (target.point.x, target.normal) = (foremost, -Vector3::x_axis());
        }
    };
    let stroke = PlannedStroke::with(&SmoothingPlanner, MissionSettings::default(), &flat)?;
    let settings = FlightSettings { hose: Some(hose()), ptu_locked: !modelled, ..FlightSettings::default() };
    let log = stroke.fly_plan(&settings)?;
    let wall = MeshSurface(&stroke.surface.world);
    // Where the pattern is on the wall, seen from the front.
    let wanted =
        |aim: &Point3<f64>| wall.cast(&(aim - 2.0 * Vector3::x()), &Vector3::x_axis(), 5.0).map(|hit| hit.point);
    let (mut squares, mut angles, mut out, mut count) = (0.0, 0.0, 0.0, 0.0_f64);
    let [mut least, mut largest] = [f64::INFINITY, 0.0_f64];
    for sample in log.samples.iter().filter(|sample| sample.flow > 0.0) {
        let FlightSample { hit: Some(hit), aim: Some(aim), distance, .. } = sample else { continue };
        let Some(wanted) = wanted(aim) else { continue };
        let Some(met) = wall.cast(&sample.nozzle, &sample.axis, 5.0) else { continue };
        count += 1.0;
        squares += (hit - wanted).norm_squared();
        angles += met.normal.dot(&-sample.axis.into_inner()).clamp(-1.0, 1.0).acos().powi(2);
        out += if (0.05..=0.15).contains(distance) { 0.0 } else { 1.0 };
        (least, largest) = (least.min(*distance), largest.max(*distance));
    }
    let count = count.max(1.0);
    Ok([
        100.0 * (squares / count).sqrt(),
        100.0 * least,
        100.0 * largest,
        (angles / count).sqrt().to_degrees(),
        100.0 * out / count,
    ])
}
