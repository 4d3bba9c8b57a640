//! From a command line to a painted object in a folder.

use std::path::Path;

use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Translation3, Vector3};
use paint_planner::gantry::{BeamSettings, GantrySettings, PoseFilterSettings, RegistrationSettings};
use paint_sim::droplets::DepositSettings;
use paint_sim::gantry_robot::{HandMotion, HandSettings, InertialSensorSettings, PoseSensorSettings};

use super::arguments::Arguments;
use super::cube::{cube, cube_edges, in_circle, upper_faces};
use super::error::HandheldError;
use super::evaluation::{evaluate, time_ratio};
use super::forecast::{PaintDevice, PaintJob, Processor};
use super::hardware::HardwareSettings;
use super::motion_file::read_poses;
use super::object::{PaintObject, SurfaceSample};
use super::painting::{HandPoses, PaintingLog, paint};
use super::pictures::{save_plan, save_textures};
use super::recorded_motion::{MotionFrame, RecordedMotion};
use super::recording;
use super::report::HandheldReport;
use super::settings::HandheldSettings;
use super::target::read_target;
use super::views::passes;
use crate::interruption::Finishing;
use crate::mesh_frame::{Subject, scale_of};
use crate::mesh_io::read_mesh;
use crate::pictures::write_png;
use crate::progress::Stage;
use crate::report::save_figures;
use crate::run_folder;
use crate::whole_file;
use crate::worker_threads::worker_threads;
use crate::{result, say};

/// Standard deviation of the believed place with which any robot may spray, m.
const GOOD_ENOUGH: f64 = 0.3e-3;
/// Scenarios over which the time of a long horizon is compared.
const RATIO_SCENARIOS: usize = 9;

/// Does what the command line asks for.
///
/// # Errors
/// [`HandheldError`]; after [`HandheldError::Unfinished`] and [`HandheldError::Unreachable`] the files are there all the same.
pub fn run(arguments: &Arguments) -> Result<(), HandheldError> {
    check(arguments)?;
    let folder = arguments.out.as_path();
    run_folder::begin(folder, "handheld").map_err(|e| HandheldError::unwritable(folder, &e))?;
    let settings = settings(arguments);
    let stage = Stage::start("object");
    let object = object(arguments, folder)?;
    stage.done(&format!("{} x {} texels", object.texels.width, object.texels.height));
    for remark in &object.remarks {
        eprintln!("warning: {remark}");
    }
    let mut device = open_device(arguments, &object, &settings)?;
    let mut report = HandheldReport {
        version: env!("CARGO_PKG_VERSION"),
        device: device.name(),
        threads: settings.threads,
        seed: arguments.seed,
        ..HandheldReport::default()
    };
    if arguments.evaluate {
        rank(arguments, &object, device.as_mut(), &settings, &mut report)?;
    }
    let _finishing = Finishing::begin();
    let log = spray(arguments, &object, device.as_mut(), &settings)?;
    report.painted(&log);
    save_textures(&object.texels, &log.truth, folder)?;
    if let Some(plan) = &log.best_plan {
        save_plan(plan, folder)?;
    }
    recording::save(&object, &settings.geometry, &log, &folder.join("handheld.mcap"))?;
    save_figures(&report, folder)?;
    result!("{}", folder.join("painted.png").display());
    judge(&object, &log, &settings, &report, arguments.motion != "synthetic")
}

/// Whether the result is usable.
fn judge(
    object: &PaintObject,
    log: &PaintingLog,
    settings: &HandheldSettings,
    report: &HandheldReport,
    recorded: bool,
) -> Result<(), HandheldError> {
    if log.emitted == 0.0 && log.held_decisions < log.decision_ms.len() {
        let (reach_m, seconds) = (settings.spray.range, log.duration());
        return Err(HandheldError::Unreachable { nearest_m: nearest(object, log), reach_m, seconds });
    }
    if report.paint_inside_fraction < 0.5 {
        let advice = if report.tracking_lost_s > 0.5 * report.painting_s {
            "the markers were lost most of the time"
        } else if report.held_decisions > report.decisions {
            "the robot's place was not known well enough most of the time: lower --pose-noise"
        } else if recorded {
            "the recorded motion is too short, or too seldom before the target"
        } else {
            "give it more --seconds"
        };
        return Err(HandheldError::Unfinished { share: report.paint_inside_fraction, advice: advice.into() });
    }
    Ok(())
}

/// Shortest distance of the robot from the target, m.
fn nearest(object: &PaintObject, log: &PaintingLog) -> f64 {
    // A target has thousands of texels and a motion thousands of moments: some of each will do for a message.
    let wanted: Vec<_> = object.wanted_points().map(|(sample, _)| sample.point).collect();
    let some = |count: usize| (count / 200).max(1);
    let places = log.ticks.iter().step_by(some(log.ticks.len())).map(|tick| tick.world_from_robot.translation.vector);
    let distances = places
        .flat_map(|place| wanted.iter().step_by(some(wanted.len())).map(move |point| (point.coords - place).norm()));
    distances.fold(f64::INFINITY, f64::min)
}

