//! A camera on a motion: its shutter, its clock, the frames it loses.

use nalgebra::Isometry3;

use super::photometry::{Photometry, Sensor, tiling};
use super::render::{TILE, TILE_HEIGHT, TILE_WIDTH, TileRays, View};
use super::rng::{Rng, derive};
use super::room::Room;
use crate::camera::Camera;
use crate::error::Error;
use crate::error::{all_not_negative, invalid};
use crate::samples::ImageView;
use crate::stamp::Stamp;
use crate::trajectory::spline::Spline;

/// A camera, its shutter, and its clock.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SimulatedCamera {
    /// Lens and place on the body; the left camera of the EuRoC vehicle.
    pub camera: Camera,
    /// Frames per second; 20.
    pub rate_hz: f64,
    /// Light, noise and blur.
    pub photometry: Photometry,
    /// What is added to a stamp to get the inertial sensor's time (`timeshift_cam_imu` of Kalibr), s; 0.
    pub time_offset_s: f64,
    /// Standard deviation of the error of a stamp, s; 0. Cut to 0.49 of the interval.
    pub stamp_jitter_s: f64,
    /// Time from the exposure of a row until that of the row below, s: rolling shutter. 0, a global shutter. The stamp is that of the
    /// middle row.
    pub row_time_s: f64,
    /// Chance that a frame is lost; 0.
    pub drop_probability: f64,
}

impl Default for SimulatedCamera {
    fn default() -> Self {
        Self {
            camera: Camera::euroc(),
            rate_hz: 20.0,
            photometry: Photometry::default(),
            time_offset_s: 0.0,
            stamp_jitter_s: 0.0,
            row_time_s: 0.0,
            drop_probability: 0.0,
        }
    }
}

/// A rendered image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// What the camera's clock said in the middle of the exposure.
    pub stamp: Stamp,
    /// The middle of the exposure in the time of the motion.
    pub true_stamp: Stamp,
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Grey values, row by row.
    pub data: Vec<u8>,
}

impl Frame {
    /// The image, borrowed.
    pub fn view(&self) -> ImageView<'_> {
        ImageView { width: self.width, height: self.height, data: &self.data }
    }
}

impl SimulatedCamera {
    /// Time from the first to the last row, s.
    fn readout_s(&self) -> f64 {
        self.row_time_s.abs() * self.camera.height as f64
    }

    /// Refuses a camera that cannot be, with the field that says so.
    pub fn check(&self) -> Result<(), Error> {
        self.camera.check()?;
        self.photometry.check()?;
        if !(self.rate_hz > 0.0 && self.rate_hz <= 1e4) {
            return Err(invalid("rate_hz", self.rate_hz, "must be above 0 and at most 10000 frames per second"));
        }
        if !(0.0..1.0).contains(&self.drop_probability) {
            return Err(invalid("drop_probability", self.drop_probability, "must be at least 0 and below 1"));
        }
        if self.photometry.exposure_s * self.rate_hz > 1.0 {
            return Err(invalid("exposure_s", self.photometry.exposure_s, "must not exceed the time between frames"));
        }
        if self.row_time_s.is_nan() || self.readout_s() * self.rate_hz > 1.0 {
            return Err(invalid(
                "row_time_s",
                self.row_time_s,
                "must be finite, and all rows shorter than the time between frames",
            ));
        }
        if self.time_offset_s.is_nan() || self.time_offset_s.abs() >= 1e6 {
            return Err(invalid("time_offset_s", self.time_offset_s, "must be finite and below a million seconds"));
        }
        all_not_negative(&[("stamp_jitter_s", self.stamp_jitter_s)])
    }
}

/// When a frame was taken, when its camera says it was, and whether it was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shot {
    pub(super) true_stamp: Stamp,
    pub(super) stamp: Stamp,
    pub(super) lost: bool,
}

/// A camera with everything computed that does not depend on the pose.
pub(super) struct Renderer {
    model: SimulatedCamera,
    seed: u64,
    first: Stamp,
    frames: usize,
    tiles: Vec<(TileRays, [f32; TILE])>,
}

