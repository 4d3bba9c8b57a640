//! From a motion and a mesh to a painted mesh in a folder.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use paint_sim::paint::PaintName;
use paint_sim::{Shot, Surface};
use serde::Serialize;

use super::arguments::Arguments;
use super::error::SprayError;
use super::motion::NozzleMotion;
use super::read_csv::read_csv;
use super::read_mcap::read_mcap;
use crate::mcap_messages::FIRST_BYTES;
use crate::mesh_frame::{Subject, scale_of};
use crate::mesh_io::read_mesh;
use crate::mission::{MissionSettings, PaintingTask, SprayDevice, SprayedFilm};
use crate::mission_file::MissionFile;
use crate::paint_set::{NamedPaint, artists_paints, read_paints};
use crate::region::Scene;
use crate::report::save_figures;
use crate::simulated_sensors::SHOT_STEP;
use crate::{result, run_folder, say};

/// Share of the shots from behind the surface from which on nothing of it is believed.
const MOSTLY: f64 = 0.5;
/// How far a nozzle sprays, metres: what lies farther is not looked at to tell its side.
const FAR: f64 = 1.0;

/// What became of the paint. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct SprayReport {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that was painted.
    pub surface: String,
    /// What was sprayed.
    pub paint: String,
    /// From the first to the last sample.
    pub duration_s: f64,
    /// Samples whose stamps repeat others or go back.
    pub samples_left_out: usize,
    /// Times without samples, over which the valve counts as shut.
    pub gaps: usize,
    /// Shots that the motion was cut into.
    pub shots: usize,
    /// Share of them from inside or behind the surface, which leave no paint.
    pub shots_behind_share: f64,
    /// Paint that left the nozzle.
    pub paint_emitted_kg: f64,
    /// Paint on the surface.
    pub paint_deposited_kg: f64,
    /// Paint that met nothing.
    pub paint_overspray_kg: f64,
    /// Mean thickness where there is paint.
    pub thickness_mean_m: f64,
    /// Largest thickness.
    pub thickness_max_m: f64,
    /// Share by area of the painted surface from which paint has run.
    pub sagging_share: f64,
}

/// Does what the command line asks for.
///
/// # Errors
/// [`SprayError`].
pub fn run(arguments: &Arguments) -> Result<(), SprayError> {
    let folder = arguments.out.as_path();
    let motion = read_motion(arguments)?;
    let paint = paint_of(&arguments.paint)?;
    let (name, scene) = surface(arguments)?;
    run_folder::begin(folder, "spray").map_err(|source| SprayError::Folder { path: folder.to_owned(), source })?;
    let defaults = MissionSettings::default();
    let threads = arguments.threads.map_or(defaults.threads, usize::from);
    let mut settings = MissionSettings { texel: arguments.texel, spot: arguments.spot, threads, ..defaults };
    settings.air = arguments.wind;
    arguments.showing.apply(&mut settings.show);
    let wall = arguments.wall.substrate().map_err(crate::mission::MissionError::from)?;
    let (paint_name, density) = (paint.name.clone(), paint.liquid.density);
    let task = PaintingTask::undecided(&name, &scene, settings)?.with_paint(paint, &wall)?;
    let device = device(&task, arguments.gpu)?;
    let mut sprayed = SprayedFilm::new(&task, &device)?;
    let shots = motion.shots(SHOT_STEP);
    let (front, behind): (Vec<_>, Vec<_>) = shots.into_iter().partition(|(_, shot)| !is_behind(device.surface(), shot));
    let count = front.len() + behind.len();
    let share = behind.len() as f64 / count.max(1) as f64;
    if share > MOSTLY {
        return Err(SprayError::Behind { path: arguments.nozzle.clone(), percent: 100.0 * share });
    }
    let lost: f64 = behind.iter().map(|(_, shot)| shot.volume).sum();
    sprayed.spray(&front, motion.duration(), folder)?;
    let (balance, [mean, max]) = (sprayed.volumes(), sprayed.thickness());
    sprayed.save(folder)?;
    sprayed.device_told().iter().for_each(|told| say!("{told}"));
    let report = SprayReport {
        version: env!("CARGO_PKG_VERSION"),
        surface: name,
        paint: paint_name,
        duration_s: motion.duration(),
        samples_left_out: motion.left_out,
        gaps: motion.gaps,
        shots: count,
        shots_behind_share: share,
        paint_emitted_kg: (balance[0] + lost) * density,
        paint_deposited_kg: balance[1] * density,
        paint_overspray_kg: (balance[2] + lost) * density,
        thickness_mean_m: mean,
        thickness_max_m: max,
        sagging_share: sprayed.share_ran(),
    };
    save_figures(&report, folder)?;
    say!(
        "{:.1} g of {} in {:.0} s, {:.1} % of it on the surface, {:.0} micrometres thick in the mean",
        1e3 * report.paint_emitted_kg,
        report.paint,
        report.duration_s,
        100.0 * report.paint_deposited_kg / report.paint_emitted_kg.max(f64::MIN_POSITIVE),
        1e6 * mean
    );
    if report.sagging_share > 0.0 {
        say!("{:.1} % of the painted surface was so thick that its paint ran", 100.0 * report.sagging_share);
    }
    result!("{}", folder.join("painted_view.png").display());
    Ok(())
}