fn check(arguments: &Arguments) -> Result<(), HandheldError> {
    let positive = [
        ("--motion-scale", arguments.motion_scale),
        ("--texel", arguments.texel),
        ("--coat", arguments.coat),
        ("--flow", arguments.flow),
        ("--stand-off", arguments.stand_off),
        ("--seconds", arguments.seconds.unwrap_or(1.0)),
        ("--pose-noise", arguments.pose_noise),
    ];
    for (option, value) in positive {
        if !(value.is_finite() && value > 0.0) {
            return Err(HandheldError::Option { option, value, must_be: "must be positive and finite" });
        }
    }
    let error = arguments.registration_error;
    if !(error.is_finite() && (0.0..=0.05).contains(&error)) {
        let must_be = "must lie between 0 and 0.05 m";
        return Err(HandheldError::Option { option: "--registration-error", value: error, must_be });
    }
    let counts = [("--scenarios", arguments.scenarios, 100_000)];
    for (option, value, most) in counts {
        if !(1..=most).contains(&value) {
            return Err(HandheldError::Option {
                option,
                value: value as f64,
                must_be: "must be at least 1, and not absurd",
            });
        }
    }
    Ok(())
}

fn settings(arguments: &Arguments) -> HandheldSettings {
    let planner =
        GantrySettings { directions: arguments.directions, horizon: arguments.horizon, ..GantrySettings::default() };
    HandheldSettings {
        planner,
        beam: (arguments.beam > 0).then_some(BeamSettings { width: arguments.beam }),
        deposit: DepositSettings {
            flow: arguments.flow,
            punishment: arguments.punishment,
            ..DepositSettings::default()
        },
        stand_off: arguments.stand_off,
        paper_literal: arguments.paper_literal,
        threads: worker_threads(arguments.threads),
        ..HandheldSettings::default()
    }
}

fn object(arguments: &Arguments, folder: &Path) -> Result<PaintObject, HandheldError> {
    let Some(mesh_file) = &arguments.mesh else {
        let coat = arguments.coat;
        let wanted = &mut |at: &SurfaceSample| if in_circle(at) { coat } else { 0.0 };
        return PaintObject::new(&cube(), &cube_edges(), arguments.texel, wanted);
    };
    let mut mesh = read_mesh(mesh_file)?;
    let (scale, said) = scale_of(&mesh, arguments.scale, Subject::Handheld);
    if !(scale.is_finite() && scale > 0.0) {
        return Err(HandheldError::Option { option: "--scale", value: scale, must_be: "must be positive and finite" });
    }
    say!("{}: {} faces, {said}, z up", mesh_file.display(), mesh.faces.len());
    let scale = scale as f32;
    mesh.positions.iter_mut().flatten().for_each(|c| *c *= scale);
    PaintObject::laid_out(&mesh, &[], arguments.texel, |size, samples| {
        save_atlas(size, samples, folder)?;
        let [width, height] = size;
        let none = || HandheldError::NoTarget { atlas: folder.join("atlas.png"), width, height };
        read_target(arguments.target.as_deref().ok_or_else(none)?, size, samples, arguments.coat)
    })
}

/// Writes `atlas.png`, one pixel per texel, to paint a target on: the surface white, paper grey.
fn save_atlas(
    [width, height]: [usize; 2],
    samples: &[Option<SurfaceSample>],
    folder: &Path,
) -> Result<(), HandheldError> {
    let picture = RgbImage::from_fn(width as u32, height as u32, |x, y| {
        Rgb(if samples[y as usize * width + x as usize].is_some() { [255; 3] } else { [200, 205, 210] })
    });
    let path = folder.join("atlas.png");
    write_png(&path, &picture, picture.dimensions().into()).map_err(|e| HandheldError::unwritable(&path, &e))
}

fn open_device<'a>(
    arguments: &Arguments,
    object: &'a PaintObject,
    settings: &HandheldSettings,
) -> Result<Box<dyn PaintDevice + 'a>, HandheldError> {
    let droplets = settings.density_droplets()?;
    if arguments.gpu {
        return super::gpu::open(&object.surface, &droplets, &settings.droplet_sets()?);
    }
    Ok(Box::new(Processor { surface: &object.surface, droplets, threads: settings.threads }))
}

