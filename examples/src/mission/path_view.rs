//! The ways of nozzle and vehicle before the surface, as a picture.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use paint_sim::Camera;
use paint_sim::render::{Frame, Shading};
use paint_sim::surface::Hit;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::view::{camera, picture_of, view};
use crate::pictures::{Polyline, Scene, save_scene};

/// Colour of the nozzles' ways.
const NOZZLE: [u8; 3] = [0, 90, 200];
/// Those of the vehicles', robot after robot.
const VEHICLES: [[u8; 3]; 4] = [[230, 110, 20], [20, 150, 90], [150, 60, 170], [190, 30, 60]];
/// Colour of keep-out volumes and anchors.
const OUTLINE: [u8; 3] = [235, 150, 0];

/// What a flight draws.
pub(super) struct FlownWay {
    /// Robot, from 0.
    pub(super) robot: usize,
    /// Of its nozzle.
    pub(super) nozzle: Vec<Point3<f64>>,
    /// Of its body.
    pub(super) vehicle: Vec<Point3<f64>>,
}

/// Draws the ways of nozzles (blue) and vehicles (a colour for each robot) before the surface, of which `shade` tells what is seen.
pub(super) fn save_path(
    task: &PaintingTask,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
    ways: Vec<FlownWay>,
    file: &Path,
) -> Result<(), MissionError> {
    let corners = task.surface.disk().positions().iter().map(|p| Point3::from(*p));
    let vehicles = ways.iter().flat_map(|way| way.vehicle.iter().copied());
    let camera = camera(task, &corners.chain(vehicles).collect::<Vec<_>>())?;
    let frame = view(task, &camera, shade)?;
    let lines = ways.into_iter().flat_map(|FlownWay { robot, nozzle, vehicle }| {
        let colour = VEHICLES[robot % VEHICLES.len()];
        [Polyline { points: nozzle, colour: NOZZLE, radius: 0.5 }, Polyline { points: vehicle, colour, radius: 0.7 }]
    });
    save_lines(task, &camera, &frame, lines.collect(), file)
}

/// Draws lines and the outlines of the mission's constraints into a view of the surface.
pub(super) fn save_lines(
    task: &PaintingTask,
    camera: &Camera,
    frame: &Frame,
    mut lines: Vec<Polyline>,
    file: &Path,
) -> Result<(), MissionError> {
    let corners = task.surface.disk().positions().iter().map(|p| Vector3::from(*p));
    let none = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    let (low, high) = corners.fold(none, |(low, high), p| (low.inf(&p), high.sup(&p)));
    let outlines = task.settings.constraints.outlines(&low, &high);
    lines.extend(outlines.into_iter().map(|points| Polyline { points, colour: OUTLINE, radius: 1.2 }));
    let project = |p: &Point3<f64>| {
        let c = camera.world_from_camera.inverse_transform_point(p);
        (c.z > 0.05).then(|| (camera.fx * c.x / c.z + camera.cx, camera.fy * c.y / c.z + camera.cy, c.z))
    };
    let scene = Scene { picture: picture_of(frame), depth: &frame.depth, project: &project };
    Ok(save_scene(file, scene, &lines)?)
}
