//! A map of a surface that was surveyed by others: its mesh as depth images from in front of it show it, without keyframes.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use paint_sim::flight::Reference;
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{TriangleSurface, render};
use tsdf_hash::slam::SlamState;
use tsdf_hash::{DepthData, DepthView, Intrinsics, Map};

use super::localisation::LocalisationError;
use crate::scan_flight::route::along;

/// Distance from the foremost point of the surface, m, and seconds from one image to the next.
const STAND_OFF: f64 = 1.5;
const BETWEEN: f64 = 0.5;
/// Size of an image and its focal length, pixels.
const IMAGE: (u32, u32, f64) = (240, 160, 140.0);
/// Size of a voxel, m: that of a scan.
const VOXEL: f64 = 0.02;

/// The map of a surface with a mean normal (see [`PaintSurface::facing`](crate::surface::PaintSurface::facing)).
///
/// # Errors
/// A surface without a front, or of no size that is flown along.
pub fn surveyed_map(
    surface: &TriangleSurface,
    facing: &Vector3<f64>,
    threads: usize,
) -> Result<SlamState, LocalisationError> {
    let route = along(surface, facing, STAND_OFF)?;
    let mut map = Map::new(tsdf_hash::Settings { voxel_size: VOXEL, threads, ..tsdf_hash::Settings::default() })?;
    let (width, height, focal) = IMAGE;
    let [cx, cy] = [width, height].map(|side| (f64::from(side) - 1.0) / 2.0);
    // Looks along x, z up.
    let body_from_camera =
        UnitQuaternion::from_euler_angles(-std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2);
    let lights = Lights {
        towards_sun: Vector3::z_axis(),
        sun: [0.0; 3],
        ambient: [1.0; 3],
        background: [0.0; 3],
        ..Lights::default()
    };
    let shade = |hit: &Hit| Shading::matt([0.5; 3], hit.normal);
    for k in 0..=(route.duration() / BETWEEN) as usize {
        let state = route.at(BETWEEN * k as f64);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), state.heading) * body_from_camera;
        let world_from_camera = Isometry3::from_parts(state.position.into(), rotation);
        let camera = paint_sim::Camera { fx: focal, fy: focal, cx, cy, width, height, world_from_camera };
        let frame = render(surface, &camera, &shade, &lights, 1, threads)?;
        if frame.depth.iter().all(|depth| *depth <= 0.0) {
            continue;
        }
        let view = DepthView {
            width: width as usize,
            height: height as usize,
            data: DepthData::F32 { data: &frame.depth },
            intrinsics: Intrinsics { fx: focal, fy: focal, cx, cy },
        };
        map.integrate(&view, None, &world_from_camera)?;
    }
    Ok(SlamState::new(map))
}