/// The planner's figures on the built-in object.
fn rank(
    arguments: &Arguments,
    object: &PaintObject,
    device: &mut dyn PaintDevice,
    settings: &HandheldSettings,
    report: &mut HandheldReport,
) -> Result<(), HandheldError> {
    if arguments.mesh.is_some() {
        let must_be = "evaluates the built-in object: leave --mesh out";
        return Err(HandheldError::Option { option: "--evaluate", value: 1.0, must_be });
    }
    let stage = Stage::start("scenarios");
    let faces = upper_faces();
    let seeds = arguments.seed..arguments.seed + arguments.seeds;
    let scenarios = (arguments.scenarios, seeds);
    let evaluation = evaluate(object, &faces, device, settings, scenarios.clone(), &|share| stage.share(0.6 * share))?;
    report.evaluated(&evaluation);
    let ranks = arguments.out.join("ranks.csv");
    whole_file::write(&ranks, evaluation.rank_curves()).map_err(|e| HandheldError::unwritable(&ranks, &e))?;
    let literal = HandheldSettings { paper_literal: true, ..settings.clone() };
    let printed = evaluate(object, &faces, device, &literal, scenarios, &|share| stage.share(0.6 + 0.4 * share))?;
    report.paper_literal_mean_rank_fraction = super::evaluation::mean(&printed.ranks);
    let long = HandheldSettings {
        planner: GantrySettings { horizon: 30, directions: 9, ..settings.planner },
        ..settings.clone()
    };
    report.long_horizon_time_ratio = time_ratio(object, &faces, device, [&long, settings], RATIO_SCENARIOS)?;
    stage.done(&format!(
        "{} scenarios: {:.1} ms, rank {:.2} %, {:.0} % in the top 5 %; greedy {:.0} %, as printed {:.0} %; beam {:.2} %",
        report.scenarios,
        report.decision_ms_median,
        100.0 * report.mean_rank_fraction,
        100.0 * report.top5_share,
        100.0 * report.greedy_mean_rank_fraction,
        100.0 * report.paper_literal_mean_rank_fraction,
        100.0 * report.beam_mean_rank_fraction
    ));
    Ok(())
}

fn recorded_motion(
    arguments: &Arguments,
    object: &PaintObject,
    settings: &HandheldSettings,
) -> Result<RecordedMotion, HandheldError> {
    let path = Path::new(&arguments.motion);
    let first = if arguments.place_motion { passes(object, settings, Some(1.0)).first().copied() } else { None };
    let frame = MotionFrame {
        scale: arguments.motion_scale,
        axes: arguments.motion_axes,
        middle: first.map(|pass| pass.middle),
    };
    RecordedMotion::new(read_poses(path)?, path, &frame)
}

fn spray(
    arguments: &Arguments,
    object: &PaintObject,
    device: &mut dyn PaintDevice,
    settings: &HandheldSettings,
) -> Result<PaintingLog, HandheldError> {
    let job = PaintJob::new(&object.surface, settings)?;
    let away = Vector3::new(1.0, -0.7, 0.4).normalize() * arguments.registration_error;
    let hardware = HardwareSettings {
        pose_sensor: PoseSensorSettings { position_sigma: arguments.pose_noise, ..PoseSensorSettings::default() },
        // What the filter reaches with each: a camera alone leaves the place less certain.
        max_position_sigma: (arguments.pose_noise * if arguments.no_inertial { 0.9 } else { 0.6 }).max(GOOD_ENOUGH),
        inertial_sensor: (!arguments.no_inertial).then(InertialSensorSettings::default),
        filter: PoseFilterSettings { position_sigma: arguments.pose_noise, ..PoseFilterSettings::default() },
        registration: arguments.correct_registration.then(RegistrationSettings::default),
        world_from_model: Isometry3::from_parts(Translation3::from(away), nalgebra::UnitQuaternion::identity()),
        seed: arguments.seed,
        ..HardwareSettings::default()
    };
    let stage = Stage::start("paint");
    let share = |share: f64| stage.share(share);
    let log = if arguments.motion == "synthetic" {
        let passes = passes(object, settings, arguments.seconds);
        let hand = HandMotion::new(&passes, HandSettings::default(), arguments.seed)?;
        let motion = HandPoses { pose: &|time| hand.at(time), tracked: &|_| true, duration: hand.duration() };
        paint(object, &job, device, &hardware, &motion, &share)?
    } else {
        let recorded = recorded_motion(arguments, object, settings)?;
        recorded.remarks.iter().for_each(|remark| say!("{remark}"));
        let (pose, tracked) = (|time| recorded.at(time), |time| recorded.tracked(time));
        let motion = HandPoses { pose: &pose, tracked: &tracked, duration: recorded.duration };
        paint(object, &job, device, &hardware, &motion, &share)?
    };
    let figures = log.truth.figures();
    stage.done(&format!(
        "{:.0} s: {:.1} % inside, {:.1} % outside, {:.2} % of the texels overdosed; not tracked for {:.1} s",
        log.duration(),
        100.0 * figures.inside,
        100.0 * figures.outside,
        100.0 * figures.overdosed(),
        log.lost_ticks as f64 * log.tick()
    ));
    Ok(log)
}