impl Renderer {
    pub(super) fn new(model: SimulatedCamera, spline: &Spline, seed: u64) -> Result<Self, Error> {
        model.check()?;
        let half_exposure = ((model.photometry.exposure_s + model.readout_s()) * 0.5e9).ceil() as i64;
        let (start, end) = spline.span();
        let first = Stamp::from_nanos(start.nanos() + half_exposure);
        let last = Stamp::from_nanos(end.nanos() - half_exposure);
        if last < first {
            return Err(Error::TooFew { what: "seconds of motion for one exposure", got: 0, need: 1 });
        }
        let (columns, rows) = tiling(&model.camera);
        let tile = |index: usize| {
            let (left, top) = (index % columns * TILE_WIDTH, index / columns * TILE_HEIGHT);
            (TileRays::new(&model.camera, left, top), model.photometry.light(&model.camera, left, top))
        };
        let tiles = (0..columns * rows).map(tile).collect();
        let frames = (last.secs_since(first) * model.rate_hz) as usize + 1;
        Ok(Self { model, seed, first, frames, tiles })
    }

    pub(super) fn model(&self) -> &SimulatedCamera {
        &self.model
    }

    pub(super) fn frames(&self) -> usize {
        self.frames
    }

    pub(super) fn shot(&self, index: usize) -> Shot {
        let interval = 1.0 / self.model.rate_hz;
        let nanos = self.first.nanos() + (index as f64 * interval * 1e9).round() as i64;
        let mut rng = Rng::new(derive(self.seed, 2 * index as u64));
        let jitter = (rng.normal() * self.model.stamp_jitter_s).clamp(-0.49 * interval, 0.49 * interval);
        let reported = nanos + ((jitter - self.model.time_offset_s) * 1e9).round() as i64;
        Shot {
            true_stamp: Stamp::from_nanos(nanos),
            stamp: Stamp::from_nanos(reported),
            lost: rng.uniform() < self.model.drop_probability,
        }
    }

    /// Renders a frame into `data`, which is resized.
    pub(super) fn render(&self, room: &Room, spline: &Spline, index: usize, data: &mut Vec<u8>) -> Result<(), Error> {
        let Camera { width, height, body_from_camera, .. } = self.model.camera;
        let middle = self.shot(index).true_stamp;
        let since = middle.secs_since(spline.span().0);
        let poses = self.model.photometry.poses;
        let occluder = room.occluder_at(since);
        let views_at = |delay: f64| -> Result<Vec<View>, Error> {
            let view = |k: usize| {
                let share = (k as f64 + 0.5) / poses as f64 - 0.5;
                let stamp = middle.nanos() + ((share * self.model.photometry.exposure_s + delay) * 1e9) as i64;
                let motion = spline.sample(Stamp::from_nanos(stamp))?;
                let rate = body_from_camera.rotation.inverse() * motion.rate_in_body;
                let world_from_camera: Isometry3<f64> = motion.world_from_body * body_from_camera;
                // Within a tile the rows are a turn apart.
                let turn_per_row = rate * self.model.row_time_s;
                Ok(View::new(room, occluder.as_ref(), (&world_from_camera, &turn_per_row), k, poses))
            };
            (0..poses).map(view).collect()
        };
        let mut views = views_at(0.0)?;
        let sensor: Sensor = self.model.photometry.sensor(since, derive(self.seed, 2 * index as u64 + 1));
        let (columns, _) = tiling(&self.model.camera);
        data.clear();
        data.resize(width * height, 0);
        for (tile, (rays, light)) in self.tiles.iter().enumerate() {
            let mut radiance = [0.0; TILE];
            if self.model.row_time_s != 0.0 && tile % columns == 0 {
                let row = (tile / columns * TILE_HEIGHT) as f64 + 0.5 * (TILE_HEIGHT as f64 - 1.0);
                views = views_at((row - 0.5 * (height as f64 - 1.0)) * self.model.row_time_s)?;
            }
            for view in &views {
                view.add_tile(rays, &mut radiance);
            }
            let grey = sensor.expose(tile, light, &radiance);
            let (left, top) = (tile % columns * TILE_WIDTH, tile / columns * TILE_HEIGHT);
            let across = TILE_WIDTH.min(width - left);
            for (row, values) in grey.chunks_exact(TILE_WIDTH).take(height - top).enumerate() {
                let at = (top + row) * width + left;
                data[at..at + across].copy_from_slice(&values[..across]);
            }
        }
        Ok(())
    }
}
