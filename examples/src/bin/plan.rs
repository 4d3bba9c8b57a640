//! Plans a mission and exports it: nothing is flown, nothing is sprayed.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::mission::{PlannedCoats, save_plan};
use paintcopter::mission_arguments::MissionArguments;
use paintcopter::{result, say};

/// Plans a painting mission without flying it: the trajectory with nozzle and valve as a table and as a recording, a picture of
/// the way, and the figures. The mission.toml that it leaves is what `paintcopter --mission` flies.
#[derive(Parser)]
#[command(
    name = "plan",
    version,
    after_help = "Example:\n  plan --mesh wall.obj --design text.png --painter centrelines --out out/text"
)]
struct Arguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/plan")]
    out: PathBuf,
}

fn main() -> ExitCode {
    run_program("plan", run)
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let mission_file = arguments.mission.mission_file()?;
    mission_file.begin_run(folder, "plan")?;
    let coats = mission_file.decide_coats(folder)?;
    for (folder, mission) in PlannedCoats::new(coats).map_err(|error| mission_file.in_mesh(error))?.missions {
        std::fs::create_dir_all(&folder)?;
        let figures = save_plan(&mission, &folder)?;
        say!("{}", figures.summary());
        result!("{}", folder.join("plan.csv").display());
    }
    Ok(())
}
