//! A simulated flight whose robot knows of its place only what its own sensors tell.

use std::collections::VecDeque;
use std::path::Path;
use std::time::Duration;

use cpu_time::ThreadTime;
use nalgebra::Isometry3;
use paint_sim::Error;
use paint_sim::flight::{GRAVITY, LocalisedPose, PoseSource, Vehicle};
use tsdf_hash::slam::SlamState;
use tsdf_hash::storage::MapFile;
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
use vio_ekf::Stamp;

use super::localisation::{LocalisationError, LocalisationSettings, OnboardLocalisation, OnboardPose};
use crate::simulated_sensors::{FaultInterval, SensorFault, SimulatedCamera, SimulatedImage, SimulatedImu};

/// Milliseconds from one inertial sample to the next, from one image to the next, and from one depth image to the next.
const INERTIAL_MS: i64 = 5;
const IMAGE_MS: i64 = 50;
const DEPTH_MS: i64 = 100;
/// Milliseconds from an image, and from a depth image, to when what was made of it is known.
const IMAGE_LATENCY_MS: i64 = 20;
const DEPTH_LATENCY_MS: i64 = 60;
/// The robot stands and looks for its place for so long at most.
const SEARCH_MS: i64 = 3000;

/// What the localisation was worth.
#[derive(Debug, Clone, Copy, Default)]
pub struct LocalisationFigures {
    /// Time from the first image to the first pose, s.
    pub relocalised_after_s: f64,
    /// Error of that pose, m.
    pub relocalisation_error_m: f64,
    /// Depth images, and those that the map did not confirm.
    pub depth_images: usize,
    /// See above.
    pub unconfirmed: usize,
    /// Processor time of the programs on board, s.
    pub cpu: Duration,
    /// Sum of the squares of the position error over all control steps, m²; their number.
    squares: f64,
    steps: usize,
}

impl LocalisationFigures {
    /// Of both flights together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            relocalised_after_s: self.relocalised_after_s.max(other.relocalised_after_s),
            relocalisation_error_m: self.relocalisation_error_m.max(other.relocalisation_error_m),
            depth_images: self.depth_images + other.depth_images,
            unconfirmed: self.unconfirmed + other.unconfirmed,
            cpu: self.cpu + other.cpu,
            squares: self.squares + other.squares,
            steps: self.steps + other.steps,
        }
    }

    /// Position error, root mean square, m.
    pub fn position_error_rms_m(&self) -> f64 {
        (self.squares / self.steps.max(1) as f64).sqrt()
    }
}

/// Sensors before a surface, the programs on board, and what they say.
pub struct LocalisedFlight<'a> {
    camera: SimulatedCamera<'a>,
    imu: Option<SimulatedImu>,
    onboard: OnboardLocalisation,
    seed: u64,
    /// Images on their way through the programs.
    images: VecDeque<Arriving<SimulatedImage>>,
    depths: VecDeque<Arriving<(SimulatedImage, Option<Isometry3<f64>>)>>,
    /// From milliseconds of the reference to those of the sensors' clock; `None` before the robot has found itself.
    offset: Option<i64>,
    captured: usize,
    fault: Option<FaultInterval>,
    figures: LocalisationFigures,
}

impl<'a> LocalisedFlight<'a> {
    /// In a stored map of the surface, from its file.
    pub fn new(camera: SimulatedCamera<'a>, map: &Path, seed: u64) -> Result<Self, LocalisationError> {
        let map = SlamState::read(
            MapFile::open(map)?,
            &tsdf_hash::Settings { threads: 1, ..tsdf_hash::Settings::default() },
            None,
        )?;
        let odometry = vio_ekf::Settings { gravity: GRAVITY, ..vio_ekf::Settings::default() };
        let settings =
            LocalisationSettings { depth_interval_s: 1e-3 * DEPTH_MS as f64, ..LocalisationSettings::default() };
        Ok(Self {
            onboard: OnboardLocalisation::new(map, camera.camera, odometry, settings)?,
            camera,
            imu: None,
            seed,
            images: VecDeque::new(),
            depths: VecDeque::new(),
            offset: None,
            captured: 0,
            fault: None,
            figures: LocalisationFigures::default(),
        })
    }

    /// With a fault of its sensors.
    #[must_use]
    pub fn with_fault(self, fault: FaultInterval) -> Self {
        Self { fault: Some(fault), ..self }
    }

    fn fault(&self, ms: i64) -> Option<SensorFault> {
        self.fault.as_ref().filter(|fault| fault.when.contains(&ms)).map(|fault| fault.fault)
    }

    /// What it was worth.
    pub fn figures(&self) -> LocalisationFigures {
        self.figures
    }

    fn capture(&mut self, truth: &Vehicle) -> Result<SimulatedImage, Error> {
        self.captured += 1;
        self.camera.capture(self.captured, &(truth.world_from_body() * self.camera.camera.body_from_camera))
    }

