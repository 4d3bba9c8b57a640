//! All numbers of the planners. `Default` holds the published values; where the papers print none, an engineering value.

use crate::error::{Error, ensure};
use crate::world::VehicleState;

/// Settings of both planners.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Settings {
    /// Stage 1: nozzle states.
    pub nozzle: NozzleSettings,
    /// Stage 2: vehicle heading.
    pub heading: HeadingSettings,
    /// Times, speeds and flow.
    pub timing: TimingSettings,
    /// The smoothing planner's filter.
    pub lowess: LowessSettings,
    /// Least distance between collision body and surface, m (default 0.03).
    pub clearance: f64,
    /// Neighbouring targets farther apart than this are separate strokes with a flight between them, m (default 0.15).
    pub break_length: f64,
    /// Greatest distance between aim and spray on the surface with the valve open, m (default 0.025: the deviation of a spot).
    pub valve_tolerance: f64,
    /// Where the flight begins; `None`: at the first target served.
    pub start: Option<VehicleState>,
    /// Where the flight ends; `None`: at the last target served.
    pub goal: Option<VehicleState>,
}

/// Stage 1 of the optimal planner (VR paper, Eqs. (1)-(6)).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct NozzleSettings {
    /// Wanted distance of the nozzle along the normal, m (0.10, Paper II section 7.1).
    pub stand_off: f64,
    /// Least distance along the normal, m (0.05, Paper II section 7.1).
    pub min: f64,
    /// Greatest distance along the normal, m (0.15, Paper II section 7.1).
    pub max: f64,
    /// Full opening angle theta of the spray cone that has to contain the target, rad (default 16 degrees).
    pub cone: f64,
    /// Greatest angle between the normal and the line from target to nozzle, rad (default 25 degrees).
    pub incidence: f64,
    /// Greatest normal deviation where the tilt joint reaches the normal, sequential mode, m (default 0.02: the VR paper, section V,
    /// always stayed below); larger than `min` times the tangent of `incidence` has no effect.
    pub deviation: f64,
    /// Greatest elevation of the spray axis, rad (default 44 degrees, one inside the +-45 of the pan-tilt unit).
    pub max_elevation: f64,
    /// Weight `c_a` of position differences between neighbours (default 0.5).
    pub ca: f64,
    /// Weight `c_b` of direction differences between neighbours, m^2 (default 0.005).
    pub cb: f64,
    /// Weight `c_c` of the change since the previous round; sequential mode damps the position only, since `aim` holds the
    /// direction (default 0.02).
    pub cc: f64,
    /// Weight `c_d` of the normal deviation (default 1).
    pub cd: f64,
    /// Weight of the miss of the spray axis, sequential mode, m^2 per rad^2 (default 0.01; the papers only bound it by the cone).
    pub aim: f64,
    /// Weight of the distance error along the normal, sequential mode (default 0.05; the papers only bound it).
    pub distance: f64,
    /// Re-linearisations in sequential mode (default 4).
    pub rounds: usize,
    /// Jacobi iterations in paper-exact mode (default 40).
    pub iterations: usize,
    /// Inradius of the triangle around a target whose edges carry the three planes of the paper-exact mode, m (default
    /// 0.01); where the surface has triangles, they are its own ([`Surface::facet`](crate::Surface::facet)).
    pub facet: f64,
}

/// Stage 2 of the optimal planner (VR paper, Eq. (7)).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct HeadingSettings {
    /// Heading bins on the full circle (default 72).
    pub bins: usize,
    /// Most bins the heading may change from one target to the next (default 3).
    pub window: usize,
    /// Weight `c_e` of the squared distance the vehicle travels, rad^2/m^4 (default 2000).
    pub ce: f64,
    /// Weight of the squared pan angle at each target, 1/m^2: keeps off the joint limits (default 0.5).
    pub pan: f64,
    /// Length over which headings are smoothed off the grid, m (default 0.3); 0 leaves them on the grid.
    pub smoothing: f64,
}

/// How fast the path is flown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TimingPolicy {
    /// The spot moves over the surface at this speed, slower where the limits ask for it.
    Uniform {
        /// Speed of the spot, m/s.
        speed: f64,
    },
    /// The time stamps of the targets, all stretched by one factor (and the flow divided by it) until the limits hold.
    GradientPreserving,
}

/// Limits and shape of the trajectory.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct TimingSettings {
    /// How times are chosen (default uniform 0.4 m/s).
    pub policy: TimingPolicy,
    /// Greatest speed of the vehicle, m/s (default 0.5).
    pub max_speed: f64,
    /// Greatest acceleration of the vehicle, m/s^2 (default 1).
    pub max_acceleration: f64,
    /// The same while paint is sprayed, m/s^2 (default 0.5, ours): the gun is off its aim by what the body leans too late.
    pub max_spray_acceleration: f64,
    /// Greatest heading rate, rad/s (default 1).
    pub max_heading_rate: f64,
    /// Greatest rate of pan and tilt, rad/s (default 6.1: just below the 59 rpm of an AX-12A servo without load, Paper II section 3; less
    /// leaves more for the lean of the body, and slows strokes over rims).
    pub max_joint_rate: f64,
    /// Greatest flow of paint, m^3/s (default 2e-6).
    pub max_flow: f64,
    /// Distance between trajectory knots where the path is smooth, m (default 0.1).
    pub knot_spacing: f64,
    /// Greatest distance between the trajectory and a planned waypoint at its time, m (default 0.002).
    pub tolerance: f64,
    /// Rounds of knot insertion, and of slowing where a route is entered in motion (default 30).
    pub rounds: usize,
}

