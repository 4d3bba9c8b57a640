//! What a mission can be told.

use std::f64::consts::FRAC_PI_3;

use paint_net::Limits;
use paint_net::painters::LayerPlanning;
use paint_planner::constraints::FlightConstraints;
use paint_planner::mission::Team;
use paint_planner::nozzle::NozzleSettings;
use paint_planner::onboard::Endurance;
use ptu_kinematics::{PtuSettings, ServoSettings};
use serde::{Deserialize, Serialize};

use super::error::MissionError;
use super::planner_choice::PlannerChoice;
use crate::air::MovingAir;
use crate::light::Light;
use crate::picture_placement::PicturePlacement;
use crate::projection::Viewpoint;
use crate::simulated_sensors::FaultInterval;
use paint_sim::film::wet::Ground;
use paint_sim::flight::{Airframe, Faults};
use paint_sim::paint::PaintName;

/// Seconds between two states of a recording, where nothing else is asked for.
pub(super) const RECORDING_STEP: f64 = 0.1;
/// Most of either a second: more than an autopilot takes.
const MOST_RECORDED: f64 = 100.0;
/// Seconds between two samples of a flight that are kept, and rows of a table where nothing else is asked for.
pub(super) const KEPT_STEP: f64 = 0.05;

/// Everything a mission can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MissionSettings {
    /// Seed of the design, the wind and the localisation errors.
    pub seed: u64,
    /// Worker threads. Not part of a mission file: results do not depend on it.
    #[serde(skip)]
    pub threads: usize,
    /// Size of a texel, metres. Default 1.25 cm (Paper IV, section 3.1).
    pub texel: f64,
    /// Standard deviation of a spray spot at the stand-off, metres. Default 2.5 cm (Paper IV: half the radius of 5 cm).
    pub spot: f64,
    /// What is in the tank. Default charcoal.
    pub paint: PaintName,
    /// How the wall soaks up the wet paint's solvent. Default sealed.
    #[serde(skip_serializing_if = "is_sealed")]
    pub ground: Ground,
    /// The air in which the spray drifts. Default: it flies straight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub air: Option<MovingAir>,
    /// Where a picture lies.
    pub placement: PicturePlacement,
    /// From where the design is thrown onto the surface; `None` lays it over the chart.
    pub viewpoint: Option<Viewpoint>,
    /// Memory that a mission may need by estimate, GiB. Default 8.
    pub memory_gib: f64,
    /// Which painter decides.
    pub painter: PainterChoice,
    /// Paint in layers by intensity, the base coat first, each with a flight of its own (Paper IV, section 3.3). Default: one
    /// flight whose flow carries the picture, which is faster at an equal result (ours).
    pub layered: Option<LayerPlanning>,
    /// Where sprays may lie, in texels. Default: 2 along a row, rows 3 apart (ours).
    pub limits: Limits,
    /// Who plans the flights, and whether the gun turns.
    #[serde(skip_serializing_if = "PlannerChoice::is_default")]
    pub path_planner: PlannerChoice,
    /// The planner's settings.
    pub planner: paint_planner::Settings,
    /// The robot's kinematics.
    pub ptu: PtuSettings,
    /// How far the vehicle pitches up and down while it hovers, radians, at most π/3. Such a vehicle is planned and not simulated. Default 0.
    #[serde(skip_serializing_if = "is_level")]
    pub pitch: f64,
    /// The servos of its pan-tilt unit.
    pub servo: ServoSettings,
    /// Who flies it.
    pub controller: ControllerChoice,
    /// The vehicle that the simulation flies.
    #[serde(skip_serializing_if = "usual_airframe")]
    pub airframe: Airframe,
    /// What controller and observer take it for.
    #[serde(skip_serializing_if = "usual_airframe")]
    pub model: Airframe,
    /// Identify that in an excitation flight before the first that paints.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub identify: bool,
    /// How it knows where it is; if nothing is said motion capture, and in a mission that scans the surface first the robot's own senses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub localisation: Option<LocalisationChoice>,
    /// How long tank and battery last; without them all comes through the tether.
    #[serde(skip_serializing_if = "Endurance::is_endless")]
    pub endurance: Endurance,
    /// Robots that paint at the same time. Default one.
    #[serde(skip_serializing_if = "is_usual_team")]
    pub team: Team,
    /// Look at the painted surface and paint again what is missing.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub look: bool,
    /// What goes wrong in the first flight.
    #[serde(skip_serializing_if = "no_faults")]
    pub faults: Faults,
    /// What goes wrong with the sensors of a robot that flies by its own senses, in its first flight.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensor_faults: Vec<FaultInterval>,
    /// Where it may not fly, and where its hose hangs, in the world of `plan.csv`; the simulated hose of a robot without a tether comes from
    /// behind the middle of the flight.
    #[serde(skip_serializing_if = "FlightConstraints::is_empty")]
    pub constraints: FlightConstraints,
    /// Rows of `trajectory.csv` and `plan.csv`, and states in `mission.mcap` and `plan.mcap`, a second; without it 20 and 10. Flights are
    /// kept at 20, so more is the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record_hz: Option<f64>,
    /// How the painted surface is shown.
    #[serde(skip_serializing_if = "Showing::is_default")]
    pub show: Showing,
}

