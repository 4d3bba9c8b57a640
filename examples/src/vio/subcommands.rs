//! The subcommands of `vio`.

use std::path::{Path, PathBuf};

use vio_ekf::sim::{Scenario, SimulatedCamera};
use vio_ekf::tune::TuneSettings;
use vio_ekf::{CalibrationSettings, Camera, LandmarkSettings, Settings};

use super::command_line::{Arguments, Command, Eval, FlightName, Sim, Track, Tune};
use super::{
    Flight, Overrides, RunSettings, SimulationSettings, Tuning, TuningData, VioReport, compare, evaluate_run,
    open_euroc, open_euroc_stereo, open_mcap, run, save, simulate, tune_noise,
};
use crate::report::save_figures;

type AnyError = Box<dyn std::error::Error>;

/// Does what the command line asks for.
///
/// # Errors
/// What was wrong with which input or option; also if the filter diverged, though its files are written.
pub fn execute(arguments: &Arguments) -> Result<(), AnyError> {
    match &arguments.command {
        None => track(&arguments.track),
        Some(Command::Sim(sim)) => render(sim),
        Some(Command::Eval(eval)) => evaluate(eval),
        Some(Command::Tune(tune)) => search(tune),
    }
}

/// How far the calibration may be off with `--calibrate`: what a ruler and a guess leave.
fn rough_calibration() -> CalibrationSettings {
    CalibrationSettings {
        camera_position_sigma_m: 0.03,
        camera_attitude_sigma: 0.05,
        time_offset_sigma_s: 0.01,
        ..CalibrationSettings::default()
    }
}

fn track(arguments: &Track) -> Result<(), AnyError> {
    let folder = &arguments.out;
    make(folder)?;
    let overrides =
        Overrides { cameras: arguments.cameras.clone(), imu: arguments.imu.clone(), truth: arguments.truth.clone() };
    let recording = match (&arguments.euroc, &arguments.mcap) {
        (Some(folder), _) if arguments.stereo => open_euroc_stereo(folder, &overrides)?,
        (Some(folder), _) => open_euroc(folder, &overrides)?,
        (None, Some(file)) => open_mcap(file, &overrides)?,
        (None, None) => return Err("name a recording with --euroc or --mcap".into()),
    };
    let calibration = if arguments.calibrate { rough_calibration() } else { CalibrationSettings::default() };
    let landmarks = LandmarkSettings { max_count: arguments.features, ..LandmarkSettings::default() };
    let filter = Settings { landmarks, calibration, ..Settings::default() };
    filter.check()?;
    let findings = recording.check(filter.gravity)?;
    eprintln!(
        "{}: {} images, {} inertial samples at {:.0} Hz, {} gaps",
        recording.name,
        recording.images.count(),
        recording.samples.len(),
        findings.rate_hz,
        findings.gaps
    );
    let threads = threads(arguments.threads);
    let run = run(&recording, &RunSettings { filter, threads, ..RunSettings::default() })?;
    for why in run.skipped.iter().take(3) {
        eprintln!("left out: {why}");
    }
    for (stamp, why) in &run.lost {
        eprintln!("diverged at {stamp} s: {why}");
    }
    let evaluation = recording.truth.as_ref().map(|truth| evaluate_run(&run, truth)).transpose()?.flatten();
    let report = VioReport::new(&recording, &findings, &run, evaluation.as_ref(), threads)?;
    save(&report, &recording, &run, evaluation.as_ref(), folder)?;
    println!("{}", folder.join("report.md").display());
    // The files are there to look at, but such a trajectory is not to be relied on.
    if let Some((stamp, why)) = run.lost.last() {
        let then = if run.tracking_at_end { "was restarted" } else { "was not restarted" };
        return Err(format!("{}: the filter diverged at {stamp} s ({why}), and {then}", recording.name).into());
    }
    Ok(())
}

fn render(arguments: &Sim) -> Result<(), AnyError> {
    make(&arguments.out)?;
    let flight = match (&arguments.trajectory, arguments.flight) {
        (Some(file), _) => Flight::File(file.clone()),
        (None, FlightName::Room) => Flight::Room,
        (None, FlightName::Wall) => Flight::Wall,
    };
    let second =
        arguments.stereo.then(|| SimulatedCamera { camera: Camera::euroc_right(), ..SimulatedCamera::default() });
    let cameras = std::iter::once(SimulatedCamera::default()).chain(second).collect();
    let settings = SimulationSettings {
        flight,
        seconds: arguments.seconds,
        scenario: Scenario { seed: arguments.seed, cameras, ..Scenario::default() },
        mcap: arguments.mcap,
        raw: arguments.raw,
        threads: threads(arguments.threads),
    };
    let simulated = simulate(&settings, &arguments.out)?;
    eprintln!(
        "{} images, {} inertial samples, {:.1} m in {:.1} s",
        simulated.frames, simulated.samples, simulated.path_length_m, simulated.duration_s
    );
    println!("{}", arguments.out.display());
    Ok(())
}

fn evaluate(arguments: &Eval) -> Result<(), AnyError> {
    let comparison = compare(&arguments.reference, &arguments.estimate)?;
    print!("{}", comparison.table());
    if let Some(folder) = &arguments.out {
        make(folder)?;
        save_figures(&comparison, folder)?;
    }
    Ok(())
}

fn search(arguments: &Tune) -> Result<(), AnyError> {
    make(&arguments.out)?;
    let data = if arguments.euroc.is_empty() {
        TuningData::simulated(arguments.flights, arguments.seconds, arguments.seed)?
    } else {
        let open = |folder: &PathBuf| {
            let recording = open_euroc(folder, &Overrides::default())?;
            recording.check(Settings::default().gravity).map(|_| recording)
        };
        TuningData::Recordings(arguments.euroc.iter().map(open).collect::<Result<_, _>>()?)
    };
    let factors: [f64; 5] = arguments.start.as_slice().try_into().map_err(|_| "--start: give five factors")?;
    if !factors.iter().all(|factor| (1e-6..=1e6).contains(factor)) {
        return Err("--start: the factors must be between 1e-6 and 1e6".into());
    }
    let tuning = Tuning {
        search: TuneSettings { evaluations: arguments.evaluations, ..TuneSettings::default() },
        start: factors.map(f64::log10),
        consistency_weight: arguments.consistency.max(0.0),
        random: arguments.random,
        seed: arguments.seed,
        resume: arguments.resume,
        threads: threads(arguments.threads),
    };
    let report = tune_noise(&data, &tuning, &arguments.out)?;
    eprintln!(
        "position error {:.4} m at the start, {:.4} m now; NEES {:.1}, now {:.1}",
        report.ate_start_m, report.ate_best_m, report.nees_start, report.nees_best
    );
    if let Some(ratio) = report.ratio_to_random {
        let (worse, points, seconds) = (100.0 * (ratio - 1.0), report.random_samples, report.search_wall_s);
        eprintln!("{worse:+.1} % against the best of {points} random points, after {seconds:.1} s");
    }
    println!("{}", arguments.out.join("report.md").display());
    Ok(())
}

fn make(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("{}: cannot be created ({e}): choose another --out", folder.display()))
}

fn threads(asked: Option<usize>) -> usize {
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).clamp(1, 1024)
}