/// LOWESS of the smoothing planner (Paper II, section 6.2, which prints no values).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct LowessSettings {
    /// Length of path that one local fit sees, m (default 0.5).
    pub span: f64,
    /// Robustifying passes with bisquare weights (default 2).
    pub passes: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            nozzle: NozzleSettings::default(),
            heading: HeadingSettings::default(),
            timing: TimingSettings::default(),
            lowess: LowessSettings::default(),
            clearance: 0.03,
            break_length: 0.15,
            valve_tolerance: 0.025,
            start: None,
            goal: None,
        }
    }
}

impl Default for NozzleSettings {
    fn default() -> Self {
        Self {
            stand_off: 0.10,
            min: 0.05,
            max: 0.15,
            cone: 16_f64.to_radians(),
            incidence: 25_f64.to_radians(),
            deviation: 0.02,
            max_elevation: 44_f64.to_radians(),
            ca: 0.5,
            cb: 0.005,
            cc: 0.02,
            cd: 1.0,
            aim: 0.01,
            distance: 0.05,
            rounds: 4,
            iterations: 40,
            facet: 0.01,
        }
    }
}

impl Default for HeadingSettings {
    fn default() -> Self {
        Self { bins: 72, window: 3, ce: 2000.0, pan: 0.5, smoothing: 0.3 }
    }
}

impl Default for TimingSettings {
    fn default() -> Self {
        Self {
            policy: TimingPolicy::Uniform { speed: 0.4 },
            max_speed: 0.5,
            max_acceleration: 1.0,
            max_spray_acceleration: 0.5,
            max_heading_rate: 1.0,
            max_joint_rate: 6.1,
            max_flow: 2e-6,
            knot_spacing: 0.1,
            tolerance: 0.002,
            rounds: 30,
        }
    }
}

impl Default for LowessSettings {
    fn default() -> Self {
        Self { span: 0.5, passes: 2 }
    }
}

impl NozzleSettings {
    /// Least and greatest distance, m.
    pub(crate) fn distances(&self) -> [f64; 2] {
        [self.min, self.max]
    }
}

impl Settings {
    /// Refuses values outside their ranges.
    pub fn check(&self) -> Result<(), Error> {
        let (nozzle, heading, timing) = (&self.nozzle, &self.heading, &self.timing);
        let positive = "finite and greater than 0";
        let weight = "finite and not negative";
        for (name, value) in [
            ("nozzle.min", nozzle.min),
            ("nozzle.cone", nozzle.cone),
            ("nozzle.incidence", nozzle.incidence),
            ("nozzle.deviation", nozzle.deviation),
            ("nozzle.max_elevation", nozzle.max_elevation),
            ("nozzle.cc", nozzle.cc),
            ("nozzle.facet", nozzle.facet),
            ("timing.max_speed", timing.max_speed),
            ("timing.max_acceleration", timing.max_acceleration),
            ("timing.max_spray_acceleration", timing.max_spray_acceleration),
            ("timing.max_heading_rate", timing.max_heading_rate),
            ("timing.max_joint_rate", timing.max_joint_rate),
            ("timing.max_flow", timing.max_flow),
            ("timing.knot_spacing", timing.knot_spacing),
            ("timing.tolerance", timing.tolerance),
            ("lowess.span", self.lowess.span),
            ("break_length", self.break_length),
            ("valve_tolerance", self.valve_tolerance),
        ] {
            ensure(name, value, value > 0.0 && value.is_finite(), positive)?;
        }
        for (name, value) in [
            ("nozzle.ca", nozzle.ca),
            ("nozzle.cb", nozzle.cb),
            ("nozzle.cd", nozzle.cd),
            ("nozzle.aim", nozzle.aim),
            ("nozzle.distance", nozzle.distance),
            ("heading.ce", heading.ce),
            ("heading.pan", heading.pan),
            ("heading.smoothing", heading.smoothing),
            ("clearance", self.clearance),
        ] {
            ensure(name, value, value >= 0.0 && value.is_finite(), weight)?;
        }
        let between = nozzle.min < nozzle.stand_off && nozzle.stand_off < nozzle.max && nozzle.max.is_finite();
        ensure("nozzle.stand_off", nozzle.stand_off, between, "between nozzle.min and nozzle.max")?;
        ensure("nozzle.cone", nozzle.cone, nozzle.cone < 2.0, "below 2 rad")?;
        ensure("nozzle.incidence", nozzle.incidence, nozzle.incidence < 1.5, "below 1.5 rad")?;
        ensure("nozzle.max_elevation", nozzle.max_elevation, nozzle.max_elevation < 1.55, "below 1.55 rad")?;
        ensure("nozzle.rounds", nozzle.rounds as f64, nozzle.rounds >= 1, "at least 1")?;
        ensure("nozzle.iterations", nozzle.iterations as f64, nozzle.iterations >= 1, "at least 1")?;
        ensure("heading.bins", heading.bins as f64, (4..=3600).contains(&heading.bins), "from 4 to 3600")?;
        ensure("heading.window", heading.window as f64, heading.window >= 1, "at least 1")?;
        if let TimingPolicy::Uniform { speed } = timing.policy {
            ensure("timing.policy.speed", speed, speed > 0.0 && speed.is_finite(), positive)?;
        }
        for (name, pose) in [("start", &self.start), ("goal", &self.goal)] {
            if let Some(state) = pose {
                let numbers =
                    [state.position.x, state.position.y, state.position.z, state.heading, state.pan, state.tilt];
                let sum: f64 = numbers.iter().sum();
                ensure(name, sum, sum.is_finite(), "a pose of finite numbers")?;
            }
        }
        Ok(())
    }
}
