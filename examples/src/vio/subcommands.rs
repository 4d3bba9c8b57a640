//! The subcommands of `vio`.

use std::path::{Path, PathBuf};

use vio_ekf::format::calibration::read_kalibr_cameras;
use vio_ekf::imu_check::{ImuValidation, ImuWarning, check_axes_with_images, diagnose_axes};
use vio_ekf::lie::so3;
use vio_ekf::run::{
    CalibrationDoubt, CalibrationPart, Loss, Picture, RecordedFrame, Run, check_calibration, evaluate_run,
};
use vio_ekf::sim::{Scenario, SimulatedCamera};
use vio_ekf::tune::TuneSettings;
use vio_ekf::{Camera, Settings};

use super::arguments::{Arguments, Command, Eval, FlightName, Sim, Track, Tune};
use super::error::{read_text, write_file};
use super::inertial::dead_reckon;
use super::run::filter;
use super::{
    CompareSettings, Flight, GreyImage, Overrides, Recording, RunSettings, SimulationSettings, TimedRun, Tuning,
    TuningData, VioError, VioReport, camera_frames, compare, open_euroc, open_euroc_stereo, open_mcap,
    open_mcap_stereo, run, save, simulate, tune_noise,
};
use crate::interruption::{self, Finishing};
use crate::report::save_figures;
use crate::run_folder;
use crate::worker_threads::worker_threads;
use crate::{result, say};

/// Images of which the first that can be read tells the size.
const LOOKED_AT: usize = 20;
/// Checks of `--calibrate` at most.
const MAX_CHECKS: usize = 4;
/// Share of the images that may be left out of a run that counts as a success.
const MAX_LEFT_OUT: f64 = 0.1;

/// The ways in.
const NO_RECORDING: &str =
    "name a recording: --euroc DIR, or --mcap FILE; without one, `vio sim --out DIR` makes a folder for --euroc";

type AnyError = Box<dyn std::error::Error>;

/// Does what the command line asks for.
///
/// # Errors
/// What was wrong with which input or option; also if the filter diverged, though its files are written.
pub fn execute(arguments: &Arguments) -> Result<(), AnyError> {
    match &arguments.command {
        None => track(&arguments.track),
        Some(Command::Sim(sim)) => render(sim),
        Some(Command::Inertial(inertial)) => {
            make(&inertial.out, "vio-inertial")?;
            say!("{}", dead_reckon(inertial)?.summary());
            result!("{}", inertial.out.display());
            Ok(())
        }
        Some(Command::Eval(eval)) => evaluate(eval),
        Some(Command::Tune(tune)) => search(tune),
    }
}

/// The settings of the file, if there is one, changed by the options.
fn filter_settings(arguments: &Track) -> Result<Settings, AnyError> {
    let mut filter = match &arguments.settings {
        Some(path) => toml::from_str(&read_text(path)?).map_err(|error| VioError::malformed(path, &error))?,
        None => Settings::default(),
    };
    if let Some(features) = arguments.features {
        filter.landmarks.max_count = features;
    }
    filter.check()?;
    Ok(filter)
}

/// An image of the size of the camera's.
fn read_mask(path: &Path, camera: &Camera) -> Result<GreyImage, AnyError> {
    let mask = GreyImage::read(path)?;
    let (given, expected) = ((mask.width, mask.height), (camera.width, camera.height));
    if given == expected {
        return Ok(mask);
    }
    Err(VioError::malformed(path, &vio_ekf::Error::ImageSize { given, expected }).into())
}

