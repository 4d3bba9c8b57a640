//! Paints a surface end to end: unwrap, decide, plan, fly, spray, report.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::exit::exit_code;
use paintcopter_examples::mission::{Mission, preview, save};
use paintcopter_examples::mission_arguments::MissionArguments;

/// Paints a surface with a simulated flying robot: unwraps it, decides what to spray, plans and flies the strokes, and shows
/// what the paint looks like. Without arguments it paints a built-in rock wall.
#[derive(Parser)]
#[command(version, after_help = "Example:\n  paintcopter --mesh bust.obj --design stripes --out out/bust")]
struct Arguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// Show what it would look like and estimate time, paint and reach; plan and fly nothing
    #[arg(long)]
    preview: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/paintcopter")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit_code("paintcopter", run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let mission_file = arguments.mission.mission_file()?;
    mission_file.write_into(folder)?;
    let decision = mission_file.decide(folder)?;
    if arguments.preview {
        let found = preview(&decision, folder)?;
        eprintln!("{}", found.summary());
        println!("{}", folder.join("preview.png").display());
        return Ok(());
    }
    let mission = Mission::run(decision).map_err(|error| mission_file.in_mesh(error))?;
    let report = save(&mission, folder)?;
    eprintln!("{}", report.summary());
    println!("{}", folder.join("report.md").display());
    Ok(())
}
