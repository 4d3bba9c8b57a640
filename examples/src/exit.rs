//! How a program begins and ends: its command line, what all programs have in common, its exit code.

use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use clap::{ArgAction, Args, Command, CommandFactory, FromArgMatches};
use clap_complete::Shell;

use crate::mcap_messages::ros2::write_ros2_beside;
use crate::{console, interruption, log, run_folder, say};

/// Version and, where it was built from a repository, its revision.
const VERSION: &str = env!("PAINTCOPTER_VERSION");

// Options that all programs have. No documentation: clap would take it for what the program does.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
struct CommonArguments {
    /// Say nothing but warnings and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Show what the libraries do, with times; twice: in detail. By library: `RUST_LOG=vio_ekf=debug`
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
    /// Print report.json, and nothing else, to stdout
    #[arg(long, global = true)]
    json: bool,
    /// Write every recording NAME.mcap once more as NAME.ros2.mcap, which ROS 2 tools read whole: CDR, profile ros2
    #[arg(long, global = true)]
    ros2: bool,
    /// Print a script that completes this command line in a shell, and end
    #[arg(long, global = true, value_name = "SHELL", exclusive = true)]
    completions: Option<Shell>,
    /// Print this program's manual page (roff), and end
    #[arg(long, global = true, exclusive = true)]
    manual: bool,
}

/// Runs a program with its command line; an error is told in one line that begins with its name. The exit code is 0 where the result is
/// usable, 1 where not, 2 where the command line is none, and [`interruption::EXIT_CODE`] where somebody has ended it, whatever there is then.
pub fn run_program<A, E>(program: &'static str, run: impl FnOnce(&A) -> Result<(), E>) -> ExitCode
where
    A: CommandFactory + FromArgMatches,
    E: Display,
{
    let mut command = command::<A>(program);
    let matches = command.get_matches_mut();
    let common = match CommonArguments::from_arg_matches(&matches) {
        Ok(common) => common,
        Err(error) => error.format(&mut command).exit(),
    };
    match print_about(&mut command, &common) {
        Ok(false) => {}
        Ok(true) => return ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{program}: stdout: {error}");
            return ExitCode::FAILURE;
        }
    }
    // Only now: who asks for a manual leaves out what is required.
    let arguments = match A::from_arg_matches(&matches) {
        Ok(arguments) => arguments,
        Err(error) => error.format(&mut command).exit(),
    };
    interruption::watch(program);
    console::configure(common.quiet, common.json);
    log::subscribe(common.verbose);
    let result = run(&arguments).map_err(|error| error.to_string());
    // What is not good enough is written all the same.
    let again = common.ros2 && !interruption::is_requested();
    let result = result.and(if again { write_for_ros2() } else { Ok(()) });
    for report in run_folder::end() {
        if common.json {
            print(&report);
        }
    }
    if let Err(error) = &result {
        eprintln!("{program}: {error}");
    }
    match result {
        _ if interruption::is_requested() => interruption::EXIT_CODE.into(),
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

/// A program's command line with what all of them have.
fn command<A: CommandFactory>(program: &'static str) -> Command {
    CommonArguments::augment_args(A::command()).name(program).bin_name(program).version(VERSION)
}

/// Prints a shell script or manual page that was asked for; whether there was one.
fn print_about(command: &mut Command, common: &CommonArguments) -> std::io::Result<bool> {
    let mut out = std::io::stdout().lock();
    if let Some(shell) = common.completions {
        let name = command.get_name().to_string();
        clap_complete::generate(shell, command, name, &mut out);
    } else if common.manual {
        let name = command.get_name().to_string();
        clap_mangen::Man::new(command.clone()).render(&mut out)?;
        for part in command.get_subcommands().filter(|part| part.get_name() != "help") {
            let name = format!("{name} {}", part.get_name());
            clap_mangen::Man::new(part.clone().display_name(&name).bin_name(&name)).render(&mut out)?;
        }
    }
    Ok(common.completions.is_some() || common.manual)
}

fn write_for_ros2() -> Result<(), String> {
    for recording in run_folder::written("mcap") {
        let written = write_ros2_beside(&recording)?;
        say!("{}", written.display());
    }
    Ok(())
}

fn print(report: &Path) {
    match std::fs::read_to_string(report) {
        Ok(text) => print!("{text}"),
        Err(error) => eprintln!("{}: cannot be read again ({error})", report.display()),
    }
}
