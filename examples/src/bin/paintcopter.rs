//! Paints a surface end to end: unwrap, decide, plan, fly, spray, report.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::interruption::Finishing;
use paintcopter::mission::{Coats, preview, preview_picture, save_flown};
use paintcopter::mission_arguments::MissionArguments;
use paintcopter::{result, say};

/// Paints a surface with a simulated flying robot: unwraps it, decides what to spray, plans and flies the strokes, and shows
/// what the paint looks like. Without arguments it paints a mural in six paints on a built-in rock wall.
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
    run_program("paintcopter", run)
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let mission_file = arguments.mission.mission_file()?.or_mural();
    if !arguments.preview {
        mission_file.settings.check_simulated()?;
    }
    mission_file.begin_run(folder, "paintcopter")?;
    let coats = mission_file.decide_coats(folder)?;
    if arguments.preview {
        if let Some(found) = preview_picture(&coats, folder)? {
            say!("{}", found.summary());
            result!("{}", folder.join("expected.png").display());
            return Ok(());
        }
        for coat in coats.coats {
            std::fs::create_dir_all(&coat.folder)?;
            let found = preview(&coat.task, &coat.folder)?;
            say!("{}", found.summary());
            result!("{}", coat.folder.join("preview.png").display());
        }
        return Ok(());
    }
    let coats = Coats::run(coats).map_err(|error| mission_file.in_mesh(error))?;
    // What is flown is not lost.
    let _finishing = Finishing::begin();
    say!("{}", save_flown(&coats, folder)?.summary());
    result!("{}", folder.join("report.md").display());
    coats.grounded().cloned().map_or(Ok(()), |grounded| Err(grounded.into()))
}
