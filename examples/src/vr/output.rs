//! What a session leaves in its folder.

use std::path::Path;

use nalgebra::{UnitVector3, Vector3};
use paint_sim::colour::decode_srgb8;
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, render};
use uv_param::SurfacePoint;

use super::canvas::Patch;
use super::counters::Traffic;
use super::error::VrError;
use super::figures::{VrFigures, figures};
use super::mission_export::write_mission;
use super::session::Session;
use crate::appearance::{Appearance, AppearanceError};
use crate::pictures::{Panel, Rgb, save_curves};
use crate::progress::Stage;
use crate::report::save_figures;
use crate::whole_file;

/// Width and height of a view, pixels.
const VIEW: (u32, u32) = (900, 560);
/// Horizontal opening angle of a view, rad.
const ANGLE: f64 = 0.9;
/// A robot that could fly less than this share of what was painted is no result.
const LEAST_FLOWN: f64 = 0.5;
/// A robot that is farther behind than this when the hand stops, m, and needs longer than this for it, s, has not followed.
const LOST: f64 = 1.0;
const LOST_TIME: f64 = 30.0;

/// Writes pictures, mission and report; the report last. The share of the paint that the mission leaves out.
pub(super) fn save(session: &Session, traffic: &Traffic, folder: &Path) -> Result<f64, VrError> {
    let stage = Stage::start("results");
    let appearance = Appearance::charcoal_on_sandstone().map_err(|error| match error {
        AppearanceError::Paint(error) => VrError::Simulation(error),
        AppearanceError::Curve(error) => VrError::Compare(error),
    })?;
    for (canvas, name) in session.canvases().into_iter().zip(["seen", "flown"]) {
        let whole = canvas.whole();
        view(session, &whole)?.save(&folder.join(format!("{name}_view.png")))?;
        let Patch { width, height, rgb, .. } = whole;
        let atlas = Rgb { width: width.into(), height: height.into(), data: rgb };
        atlas.save(&folder.join(format!("{name}.png")))?;
    }
    save_latency(session, folder)?;
    let left_out = write_mission(session, &appearance, folder)?;
    let figures = VrFigures { mission_left_out_share: left_out, ..figures(session, traffic, &appearance)? };
    save_figures(&figures, folder)?;
    stage.done(&format!(
        "{} states, {} plans, latency at most {:.2} s and {:.2} m; {}",
        figures.states,
        figures.plans,
        figures.latency_time_max_s,
        figures.latency_distance_max_m,
        folder.display()
    ));
    let flown = 1.0 - figures.refused_paint as f64 / figures.paint_tasks.max(1) as f64;
    if flown < LEAST_FLOWN {
        let advice = "paint where the robot can stand before the surface, or choose another mesh";
        return Err(VrError::Unreachable { share: flown, advice });
    }
    match session.behind() {
        Some([lag, seconds]) if lag > LOST && seconds > LOST_TIME => Err(VrError::NeverCaughtUp { lag, seconds }),
        _ => Ok(left_out),
    }
}

/// Latency in time and in distance over the session's time (VR paper, Fig. 6).
fn save_latency(session: &Session, folder: &Path) -> Result<(), VrError> {
    let curves = session.curves();
    if curves.time.is_empty() {
        return Ok(());
    }
    save_latency_table(session, &folder.join("latency.csv"))?;
    // A plan's latency holds until the next plan.
    let mut steps = Vec::new();
    for pair in curves.time.windows(2) {
        steps.extend([pair[0], (pair[1].0, pair[0].1)]);
    }
    steps.extend(curves.time.last());
    let panels = [
        Panel { label: "LT [s]", curves: vec![("latency in time", steps)] },
        Panel { label: "LD [m]", curves: vec![("latency in distance", curves.distance.clone())] },
    ];
    let title = format!("Latency, segments of {} m", session.settings().session.segment);
    Ok(save_curves(&folder.join("latency.png"), &title, "time [s]", &panels)?)
}

/// The same as rows: `time` at each plan for paint, s, `distance` every tenth of a second, m.
fn save_latency_table(session: &Session, path: &Path) -> Result<(), VrError> {
    let curves = session.curves();
    let mut table = String::from("time_s,latency,value\n");
    for (name, curve) in [("time_s", &curves.time), ("distance_m", &curves.distance)] {
        table.extend(curve.iter().map(|(time, value)| format!("{time:.3},{name},{value:.4}\n")));
    }
    whole_file::write(path, table).map_err(VrError::unwritable(path))
}

/// The surface in its paint as the person sees it from the start.
fn view(session: &Session, atlas: &Patch) -> Result<Rgb, VrError> {
    let world = session.world();
    let heading = world.home.heading;
    let ahead = Vector3::new(heading.cos(), heading.sin(), 0.0);
    let eye = world.stand - ahead * 1.2;
    let camera = Camera::looking_at(&eye, &(eye + ahead), &Vector3::z(), ANGLE, VIEW)?;
    let towards_sun = UnitVector3::new_normalize(-ahead + 0.8 * Vector3::z() + 0.4 * Vector3::z().cross(&ahead));
    let lights = Lights { towards_sun, sun: [0.9; 3], ambient: [0.3; 3], ..Lights::default() };
    let shade = |hit: &Hit| shading(session, atlas, hit);
    let frame = render(&world.surface.world, &camera, &shade, &lights, 2, 1)?;
    Ok(Rgb::from_pixels(frame.width as usize, frame.height as usize, frame.colour))
}

fn shading(session: &Session, atlas: &Patch, hit: &Hit) -> Shading {
    let surface = &session.world().surface;
    if hit.face as usize >= surface.disk().faces().len() {
        return Shading::matt([0.4; 3], hit.normal);
    }
    let [a, b] = hit.barycentric;
    let at = SurfacePoint { face: hit.face, barycentric: [1.0 - a - b, a, b] };
    let normal = surface.chart.smooth_normal(at).into_inner();
    let texel = surface.texels.texel_of_uv(surface.chart.uv_of(at));
    let albedo = texel.map_or([0.4; 3], |[column, row]| {
        let first = 3 * (row * surface.width() + column);
        [0, 1, 2].map(|k| decode_srgb8(atlas.rgb[first + k]) as f32)
    });
    Shading::matt(albedo, normal)
}
