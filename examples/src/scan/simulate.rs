//! A recording to try: the robot's cameras fly along the built-in wall; in the layout of 7-Scenes, with the true poses.

use std::path::Path;

use image::{ColorType, ExtendedColorType, ImageFormat};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use paint_sim::TriangleSurface;
use paint_sim::flight::Reference as _;
use tsdf_hash::{ColourData, DepthData};

use super::arguments::Simulation;
use crate::interruption::{self, Finishing};
use crate::mesh_placement::mean_normal;
use crate::progress::Stage;
use crate::scan_flight::route::along;
use crate::simulated_sensors::SimulatedCamera;
use crate::whole_file::{self, WholeFile};
use crate::worker_threads::worker_threads;
use crate::world::rock_wall;

/// Images per second, as the reader of the layout takes them.
const RATE: f64 = 30.0;
/// The flight begins at rest; this much of it is left out, s.
const BEGIN: f64 = 2.0;
/// Distance from the wall, m.
const STAND_OFF: f64 = 1.5;

type AnyError = Box<dyn std::error::Error>;

/// Writes the frames into a folder that exists; how many there are, fewer where somebody interrupts.
pub(super) fn simulate(simulation: &Simulation) -> Result<usize, AnyError> {
    let mesh = rock_wall(simulation.seed);
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces)?;
    let facing = mean_normal(&mesh);
    let route = along(&surface, &facing, STAND_OFF)?;
    let mut camera = SimulatedCamera::new(&surface, -facing, simulation.seed, worker_threads(simulation.threads));
    let k = &camera.camera;
    let matrix = format!("{} 0 {}\n0 {} {}\n0 0 1\n", k.fx, k.cx, k.fy, k.cy);
    write(&simulation.out.join("camera-intrinsics.txt"), matrix.as_bytes())?;
    let (body_from_camera, width, height) = (k.body_from_camera, k.width as u32, k.height as u32);
    let count = (simulation.seconds * RATE).round().max(1.0) as usize;
    let _finishing = Finishing::begin();
    let stage = Stage::start("render");
    for index in 0..count {
        if interruption::is_requested() {
            stage.done(&format!("{index} frames of {count}"));
            return Ok(index);
        }
        stage.share(index as f64 / count as f64);
        let state = route.at(BEGIN + index as f64 / RATE);
        let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), state.heading);
        let world_from_camera = Isometry3::from_parts(state.position.coords.into(), heading) * body_from_camera;
        let image = camera.capture(index, &world_from_camera)?;
        let views = camera.views(&image);
        let (depth, colour) = (views.depth(), views.colour());
        let name = |ending: &str| simulation.out.join(format!("frame-{index:06}.{ending}"));
        if let (DepthData::F32 { data: metres }, ColourData::Rgb8(rgb)) = (depth.data, colour.data) {
            let millimetres = metres.iter().map(|z| (1000.0 * z).round() as u16);
            let bytes: Vec<u8> = millimetres.flat_map(u16::to_ne_bytes).collect();
            png(&name("depth.png"), &bytes, [width, height], ColorType::L16.into())?;
            png(&name("color.png"), rgb, [width, height], ColorType::Rgb8.into())?;
        }
        let rows = world_from_camera.to_homogeneous();
        let text: Vec<String> = rows.row_iter().map(|r| format!("{} {} {} {}", r[0], r[1], r[2], r[3])).collect();
        write(&name("pose.txt"), text.join("\n").as_bytes())?;
    }
    stage.done(&format!("{count} frames"));
    Ok(count)
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    whole_file::write(path, bytes).map_err(|error| format!("{}: cannot be written ({error})", path.display()))
}

fn png(path: &Path, bytes: &[u8], [width, height]: [u32; 2], kind: ExtendedColorType) -> Result<(), String> {
    let save = || -> image::ImageResult<()> {
        let mut file = WholeFile::create(path)?;
        image::write_buffer_with_format(&mut file, bytes, width, height, kind, ImageFormat::Png)?;
        Ok(file.commit()?)
    };
    save().map_err(|error| format!("{}: cannot be written ({error})", path.display()))
}
