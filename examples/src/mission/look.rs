//! Looking at the painted surface from a flight along it: the film on every texel, by pictures from before and after.

use paint_sim::colour::decode_srgb8;
use paint_sim::film::inspection::{FilmEstimate, GreyPaint, Mosaic, Picture, estimate_film};
use paint_sim::flight::{CONTROL_STEP, FlightSample, LocalisedPose, PoseSource, Reference as _, Vehicle};
use paint_sim::{Error, FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::flight_conditions::localisation_noise;
use super::flight_sensors::{Poses, camera_before};
use super::fly::LayerFlight;
use super::flyer::{Flight, Flyer, Purpose};
use super::painting_task::PaintingTask;
use crate::progress::Stage;
use crate::scan_flight::route::along;
use crate::simulated_sensors::{SEEN, SimulatedCamera};

/// Distance of the robot from the foremost point of the surface, metres: near, as an error of its attitude shifts what it sees.
const STAND_OFF: f64 = 1.0;
/// Seconds between two pictures.
const BETWEEN: f64 = 0.5;
/// With fewer bare texels light and exposure are taken for unchanged.
const LEAST_BARE: usize = 500;

/// The film that flights have left on texels, as the robot sees it; `bare` are texels that no paint was meant for.
pub(super) fn look(
    task: &PaintingTask,
    flights: &[LayerFlight],
    bare: &[bool],
    flyer: &mut dyn Flyer,
) -> Result<Vec<Option<FilmEstimate>>, MissionError> {
    let stage = Stage::start("look");
    let paint = &task.paint.paint;
    let before =
        photograph(task, camera_before(task, std::iter::empty())?, 1, flyer, &|share| stage.share(0.5 * share))?;
    let camera = camera_before(task, flights.iter().flat_map(|layer| layer.shots.iter().map(|(_, shot)| *shot)))?;
    let after = photograph(task, camera, 2, flyer, &|share| stage.share(0.5 + 0.5 * share))?;
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
fn photograph(
    task: &PaintingTask,
    camera: SimulatedCamera,
    number: u64,
    flyer: &mut dyn Flyer,
    tell: &dyn Fn(f64),
) -> Result<Mosaic, MissionError> {
    let PaintingTask { settings, surface, .. } = task;
    let seed = settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(0x100 + number);
    let usual =
        FlightSettings { airframe: settings.airframe, model: Some(settings.model), seed, ..FlightSettings::default() };
    let conditions = FlightSettings { localisation: localisation_noise(settings, usual.localisation), ..usual };
    let mut poses = Poses::of(task, || Ok(camera.clone()), number, &conditions)?;
    // The robot knows the surface that it plans on.
    let mosaic = Mosaic::new(surface.film_texels().0);
    let mut photographer = Photographer {
        inner: poses.source(),
        camera,
        known: &surface.world,
        mosaic,
        next: 0.0,
        taken: 0,
        threads: settings.threads,
    };
    let route = along(task.met(), &surface.facing(), STAND_OFF).map_err(MissionError::Look)?;
    let flight = Flight { task, purpose: Purpose::Look, reference: &route, conditions };
    let (_, ended) = flyer.fly(&flight, &mut photographer, &|time| tell(time / route.duration()))?;
    ended.map_or(Ok(photographer.mosaic), Err)
}

/// Another source of poses, with a camera that takes pictures on the way.
struct Photographer<'a> {
    inner: &'a mut dyn PoseSource,
    camera: SimulatedCamera<'a>,
    known: &'a TriangleSurface,
    mosaic: Mosaic,
    /// When it takes the next, s.
    next: f64,
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
        let known = pose.filter(|pose| pose.trusted && time >= self.next);
        if let Some(LocalisedPose { world_from_body, .. }) = known {
            // Half a control step less, or rounding would decide.
            self.next = time + BETWEEN - 0.5 * CONTROL_STEP;
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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Translation3};

    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::region::Scene;

    /// It is where it stands, and knows it.
    struct Standing;

    impl PoseSource for Standing {
        fn pose(&mut self, _: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
            let world_from_body = Isometry3::from_parts(Translation3::from(truth.position.coords), truth.rotation());
            Ok(Some(LocalisedPose { world_from_body, trusted: true, sigma: [0.0; 2] }))
        }
    }

    /// A flight whose clock is at 30 s when it begins: two pictures in the first 0.6 s, not all those of the half minute before.
    #[test]
    fn pictures_are_half_a_second_apart_whenever_they_begin() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let task = PaintingTask::undecided("wall", &Scene::whole(test_panel::mesh()), settings).unwrap();
        let mut photographer = Photographer {
            inner: &mut Standing,
            camera: camera_before(&task, std::iter::empty()).unwrap(),
            known: &task.surface.world,
            mosaic: Mosaic::new(task.surface.film_texels().0),
            next: 0.0,
            taken: 0,
            threads: 1,
        };
        let stands = Vehicle::at_rest(Point3::new(-1.0, 0.0, 2.0), 0.0);
        for step in 0..60 {
            photographer.pose(30.0 + 0.01 * f64::from(step), &stands).unwrap();
        }
        assert_eq!(photographer.taken, 2);
        assert!(photographer.mosaic.light().iter().flatten().count() > 1000);
    }
}
