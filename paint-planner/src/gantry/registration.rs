//! Where the object really stands: its registration corrected while painting, from distances measured to it (handheld paper, Section VII,
//! future work).
//!
//! The state is a small motion of the object, `(translation, rotation)` about its middle, which walks at random; each distance is a scalar
//! measurement of it (point to plane), with a gate against what hits an edge.

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3, Vector6};

use crate::error::Error;
use crate::world::Surface;

/// Noise and gates of the registration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct RegistrationSettings {
    /// Standard deviation of the object's place at the start, m (default 6 mm: the worst offset of the paper's demonstration).
    pub translation_sigma: f64,
    /// Standard deviation of its orientation at the start, rad (default 1 degree).
    pub rotation_sigma: f64,
    /// Random walk of its place, m per root second (default 0.1 mm).
    pub walk: f64,
    /// Standard deviation of a measured distance, pose noise included, m (default 2 mm).
    pub range_sigma: f64,
    /// Largest squared Mahalanobis distance of a reading that is believed (default 9).
    pub gate: f64,
    /// Largest angle between beam and normal at which a reading is used, rad (default 70 degrees).
    pub max_incidence: f64,
    /// Longest distance that is used, m (default 0.3).
    pub max_range: f64,
}

impl Default for RegistrationSettings {
    fn default() -> Self {
        Self {
            translation_sigma: 6e-3,
            rotation_sigma: 1.0_f64.to_radians(),
            walk: 1e-4,
            range_sigma: 2e-3,
            gate: 9.0,
            max_incidence: 70.0_f64.to_radians(),
            max_range: 0.3,
        }
    }
}

/// A measured distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeReading {
    /// Where the beam begins, in the world as the pose sensor has it, m.
    pub origin: Point3<f64>,
    /// Its direction.
    pub direction: UnitVector3<f64>,
    /// Measured distance, m; `None` where nothing was hit.
    pub distance: Option<f64>,
}

/// Filter over the object's motion against the model's place.
#[derive(Debug, Clone)]
pub struct Registration {
    settings: RegistrationSettings,
    /// About which the object turns.
    middle: Point3<f64>,
    /// Motion of the object: translation, m, then rotation vector, rad.
    state: Vector6<f64>,
    covariance: Matrix6<f64>,
    /// Readings that were used.
    pub used: usize,
    /// Readings that were not: no hit, too far, too flat, or gated.
    pub rejected: usize,
}

impl Registration {
    /// An object believed to stand where its model says; `middle` is a point in it (m, world).
    ///
    /// # Errors
    /// Settings that are not positive.
    pub fn new(middle: Point3<f64>, settings: RegistrationSettings) -> Result<Self, Error> {
        for (name, value) in [
            ("registration.translation_sigma", settings.translation_sigma),
            ("registration.rotation_sigma", settings.rotation_sigma),
            ("registration.range_sigma", settings.range_sigma),
            ("registration.gate", settings.gate),
            ("registration.max_incidence", settings.max_incidence),
            ("registration.max_range", settings.max_range),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::Setting { name, value, requirement: "finite and greater than 0" });
            }
        }
        if !(settings.walk.is_finite() && settings.walk >= 0.0) {
            let (name, value) = ("registration.walk", settings.walk);
            return Err(Error::Setting { name, value, requirement: "finite and not negative" });
        }
        let (t, r) = (settings.translation_sigma.powi(2), settings.rotation_sigma.powi(2));
        let covariance = Matrix6::from_diagonal(&Vector6::new(t, t, t, r, r, r));
        Ok(Self { settings, middle, state: Vector6::zeros(), covariance, used: 0, rejected: 0 })
    }

    /// The motion that takes the model from its place to where the object stands.
    pub fn correction(&self) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(self.state.fixed_rows::<3>(3).into_owned());
        let shift = self.state.fixed_rows::<3>(0).into_owned();
        let about = self.middle.coords;
        Isometry3::from_parts(Translation3::from(about + shift - rotation * about), rotation)
    }

    /// Standard deviation of the object's place along each axis, m.
    pub fn translation_sigmas(&self) -> Vector3<f64> {
        Vector3::new(self.covariance[(0, 0)], self.covariance[(1, 1)], self.covariance[(2, 2)]).map(f64::sqrt)
    }

    /// Lets `dt` seconds pass and takes in a reading against the surface of the model in its own place. Returns whether it was used.
    pub fn update(&mut self, reading: &RangeReading, surface: &dyn Surface, dt: f64) -> bool {
        let walk = self.settings.walk.powi(2) * dt.max(0.0);
        (0..3).for_each(|k| self.covariance[(k, k)] += walk);
        let used = self.measure(reading, surface).is_some();
        if used {
            self.used += 1;
        } else {
            self.rejected += 1;
        }
        used
    }

    fn measure(&mut self, reading: &RangeReading, surface: &dyn Surface) -> Option<()> {
        let measured = reading.distance.filter(|d| d.is_finite() && *d <= self.settings.max_range)?;
        // The beam as the model in its own place would see it.
        let model_from_world = self.correction().inverse();
        let origin = model_from_world * reading.origin;
        let direction = model_from_world.rotation * reading.direction;
        let hit = surface.cast(&origin, &direction, 2.0 * self.settings.max_range)?;
        let facing = hit.normal.dot(&direction);
        if facing.abs() < self.settings.max_incidence.cos() {
            return None;
        }
        let world = self.correction();
        let (point, normal) = (world * hit.point, world.rotation * hit.normal.into_inner());
        // A motion of the object along its normal changes the distance by one over the cosine.
        let per_normal = normal / facing;
        let turn = (point - self.middle).cross(&per_normal);
        let jacobian = Vector6::new(per_normal.x, per_normal.y, per_normal.z, turn.x, turn.y, turn.z);
        let residual = measured - hit.distance;
        let gain = self.covariance * jacobian;
        let variance = jacobian.dot(&gain) + self.settings.range_sigma.powi(2);
        if residual * residual > self.settings.gate * variance {
            return None;
        }
        self.state += gain * (residual / variance);
        self.covariance -= gain * gain.transpose() / variance;
        // Rounding must not make it lopsided.
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        Some(())
    }
}
