//! A simulated flight whose robot knows of its place only what its own sensors tell.

use std::collections::VecDeque;
use std::time::Duration;

use cpu_time::ThreadTime;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use paint_sim::Error;
use paint_sim::flight::multirotor::{Imu, ImuSettings};
use paint_sim::flight::{FlightSample, GRAVITY, LocalisedPose, PoseSource, Vehicle};
use tsdf_hash::slam::SlamState;
use vio_ekf::Stamp;
use vio_ekf::fusion::{AidedPose, ImuPairSettings, MapAidedSettings, UnifiedSettings};

use super::localisation::{LocalisationError, OnboardLocalisation};
use super::sway::{FIRST_MS, SWAY_MS, in_its_place, sway};
use crate::simulated_sensors::{
    FRAMES_PER_SECOND, FaultInterval, PaintedFront, SensorFault, SimulatedCamera, SimulatedImage,
};

/// Milliseconds from one inertial sample to the next, from one image to the next, and from one depth image to the next.
const INERTIAL_MS: i64 = 5;
const IMAGE_MS: i64 = (1000.0 / FRAMES_PER_SECOND) as i64;
const DEPTH_MS: i64 = 100;
/// Milliseconds from an image, and from a depth image, to when what was made of it is known.
const IMAGE_LATENCY_MS: i64 = 20;
const DEPTH_LATENCY_MS: i64 = 60;
/// The vehicle's own sensor has noise of its own.
const OF_VEHICLE: u64 = 0x1_0000;
/// A vehicle's sensor that is later than this, s, is left out.
const SECOND_IMU_TIMEOUT: f64 = 0.01;

/// What the localisation was worth.
#[derive(Debug, Clone, Copy, Default)]
pub struct LocalisationFigures {
    /// Time from the first image to the first pose, s.
    pub relocalised_after_s: f64,
    /// Error of that pose, m.
    pub relocalisation_error_m: f64,
    /// Depth images.
    pub depth_images: usize,
    /// Those of them that gave no pose in the map, or one that was not the expected one.
    pub unconfirmed: usize,
    /// Processor time of the programs on board, s.
    pub cpu: Duration,
    /// Sum of the squares of the position error over all control steps, m².
    squares: f64,
    /// Control steps.
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

/// What the pose between two images is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bridging {
    /// The odometry's last two poses, at the times of their images, moved on.
    Odometry,
    /// The inertial sensor of the camera.
    CameraImu,
    /// That and the vehicle's own.
    #[default]
    BothImus,
}

/// Sensors before a surface, the programs on board, and what they say.
pub struct LocalisedFlight<'a> {
    camera: SimulatedCamera<'a>,
    imu: Imu,
    vehicle_imu: Imu,
    bridging: Bridging,
    onboard: OnboardLocalisation,
    /// Images on their way through the programs.
    images: VecDeque<Arriving<SimulatedImage>>,
    depths: VecDeque<Arriving<(SimulatedImage, Option<AidedPose>)>>,
    /// What the odometry said of the moments of images, and the last two of those that are known.
    said: VecDeque<Arriving<Option<AidedPose>>>,
    known: [Option<(i64, AidedPose)>; 2],
    /// From milliseconds of the reference to those of the sensors' clock; `None` before the robot has found itself.
    offset: Option<i64>,
    captured: usize,
    /// Milliseconds of the sensors' clock now, and when the first paint left the nozzle.
    now: i64,
    painting_since: Option<i64>,
    faults: Vec<FaultInterval>,
    /// Inertial samples that are late, of the camera's sensor and of the vehicle's.
    late: [VecDeque<Arriving<vio_ekf::Imu>>; 2],
    figures: LocalisationFigures,
}

impl<'a> LocalisedFlight<'a> {
    /// In a stored map of the surface.
    pub fn new(camera: SimulatedCamera<'a>, map: SlamState, seed: u64) -> Result<Self, LocalisationError> {
        Self::bridged(camera, map, seed, Bridging::default())
    }

    /// The same with poses between images as it is said.
    pub fn bridged(
        camera: SimulatedCamera<'a>,
        map: SlamState,
        seed: u64,
        bridging: Bridging,
    ) -> Result<Self, LocalisationError> {
        let odometry = vio_ekf::Settings { gravity: GRAVITY, ..vio_ekf::Settings::default() };
        let pair = ImuPairSettings { timeout_s: SECOND_IMU_TIMEOUT, ..ImuPairSettings::default() };
        let unified = UnifiedSettings {
            lag_s: 1e-3 * (DEPTH_LATENCY_MS + 2 * INERTIAL_MS) as f64,
            imu_pair: (bridging == Bridging::BothImus).then_some(pair),
            ..UnifiedSettings::default()
        };
        let settings =
            MapAidedSettings { unified, pose_interval_s: 1e-3 * DEPTH_MS as f64, ..MapAidedSettings::default() };
        Ok(Self {
            onboard: OnboardLocalisation::new(map, camera.camera, odometry, settings)?,
            camera,
            imu: Imu::new(ImuSettings::default(), seed)?,
            vehicle_imu: Imu::new(ImuSettings::default(), seed.wrapping_add(OF_VEHICLE))?,
            bridging,
            said: VecDeque::new(),
            known: [None; 2],
            images: VecDeque::new(),
            depths: VecDeque::new(),
            offset: None,
            captured: 0,
            now: 0,
            painting_since: None,
            faults: Vec::new(),
            late: Default::default(),
            figures: LocalisationFigures::default(),
        })
    }