fn track(arguments: &Track) -> Result<(), AnyError> {
    if arguments.euroc.is_none() && arguments.mcap.is_none() {
        return Err(NO_RECORDING.into());
    }
    let folder = &arguments.out;
    make(folder, "vio")?;
    let overrides = Overrides {
        cameras: arguments.cameras.clone(),
        imu: arguments.imu.clone(),
        truth: arguments.truth.clone(),
        camera_topics: arguments.camera_topic.clone(),
        imu_topic: arguments.imu_topic.clone(),
    };
    let mut recording = match (&arguments.euroc, &arguments.mcap) {
        (Some(folder), _) if arguments.stereo => open_euroc_stereo(folder, &overrides)?,
        (Some(folder), _) => open_euroc(folder, &overrides)?,
        (None, Some(file)) if arguments.stereo => open_mcap_stereo(file, &overrides)?,
        (None, Some(file)) => open_mcap(file, &overrides)?,
        (None, None) => return Err(NO_RECORDING.into()),
    };
    recording.mask = arguments.mask.as_ref().map(|path| read_mask(path, &recording.camera.camera)).transpose()?;
    let filter = filter_settings(arguments)?;
    check_first_images(&recording)?;
    recording.assumed.iter().for_each(|assumed| eprintln!("warning: {assumed}"));
    let mut findings = check_samples(&recording, filter.gravity, arguments.accept_imu)?;
    say!("{}: {} images, {} inertial samples", recording.name, recording.images.count(), recording.samples.len());
    if !recording.unused.is_empty() {
        say!(
            "topics that are not used: {} (choose with --camera-topic and --imu-topic; a second camera goes along with --stereo)",
            recording.unused.join(", ")
        );
    }
    if let Some(findings) = &mut findings {
        let camera = recording.camera;
        let known = (filter.gravity, camera.time_offset_s);
        let frames = camera_frames(&recording);
        let mask = recording.mask.as_ref().map(Picture::view);
        let seen_by = (&camera.camera, mask.as_ref());
        findings.warnings.extend(check_axes_with_images(&recording.samples, frames, seen_by, known)?);
        say!("inertial sensor: {:.0} Hz, {} gaps", findings.rate_hz, findings.gaps);
        findings.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        match findings.refuse_contradicted() {
            Err(error) if arguments.accept_imu => eprintln!("warning: {error}; taken as they are (--accept-imu)"),
            other => other.map_err(|error| format!("{}: {error}", recording.name))?,
        }
    }
    let threads = worker_threads(arguments.threads);
    let mut settings = RunSettings { filter, threads, ..RunSettings::default() };
    let given = recording.camera.camera.body_from_camera.rotation;
    let left = if arguments.calibrate { calibrate(&mut recording, &mut settings)? } else { None };
    let _finishing = Finishing::begin();
    let (timed, doubt) = if arguments.calibrate {
        (run(&recording, &settings), left)
    } else {
        with_calibration_check(&recording, &settings)
    };
    if let Some(doubt) = &doubt {
        eprintln!("warning: {}", calibration_advice(doubt, arguments.calibrate));
    }
    let is_static = |warning: &&ImuWarning| matches!(warning, ImuWarning::StaticView { .. });
    let static_view = findings.as_ref().and_then(|findings| findings.warnings.iter().find(is_static));
    let found = Found { static_view: static_view.map(ToString::to_string), doubt, is_calibrated: arguments.calibrate };
    let timed = match timed {
        // Pictures that cannot be used have nothing to do with axes.
        Err(error @ VioError::Pictures { .. }) => return Err(error.into()),
        Err(VioError::Unusable { recording: name, why }) => {
            return Err(format!("{name}: {}", with_cause(why, &found, &recording, &settings)).into());
        }
        other => other?,
    };
    let run = &timed.run;
    for why in run.skipped.iter().take(3) {
        say!("left out: {why}");
    }
    if let Some(matrix) = run.accel_matrix() {
        let scale = [0, 1, 2].map(|axis| 100.0 * (matrix[(axis, axis)].recip() - 1.0));
        let [x, y, z] = scale.map(|percent| format!("{percent:+.1}"));
        say!(
            "the accelerometer was not found to be calibrated: it reads {x}, {y}, {z} % on its axes (accel_matrix in report.json)"
        );
    }
    for Loss { stamp, reason: why } in &run.lost {
        say!("diverged at {stamp} s: {why}");
    }
    let evaluation = recording.truth.as_ref().map(|truth| evaluate_run(run, truth)).transpose()?.flatten();
    write_file(&folder.join("settings.toml"), toml::to_string(&settings.filter)?.as_bytes())?;
    let mut report = VioReport::new(&recording, findings.as_ref(), &timed, evaluation.as_ref(), threads)?;
    report.extrinsics_error_rad = so3::angle_between(&given, &run.calibration.body_from_camera.rotation);
    save(&report, &recording, run, evaluation.as_ref(), folder)?;
    result!("{}", folder.join("report.md").display());
    if run.segments.len() > 1 {
        say!("{} segments, each in a world of its own: see trajectory.tum and report.json", run.segments.len());
    }
    if run.withdrawn > 0 {
        say!("{} poses were taken back: wrong starts, or contradicted before a divergence", run.withdrawn);
    }
    // The files are there to look at, but such a trajectory is not to be relied on.
    usable(&recording, run).map_err(|why| with_cause(why, &found, &recording, &settings).into())
}

/// Corrects the calibration of a recording, and lets the run estimate what is left of what was doubted: checks until nothing is doubted,
/// because a first estimate far from what is given is not at its best. What is doubted at the last check, or cannot be put right.
fn calibrate(recording: &mut Recording, settings: &mut RunSettings) -> Result<Option<CalibrationDoubt>, VioError> {
    let (mut freed, mut left) = (settings.filter, None);
    for _ in 0..MAX_CHECKS {
        let filter = filter(recording, settings, true)?;
        left = check_calibration(&filter, &recording.samples, || camera_frames(recording));
        let Some(doubt) = &left else { break };
        say!("calibration: {doubt}");
        recording.correct_calibration(doubt);
        freed = doubt.freed(&freed);
        if doubt.found.is_none() {
            break;
        }
    }
    say!("calibration in use: {}", recording.calibration_words());
    settings.filter = freed;
    Ok(left)
}

