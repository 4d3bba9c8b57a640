//! What a mission leaves in its folder.

use std::path::Path;

use nalgebra::Point3;
use paint_net::Image;
use paint_sim::flight::FlightSample;
use paint_sim::render::Shading;
use paint_sim::surface::Hit;
use tsdf_hash::mesh::Mesh;

use super::error::MissionError;
use super::figures::report;
use super::inspect::inspect;
use super::painted_mesh::save_painted_mesh;
use super::painted_views::save_painted_views;
use super::painting_task::PaintingTask;
use super::path_view::{FlownWay, save_path};
use super::progress_views::save_progress;
use super::run::{Mission, one_after_another};
use super::sagging::save_sagging;
use super::settings::{PainterChoice, RECORDING_STEP};
use super::shading::shading;
use super::team::first_of_each_cell;
use super::trajectory_table::save_trajectories;
use super::written_file::{unwritable, write};
use crate::mesh_io::{PlyMesh, write_ply};
use crate::pictures::{COLOUR_DIFFERENCE, ErrorScale, Panel, Rgb, save_curves, save_error_map};
use crate::progress::Stage;
use crate::recording::{ColouredMesh, RobotState, save_recording};

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
    save_sagging(&[mission], folder)?;
    stage.share(0.2);
    if mission.task.of_picture {
        // Its surface and its flight are shown with those of the other paints.
        save_angles(&[mission], folder)?;
        save_trajectories(&[mission], folder)?;
        stage.done(&folder.display().to_string());
    } else {
        let colours = save_painted_mesh(&mission.task, &page_colours(&mission.task, &mission.painted_depth()), folder)?;
        stage.share(0.4);
        let painted = mission.painted_depth();
        let shade = |hit: &Hit| shading(&mission.task, &painted, hit);
        save_painted_views(&mission.task, &shade, folder)?;
        save_progress(mission, &folder.join("progress.png"))?;
        save_flown_path(mission, &shade, folder)?;
        stage.share(0.8);
        save_flights(&[mission], &colours, folder)?;
        stage.done(&folder.display().to_string());
    }

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

/// What this depth of paint looks like on the page, `None` beside the surface.
pub(super) fn page_colours(task: &PaintingTask, depth: &Image) -> Vec<Option<[u8; 3]>> {
    let colour = |(covered, depth): (&f64, &f64)| (*covered > 0.0).then(|| task.appearance.srgb(*depth));
    task.coverage.data().iter().zip(depth.data()).map(colour).collect()
}

/// The chart with this depth of paint on its pixels.
pub(super) fn texture(task: &PaintingTask, depth: &Image) -> Rgb {
    Rgb::of_page(depth.width(), depth.height(), page_colours(task, depth))
}

/// The ways of the first flights before the surface, one of each robot's cells: of several layers the base coat alone, as all of them hide the surface
/// and one another.
pub(super) fn save_flown_path(
    mission: &Mission,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
    folder: &Path,
) -> Result<(), MissionError> {
    let ways = first_of_each_cell(mission.flights.iter().map(|flight| (flight.turn, flight))).map(|flight| {
        let path = |of: &dyn Fn(&FlightSample) -> Point3<f64>| flight.flight.every(RECORDING_STEP).map(of).collect();
        FlownWay {
            robot: flight.turn.robot,
            nozzle: path(&|s| s.nozzle),
            vehicle: path(&|s| s.world_from_body.translation.vector.into()),
        }
    });
    save_path(&mission.task, shade, ways.collect(), &folder.join("path.png"))
}

/// The flights of some missions, one after the other: `angles.png` of the first robot, `trajectory.csv`, `mission.mcap`; with the colours of the vertices in the end.
pub(super) fn save_flights(missions: &[&Mission], colours: &[[u8; 3]], folder: &Path) -> Result<(), MissionError> {
    save_angles(missions, folder)?;
    save_trajectories(missions, folder)?;
    if let Some(mission) = missions.first() {
        write(&folder.join("robot.urdf"), &mission.task.urdf())?;
    }
    save_mcap(missions, colours, folder)
}

fn save_angles(missions: &[&Mission], folder: &Path) -> Result<(), MissionError> {
    let mut curves: [Vec<(f64, f64)>; 6] = std::array::from_fn(|_| Vec::new());
    let flights = || one_after_another(missions).filter(|(_, f)| f.turn.robot == 0);
    let total: usize = flights().map(|(_, f)| f.flight.samples.len()).sum();
    let stride = (total / CURVE_POINTS).max(1);
    for (start, f) in flights() {
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
    }
    let [wanted_pan, pan, wanted_tilt, tilt, distance, deviation] = curves;
    let panels = [
        Panel { label: "pan, degrees", curves: vec![("desired", wanted_pan), ("actual", pan)] },
        Panel { label: "tilt, degrees", curves: vec![("desired", wanted_tilt), ("actual", tilt)] },
        Panel { label: "distance, cm", curves: vec![("nozzle to surface, valve open", distance)] },
        Panel { label: "off the normal, cm", curves: vec![("planned nozzle", deviation)] },
    ];
    save_curves(&folder.join("angles.png"), "Pan-tilt unit and nozzle over the mission", "time, min", &panels)?;
    Ok(())
}

fn save_mcap(missions: &[&Mission], colours: &[[u8; 3]], folder: &Path) -> Result<(), MissionError> {
    let Some(task) = missions.first().map(|mission| &mission.task) else { return Ok(()) };
    let (mut states, mut log_lines, mut paints) = (Vec::new(), Vec::new(), Vec::new());
    let ([_, step], mut begun) = (task.settings.record_steps(), 0.0);
    for mission in missions {
        paints.push((begun, mission.task.paint_style()));
        if missions.len() > 1 {
            log_lines.push((begun, format!("paint: {}", mission.task.paint.name)));
        }
        for (k, f) in mission.flights.iter().enumerate() {
            let (start, strokes) = (begun + f.start, f.route.strokes);
            log_lines.push((start, format!("layer {} of {}: {strokes} strokes", k + 1, mission.flights.len())));
            states.extend(f.flight.every(step).map(|s| RobotState {
                robot: f.turn.robot,
                time: start + s.time,
                world_from_body: s.world_from_body,
                arm: mission.arm(s),
                joints: s.pan_tilt,
                hit: s.hit,
                flow: s.flow,
            }));
        }
        begun += mission.flight_time();
    }
    let mesh = ColouredMesh {
        positions: &task.surface.vertices(),
        faces: task.surface.disk().faces(),
        colours,
        bare: task.appearance.srgb(0.0),
    };
    let origin = task.origin(folder);
    save_recording(&folder.join("mission.mcap"), &mesh, &paints, &mut states, &mut log_lines, &origin)?;
    Ok(())
}
