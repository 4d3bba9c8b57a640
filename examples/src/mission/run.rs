//! The mission itself: its stages in order, and what they leave.

use nalgebra::Isometry3;
use paint_net::Image;
use paint_planner::mission::TargetOutcomes;
use paint_sim::Film;
use paint_sim::flight::FlightSample;
use ptu_kinematics::Joints;

use super::built_in_flyer::BuiltInFlyer;
use super::error::MissionError;
use super::fly::{Flown, LayerFlight, fly};
use super::flyer::Flyer;
use super::grounded::Grounded;
use super::identify::{Identified, identify};
use super::painting_task::PaintingTask;
use super::planned_mission::{PlannedMission, share_out_of_reach};
use super::spray_flights::{Sprayed, spray};
use super::touch_up::{TouchUpFigures, touch_up};
use super::wet_surface::DriedSurface;
use crate::appearance::UNIT_THICKNESS;

/// Thickness below which nothing is wanted, metres: ink is given to a few digits.
const LEAST_COAT: f64 = 0.5e-6;

/// Everything a mission made; what the report, the pictures and the recording are drawn from.
pub struct Mission {
    pub(super) task: PaintingTask,
    pub(super) flights: Vec<LayerFlight>,
    pub(super) film: Film,
    /// Pixel of every texel of the film.
    pub(super) pixels: Vec<usize>,
    /// Texels from which paint has run.
    pub(super) ran: Vec<bool>,
    /// Time on the ground between coats, and after the last until it is dry to touch, s.
    pub(super) ground_times: [f64; 2],
    /// Depth per pixel after each of equal parts of the spraying but the last; none of a picture's paint.
    pub(super) partly_painted: Vec<Image>,
    pub(super) planning: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    pub(super) unreachable_paint: f64,
    /// Targets that keep more clearance since the rehearsal in wind, and those it gave up.
    pub(super) kept_off: usize,
    pub(super) left_bare: usize,
    /// What becomes of the targets with paint.
    pub(super) outcomes: TargetOutcomes,
    /// What looking at it found, if the robot has looked.
    pub(super) looked: Option<TouchUpFigures>,
    /// What an excitation flight told, if one was flown.
    pub(super) identified: Option<Identified>,
    /// Why the rest was not flown, if it was not.
    pub(super) grounded: Option<Grounded>,
}

impl Mission {
    /// Plans and flies what was decided in the built-in simulation, and sprays it onto the film.
    pub fn run(task: PaintingTask) -> Result<Self, MissionError> {
        PlannedMission::new(task).and_then(|mission| Self::fly(mission, &mut BuiltInFlyer))
    }

    /// Flies what is planned, and sprays it onto the film. What was flown before a flight that could not be is kept, and the
    /// report says so.
    pub fn fly(mission: PlannedMission, flyer: &mut dyn Flyer) -> Result<Self, MissionError> {
        let PlannedMission { mut task, planned } = mission;
        task.settings.check_simulated()?;
        let (planning, unreachable_paint) = (planned.seconds, planned.unreachable_paint);
        let (kept_off, left_bare, outcomes) = (planned.kept_off, planned.left_bare, planned.outcomes);
        let identified = identify(&mut task, &planned)?;
        let Flown { layers: mut flights, mut grounded } = fly(planned, &task, &[], flyer)?;
        let mut sprayed = spray(flights.iter().map(LayerFlight::paint), &task)?;
        let mut looked = None;
        if task.settings.look && grounded.is_none() {
            match touch_up(&mut task, &flights, &sprayed.surface, flyer) {
                Ok((again, figures)) => {
                    flights.extend(again.layers);
                    grounded = again.grounded;
                    // From the beginning, as the shots of one flight are batched.
                    sprayed = spray(flights.iter().map(LayerFlight::paint), &task)?;
                    looked = Some(figures);
                }
                // How long painting again would have taken is not known.
                Err(error) => grounded = Some(Grounded::by(&error, 0.0)),
            }
        }
        let Sprayed { surface: DriedSurface { film, pixels, ran, waited, drying }, before: partly_painted } = sprayed;
        // They are on the surface.
        for flight in &mut flights {
            flight.shots = Vec::new();
        }
        Ok(Self {
            task,
            flights,
            film,
            pixels,
            ran,
            ground_times: [waited, drying],
            partly_painted,
            planning,
            unreachable_paint,
            kept_off,
            left_bare,
            outcomes,
            looked,
            identified,
            grounded,
        })
    }