/// The run, and beside it, on a second thread if there is one, what the images say against the calibration.
fn with_calibration_check(
    recording: &Recording,
    settings: &RunSettings,
) -> (Result<TimedRun, VioError>, Option<CalibrationDoubt>) {
    let check = || {
        let filter = filter(recording, settings, true).ok()?;
        check_calibration(&filter, &recording.samples, || camera_frames(recording))
    };
    if settings.threads < 2 {
        return (run(recording, settings), check());
    }
    std::thread::scope(|scope| {
        let beside = scope.spawn(check);
        let timed = run(recording, settings);
        (timed, beside.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}

/// What is doubted of the calibration, and what to do.
fn calibration_advice(doubt: &CalibrationDoubt, is_calibrated: bool) -> String {
    let way_out = if doubt.parts.contains(&CalibrationPart::CameraOrder) {
        "exchange the cameras"
    } else if is_calibrated {
        "that was put right, and may not be enough: calibrate anew"
    } else {
        "run with --calibrate, or calibrate anew"
    };
    format!("the images contradict the calibration: {doubt}: {way_out}")
}

/// Refuses a recording whose images are of another size than the calibration's, before anything is looked for in them.
fn check_first_images(recording: &Recording) -> Result<(), VioError> {
    recording.check_clocks()?;
    let readable = |frame: RecordedFrame<GreyImage>| frame.picture.ok();
    let Some(first) = camera_frames(recording).take(LOOKED_AT).find_map(readable) else { return Ok(()) };
    let camera = recording.camera.camera;
    let (given, expected) = ((first.width, first.height), (camera.width, camera.height));
    if given == expected {
        return Ok(());
    }
    let why = vio_ekf::Error::ImageSize { given, expected }.to_string();
    Err(VioError::Unusable { recording: recording.name.clone(), why })
}

/// The test of the inertial samples; `None` if they are accepted though they fail it.
fn check_samples(recording: &Recording, gravity: f64, accept: bool) -> Result<Option<ImuValidation>, AnyError> {
    match recording.check(gravity) {
        Err(VioError::Unusable { why, .. }) if accept => {
            recording.check_clocks()?;
            eprintln!("warning: {why}; taken as they are (--accept-imu)");
            Ok(None)
        }
        other => Ok(other.map(Some)?),
    }
}

/// What the images say beside the run.
struct Found {
    /// That part of them stands still, in words.
    static_view: Option<String>,
    /// What they contradict of the calibration.
    doubt: Option<CalibrationDoubt>,
    /// Whether that has been put right already.
    is_calibrated: bool,
}

/// Why a run failed and, if something else is in view, or calibration or axes are the cause, which.
fn with_cause(why: String, found: &Found, recording: &Recording, settings: &RunSettings) -> String {
    // A filter that follows the vehicle itself contradicts any calibration and any axes.
    if let Some(static_view) = &found.static_view {
        return format!("{why}; {static_view}");
    }
    if let Some(doubt) = &found.doubt {
        return format!("{why}; {}", calibration_advice(doubt, found.is_calibrated));
    }
    if interruption::is_requested() {
        return why;
    }
    say!("looking for a cause: the inertial sensor is read with other axes");
    let cause = filter(recording, settings, false)
        .ok()
        .and_then(|filter| diagnose_axes(&filter, &recording.samples, camera_frames(recording), settings.threads));
    match cause {
        Some(cause) => format!("{why}; it would go on if {cause}"),
        None if found.is_calibrated => why,
        None => format!("{why}; if the calibration may be wrong, --calibrate estimates it"),
    }
}

/// Whether a run did what was asked of it, or why not.
fn usable(recording: &Recording, run: &Run) -> Result<(), String> {
    let (name, images, poses) = (&recording.name, recording.images.count(), run.poses());
    if let Some(Loss { stamp, reason }) = run.lost.last().filter(|_| !run.tracking_at_end) {
        return Err(format!("{name}: the filter diverged at {stamp} s ({reason}), and was not restarted"));
    }
    if 2 * poses < images {
        let skipped = run.skipped.first().map(ToString::to_string);
        let why = skipped.or_else(|| run.lost.last().map(|loss| loss.reason.to_string()));
        let why = why.unwrap_or_else(|| "it started late".into());
        return Err(format!("{name}: only {poses} of {images} images have a pose: {why}"));
    }
    let left_out = run.skipped.len();
    match run.skipped.first() {
        Some(first) if left_out as f64 > MAX_LEFT_OUT * images as f64 => {
            Err(format!("{name}: {left_out} of {images} images were left out; the first: {first}"))
        }
        _ => Ok(()),
    }
}

fn render(arguments: &Sim) -> Result<(), AnyError> {
    make(&arguments.out, "vio-sim")?;
    let flight = match (&arguments.trajectory, arguments.flight) {
        (Some(file), _) => Flight::File(file.clone()),
        (None, FlightName::Room) => Flight::Room,
        (None, FlightName::Wall) => Flight::Wall,
    };
    let cameras = simulated_cameras(arguments)?;
    let settings = SimulationSettings {
        flight,
        seconds: arguments.seconds,
        scenario: Scenario { seed: arguments.seed, cameras, ..Scenario::default() },
        mcap: arguments.mcap,
        raw: arguments.raw,
        threads: worker_threads(arguments.threads),
    };
    let simulated = simulate(&settings, &arguments.out)?;
    say!(
        "{} images, {} inertial samples, {:.1} m in {:.1} s",
        simulated.frames,
        simulated.samples,
        simulated.path_length_m,
        simulated.duration_s
    );
    result!("{}", arguments.out.display());
    Ok(())
}

/// The cameras of EuRoC, or those of a file.
fn simulated_cameras(arguments: &Sim) -> Result<Vec<SimulatedCamera>, AnyError> {
    let count = if arguments.stereo { 2 } else { 1 };
    let cameras = match &arguments.cameras {
        None => vec![Camera::euroc(), Camera::euroc_right()],
        Some(path) => {
            let chain = read_kalibr_cameras(&read_text(path)?).map_err(|error| VioError::malformed(path, &error))?;
            if chain.len() < count {
                return Err(VioError::malformed(path, &"holds one camera only").into());
            }
            chain.iter().map(|calibration| calibration.camera).collect()
        }
    };
    let simulated = |camera: Camera| SimulatedCamera {
        camera,
        row_time_s: arguments.readout / camera.height as f64,
        ..SimulatedCamera::default()
    };
    Ok(cameras.into_iter().take(count).map(simulated).collect())
}

fn evaluate(arguments: &Eval) -> Result<(), AnyError> {
    let settings = CompareSettings {
        max_difference_s: arguments.max_difference,
        sim3: arguments.sim3,
        rpe_lengths_m: arguments.rpe.clone(),
    };
    let comparison = compare(&arguments.reference, &arguments.estimate, &settings)?;
    print!("{}", comparison.table());
    if let Some(folder) = &arguments.out {
        make(folder, "vio-eval")?;
        save_figures(&comparison, folder)?;
    }
    Ok(())
}

fn search(arguments: &Tune) -> Result<(), AnyError> {
    make(&arguments.out, "vio-tune")?;
    let data = if arguments.euroc.is_empty() {
        TuningData::simulated(arguments.flights, arguments.seconds, arguments.seed)?
    } else {
        let open = |folder: &PathBuf| -> Result<Recording, VioError> {
            let recording = open_euroc(folder, &Overrides::default())?;
            let findings = recording.check(Settings::default().gravity)?;
            findings.warnings.iter().for_each(|warning| eprintln!("warning: {}: {warning}", recording.name));
            Ok(recording)
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
        regularization: arguments.regularization.max(0.0),
        random: arguments.random,
        seed: arguments.seed,
        resume: arguments.resume,
        threads: worker_threads(arguments.threads),
    };
    let report = tune_noise(&data, &tuning, &arguments.out)?;
    say!(
        "position error {:.4} m at the start, {:.4} m now; NEES {:.1}, now {:.1}",
        report.ate_start_m,
        report.ate_best_m,
        report.nees_start,
        report.nees_best
    );
    match (report.held_out_error_data_sheet_m, report.held_out_error_tuned_m) {
        (Some(given), Some(tuned)) => {
            say!("on recordings left out: {given:.4} m with the noise given, {tuned:.4} m with that of the others");
        }
        _ => say!("one recording only: nothing says what the result is worth on others"),
    }
    if report.data_sheet_kept {
        say!("no gain on what was left out, or worse positions: noise.yaml has the noise given");
    }
    if let Some(ratio) = report.ratio_to_random {
        let (worse, points, seconds) = (100.0 * (ratio - 1.0), report.random_samples, report.search_wall_s);
        say!("{worse:+.1} % against the best of {points} random points, after {seconds:.1} s");
    }
    result!("{}", arguments.out.join("report.md").display());
    Ok(())
}

/// Makes the folder of what a subcommand leaves: each has its own files in it.
fn make(folder: &Path, subcommand: &str) -> Result<(), String> {
    run_folder::begin(folder, subcommand)
        .map_err(|e| format!("{}: cannot be created ({e}): choose another --out", folder.display()))
}