    /// Looks for its place before take-off, at the pose where it stands. Returns the milliseconds that takes.
    fn search(&mut self, truth: &Vehicle) -> Result<i64, String> {
        self.imu = Some(SimulatedImu::new(LocalisationSettings::default().imu, self.seed, stamp(0), truth));
        for ms in (1..=SEARCH_MS).filter(|ms| ms % INERTIAL_MS == 0) {
            self.sense_motion(ms, truth)?;
            if ms % DEPTH_MS != 0 {
                continue;
            }
            let image = self.capture(truth).map_err(|error| error.to_string())?;
            let views = Views::of(&image, &self.camera);
            let cpu = ThreadTime::now();
            let found = self.onboard.relocalise(stamp(ms), &views.depth(&image), &views.colour());
            self.figures.cpu += cpu.elapsed();
            if let Some(world_from_body) = found.map_err(|error| error.to_string())? {
                self.figures.relocalised_after_s = 1e-3 * ms as f64;
                let error = world_from_body.translation.vector - truth.position.coords;
                self.figures.relocalisation_error_m = error.norm();
                return Ok(ms);
            }
        }
        Err(format!("the robot does not find itself in the map within {} s: it does not take off", SEARCH_MS / 1000))
    }

    fn sense_motion(&mut self, ms: i64, truth: &Vehicle) -> Result<(), String> {
        let fault = self.fault(ms);
        let sample = self.imu.as_mut().map(|imu| imu.sample(stamp(ms), truth));
        let sample = sample.and_then(|sample| fault.map_or(Some(sample), |fault| fault.inertial(sample)));
        let Some(sample) = sample else { return Ok(()) };
        let cpu = ThreadTime::now();
        let done = self.onboard.imu(&sample).map_err(|error| error.to_string());
        self.figures.cpu += cpu.elapsed();
        done
    }

    /// What the sensors give at a millisecond of their clock, and what the programs are through with.
    fn sense(&mut self, ms: i64, truth: &Vehicle) -> Result<(), String> {
        let text = |error: LocalisationError| error.to_string();
        if ms % INERTIAL_MS == 0 {
            self.sense_motion(ms, truth)?;
        }
        if ms % IMAGE_MS == 0 {
            let mut image = self.capture(truth).map_err(|error| error.to_string())?;
            let fault = self.fault(ms);
            if fault == Some(SensorFault::CameraBlack) {
                image.darken();
            }
            if ms % DEPTH_MS == 0 && !matches!(fault, Some(SensorFault::NoDepth | SensorFault::NoImages)) {
                let pose = self.onboard.pose(stamp(ms)).map(|pose| pose.world_from_body);
                self.depths.push_back(Arriving { at: ms + DEPTH_LATENCY_MS, taken: ms, what: (image.clone(), pose) });
            }
            if fault != Some(SensorFault::NoImages) {
                self.images.push_back(Arriving { at: ms + IMAGE_LATENCY_MS, taken: ms, what: image });
            }
        }
        let cpu = ThreadTime::now();
        while let Some(Arriving { taken, what: image, .. }) = self.images.pop_front_if(|image| image.at <= ms) {
            self.onboard.image(stamp(taken), &image.grey()).map_err(text)?;
        }
        while let Some(Arriving { taken, what: (image, pose), .. }) = self.depths.pop_front_if(|depth| depth.at <= ms) {
            let views = Views::of(&image, &self.camera);
            let update =
                self.onboard.depth(stamp(taken), &views.depth(&image), &views.colour(), pose.as_ref()).map_err(text)?;
            self.figures.depth_images += 1;
            self.figures.unconfirmed += usize::from(!update.confirmed);
        }
        self.figures.cpu += cpu.elapsed();
        Ok(())
    }
}

impl PoseSource for LocalisedFlight<'_> {
    fn moved(&mut self, time: f64, truth: &Vehicle) -> Result<(), Error> {
        let Some(offset) = self.offset else { return Ok(()) };
        self.sense(milliseconds(time) + offset, truth).map_err(|why| Error::Localisation { time, why })
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        if self.offset.is_none() {
            let found = self.search(truth).map_err(|why| Error::Localisation { time, why })?;
            self.offset = Some(found - milliseconds(time));
        }
        let now = stamp(milliseconds(time) + self.offset.unwrap_or_default());
        let Some(OnboardPose { world_from_body, trusted, .. }) = self.onboard.pose(now) else { return Ok(None) };
        self.figures.steps += 1;
        self.figures.squares += (world_from_body.translation.vector - truth.position.coords).norm_squared();
        Ok(Some(LocalisedPose { world_from_body, trusted }))
    }
}

/// A measurement on its way through the programs, in milliseconds of the sensors' clock.
struct Arriving<T> {
    at: i64,
    taken: i64,
    what: T,
}

/// An image as the map wants it.
struct Views {
    size: (usize, usize),
    intrinsics: Intrinsics,
    rgb: Vec<u8>,
}

impl Views {
    fn of(image: &SimulatedImage, camera: &SimulatedCamera) -> Self {
        let size = (camera.camera.width, camera.camera.height);
        Self { size, intrinsics: camera.intrinsics(), rgb: image.colour() }
    }

    fn depth<'a>(&self, image: &'a SimulatedImage) -> DepthView<'a> {
        let ((width, height), data) = (self.size, DepthData::F32 { data: &image.depth });
        DepthView { width, height, data, intrinsics: self.intrinsics }
    }

    fn colour(&self) -> ColourView<'_> {
        let ((width, height), data) = (self.size, ColourData::Rgb8(&self.rgb));
        ColourView { width, height, data, intrinsics: self.intrinsics }
    }
}

fn milliseconds(time: f64) -> i64 {
    (1e3 * time).round() as i64
}

fn stamp(ms: i64) -> Stamp {
    Stamp::from_nanos(1_000_000 * ms)
}