    /// With faults of its sensors, one at a time.
    #[must_use]
    pub fn with_faults(self, faults: Vec<FaultInterval>) -> Self {
        Self { faults, ..self }
    }

    /// What is wrong now.
    fn fault(&self) -> Option<FaultInterval> {
        let painting = 1e-3 * (self.now - self.painting_since?) as f64;
        self.faults.iter().copied().find(|fault| fault.contains(painting))
    }

    /// The paint that is on the surface, where the camera sees it.
    pub fn into_paint(self) -> Option<PaintedFront> {
        self.camera.into_paint()
    }

    /// What it was worth.
    pub fn figures(&self) -> LocalisationFigures {
        self.figures
    }

    fn capture(&mut self, truth: &Vehicle) -> Result<SimulatedImage, LocalisationError> {
        self.captured += 1;
        let world_from_camera = truth.world_from_body() * self.camera.camera.body_from_camera;
        Ok(self.camera.capture(self.captured, &world_from_camera)?)
    }

    /// Looks for its place before the flight, at the pose where it stands and then swaying about it, in the air or in its operator's hand. Returns
    /// the milliseconds that takes.
    fn search(&mut self, truth: &Vehicle) -> Result<i64, LocalisationError> {
        let mut found = false;
        for ms in 1..=SWAY_MS {
            let (truth, stands) = sway(truth, ms);
            if found {
                self.sense(ms, &truth)?;
                continue;
            }
            found = self.look(ms, &truth, stands)?;
            if found && in_its_place(ms) {
                return Ok(ms);
            }
        }
        if found { Ok(SWAY_MS) } else { Err(LocalisationError::NotHere { seconds: 1e-3 * SWAY_MS as f64 }) }
    }

    /// A millisecond of looking for its place. Returns whether it has been found: then the odometry starts there.
    fn look(&mut self, ms: i64, truth: &Vehicle, stands: bool) -> Result<bool, LocalisationError> {
        if ms % INERTIAL_MS == 0 {
            self.sense_motion(ms, truth)?;
        }
        if ms % DEPTH_MS != 0 {
            return Ok(false);
        }
        let image = self.capture(truth)?;
        let views = self.camera.views(&image);
        let cpu = ThreadTime::now();
        // What does not look as it did may have been painted since.
        let colour = (ms <= FIRST_MS).then(|| views.colour());
        let pose = self.onboard.relocalise(stamp(ms), &views.depth(), colour.as_ref(), stands);
        self.figures.cpu += cpu.elapsed();
        let Some(world_from_body) = pose? else { return Ok(false) };
        self.figures.relocalised_after_s = 1e-3 * ms as f64;
        self.figures.relocalisation_error_m = (world_from_body.translation.vector - truth.position.coords).norm();
        Ok(true)
    }

    fn sense_motion(&mut self, ms: i64, truth: &Vehicle) -> Result<(), LocalisationError> {
        let reading = self.imu.measure(&truth.velocity, &truth.rotation(), 1e-3 * INERTIAL_MS as f64);
        let of_vehicle = self.vehicle_imu.measure(&truth.velocity, &truth.rotation(), 1e-3 * INERTIAL_MS as f64);
        let failing = self.fault();
        let cpu = ThreadTime::now();
        let mut done = Ok(());
        for (which, reading) in [reading, of_vehicle].into_iter().enumerate() {
            let sample =
                vio_ekf::Imu { stamp: stamp(ms), gyro: reading.angular_velocity, accel: reading.specific_force };
            let fault = failing.filter(|fault| fault.of_vehicle == (which == 1)).map(|fault| fault.fault);
            let late = &mut self.late[which];
            let delay = if let Some(SensorFault::LateMotion(delay)) = fault { delay } else { 0 };
            let sample = fault.map_or(Some(sample), |fault| fault.inertial(sample));
            late.extend(sample.map(|what| Arriving { at: ms + delay, taken: ms, what }));
            while let Some(Arriving { what, .. }) = late.pop_front_if(|late| delay == 0 || late.at <= ms) {
                if which == 0 {
                    done = done.and_then(|()| self.onboard.imu(&what));
                } else if self.bridging == Bridging::BothImus {
                    done = done.and_then(|()| self.onboard.second_imu(&what));
                }
            }
        }
        self.figures.cpu += cpu.elapsed();
        done
    }

