//! Looking at the painted surface from a flight along it: the film on every texel, by pictures from before and after.

use nalgebra::Point3;
use paint_sim::colour::decode_srgb8;
use paint_sim::film::inspection::{FilmEstimate, GreyPaint, Mosaic, Picture, estimate_film};
use paint_sim::flight::{
    CascadedController, ControllerSettings, FlightSample, IdealPanTilt, LocalisedPose, PoseSensor, PoseSource, Vehicle,
    fly_localised,
};
use paint_sim::{Error, FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::flight_sensors::{camera_before, localised_flight};
use super::fly::{LayerFlight, localisation_noise};
use super::painting_task::PaintingTask;
use super::settings::LocalisationChoice;
use crate::progress::Stage;
use crate::scan_flight::route::along;
use crate::simulated_sensors::{SEEN, SimulatedCamera};

/// Distance of the robot from the foremost point of the surface, metres: near, as an error of its attitude shifts what it sees.
const STAND_OFF: f64 = 1.0;
/// Seconds between two pictures.
const BETWEEN: f64 = 0.5;
/// With fewer bare texels light and exposure are taken for unchanged.
const LEAST_BARE: usize = 500;
/// Length of the gun, metres: it points ahead and does nothing.
const GUN: f64 = 0.3;

/// The film that flights have left on texels, as the robot sees it; `bare` are texels that no paint was meant for.
pub(super) fn look(
    task: &PaintingTask,
    flights: &[LayerFlight],
    bare: &[bool],
) -> Result<Vec<Option<FilmEstimate>>, MissionError> {
    let stage = Stage::start("look");
    let paint = &task.paint.paint;
    let before = photograph(task, camera_before(task, std::iter::empty())?, 1)?;
    stage.share(0.5);
    let after = photograph(task, camera_before(task, flights.iter().map(|layer| &layer.flight))?, 2)?;
    // The camera's exposure is set by a white patch, so that its light is the reflectance.
    let light: Vec<f64> = before.light().iter().flatten().map(|texel| texel.log.exp()).collect();
    let ground = light.iter().sum::<f64>() / light.len().max(1) as f64;
    let enough = bare.iter().filter(|bare| **bare).count() >= LEAST_BARE;
    let told = estimate_film(&before, &after, enough.then_some(bare), &GreyPaint::at(paint, SEEN), ground)?;
    let seen = told.iter().flatten().count();
    stage.done(&format!("{:.1} % of the surface seen", 100.0 * seen as f64 / told.len().max(1) as f64));
    Ok(told)
}

/// Flies along the surface and takes pictures; places are where the robot takes itself to be.
fn photograph(task: &PaintingTask, camera: SimulatedCamera, flight: u64) -> Result<Mosaic, MissionError> {
    let PaintingTask { settings, surface, .. } = task;
    let seed = settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(0x100 + flight);
    let usual =
        FlightSettings { airframe: settings.airframe, model: Some(settings.model), seed, ..FlightSettings::default() };
    let mut sensor = PoseSensor::new(localisation_noise(settings, usual.localisation), 0.01, seed);
    let mut onboard = match settings.localisation.unwrap_or_default() {
        LocalisationChoice::Slam => Some(localised_flight(task, camera.clone(), flight)?),
        LocalisationChoice::MotionCapture | LocalisationChoice::Noise => None,
    };
    let inner: &mut dyn PoseSource = match &mut onboard {
        Some(onboard) => onboard,
        None => &mut sensor,
    };
    // The robot knows the surface that it plans on.
    let mosaic = Mosaic::new(surface.film_texels().0);
    let mut photographer =
        Photographer { inner, camera, known: &surface.world, mosaic, taken: 0, threads: settings.threads };
    let route = along(task.met(), &surface.facing(), STAND_OFF).map_err(MissionError::Look)?;
    let mut controller = CascadedController::new(usual.model(), ControllerSettings::default());
    let mut gun = IdealPanTilt::new(Point3::origin(), GUN, [0.8; 2])?;
    fly_localised(&route, &mut controller, &mut gun, task.met(), &mut photographer, &usual)?;
    Ok(photographer.mosaic)
}

/// Another source of poses, with a camera that takes pictures on the way.
struct Photographer<'a> {
    inner: &'a mut dyn PoseSource,
    camera: SimulatedCamera<'a>,
    known: &'a TriangleSurface,
    mosaic: Mosaic,
    taken: usize,
    threads: usize,
}

impl PoseSource for Photographer<'_> {
    fn moved(&mut self, time: f64, truth: &Vehicle) -> Result<(), Error> {
        self.inner.moved(time, truth)
    }

    fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        self.inner.sprayed(sample, interval);
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        let pose = self.inner.pose(time, truth)?;
        let known = pose.filter(|pose| pose.trusted && time >= BETWEEN * self.taken as f64);
        if let Some(LocalisedPose { world_from_body, .. }) = known {
            self.taken += 1;
            let vio_ekf::Camera { fx, fy, cx, cy, width, height, body_from_camera, .. } = self.camera.camera;
            let image = self.camera.capture(self.taken, &(truth.world_from_body() * body_from_camera))?;
            let light: Vec<f32> = image.grey().data.iter().map(|grey| decode_srgb8(*grey) as f32).collect();
            let world_from_camera = world_from_body * body_from_camera;
            let (width, height) = (width as u32, height as u32);
            let camera = paint_sim::Camera { fx, fy, cx, cy, width, height, world_from_camera };
            self.mosaic.add(&Picture { camera, light: &light }, self.known, self.threads)?;
        }
        Ok(pose)
    }
}
