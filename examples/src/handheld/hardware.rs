//! What the robot is made of, and how well.

use nalgebra::Isometry3;
use paint_planner::gantry::{PoseFilterSettings, RegistrationSettings};
use paint_sim::gantry_robot::{
    InertialSensorSettings, PoseSensorSettings, RangeSensorSettings, StepperSettings, ValveSettings,
};

/// Sensors, actuators and what is wrong with them.
#[derive(Debug, Clone, PartialEq)]
pub struct HardwareSettings {
    /// Marker tracking.
    pub pose_sensor: PoseSensorSettings,
    /// Inertial sensor; `None`: the camera alone, as in the paper.
    pub inertial_sensor: Option<InertialSensorSettings>,
    /// What the filter believes of them.
    pub filter: PoseFilterSettings,
    /// Largest standard deviation of the believed place at which the valve may open, m.
    pub max_position_sigma: f64,
    /// Beams towards the object.
    pub range_sensor: RangeSensorSettings,
    /// Correction of the object's place by them; `None` believes the model.
    pub registration: Option<RegistrationSettings>,
    /// Where the object stands against where the model says.
    pub world_from_model: Isometry3<f64>,
    /// The slide.
    pub stepper: StepperSettings,
    /// Acceleration of the rounded corners, m/s^2.
    pub corner_acceleration: f64,
    /// The valve.
    pub valve: ValveSettings,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for HardwareSettings {
    fn default() -> Self {
        Self {
            pose_sensor: PoseSensorSettings::default(),
            inertial_sensor: Some(InertialSensorSettings::default()),
            filter: PoseFilterSettings::default(),
            max_position_sigma: 1.2e-3,
            range_sensor: RangeSensorSettings::default(),
            registration: Some(RegistrationSettings::default()),
            world_from_model: Isometry3::identity(),
            stepper: StepperSettings::default(),
            corner_acceleration: 5.0,
            valve: ValveSettings::default(),
            seed: 1,
        }
    }
}