    /// The last two poses of the odometry, moved on to now.
    fn moved_on(&mut self, ms: i64) -> Option<AidedPose> {
        while let Some(Arriving { taken, what, .. }) = self.said.pop_front_if(|said| said.at <= ms) {
            self.known = [self.known[1], what.map(|pose| (taken, pose))];
        }
        let [before, last] = self.known;
        let (at, last) = last?;
        let Some((first, before)) = before.filter(|(_, before)| before.source == last.source) else {
            return Some(last);
        };
        let share = (ms - at) as f64 / (at - first) as f64;
        let [from, to] = [before.world_from_body, last.world_from_body];
        let shift = (to.translation.vector - from.translation.vector) * share;
        let turn = UnitQuaternion::from_scaled_axis((to.rotation * from.rotation.inverse()).scaled_axis() * share);
        let world_from_body = Isometry3::from_parts((to.translation.vector + shift).into(), turn * to.rotation);
        Some(AidedPose { world_from_body, ..last })
    }

    /// What the sensors give at a millisecond of their clock, and what the programs are through with.
    fn sense(&mut self, ms: i64, truth: &Vehicle) -> Result<(), LocalisationError> {
        self.now = ms;
        if ms % INERTIAL_MS == 0 {
            self.sense_motion(ms, truth)?;
        }
        if ms % IMAGE_MS == 0 {
            let mut image = self.capture(truth)?;
            let fault = self.fault().map(|fault| fault.fault);
            if self.bridging == Bridging::Odometry {
                let what = self.onboard.pose(stamp(ms));
                self.said.push_back(Arriving { at: ms + IMAGE_LATENCY_MS, taken: ms, what });
            }
            if fault == Some(SensorFault::CameraBlack) {
                image.darken();
            }
            if ms % DEPTH_MS == 0 && !matches!(fault, Some(SensorFault::NoDepth | SensorFault::NoImages)) {
                let depth = match fault {
                    Some(SensorFault::DepthOfElsewhere(off)) => self.capture(&beside(truth, off))?,
                    _ => image.clone(),
                };
                let pose = self.onboard.pose(stamp(ms));
                self.depths.push_back(Arriving { at: ms + DEPTH_LATENCY_MS, taken: ms, what: (depth, pose) });
            }
            if fault != Some(SensorFault::NoImages) {
                self.images.push_back(Arriving { at: ms + IMAGE_LATENCY_MS, taken: ms, what: image });
            }
        }
        let cpu = ThreadTime::now();
        while let Some(Arriving { taken, what: image, .. }) = self.images.pop_front_if(|image| image.at <= ms) {
            self.onboard.image(stamp(taken), &image.grey())?;
        }
        while let Some(Arriving { taken, what: (image, pose), .. }) = self.depths.pop_front_if(|depth| depth.at <= ms) {
            let views = self.camera.views(&image);
            let update = self.onboard.depth(stamp(taken), &views.depth(), pose.as_ref())?;
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
        self.sense(milliseconds(time) + offset, truth).map_err(|why| Error::Localisation { time, why: why.to_string() })
    }

    fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        if sample.flow > 0.0 {
            self.painting_since.get_or_insert(self.now);
        }
        self.camera.spray(sample, interval);
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        if self.offset.is_none() {
            let found = self.search(truth).map_err(|why| Error::Localisation { time, why: why.to_string() })?;
            self.offset = Some(found - milliseconds(time));
        }
        let now = milliseconds(time) + self.offset.unwrap_or_default();
        let pose = match self.bridging {
            Bridging::Odometry => self.moved_on(now).or_else(|| self.onboard.pose(stamp(now))),
            Bridging::CameraImu | Bridging::BothImus => self.onboard.pose(stamp(now)),
        };
        let Some(AidedPose { world_from_body, trusted, position_sigma_m, attitude_sigma_rad, .. }) = pose else {
            return Ok(None);
        };
        self.figures.steps += 1;
        self.figures.squares += (world_from_body.translation.vector - truth.position.coords).norm_squared();
        Ok(Some(LocalisedPose { world_from_body, trusted, sigma: [position_sigma_m, attitude_sigma_rad] }))
    }
}

/// A measurement on its way through the programs, in milliseconds of the sensors' clock.
struct Arriving<T> {
    at: i64,
    taken: i64,
    what: T,
}

/// The same so far to its left, m.
fn beside(truth: &Vehicle, off: f64) -> Vehicle {
    Vehicle { position: truth.position + truth.rotation() * Vector3::y() * off, ..*truth }
}

fn milliseconds(time: f64) -> i64 {
    (1e3 * time).round() as i64
}

fn stamp(ms: i64) -> Stamp {
    Stamp::from_nanos(1_000_000 * ms)
}
