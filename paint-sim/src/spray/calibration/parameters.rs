//! What can be found, and the coordinates in which it is sought.

use nalgebra::{SMatrix, SVector};

use crate::error::{Error, check_not_negative, check_positive, check_range};
use crate::spray::SprayModel;

/// Parameters of a spray and its valve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Parameter {
    /// [`SprayModel::sigma`], rad.
    Sigma,
    /// Paint per second with the valve open, m^3/s.
    Flow,
    /// [`SprayModel::aspect`].
    Aspect,
    /// [`SprayModel::turn`], rad.
    Turn,
    /// [`SprayModel::yaw`], rad.
    Yaw,
    /// [`SprayModel::pitch`], rad.
    Pitch,
    /// How much shorter paint leaves the nozzle than the valve is told to be open, s.
    Delay,
}

/// How many there are.
pub(super) const COUNT: usize = 7;
/// All of them, in the order of the coordinates.
pub(super) const ALL: [Parameter; COUNT] = [
    Parameter::Sigma,
    Parameter::Flow,
    Parameter::Aspect,
    Parameter::Turn,
    Parameter::Yaw,
    Parameter::Pitch,
    Parameter::Delay,
];
/// One number for each parameter.
pub(super) type Vector = SVector<f64, COUNT>;

/// What is known before.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct CalibrationSettings {
    /// Values of what is held, and what is not sought at all: the cut (a real jet has no edge: default 5) and the efficiency, whose product
    /// with the flow is all that a card can tell.
    pub spray: SprayModel,
    /// The flow where it is held, m^3/s. Default 1 mm^3/s.
    pub flow: f64,
    /// The delay where it is held, and where its search starts, s. Default 0.
    pub delay: f64,
    /// What is not sought. Default: the delay, which takes bursts of several durations.
    pub held: Vec<Parameter>,
    /// Standard deviation of a reading, in its unit. Default 0.01, for reflectances.
    pub noise: f64,
    /// Most steps of a search. Default 50.
    pub iterations: usize,
}

impl Default for CalibrationSettings {
    fn default() -> Self {
        Self {
            spray: SprayModel { cut: 5.0, ..SprayModel::default() },
            flow: 1e-9,
            delay: 0.0,
            held: vec![Parameter::Delay],
            noise: 0.01,
            iterations: 50,
        }
    }
}

impl CalibrationSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        self.spray.check()?;
        check_positive("calibration.spray.efficiency", self.spray.efficiency)?;
        check_positive("calibration.flow", self.flow)?;
        check_not_negative("calibration.delay", self.delay)?;
        check_positive("calibration.noise", self.noise)?;
        check_range("calibration.iterations", self.iterations as f64, 1.0, 1e4, "between 1 and 10000")?;
        if self.free() == [false; COUNT] {
            return Err(Error::Empty { what: "the list of parameters that are not held" });
        }
        Ok(())
    }

    /// Which parameters are sought.
    pub(super) fn free(&self) -> [bool; COUNT] {
        ALL.map(|parameter| !self.held.contains(&parameter))
    }

    /// Whether aspect and turn are sought together, as a vector that is zero for a round spray, where the turn means nothing.
    pub(super) fn free_ellipse(&self) -> bool {
        let free = self.free();
        free[2] && free[3]
    }

    /// Coordinates: `ln t`, `ln flow`, the ellipse, the slopes of the jet's middle, the delay. The ellipse is `ln a` and the turn, or
    /// `ln a (cos 2 turn, sin 2 turn)` where both are sought.
    pub(super) fn coordinates(&self, spray: &SprayModel, flow: f64, delay: f64) -> Vector {
        let (size, turn) = (spray.aspect.ln(), spray.turn);
        let ellipse =
            if self.free_ellipse() { [size * (2.0 * turn).cos(), size * (2.0 * turn).sin()] } else { [size, turn] };
        let [yaw, pitch] = [spray.yaw.tan(), spray.pitch.tan()];
        Vector::from([spray.sigma.tan().ln(), flow.ln(), ellipse[0], ellipse[1], yaw, pitch, delay])
    }

    /// `ln a` and the turn of coordinates; an ellipse that is sought has its long side first.
    pub(super) fn ellipse(&self, at: &Vector) -> [f64; 2] {
        if self.free_ellipse() { [at[2].hypot(at[3]), 0.5 * at[3].atan2(at[2])] } else { [at[2], at[3]] }
    }

    /// The spray of coordinates; flow and delay are `exp(at[1])` and `at[6]`.
    pub(super) fn spray(&self, at: &Vector) -> SprayModel {
        let [size, turn] = self.ellipse(at);
        let (sigma, yaw, pitch) = (at[0].exp().atan(), at[4].atan(), at[5].atan());
        SprayModel { sigma, aspect: size.exp(), turn, yaw, pitch, ..self.spray }
    }

    /// Standard deviations of the parameters from the covariance of the coordinates.
    pub(super) fn deviations(&self, at: &Vector, covariance: &SMatrix<f64, COUNT, COUNT>) -> Vector {
        let root = |k: usize| covariance[(k, k)].max(0.0).sqrt();
        let [size, turn] = self.ellipse(at);
        let (long, turned) = if self.free_ellipse() {
            let (s, c) = (2.0 * turn).sin_cos();
            let (pp, pq, qq) = (covariance[(2, 2)], covariance[(2, 3)], covariance[(3, 3)]);
            let along = (c * c * pp + 2.0 * c * s * pq + s * s * qq).max(0.0).sqrt();
            let across = (s * s * pp - 2.0 * c * s * pq + c * c * qq).max(0.0).sqrt();
            (along, 0.5 * across / size.max(f64::MIN_POSITIVE))
        } else {
            (root(2), root(3))
        };
        // A turn of which nothing is known is even over half a revolution.
        let unknown = std::f64::consts::PI / 12.0_f64.sqrt();
        let angle = |slope: f64, deviation: f64| deviation / (1.0 + slope * slope);
        let t = at[0].exp();
        Vector::from([
            angle(t, t * root(0)),
            at[1].exp() * root(1),
            size.exp() * long,
            turned.min(unknown),
            angle(at[4], root(4)),
            angle(at[5], root(5)),
            root(6),
        ])
    }
}
