//! The messages of the simulator's link: sensors in, motors out. PX4's clock is the stamp of `HIL_SENSOR`.

use mavlink::dialects::common::{
    HIL_ACTUATOR_CONTROLS_DATA, HIL_SENSOR_DATA, HilSensorUpdatedFlags, MavMessage, MavModeFlag,
};
use nalgebra::Vector3;
use paint_sim::flight::multirotor::{BarometerReading, ImuReading};

use super::frames;

/// Inertial sensor, magnetometer (gauss, body frame) and barometer at a time in microseconds.
pub fn hil_sensor(time_us: u64, imu: &ImuReading, field: &Vector3<f64>, barometer: &BarometerReading) -> MavMessage {
    let [force, rate, field] =
        [imu.specific_force, imu.angular_velocity, *field].map(|v| frames::body(&v).cast::<f32>());
    MavMessage::HIL_SENSOR(HIL_SENSOR_DATA {
        time_usec: time_us,
        xacc: force.x,
        yacc: force.y,
        zacc: force.z,
        xgyro: rate.x,
        ygyro: rate.y,
        zgyro: rate.z,
        xmag: field.x,
        ymag: field.y,
        zmag: field.z,
        // Hectopascals.
        abs_pressure: (barometer.pressure / 100.0) as f32,
        diff_pressure: 0.0,
        pressure_alt: barometer.height as f32,
        temperature: barometer.temperature as f32,
        // All but the reset of the simulation, bit 31.
        fields_updated: HilSensorUpdatedFlags::all() - HilSensorUpdatedFlags::HIL_SENSOR_UPDATED_RESET,
        id: 0,
    })
}

/// The commands of the first `rotors` motors, 0 to 1; all 0 while the autopilot is disarmed, 0 for those that are not finite.
pub fn motor_commands(controls: &HIL_ACTUATOR_CONTROLS_DATA, rotors: usize) -> Vec<f64> {
    let armed = controls.mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
    let command = |value: &f32| if armed && value.is_finite() { f64::from(value.clamp(0.0, 1.0)) } else { 0.0 };
    controls.controls.iter().take(rotors).map(command).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_are_turned_into_the_frames_of_mavlink() {
        let imu =
            ImuReading { specific_force: Vector3::new(0.1, 0.2, 9.8), angular_velocity: Vector3::new(0.3, 0.4, 0.5) };
        let barometer = BarometerReading { pressure: 95_461.0, height: 500.0, temperature: 11.75 };
        let MavMessage::HIL_SENSOR(sent) = hil_sensor(4000, &imu, &Vector3::new(0.21, 0.02, -0.43), &barometer) else {
            panic!("another message")
        };
        // At rest the force points up: -9.8 along a z that points down.
        assert_eq!([sent.xacc, sent.yacc, sent.zacc], [0.1, -0.2, -9.8]);
        assert_eq!([sent.xgyro, sent.ygyro, sent.zgyro], [0.3, -0.4, -0.5]);
        assert_eq!([sent.xmag, sent.ymag, sent.zmag], [0.21, -0.02, 0.43]);
        assert_eq!((sent.abs_pressure, sent.fields_updated.bits(), sent.time_usec), (954.61, 0x1fff, 4000));
    }

    #[test]
    fn disarmed_motors_stand_still() {
        let mut controls = HIL_ACTUATOR_CONTROLS_DATA::default();
        controls.controls[..5].copy_from_slice(&[0.5, f32::NAN, 1.5, -0.2, 0.7]);
        controls.mode = MavModeFlag::empty();
        assert_eq!(motor_commands(&controls, 4), [0.0; 4]);
        controls.mode = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        assert_eq!(motor_commands(&controls, 4), [0.5, 0.0, 1.0, 0.0]);
    }
}
