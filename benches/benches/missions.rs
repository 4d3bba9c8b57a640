//! Paints the built-in rock once per seed and holds every figure of the report against what is asked of it.
//!
//! `cargo bench -p paintcopter-benches --bench missions -- --seeds 1..10`

use std::error::Error;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use paintcopter::design::Design;
use paintcopter::mission::{Mission, MissionSettings, PaintingTask, inspect, report, save};
use paintcopter::region::Scene;
use paintcopter::report::Check;
use paintcopter::world::rock_wall;

/// Most missions of one run: more is a slip of the keyboard.
const MOST_SEEDS: u64 = 1000;

/// Runs the main job on the built-in rock for every seed and prints one table of its figures; fails if one of them is not
/// what is asked for.
#[derive(Parser)]
struct Arguments {
    /// Seeds, first and last included: A..B, or one alone
    #[arg(long, default_value = "1..10", value_parser = seeds)]
    seeds: RangeInclusive<u64>,
    /// Worker threads of a mission [default: all cores]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Keep pictures and reports, one folder per seed in this one
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What `cargo bench` says; without it nothing is run
    #[arg(long, hide = true)]
    bench: bool,
}

fn seeds(text: &str) -> Result<RangeInclusive<u64>, String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let number = |text: &str| text.parse::<u64>().map_err(|_| format!("\"{text}\" is not a seed; give A..B"));
    let (first, last) = (number(first)?, number(last)?);
    match last.checked_sub(first) {
        Some(more) if more < MOST_SEEDS => Ok(first..=last),
        Some(_) => Err(format!("at most {MOST_SEEDS} seeds")),
        None => Err("the first seed must not be larger than the last".into()),
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if !arguments.bench {
        // `cargo test --all-targets` starts benches as well.
        eprintln!("missions: skipped; run `cargo bench -p paintcopter-benches --bench missions`");
        return ExitCode::SUCCESS;
    }
    let (mut missions, mut failed) = (Vec::new(), 0);
    for seed in arguments.seeds {
        let clock = Instant::now();
        let folder = arguments.out.as_ref().map(|out| out.join(format!("seed-{seed}")));
        match checks(seed, arguments.threads, folder.as_deref()) {
            Ok(checks) => missions.push((seed, checks)),
            Err(error) => {
                eprintln!("missions: seed {seed}: {error}");
                failed += 1;
            }
        }
        eprintln!("seed {seed}: {:.0} s", clock.elapsed().as_secs_f64());
    }
    print!("{}", table(&missions));
    let missed = missions.iter().flat_map(|(_, checks)| checks).filter(|c| !c.holds()).count();
    if missed + failed == 0 {
        return ExitCode::SUCCESS;
    }
    eprintln!("missions: {missed} figures are not what is asked for, {failed} missions failed");
    ExitCode::FAILURE
}

fn checks(seed: u64, threads: Option<u16>, folder: Option<&Path>) -> Result<Vec<Check>, Box<dyn Error>> {
    let mut settings = MissionSettings { seed, ..MissionSettings::default() };
    if let Some(threads) = threads {
        settings.threads = threads.into();
    }
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}; choose another --out", folder.display()))?;
    }
    let mission = Mission::run(PaintingTask::new(
        "Rock wall",
        &Scene::whole(rock_wall(seed)),
        &Design::Strata { seed },
        settings,
    )?)?;
    let report = match folder {
        Some(folder) => save(&mission, folder)?,
        None => report(&mission, &inspect(&mission)?)?,
    };
    Ok(report.checks())
}

/// One row per figure, one column per seed.
fn table(missions: &[(u64, Vec<Check>)]) -> String {
    let seeds = missions.iter().map(|(seed, _)| format!("seed {seed}"));
    let head = ["figure".into(), "asked for".into()].into_iter().chain(seeds).chain(["worst".into(), "holds".into()]);
    let mut rows = vec![head.collect::<Vec<String>>()];
    let count = missions.first().map_or(0, |(_, checks)| checks.len());
    for k in 0..count {
        let column: Vec<&Check> = missions.iter().map(|(_, checks)| &checks[k]).collect();
        let show = |check: &Check| check.unit.show(check.value);
        // Nothing is worse than a NaN.
        let margin = |check: &Check| if check.value.is_nan() { f64::NEG_INFINITY } else { check.margin() };
        let worst = column.iter().copied().min_by(|a, b| margin(a).total_cmp(&margin(b)));
        let mut row = vec![column[0].figure.to_string(), column[0].requirement_text()];
        row.extend(column.iter().map(|c| show(c)));
        row.push(worst.filter(|c| c.margin() != f64::INFINITY).map_or("-".into(), show));
        row.push(if column.iter().all(|c| c.holds()) { "yes".into() } else { "NO".into() });
        rows.push(row);
    }
    aligned(&rows)
}

/// The rows as a Markdown table with columns of even width, the first row as its head.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        for (cell, &width) in row.iter().zip(&widths) {
            text += &format!("| {cell:width$} ");
        }
        text += "|\n";
        if k == 0 {
            for width in &widths {
                text += &format!("|{}", "-".repeat(width + 2));
            }
            text += "|\n";
        }
    }
    text
}