    /// The layers, in the order in which they were flown; those of several robots one robot after the other.
    pub fn flights(&self) -> &[LayerFlight] {
        &self.flights
    }

    /// From the first take-off to the last landing without the time on the ground between coats, s.
    pub(super) fn flight_time(&self) -> f64 {
        self.flights.iter().map(LayerFlight::end).fold(0.0, f64::max)
    }

    /// Flights that tank, battery, or what ended one in the air have cut the plans into, if they have.
    pub(super) fn sorties(&self) -> Option<usize> {
        let count = self.flights.iter().map(|flight| flight.sorties).sum();
        let cut = !self.task.settings.endurance.is_endless() || count > self.flights.len();
        cut.then_some(count)
    }

    /// Paint depth per pixel as it came out, 0 beside the surface.
    pub(super) fn painted_depth(&self) -> Image {
        self.task.depth_of(&self.film, &self.pixels)
    }

    /// Paint depth per pixel as it is wanted.
    pub(super) fn wanted_depth(&self) -> Image {
        self.task.wanted_depth()
    }

    pub(super) fn painted_ink(&self) -> Image {
        self.painted_depth().map(|d| self.task.appearance.ink().forward(d))
    }

    /// CIEDE2000 between painted and wanted per pixel, `None` beside the surface.
    pub(super) fn colour_difference(&self) -> Vec<Option<f64>> {
        let painted = self.painted_depth();
        let pixel = |k: usize| {
            let wanted = self.task.appearance.ink().inverse(self.task.wanted.data()[k]);
            paint_sim::colour::ciede2000(self.task.appearance.lab(painted.data()[k]), self.task.appearance.lab(wanted))
        };
        (0..painted.data().len()).map(|k| (self.task.coverage.data()[k] > 0.0).then(|| pixel(k))).collect()
    }

    /// Thickness over wanted thickness per pixel, `None` where the robot cannot paint or nothing is wanted.
    pub(super) fn thickness_ratio(&self) -> Vec<Option<f64>> {
        let PaintingTask { wanted, in_reach, appearance, .. } = &self.task;
        let mut ratio = vec![None; in_reach.len()];
        for (k, &pixel) in self.pixels.iter().enumerate() {
            let asked = appearance.ink().inverse(wanted.data()[pixel]) * UNIT_THICKNESS;
            if in_reach[pixel] && asked >= LEAST_COAT {
                ratio[pixel] = Some(self.film.thickness(k) / asked);
            }
        }
        ratio
    }

    /// Share of the wanted paint that was not planned.
    pub(super) fn share_out_of_reach(&self) -> f64 {
        let layers = self.flights.iter().map(|f| (&f.route, &f.plan));
        share_out_of_reach(&self.task, self.unreachable_paint, layers)
    }

    /// The arm's links at a sample: pan in the body's frame, tilt in pan's, the nozzle in tilt's (x along the spray).
    pub(super) fn arm(&self, sample: &FlightSample) -> [Isometry3<f64>; 3] {
        let [pan, tilt] = sample.pan_tilt;
        self.task.robot.chain.link_poses(Joints { pan, tilt })
    }
}

/// The flights of missions that follow each other, each with when it begins, s.
pub(super) fn one_after_another<'a>(missions: &[&'a Mission]) -> impl Iterator<Item = (f64, &'a LayerFlight)> {
    let mut next = 0.0;
    missions.iter().flat_map(move |mission| {
        let begun = next;
        next += mission.flight_time();
        mission.flights.iter().map(move |flight| (begun + flight.start, flight))
    })
}
