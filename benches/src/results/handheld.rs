//! The handheld paper: Table I, the ranks of its Fig. 5, and the displaced object of its Fig. 7.

use std::error::Error;
use std::path::Path;

use clap::Parser as _;
use paintcopter::handheld::{Arguments, HandheldError, run};
use serde_json::Value;

use super::extent::Extent;
use super::table::{Table, number};

/// Runs `handheld` and returns its report, that of a painting that was not finished included.
pub(super) fn report(scratch: &Path, name: &str, options: &[&str]) -> Result<Value, Box<dyn Error>> {
    let folder = scratch.join(name);
    let out = format!("--out={}", folder.display());
    let line = ["handheld".into(), out].into_iter().chain(options.iter().map(ToString::to_string));
    match run(&Arguments::try_parse_from(line)?) {
        Err(HandheldError::Unfinished { .. }) | Ok(()) => {}
        Err(error) => return Err(error.into()),
    }
    Ok(serde_json::from_str(&std::fs::read_to_string(folder.join("report.json"))?)?)
}

pub(super) fn figure(report: &Value, name: &str) -> Result<f64, Box<dyn Error>> {
    report[name].as_f64().ok_or_else(|| format!("report.json of handheld lacks {name}").into())
}

/// The table, and the curves of Fig. 5.
///
/// # Errors
/// Those of `handheld`, and files that it did not leave.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let (scenarios, seeds, seconds) = match extent {
        Extent::Whole => ("--seeds=10", 1..=5, "--seconds=20"),
        Extent::Quick => ("--seeds=1", 1..=1, "--seconds=5"),
    };
    let planned = report(scratch, "handheld-evaluated", &["--evaluate", scenarios, seconds])?;
    let mut table = Table::new("handheld", &["figure", "paper", "here"]);
    let mut row = |figure: &str, printed: &str, here: String| table.row([figure.into(), printed.into(), here]);
    let time = |planner: &str| -> Result<String, Box<dyn Error>> {
        let [mean, deviation] = ["mean", "deviation"].map(|of| figure(&planned, &format!("{planner}_ms_{of}")));
        Ok(format!("{:.1}; {:.1}", mean?, deviation?))
    };
    let percent = |name: &str| figure(&planned, name).map(|share| number(100.0 * share, 2));
    row("Table I: proposed; mean and deviation; ms", "32.6; 3.27", time("decision")?);
    row("Table I: greedy; mean and deviation; ms", "116.84; 3.20", time("greedy")?);
    row("Fig. 5: proposed; mean rank; %", "15", percent("mean_rank_fraction")?);
    row("Fig. 5: Eqs. (1); (3); (4) as printed; mean rank; %", "15", percent("paper_literal_mean_rank_fraction")?);
    row("Fig. 5: proposed; in the best 5 %; % of trials", "\"most\"", percent("top5_share")?);
    row("Fig. 5: greedy; mean rank; %", "53 (59.6 by its ranks)", percent("greedy_mean_rank_fraction")?);
    row("Fig. 5: random; mean rank; %", "50 expected", percent("random_mean_rank_fraction")?);
    for (name, correction) in [("as it is", None), ("corrected while painting", Some("--correct-registration"))] {
        let (mut beside, mut left) = (Vec::new(), 0.0_f64);
        for seed in seeds.clone() {
            let seed = format!("--seed={seed}");
            let options = ["--registration-error=0.006", seconds, &seed].into_iter().chain(correction);
            let painted = report(scratch, "handheld-displaced", &options.collect::<Vec<_>>())?;
            let [inside, outside, above] =
                ["inside", "outside", "above"].map(|of| figure(&painted, &format!("paint_{of}_fraction")));
            let outside = outside?;
            beside.push(100.0 * outside / (inside? + outside + above?));
            left = left.max(1e3 * figure(&painted, "registration_error_m")?);
        }
        let worst = beside.iter().copied().fold(0.0, f64::max);
        let mean = beside.iter().sum::<f64>() / beside.len() as f64;
        row(&format!("Fig. 7: object 6 mm off; {name}: error left; worst; mm"), "up to 6", number(left, 1));
        row("of its paint beside the circles; mean; worst of five seeds; %", "-", format!("{mean:.0}; {worst:.0}"));
    }
    let text = std::fs::read_to_string(scratch.join("handheld-evaluated/ranks.csv"))?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let mut curves = Table::new("handheld_fig_5", &head);
    curves.rows.extend(lines.map(|line| line.split(',').map(String::from).collect()));
    Ok(vec![table, curves])
}
