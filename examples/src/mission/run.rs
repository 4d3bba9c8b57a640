//! The mission itself: its stages in order, and what they leave.

use nalgebra::Isometry3;
use paint_net::Image;
use paint_sim::Film;
use paint_sim::flight::FlightSample;
use ptu_kinematics::Joints;

use super::decision::Decision;
use super::error::MissionError;
use super::fly::{LayerFlight, fly, spray};
use super::plan::plan;
use crate::appearance::UNIT_THICKNESS;

/// A mission is given up when more of the wanted paint than this is out of reach.
const MAX_UNREACHABLE_SHARE: f64 = 0.9;

/// Everything a mission made; what the report, the pictures and the recording are drawn from.
pub struct Mission {
    pub(super) decision: Decision,
    pub(super) flights: Vec<LayerFlight>,
    pub(super) film: Film,
    /// Pixel of every texel of the film.
    pub(super) pixels: Vec<usize>,
    pub(super) planning: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    pub(super) unreachable_paint: f64,
    /// Targets that keep more clearance since the rehearsal in wind, and those it gave up.
    pub(super) kept_off: usize,
    pub(super) left_bare: usize,
}

impl Mission {
    /// Plans and flies what was decided, and sprays it onto the film.
    pub fn run(decision: Decision) -> Result<Self, MissionError> {
        let Decision { layers, surface, robot, settings, .. } = &decision;
        let planned = plan(layers, surface, robot, settings)?;
        let (planning, unreachable_paint) = (planned.seconds, planned.unreachable_paint);
        let (kept_off, left_bare) = (planned.kept_off, planned.left_bare);
        let flights = fly(planned, surface, robot, settings)?;
        let (film, pixels) = spray(&flights, surface, settings)?;
        let mission = Self { decision, flights, film, pixels, planning, unreachable_paint, kept_off, left_bare };
        let share = mission.share_out_of_reach();
        if share > MAX_UNREACHABLE_SHARE {
            return Err(MissionError::OutOfReach { percent: 100.0 * share });
        }
        Ok(mission)
    }

    /// The layers, in the order in which they were flown.
    pub fn flights(&self) -> &[LayerFlight] {
        &self.flights
    }

    /// Paint depth per pixel as it came out, 0 beside the surface.
    pub(super) fn painted_depth(&self) -> Image {
        let mut depth = self.decision.wanted.map(|_| 0.0);
        for (k, &pixel) in self.pixels.iter().enumerate() {
            depth.data_mut()[pixel] = self.film.thickness(k) / UNIT_THICKNESS;
        }
        depth
    }

    pub(super) fn painted_ink(&self) -> Image {
        self.painted_depth().map(|d| self.decision.appearance.ink().forward(d))
    }

    /// CIEDE2000 between painted and wanted per pixel, `None` beside the surface.
    pub(super) fn colour_difference(&self) -> Vec<Option<f64>> {
        let painted = self.painted_depth();
        let pixel = |k: usize| {
            let wanted = self.decision.appearance.ink().inverse(self.decision.wanted.data()[k]);
            paint_sim::ciede2000(self.decision.appearance.lab(painted.data()[k]), self.decision.appearance.lab(wanted))
        };
        (0..painted.data().len()).map(|k| (self.decision.coverage.data()[k] > 0.0).then(|| pixel(k))).collect()
    }

    /// Share of the wanted paint that was not planned: no pose of the robot, or no surface below the spray.
    pub(super) fn share_out_of_reach(&self) -> f64 {
        let (mut planned, mut wanted) = (0.0, self.unreachable_paint + self.decision.wanted_out_of_reach());
        for f in &self.flights {
            wanted += f.route.lost + f.route.paint();
            planned += (0..f.route.targets.len()).map(|k| f.plan.volume(k)).sum::<f64>();
        }
        if wanted > 0.0 { (1.0 - planned / wanted).max(0.0) } else { 0.0 }
    }

    /// The arm's links at a sample: pan in the body's frame, tilt in pan's, the nozzle in tilt's (x along the spray).
    pub(super) fn arm(&self, sample: &FlightSample) -> [Isometry3<f64>; 3] {
        let [pan, tilt] = sample.pan_tilt;
        self.decision.robot.chain.link_poses(Joints { pan, tilt })
    }
}
