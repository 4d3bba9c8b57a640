//! Plans are rehearsed in simulated wind.

use paint_planner::mission::{NearMiss, Rehearsal, gap};
use paint_planner::{Plan, Surface};
use paint_sim::flight::FlightSample;
use ptu_kinematics::Joints;

use super::error::MissionError;
use super::settings::MissionSettings;
use super::simulated_flight::{flight_settings, fly_plan};
use crate::adapters::{MeshSurface, Robot};
use crate::surface::PaintSurface;

/// Winds in which each plan is flown.
const WINDS: u64 = 2;
/// What the robot keeps from the surface in a rehearsal, metres: the wind of the flight itself is not known.
const MARGIN: f64 = 0.015;
/// Time between two looks at the gap in a flight, s: 2.5 cm at full speed.
pub(super) const GAP_STEP: f64 = 0.05;
/// Winds of the rehearsals are not that of the flight.
const SALT: u64 = 0x5EED_0F4E;

/// Flights in the usual wind before a surface as the robot knows it; none of a vehicle that is not simulated, nor of a planner that keeps no
/// clearance that it is told.
pub(super) struct WindRehearsal<'a> {
    pub(super) surface: &'a PaintSurface,
    pub(super) robot: &'a Robot,
    pub(super) settings: &'a MissionSettings,
}

impl Rehearsal for WindRehearsal<'_> {
    type Error = MissionError;

    fn near_misses(&self, plan: &Plan) -> Result<Vec<NearMiss>, MissionError> {
        let Self { surface, robot, settings } = self;
        if settings.check_simulated().is_err() || !settings.path_planner.is_rehearsed() {
            return Ok(Vec::new());
        }
        let mesh = MeshSurface(&surface.world);
        let obstacles = settings.constraints.around(&mesh);
        let mut near_misses = Vec::new();
        for wind in 0..WINDS {
            let seed = settings.seed ^ SALT.wrapping_add(wind);
            let flight = flight_settings(plan, robot.tether, seed);
            let log = fly_plan(plan, &surface.world, robot, settings, &flight)?;
            let missing = |sample: &FlightSample| NearMiss {
                time: sample.time,
                missing: MARGIN - gap_at(robot, &obstacles, sample, MARGIN),
            };
            near_misses.extend(log.every(GAP_STEP).map(missing).filter(|near_miss| near_miss.missing > 0.0));
        }
        Ok(near_misses)
    }
}

/// Least distance between the robot and what is in its way at a moment of a flight, metres; at most `below`, negative where they overlap.
pub(super) fn gap_at(robot: &Robot, obstacles: &dyn Surface, sample: &FlightSample, below: f64) -> f64 {
    let joints = Joints { pan: sample.pan_tilt[0], tilt: sample.pan_tilt[1] };
    let mut spheres = Vec::new();
    robot.body.spheres(&robot.chain, &sample.world_from_body, &joints, &mut spheres);
    gap(&spheres, obstacles, below)
}

#[cfg(test)]
mod tests {
    use paint_planner::mission::{MissionPlan, MissionPlanner, Route};
    use paint_planner::{OptimalPlanner, Settings};
    use ptu_kinematics::Ptu;

    use super::super::test_panel;
    use super::*;

    #[test]
    fn what_comes_too_near_in_wind_keeps_off_or_stays_bare() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let (surface, targets) = (test_panel::surface(), test_panel::targets());
        let planner = Settings { clearance: 0.0, ..settings.planner.clone() };
        let near_misses = |robot: &Robot, plan: &Plan| {
            WindRehearsal { surface: &surface, robot, settings: &settings }.near_misses(plan).unwrap()
        };
        let rehearse = |robot: &Robot| {
            let planner = MissionPlanner {
                planner: &OptimalPlanner::default(),
                surface: &MeshSurface(&surface.world),
                tool: robot,
                rehearsal: &WindRehearsal { surface: &surface, robot, settings: &settings },
                settings: paint_planner::mission::MissionSettings {
                    planner: planner.clone(),
                    flights: 1,
                    ..paint_planner::mission::MissionSettings::default()
                },
            };
            let mut mission = MissionPlan::default();
            let route = Route::ordered(std::slice::from_ref(&targets), None, &planner.settings.planner).unwrap();
            planner.add_layer(route, &mut mission).unwrap();
            mission.flights.remove(0)
        };
        let mut robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let roomy = rehearse(&robot);
        assert_eq!((roomy.kept_off(), roomy.excluded()), (0, 0));
        // Rotors that reach nearly to the wall while the nozzle is at work.
        robot.body.vehicle_radius = 0.65;
        let tight = rehearse(&robot);
        assert!(tight.kept_off() > 0, "no plan of this comes near enough to be rehearsed");
        assert_eq!(near_misses(&robot, &tight.plan), []);
    }
}