/// How the painted surface is shown: nothing of it changes what is painted.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Showing {
    /// In what light; without it a sun behind the camera, without sky. With it, also from several places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    /// Roughness of a varnish over the painted surface, 0.02 to 1; matt without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gloss: Option<f64>,
    /// From how many places around it; none without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turntable: Option<u16>,
}

/// Most places of a turntable.
pub(crate) const TURNTABLE: u16 = 72;

impl Showing {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self) -> Result<(), MissionError> {
        if self.turntable.is_some_and(|count| !(1..=TURNTABLE).contains(&count)) {
            return Err(MissionError::Turntable);
        }
        self.gloss.map_or(Ok(()), |roughness| Ok(paint_sim::render::Coat::new(roughness).map(|_| ())?))
    }
}

/// The flight controllers to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerChoice {
    /// `paint_sim::flight::CascadedController`: the better aim in a light wind.
    #[default]
    Cascade,
    /// `paint_planner::control::TrackingMpc`: keeps the distance better, above all in strong gusts.
    Mpc,
}

/// What tells the painting flight where the robot is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LocalisationChoice {
    /// Motion capture, by a model of its noise.
    #[default]
    MotionCapture,
    /// A model of a localisation that errs by 7 cm, as the thesis measured.
    Noise,
    /// The robot's own camera, depth camera and inertial sensor, in the map of its scan.
    Slam,
}

fn is_usual_team(team: &Team) -> bool {
    *team == Team::default()
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_level(pitch: &f64) -> bool {
    *pitch == 0.0
}

fn is_sealed(ground: &Ground) -> bool {
    *ground == Ground::default()
}

fn usual_airframe(airframe: &Airframe) -> bool {
    *airframe == Airframe::default()
}

fn no_faults(faults: &Faults) -> bool {
    *faults == Faults::default()
}

/// The painters to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PainterChoice {
    /// The network with feedback from its canvas.
    Feedback,
    /// All sprays at once.
    Deconvolution,
    /// The same with strokes along lines.
    Centrelines,
    /// Rows over whole regions, with doses corrected for the surface.
    Fill,
    /// One spray after the other.
    Pursuit,
    /// The thesis' network: each spray with a spread, and so a distance, of its own.
    Thesis,
    /// Rows as wide as the picture allows, in the direction that crosses its lines.
    AdaptiveRows,
}

impl Default for MissionSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            texel: 0.0125,
            spot: 0.025,
            paint: PaintName::default(),
            ground: Ground::default(),
            air: None,
            memory_gib: 8.0,
            placement: PicturePlacement::default(),
            viewpoint: None,
            painter: PainterChoice::Feedback,
            layered: None,
            limits: Limits { spray_spacing: 2, row_spacing: 3, min_volume: 0.01, ..Limits::default() },
            path_planner: PlannerChoice::default(),
            planner: planner_settings(),
            ptu: PtuSettings::default(),
            pitch: 0.0,
            servo: ServoSettings::default(),
            controller: ControllerChoice::default(),
            airframe: Airframe::default(),
            model: Airframe::default(),
            identify: false,
            localisation: None,
            endurance: Endurance::default(),
            team: Team::default(),
            look: false,
            faults: Faults::default(),
            sensor_faults: Vec::new(),
            constraints: FlightConstraints::default(),
            record_hz: None,
            show: Showing::default(),
        }
    }
}

impl MissionSettings {
    /// Refuses sizes that are none. What belongs to a library, the library checks.
    pub(super) fn check(&self) -> Result<(), MissionError> {
        let sizes = [("texel", self.texel), ("spot", self.spot), ("memory_gib", self.memory_gib)];
        let asked = [("placement.size", self.placement.size), ("record_hz", self.record_hz)];
        let asked = asked.into_iter().filter_map(|(name, value)| Some((name, value?)));
        for (name, value) in sizes.into_iter().chain(asked) {
            if !(value.is_finite() && value > 0.0) {
                return Err(MissionError::Setting { name, value });
            }
        }
        if let Some(value) = self.record_hz.filter(|hz| *hz > MOST_RECORDED) {
            return Err(MissionError::Recorded { value });
        }
        if !(0.0..=FRAC_PI_3).contains(&self.pitch) {
            return Err(MissionError::Pitch { value: self.pitch });
        }
        let (planned, servo) = (self.planner.timing.max_joint_rate, self.servo.max_rate);
        if planned > servo {
            return Err(MissionError::JointRate { planned, servo });
        }
        if let Some(number) = self.sensor_faults.iter().position(|fault| !fault.is_sound()) {
            return Err(MissionError::SensorFault { number: number + 1 });
        }
        if self.look && !self.constraints.is_empty() {
            return Err(MissionError::LookConstrained);
        }
        if self.team.robots > 1 && self.constraints.tether.is_some() {
            return Err(MissionError::TeamTethered);
        }
        self.team.check()?;
        self.show.check()?;
        Ok(self.constraints.check()?)
    }

