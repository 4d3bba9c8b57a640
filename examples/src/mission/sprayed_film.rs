//! Shots from anywhere on a surface: what a mission shows of its own.

use std::path::Path;

use paint_sim::surface::Hit;
use paint_sim::{Film, Shot};

use super::error::MissionError;
use super::mission_output::{page_colours, texture};
use super::painted_mesh::save_painted_mesh;
use super::painted_views::save_painted_views_of;
use super::painting_task::PaintingTask;
use super::shading::shading;
use super::spray_device::{SprayDevice, Sprayer};
use super::wet_surface::{Deposit, WetSurface};
use crate::progress::Stage;

/// Pictures of the paint as it grows.
const PICTURES: usize = 8;

/// A surface with a film of one paint that grows shot by shot.
pub struct SprayedFilm<'a> {
    task: &'a PaintingTask,
    surface: WetSurface,
    device: &'a SprayDevice<'a>,
    sprayer: Sprayer,
}

impl<'a> SprayedFilm<'a> {
    /// The bare surface of a task, sprayed on a device that was opened for it.
    ///
    /// # Errors
    /// Settings out of range, a GPU that cannot hold the texels.
    pub fn new(task: &'a PaintingTask, device: &'a SprayDevice<'a>) -> Result<Self, MissionError> {
        let surface = WetSurface::new(task)?;
        let sprayer = device.sprayer(surface.film().film())?;
        Ok(Self { task, surface, device, sprayer })
    }

    /// Sprays shots with their times of `duration` seconds, in their order, and leaves a picture after every eighth of it in `folder`.
    ///
    /// # Errors
    /// Shots that the simulation refuses, a folder that cannot be written.
    pub fn spray(&mut self, shots: &[(f64, Shot)], duration: f64, folder: &Path) -> Result<(), MissionError> {
        let stage = Stage::start("spray");
        let (task, device, sprayer) = (self.task, self.device, &self.sprayer);
        let mut rest = shots;
        for k in 1..=PICTURES {
            let until = duration * k as f64 / PICTURES as f64;
            let count = if k == PICTURES { rest.len() } else { rest.partition_point(|(time, _)| *time <= until) };
            let (now, later) = rest.split_at(count);
            let deposit: Deposit = &|film, shots, told| device.deposit(sprayer, film, shots, task, told);
            self.surface.spray_by(deposit, now, task, &|_| ())?;
            let depth = self.surface.depth(task);
            texture(task, &depth).save(&folder.join(format!("painted_{k}_of_{PICTURES}.png")))?;
            stage.share(k as f64 / PICTURES as f64);
            rest = later;
        }
        self.surface.land(duration, true)?;
        stage.done(&format!("{} shots", shots.len()));
        Ok(())
    }

    /// The paint.
    fn film(&self) -> &Film {
        self.surface.film().film()
    }

    /// What a GPU has done, in words.
    pub fn device_told(&self) -> Option<String> {
        self.device.told(&self.sprayer)
    }

    /// Share by area of the painted surface from which paint has run.
    pub fn share_ran(&self) -> f64 {
        self.surface.film().share_ran()
    }

    /// Paint that left the nozzle, that lies on the surface, and that met nothing or dripped off, m³.
    pub fn volumes(&self) -> [f64; 3] {
        let balance = self.film().mass_balance();
        [balance.emitted, balance.deposited, balance.overspray + balance.dripped]
            .map(|quanta| quanta as f64 * paint_sim::spray::QUANTUM)
    }

    /// Mean thickness by area where there is paint, and the largest, metres.
    pub fn thickness(&self) -> [f64; 2] {
        let (mut volume, mut area, mut most) = (0.0, 0.0, 0.0_f64);
        let film = self.film();
        for (k, texel) in film.texels().iter().enumerate() {
            let thickness = film.thickness(k);
            if thickness > 0.0 {
                (volume, area) = (volume + thickness * texel.area, area + texel.area);
                most = most.max(thickness);
            }
        }
        [volume / f64::max(area, f64::MIN_POSITIVE), most]
    }

    /// Writes the painted mesh and pictures into an existing folder.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), MissionError> {
        let (task, depth) = (self.task, self.surface.depth(self.task));
        texture(task, &depth).save(&folder.join("painted.png"))?;
        save_painted_mesh(task, &page_colours(task, &depth), folder)?;
        save_painted_views_of(self.device.surface(), task, &|hit: &Hit| shading(task, &depth, hit), folder)
    }
}
