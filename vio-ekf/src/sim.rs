//! A test bed for visual-inertial odometry: a smooth motion, the exact inertial readings along it with the faults of a
//! real sensor, and photographs of a textured room.
//!
//! The spline is the truth. Everything random comes from the seed, and every frame can be made by itself, on any thread
//! and in any order, with the same bytes.
//!
//! ```
//! use vio_ekf::nalgebra::Isometry3;
//! use vio_ekf::sim::{RoomSettings, Scenario, Simulation};
//! use vio_ekf::Stamp;
//! use vio_ekf::trajectory::Spline;
//!
//! // Sideways along a wall at 1 m/s for half a second, looking along the body's z axis.
//! let knots = (0..14).map(|i| Isometry3::translation(0.05 * f64::from(i), 0.0, 1.0)).collect();
//! let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, knots)?;
//! let room = RoomSettings { texture_size: 256, ..RoomSettings::default() };
//! let simulation = Simulation::new(spline, Scenario { seed: 7, room, ..Scenario::default() })?;
//!
//! let imu = simulation.imu(0)?;
//! assert!((imu.samples[0].accel.norm() - 9.81).abs() < 0.5);
//! let frame = simulation.frames(0).next().expect("the motion is longer than an exposure")?;
//! assert_eq!(frame.data.len(), 752 * 480);
//! # Ok::<(), vio_ekf::Error>(())
//! ```

mod camera;
mod flight;
mod imu;
mod photometry;
mod points;
mod render;
mod rng;
mod room;
mod texture;

pub use camera::{Frame, SimulatedCamera};
pub use flight::{camera_ahead, camera_ahead_right, painting_flight};
pub use imu::{ImuLimits, ImuModel, ImuRecording, Vibration};
pub use photometry::{Gain, Photometry};
pub use points::{forward_pinhole, observe_points, swaying_flight};
pub use room::{Cuboid, Occluder, Room, RoomSettings, Surface};
pub use texture::Texture;

use camera::Renderer;
#[cfg(any(test, feature = "tune"))]
pub(crate) use rng::Rng;
use rng::derive;

use crate::error::Error;
use crate::error::invalid;
use crate::stamp::Stamp;
use crate::trajectory::spline::{Motion, Spline};

/// What is simulated.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Scenario {
    /// Seed of the room, the biases and all noise; 1.
    pub seed: u64,
    /// Gravity along the world's −z, m/s²; 9.81.
    pub gravity: f64,
    /// Inertial sensors; one of the EuRoC vehicle.
    pub imus: Vec<ImuModel>,
    /// Cameras; the left one of the EuRoC vehicle.
    pub cameras: Vec<SimulatedCamera>,
    /// The room.
    pub room: RoomSettings,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            seed: 1,
            gravity: 9.81,
            imus: vec![ImuModel::default()],
            cameras: vec![SimulatedCamera::default()],
            room: RoomSettings::default(),
        }
    }
}

/// A motion through a room, ready to be recorded.
pub struct Simulation {
    spline: Spline,
    seed: u64,
    gravity: f64,
    imus: Vec<ImuModel>,
    renderers: Vec<Renderer>,
    room: Room,
}

impl Simulation {
    /// Builds a room around the motion.
    pub fn new(spline: Spline, scenario: Scenario) -> Result<Self, Error> {
        let room = Room::around(&spline, &scenario.room, scenario.seed)?;
        Self::in_room(spline, room, scenario)
    }

    /// In a room of the caller's; [`Scenario::room`] is not used. The motion should stay inside it.
    pub fn in_room(spline: Spline, room: Room, scenario: Scenario) -> Result<Self, Error> {
        room.check()?;
        if !(scenario.gravity >= 0.0 && scenario.gravity.is_finite()) {
            return Err(invalid("gravity", scenario.gravity, "must be finite and not negative"));
        }
        for imu in &scenario.imus {
            imu.check()?;
        }
        let renderer =
            |(index, model): (u64, SimulatedCamera)| Renderer::new(model, &spline, derive(scenario.seed, 1000 + index));
        let renderers = (0..).zip(scenario.cameras).map(renderer).collect::<Result<_, _>>()?;
        Ok(Self { spline, seed: scenario.seed, gravity: scenario.gravity, imus: scenario.imus, renderers, room })
    }

    /// The motion, which is the truth.
    pub fn spline(&self) -> &Spline {
        &self.spline
    }

    /// The room.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// True motion at a time inside the spline's span.
    pub fn motion(&self, stamp: Stamp) -> Result<Motion, Error> {
        self.spline.sample(stamp)
    }

    /// What inertial sensor `which` recorded over the whole motion.
    pub fn imu(&self, which: usize) -> Result<ImuRecording, Error> {
        let model = self.imus.get(which).ok_or_else(|| missing("inertial sensor", which, self.imus.len()))?;
        model.record(&self.spline, self.gravity, derive(self.seed, 100 + which as u64))
    }

    /// Number of frames that camera `which` takes, those it loses included; 0 for a camera that is not there.
    pub fn frame_count(&self, which: usize) -> usize {
        self.renderers.get(which).map_or(0, Renderer::frames)
    }

    /// Frame `index` of camera `which`; `None` if the camera lost it.
    pub fn frame(&self, which: usize, index: usize) -> Result<Option<Frame>, Error> {
        let renderer = self.renderers.get(which).ok_or_else(|| missing("camera", which, self.renderers.len()))?;
        if index >= renderer.frames() {
            return Err(missing("frame", index, renderer.frames()));
        }
        let shot = renderer.shot(index);
        if shot.lost {
            return Ok(None);
        }
        let mut data = Vec::new();
        renderer.render(&self.room, &self.spline, index, &mut data)?;
        let camera = &renderer.model().camera;
        let (width, height) = (camera.width, camera.height);
        Ok(Some(Frame { stamp: shot.stamp, true_stamp: shot.true_stamp, width, height, data }))
    }

    /// The frames of camera `which` in order, made one by one as they are asked for; lost ones are left out.
    pub fn frames(&self, which: usize) -> impl Iterator<Item = Result<Frame, Error>> + '_ {
        (0..self.frame_count(which)).filter_map(move |index| self.frame(which, index).transpose())
    }
}

fn missing(what: &'static str, index: usize, count: usize) -> Error {
    Error::NoSuch { what, index, count }
}