    /// Seconds between two rows of a table of the flights, and between two states of a recording.
    pub(super) fn record_steps(&self) -> [f64; 2] {
        self.record_hz.map_or([KEPT_STEP, RECORDING_STEP], |hz| [1.0 / hz; 2])
    }

    /// Refuses a vehicle that nothing simulates.
    ///
    /// # Errors
    /// A vehicle that pitches in hover.
    pub fn check_simulated(&self) -> Result<(), MissionError> {
        if self.pitch > 0.0 { Err(MissionError::PitchedFlight) } else { Ok(()) }
    }
}

/// The planner's defaults with a weaker pull between neighbours, as the normals are averaged over a footprint already, and a strong
/// one to the stand-off: where the tilt joint ends, a nozzle off the normal would come near to be less far off it, and its spot
/// shrink to a dark dot. The spray rises to 40 degrees, not to the 45 of the joint: the body leans against the wind, and a joint at its
/// end misses by a centimetre and more.
fn planner_settings() -> paint_planner::Settings {
    let defaults = paint_planner::Settings::default();
    let max_elevation = 40.0_f64.to_radians();
    paint_planner::Settings {
        nozzle: NozzleSettings { ca: 0.1, cb: 0.002, distance: 0.3, max_elevation, ..defaults.nozzle },
        ..defaults
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_panel;
    use super::*;
    use crate::adapters::{MeshSurface, Robot};
    use crate::simulated_sensors::SensorFault;
    use nalgebra::{UnitVector3, Vector3};
    use ptu_kinematics::Ptu;

    #[test]
    fn plans_that_ask_too_much_of_the_servos_are_refused() {
        let mut settings = MissionSettings::default();
        settings.check().unwrap();
        settings.servo.max_rate = 0.9 * settings.planner.timing.max_joint_rate;
        assert!(matches!(settings.check(), Err(MissionError::JointRate { .. })));
    }

    /// Nothing is a fault at no time, or of a size that is not a number.
    #[test]
    fn sensor_faults_that_make_no_sense_are_refused_by_number() {
        let sound = FaultInterval { fault: SensorFault::Clipped(9.0), of_vehicle: true, from: 2.0, until: 3.0 };
        let check = |fault| MissionSettings { sensor_faults: vec![sound, fault], ..MissionSettings::default() }.check();
        check(FaultInterval { until: f64::INFINITY, ..sound }).unwrap();
        for bad in [
            FaultInterval { from: -1.0, ..sound },
            FaultInterval { from: f64::NAN, ..sound },
            FaultInterval { until: 1.0, ..sound },
            FaultInterval { fault: SensorFault::Clipped(-9.0), ..sound },
            FaultInterval { fault: SensorFault::LateMotion(-1), ..sound },
            FaultInterval { fault: SensorFault::DepthOfElsewhere(f64::NAN), ..sound },
        ] {
            assert!(matches!(check(bad), Err(MissionError::SensorFault { number: 2 })), "{bad:?}");
        }
    }

    #[test]
    fn spots_keep_their_size_where_the_tilt_joint_ends() {
        let settings = MissionSettings::default();
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        // Normals that rise to 60 degrees below the horizon, where the joint has 44.
        let steep = |k: usize| (60.0_f64 * (k as f64 / 39.0)).to_radians().sin_cos();
        let normal = |k| UnitVector3::new_normalize(Vector3::new(-steep(k).1, 0.0, -steep(k).0));
        let targets: Vec<_> = test_panel::targets()
            .iter()
            .enumerate()
            .map(|(k, t)| paint_planner::Target { normal: normal(k), ..*t })
            .collect();
        let nearest = |planner: &paint_planner::Settings| {
            let plan = paint_planner::plan(&targets, &MeshSurface(&surface.world), &robot, planner).unwrap();
            assert!(plan.reachable.iter().all(|reached| *reached));
            let distances = targets.iter().zip(&plan.nozzle).map(|(t, nozzle)| (t.point - nozzle.position).norm());
            distances.fold(f64::INFINITY, f64::min)
        };
        let mut weak = settings.planner.clone();
        weak.nozzle.distance = NozzleSettings::default().distance;
        let (kept, lost) = (nearest(&settings.planner), nearest(&weak));
        assert!(kept > 0.07 && kept > 1.2 * lost, "{kept} m, {lost} m with a weak pull");
    }
}
