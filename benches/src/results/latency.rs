//! Latencies of the VR letter, its Fig. 6 (thesis, Fig. 7.6), at the letter's two configurations and at ours.

use std::error::Error;
use std::path::Path;

use clap::Parser as _;
use paintcopter::vr::{Arguments, run};

use super::extent::Extent;
use super::program_report::ProgramReport;
use super::table::{Table, number};

/// Length of the segments, speed of hand and robot (m, m/s), and the printed latencies: the letter's two, then ours.
const RUNS: [Run; 3] = [
    Run {
        name: "1 m; robot 8 cm/s",
        options: &["--segment=1", "--robot-speed=0.08"],
        printed: ["10 to 15", "1 to 1.5", "356"],
    },
    Run {
        name: "0.5 m; robot 15 cm/s",
        options: &["--segment=0.5", "--robot-speed=0.15"],
        printed: ["5 to 8", "0.3 to 0.9", "189"],
    },
    Run { name: "ours: 0.1 m; robot 40 cm/s", options: &[], printed: ["-"; 3] },
];
/// The hand waits so long for the robot, s.
const ARRIVAL: f64 = 10.0;
/// Within this time after it the first segment of 1 m is there, s: before, nothing is late yet.
const FIRST_SEGMENT: f64 = 15.0;
/// Speed of the hand, m/s, and length of its way, m.
const HAND: f64 = 0.08;
const WAY: f64 = 7.75;

struct Run {
    name: &'static str,
    options: &'static [&'static str],
    printed: [&'static str; 3],
}

/// The table, and the curves of each configuration.
///
/// # Errors
/// Those of `vr`, and files that it did not leave.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let head = [
        "segments; hand 8 cm/s",
        "latency in time; s; printed",
        "here",
        "in distance; m; printed",
        "here",
        "planning; ms; printed",
        "here; median",
        "plans",
    ];
    let mut table = Table::new("latency", &head);
    let mut curves = Table::new("fig_7_6", &["run", "curve", "time_s", "value"]);
    // A quick run flies the shorter segments alone.
    let runs = if extent == Extent::Quick { &RUNS[1..2] } else { &RUNS[..] };
    for (k, of) in runs.iter().enumerate() {
        let folder = scratch.join(format!("latency-{k}"));
        let fixed = ["vr".into(), "--experiment=area-fill".into(), format!("--hand-speed={HAND}")];
        let out = format!("--out={}", folder.display());
        let line = fixed.into_iter().chain([out]).chain(of.options.iter().map(ToString::to_string));
        run(&Arguments::try_parse_from(line)?)?;
        let report = ProgramReport::read(&folder)?;
        let latencies = std::fs::read_to_string(folder.join("latency.csv"))?;
        let mut ranges = Vec::new();
        for (curve, digits) in [("time_s", 1), ("distance_m", 2)] {
            let points = points(&latencies, curve)?;
            // While hand and robot both paint: after the first segment has come, until the hand stops.
            let painting =
                points.iter().filter(|[time, _]| (ARRIVAL + FIRST_SEGMENT..ARRIVAL + WAY / HAND).contains(time));
            let [least, most] = painting.fold([f64::INFINITY, 0.0], |[a, b]: [f64; 2], [_, v]| [a.min(*v), b.max(*v)]);
            ranges.push(format!("{least:.digits$} to {most:.digits$}"));
            // Lags come every tenth of a second.
            let stride = if curve == "distance_m" { 10 } else { 1 };
            for [time, value] in points.into_iter().step_by(stride) {
                curves.row([(k + 1).to_string(), curve.into(), number(time, 1), number(value, 3)]);
            }
        }
        let [time, distance, planning] = of.printed.map(String::from);
        let [in_time, in_distance] = [ranges[0].clone(), ranges[1].clone()];
        let planned = number(report.figure("planning_median_ms")?, 1);
        let plans = number(report.figure("paint_tasks")?, 0);
        table.row([of.name.into(), time, in_time, distance, in_distance, planning, planned, plans]);
    }
    Ok(vec![table, curves])
}

/// Time and value of the rows of one curve.
fn points(latencies: &str, curve: &str) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    let mut points = Vec::new();
    for line in latencies.lines().skip(1) {
        if let [time, name, value] = line.split(',').collect::<Vec<_>>()[..]
            && name == curve
        {
            points.push([time.parse()?, value.parse()?]);
        }
    }
    Ok(points)
}
