//! What a mission leaves in its folder.

use std::path::Path;

use nalgebra::Point3;
use paint_net::Image;
use paint_sim::flight::FlightSample;
use paint_sim::surface::Hit;
use tsdf_hash::mesh::Mesh;

use super::error::MissionError;
use super::figures::report;
use super::inspect::inspect;
use super::painting_task::PaintingTask;
use super::path_view::save_path;
use super::run::Mission;
use super::settings::PainterChoice;
use super::shading::{shading, vertex_colours};
use super::trajectory_table::trajectory_table;
use super::view::{camera, picture_of, view};
use crate::mesh_io::{PlyMesh, write_ply};
use crate::pictures::{COLOUR_DIFFERENCE, ErrorScale, Panel, Rgb, save_curves, save_error_map};
use crate::progress::Stage;
use crate::recording::{ColouredMesh, RobotState, save_recording};
use crate::textured_mesh::{TexturedMesh, with_gutter};
use crate::whole_file;

/// Colour beside the surface in the texture pictures.
const BACKGROUND: [u8; 3] = [255, 255, 255];
/// Seconds between two states of the recording.
pub(super) const RECORDING_STEP: f64 = 0.1;
/// Points in a curve: more than the picture has columns shows nothing more.
const CURVE_POINTS: usize = 2800;

/// How far a coat is off its thickness.
const COAT: ErrorScale<'static> = ErrorScale {
    title: "Thickness of the coat, off the wanted one",
    label: "percent (50 and above share a colour)",
    ceiling: 50.0,
};

/// Writes pictures, mesh, recording and report into an existing folder; the report last, so that its presence means the
/// folder is complete.
pub fn save(mission: &Mission, folder: &Path) -> Result<crate::report::Report, MissionError> {
    let stage = Stage::start("pictures");
    save_textures(mission, folder)?;
    stage.share(0.2);
    let colours = vertex_colours(&mission.task, &mission.painted_depth());
    let positions = mission.task.surface.vertices();
    let faces = mission.task.surface.disk().faces();
    let ply = folder.join("surface.ply");
    write_ply(&ply, &PlyMesh { positions: &positions, normals: None, colours: &colours, faces })
        .map_err(unwritable(&ply))?;
    stage.share(0.4);
    save_views(mission, folder)?;
    stage.share(0.8);
    save_angles(mission, &folder.join("angles.png"))?;
    write(&folder.join("trajectory.csv"), &trajectory_table(mission))?;
    write(&folder.join("robot.urdf"), &mission.task.urdf())?;
    save_textured_mesh(mission, folder)?;
    save_mcap(
        mission,
        folder,
        &ColouredMesh { positions: &positions, faces, colours: &colours, bare: mission.task.appearance.srgb(0.0) },
    )?;
    stage.done(&folder.display().to_string());

    let stage = Stage::start("scan");
    let found = inspect(mission)?;
    let Mesh { positions, faces, colours, .. } = &found.mesh;
    let found_mesh = PlyMesh { positions, normals: None, colours, faces };
    let ply = folder.join("scan.ply");
    write_ply(&ply, &found_mesh).map_err(unwritable(&ply))?;
    for (name, trajectory) in [("drift_true.tum", &found.flown), ("drift_estimated.tum", &found.estimated)] {
        write(&folder.join(name), &vio_ekf::format::tum::write(trajectory))?;
    }
    stage.done(&format!("{} faces, {:.2} mm off the surface", found.mesh.faces.len(), 1e3 * found.mesh_error));
    let figures = report(mission, &found)?;
    figures.save(folder)?;
    Ok(figures)
}

fn save_textures(mission: &Mission, folder: &Path) -> Result<(), MissionError> {
    let width = mission.task.wanted.width();
    let ink = mission.task.appearance.ink();
    texture(&mission.task, &mission.task.wanted.map(|wanted| ink.inverse(wanted))).save(&folder.join("wanted.png"))?;
    texture(&mission.task, &mission.painted_depth()).save(&folder.join("painted.png"))?;
    save_error_map(
        &folder.join("error.png"),
        width,
        &mission.colour_difference(),
        (mission.task.settings.texel, "m"),
        &COLOUR_DIFFERENCE,
    )?;
    if mission.task.settings.painter == PainterChoice::Fill {
        let off = mission.thickness_ratio().into_iter().map(|ratio| ratio.map(|ratio| 100.0 * (ratio - 1.0).abs()));
        let texel = (mission.task.settings.texel, "m");
        save_error_map(&folder.join("coat.png"), width, &off.collect::<Vec<_>>(), texel, &COAT)?;
    }
    Ok(())
}

/// The chart with this depth of paint on its pixels.
pub(super) fn texture(task: &PaintingTask, depth: &Image) -> Rgb {
    let (width, height) = (depth.width(), depth.height());
    let pixel = |k: usize| {
        if task.coverage.data()[k] > 0.0 { task.appearance.srgb(depth.data()[k]) } else { BACKGROUND }
    };
    Rgb::from_pixels(width, height, (0..width * height).map(pixel)).enlarged((1400 / width as u32).clamp(1, 8))
}

/// The surface with this depth of paint as somebody standing before it sees it.
pub(super) fn painted_view(task: &PaintingTask, painted: &Image) -> Result<Rgb, MissionError> {
    let corners: Vec<Point3<f64>> = task.surface.disk().positions().iter().map(|p| Point3::from(*p)).collect();
    let shade = |hit: &Hit| shading(task, painted, hit);
    Ok(picture_of(&view(task, &camera(task, &corners)?, &shade)?))
}

