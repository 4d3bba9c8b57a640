//! What a flight leaves: samples of paint and of ways, and the track.

use std::fmt::{Display, Write as _};

use nalgebra::Point3;
use paint_planner::onboard::Phase;
use paint_sim::Surface;
use paint_sim::flight::{FlightLog, FlightSample, PanTilt, Reference, Vehicle};

use super::error::RobotError;
use super::on_board::{CONTROL_STEP, OnBoard};

/// Control steps from one line of the track to the next.
const TRACK_STEPS: u64 = 5;

/// What is there to be seen in a control step.
pub(super) struct Seen<'a> {
    pub(super) vehicle: Vehicle,
    /// Where the on-board program takes it to be.
    pub(super) estimated: Point3<f64>,
    pub(super) ptu: &'a dyn PanTilt,
    pub(super) pan_tilt: [f64; 2],
    /// Out of the nozzle, m^3/s.
    pub(super) flow: f64,
}

/// Takes down a flight, control step by control step.
pub(super) struct Recorder<'a> {
    plan: &'a dyn Reference,
    surface: &'a dyn Surface,
    painting: Vec<FlightSample>,
    ways: Vec<FlightSample>,
    track: String,
    steps: u64,
}

impl<'a> Recorder<'a> {
    /// For a plan before what the spray meets.
    pub(super) fn new(plan: &'a dyn Reference, surface: &'a dyn Surface) -> Self {
        let track = String::from(
            "time_s,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,roll_rad,pitch_rad,yaw_rad,estimated_x_m,estimated_y_m,estimated_z_m,wanted_x_m,wanted_y_m,wanted_z_m,phase\n",
        );
        Self { plan, surface, painting: Vec::new(), ways: Vec::new(), track, steps: 0 }
    }

    /// A control step of the on-board program. Returns the sample of one on the plan.
    pub(super) fn note(
        &mut self,
        now: f64,
        on_board: &OnBoard,
        seen: &Seen,
    ) -> Result<Option<FlightSample>, RobotError> {
        let Seen { vehicle, estimated, ptu, pan_tilt, flow } = seen;
        let measured =
            |time, wanted| FlightSample::measured(time, vehicle, *estimated, *pan_tilt, wanted, *ptu, self.surface);
        let mut painted = None;
        if let Some(time) = on_board.plan_time(now) {
            let wanted = self.plan.at(time);
            let held = *flow == 0.0 && wanted.flow > 0.0;
            let sample = FlightSample { flow: *flow, held, ..measured(time, &wanted)? };
            self.painting.push(sample);
            painted = Some(sample);
        } else if let Some(wanted) = on_board.wanted(now).filter(|_| on_board.phase().is_guarded()) {
            self.ways.push(measured(now, &wanted)?);
        }
        let wanted = on_board.wanted(now).map(|wanted| wanted.position);
        self.line(now, vehicle, [Some(*estimated), wanted], &on_board.phase());
        Ok(painted)
    }

    /// A control step in the track alone, with where the vehicle takes itself to be and where it shall be, as far as there is such a place.
    pub(super) fn line(&mut self, now: f64, vehicle: &Vehicle, places: [Option<Point3<f64>>; 2], phase: &dyn Display) {
        if self.steps.is_multiple_of(TRACK_STEPS) {
            let (p, v, [roll, pitch, yaw]) = (vehicle.position, vehicle.velocity, vehicle.attitude);
            let numbers = [now, p.x, p.y, p.z, v.x, v.y, v.z, roll, pitch, yaw].map(|value| format!("{value:.6}"));
            let place = |place: Option<Point3<f64>>| {
                place.map_or_else(|| ",,".into(), |p| format!("{:.6},{:.6},{:.6}", p.x, p.y, p.z))
            };
            // Writing to a string cannot fail.
            let _ = writeln!(self.track, "{},{},{phase}", numbers.join(","), places.map(place).join(","));
        }
        self.steps += 1;
    }

    /// All of it.
    pub(super) fn finish(self, events: &[(f64, Phase)]) -> Record {
        let log = |samples| FlightLog { samples, interval: CONTROL_STEP };
        Record { painting: log(self.painting), ways: log(self.ways), track: self.track, events: events.to_vec() }
    }
}

/// What a flight has left.
pub struct Record {
    /// Samples of the paint phases, by the plan's time.
    pub painting: FlightLog,
    /// Samples of the ways there and back and of holds, by the flight's time.
    pub ways: FlightLog,
    /// Time, position, velocity, attitude, estimated and wanted position and phase of the whole flight, 20 rows a second, as a table (CSV).
    pub track: String,
    /// When each phase began.
    pub events: Vec<(f64, Phase)>,
}