fn read_motion(arguments: &Arguments) -> Result<NozzleMotion, SprayError> {
    let path = &arguments.nozzle;
    let flow = arguments.flow.map(|litres| litres * 1e-3 / 60.0);
    let samples = if is_mcap(path).map_err(|error| SprayError::motion(path, &error))? {
        read_mcap(path, flow)
    } else {
        let text = std::fs::read_to_string(path).map_err(|error| format!("neither MCAP nor text ({error})"));
        text.and_then(|text| read_csv(&text, flow))
    };
    let motion = samples.and_then(NozzleMotion::new).map_err(|why| SprayError::motion(path, &why))?;
    if motion.left_out + motion.gaps > 0 {
        let (left_out, gaps) = (motion.left_out, motion.gaps);
        say!(
            "{}: {left_out} samples left out whose stamps repeat or go back, {gaps} gaps with the valve shut",
            path.display()
        );
    }
    Ok(motion)
}

/// By its first bytes: a recording need not fit into memory.
fn is_mcap(path: &Path) -> std::io::Result<bool> {
    let mut head = Vec::new();
    File::open(path)?.take(FIRST_BYTES.len() as u64).read_to_end(&mut head)?;
    Ok(head == FIRST_BYTES)
}

fn paint_of(name: &str) -> Result<NamedPaint, SprayError> {
    let known = PaintName::ALL.into_iter().find(|known| known.as_str() == name);
    if let Some(known) = known {
        return Ok(NamedPaint::built_in(known).map_err(crate::mission::MissionError::from)?);
    }
    let artists = artists_paints().map_err(crate::mission::MissionError::from)?;
    if let Some(pigment) = artists.into_iter().find(|pigment| pigment.name == name) {
        return Ok(pigment);
    }
    let mut paints = read_paints(Path::new(name))?;
    Ok(paints.swap_remove(0))
}

/// The mesh in metres: where its file has it, or as missions place it.
fn surface(arguments: &Arguments) -> Result<(String, Scene), SprayError> {
    let path = match &arguments.mesh {
        Some(path) if !arguments.placed => path,
        mesh => {
            let mission = MissionFile { mesh: mesh.clone(), scale: arguments.scale, ..MissionFile::default() };
            return Ok(mission.read_surface()?);
        }
    };
    let mut mesh = read_mesh(path)?;
    mesh.notes.iter().for_each(|note| say!("{}: {note}", path.display()));
    let (scale, said) = scale_of(&mesh, arguments.scale, Subject::Place);
    say!("{}: {} faces, {said}", path.display(), mesh.faces.len());
    // Coordinates of the file, also where it lies far from its origin.
    let origin = mesh.origin;
    for position in &mut mesh.positions {
        for c in 0..3 {
            position[c] = ((f64::from(position[c]) + origin[c]) * scale) as f32;
        }
    }
    mesh.origin = [0.0; 3];
    let name = path.file_stem().map_or("Mesh".into(), |stem| stem.to_string_lossy());
    Ok((name.into_owned(), Scene::whole(mesh)))
}

fn device(task: &PaintingTask, gpu: bool) -> Result<SprayDevice<'_>, SprayError> {
    if !gpu {
        return Ok(SprayDevice::processor(task));
    }
    #[cfg(feature = "gpu")]
    return Ok(SprayDevice::gpu(task)?);
    #[cfg(not(feature = "gpu"))]
    Err(SprayError::NoGpu)
}

/// Whether a shot begins inside of the surface or behind it: what it would meet looks away from it.
fn is_behind(world: &dyn Surface, shot: &Shot) -> bool {
    world.cast(&shot.origin, &shot.axis, FAR).is_some_and(|hit| hit.normal.dot(&shot.axis) > 0.0)
}