fn save_views(mission: &Mission, folder: &Path) -> Result<(), MissionError> {
    let painted = mission.painted_depth();
    painted_view(&mission.task, &painted)?.save(&folder.join("painted_view.png"))?;

    // Of layers the base coat alone: all of them on top of each other hide the surface and one another.
    let Some(base) = mission.flights.first() else { return Ok(()) };
    let path = |of: &dyn Fn(&FlightSample) -> Point3<f64>| -> Vec<Point3<f64>> {
        base.flight.samples.iter().step_by(10).map(of).collect()
    };
    let vehicle = path(&|s| s.world_from_body.translation.vector.into());
    let nozzle = path(&|s| s.nozzle);
    save_path(&mission.task, &painted, nozzle, vehicle, &folder.join("path.png"))
}

fn save_angles(mission: &Mission, path: &Path) -> Result<(), MissionError> {
    let mut curves: [Vec<(f64, f64)>; 6] = std::array::from_fn(|_| Vec::new());
    let total: usize = mission.flights.iter().map(|f| f.flight.samples.len()).sum();
    let stride = (total / CURVE_POINTS).max(1);
    let mut start = 0.0;
    for f in &mission.flights {
        for s in f.flight.samples.iter().step_by(stride) {
            let minutes = (start + s.time) / 60.0;
            let open = |v: f64| if s.flow > 0.0 { v } else { f64::NAN };
            curves[0].push((minutes, s.desired_pan_tilt[0].to_degrees()));
            curves[1].push((minutes, s.pan_tilt[0].to_degrees()));
            curves[2].push((minutes, s.desired_pan_tilt[1].to_degrees()));
            curves[3].push((minutes, s.pan_tilt[1].to_degrees()));
            curves[4].push((minutes, open(100.0 * s.distance)));
        }
        for (k, t) in f.route.targets.iter().enumerate().filter(|(k, t)| t.dose > 0.0 && f.plan.reachable[*k]) {
            let minutes = (start + f.plan.target_time[k]) / 60.0;
            curves[5].push((minutes, 100.0 * t.normal_deviation(&f.plan.nozzle[k].position)));
        }
        start += f.plan.trajectory.duration();
    }
    let [wanted_pan, pan, wanted_tilt, tilt, distance, deviation] = curves;
    let panels = [
        Panel { label: "pan, degrees", curves: vec![("desired", wanted_pan), ("actual", pan)] },
        Panel { label: "tilt, degrees", curves: vec![("desired", wanted_tilt), ("actual", tilt)] },
        Panel { label: "distance, cm", curves: vec![("nozzle to surface, valve open", distance)] },
        Panel { label: "off the normal, cm", curves: vec![("planned nozzle", deviation)] },
    ];
    save_curves(path, "Pan-tilt unit and nozzle over the mission", "time, min", &panels)?;
    Ok(())
}

fn save_mcap(mission: &Mission, folder: &Path, mesh: &ColouredMesh) -> Result<(), MissionError> {
    let mut states = Vec::new();
    let mut log_lines = Vec::new();
    let mut start = 0.0;
    for (k, f) in mission.flights.iter().enumerate() {
        let strokes = f.route.strokes;
        log_lines.push((start, format!("layer {} of {}: {strokes} strokes", k + 1, mission.flights.len())));
        let stride = (RECORDING_STEP / f.flight.interval).round().max(1.0) as usize;
        states.extend(f.flight.samples.iter().step_by(stride).map(|s| RobotState {
            time: start + s.time,
            world_from_body: s.world_from_body,
            arm: mission.arm(s),
            joints: s.pan_tilt,
            hit: s.hit,
            flow: s.flow,
        }));
        start += f.plan.trajectory.duration();
    }
    let origin = mission.task.origin(folder);
    save_recording(&folder.join("mission.mcap"), mesh, mission.task.paint_style(), &states, &log_lines, &origin)?;
    Ok(())
}

/// The painted part of the surface with the paint as its texture: `painted.glb`, and `painted.obj` with its material.
fn save_textured_mesh(mission: &Mission, folder: &Path) -> Result<(), MissionError> {
    let painted = mission.painted_depth();
    let (width, height) = (painted.width(), painted.height());
    let pixel =
        |k: usize| (mission.task.coverage.data()[k] > 0.0).then(|| mission.task.appearance.srgb(painted.data()[k]));
    let extent = [width, height].map(|side| side as f64 * mission.task.settings.texel);
    let mesh = TexturedMesh {
        positions: mission.task.surface.disk().positions(),
        faces: mission.task.surface.disk().faces(),
        origin: [0.0; 3],
        uv: mission.task.surface.chart.uv().iter().map(|uv| [uv[0] / extent[0], uv[1] / extent[1]]).collect(),
        texture: with_gutter(width, height, (0..width * height).map(pixel).collect()),
    };
    mesh.save(folder, "painted").map_err(unwritable(&folder.join("painted.*")))
}

pub(super) fn write(path: &Path, text: &str) -> Result<(), MissionError> {
    whole_file::write(path, text).map_err(unwritable(path))
}

pub(super) fn unwritable(path: &Path) -> impl FnOnce(std::io::Error) -> MissionError {
    let path = path.display().to_string();
    |source| MissionError::Unwritable { path, source }
}
