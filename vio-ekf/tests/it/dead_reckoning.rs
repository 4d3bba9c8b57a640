//! Real inertial samples carried on from the recorded truth by the filter itself, without any camera.
//!
//! The figures: `cargo test --release -p vio-ekf --test it dead_reckoning -- --nocapture`.

use crate::support::recorded;
use nalgebra::Vector3;
use vio_ekf::filter::LandmarkSettings;
use vio_ekf::format::{asl, euroc};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::sim::{ImuModel, RoomSettings, Scenario, Simulation, painting_flight};
use vio_ekf::{Camera, Imu, ImuNoise, Settings, Stamp, Vio, nalgebra};

/// Stamps of truth and samples agree to this, ns.
const SAME: i64 = 1_000;

/// A flight's samples, and its truth at (nearly) the same times.
fn flight(name: &str, imu: &str) -> Option<(Vec<Imu>, euroc::States)> {
    let folder = format!("vio/euroc_imu_gt/{name}");
    let samples = asl::read_imu(&recorded::text(&format!("{folder}/{imu}.txt.gz"))?).unwrap();
    let truth = euroc::read(&recorded::text(&format!("{folder}/groundtruth_{name}.csv.gz")).unwrap()).unwrap();
    Some((samples, truth))
}

/// Medians of the errors in attitude (degrees) and velocity (m/s) after `steps` samples, over starts `every` so many rows of
/// the truth apart, each from the true state and biases.
fn medians(samples: &[Imu], truth: &euroc::States, gravity: f64, steps: usize, every: usize) -> (f64, f64, usize) {
    let (stamps, poses) = (truth.trajectory.stamps(), truth.trajectory.poses());
    let settings = Settings {
        gravity,
        landmarks: LandmarkSettings { max_count: 1, ..LandmarkSettings::default() },
        ..Settings::default()
    };
    let asleep = Vio::new(Camera::euroc(), ImuNoise::default(), settings).unwrap();
    let (mut angles, mut speeds) = (Vec::new(), Vec::new());
    for row in (0..stamps.len() - steps).step_by(every) {
        let (from, to) = (stamps[row], Stamp::from_nanos(stamps[row + steps].nanos() + SAME));
        let mut coming = samples[samples.partition_point(|s| s.stamp <= from) - 1..].iter();
        let begin = poses[row];
        let mut vio = asleep.clone();
        vio.imu(coming.next().unwrap()).unwrap();
        vio.initialize(&InitialState {
            stamp: from,
            world_from_body: begin,
            velocity_in_body: begin.rotation.inverse() * truth.velocities_in_world[row],
            gyro_bias: truth.gyro_biases[row],
            accel_bias: truth.accel_biases[row],
            sigma: InitialSigma::default(),
        })
        .unwrap();
        for sample in coming.take_while(|s| s.stamp <= to) {
            vio.imu(sample).unwrap();
        }
        let end = vio.output().unwrap();
        assert!((end.stamp.nanos() - stamps[row + steps].nanos()).abs() <= SAME, "{}", end.stamp);
        let rotation = end.world_from_body.rotation;
        angles.push(rotation.angle_to(&poses[row + steps].rotation).to_degrees());
        let velocity: Vector3<f64> = rotation * end.velocity_in_body;
        speeds.push((velocity - truth.velocities_in_world[row + steps]).norm());
    }
    let middle = angles.len() / 2;
    let [angle, speed] = [&mut angles, &mut speeds].map(|v| *v.select_nth_unstable_by(middle, f64::total_cmp).1);
    (angle, speed, angles.len())
}

/// One second from truth and true bias: what the sensor alone can do, as far as the truth is one. Its velocities are
/// themselves the integral of these samples, corrected every tenth of a second (see below), and those corrections are nearly
/// all that is measured here: no other rule, time shift, gravity, scale or lever arm takes away more than a tenth of it.
#[test]
fn a_second_of_real_samples() {
    for (name, imu, most_degrees, most_speed) in
        [("MH_04_difficult", "imu_MH04", 0.06, 0.040), ("V1_02_medium", "imu_V102", 0.16, 0.048)]
    {
        let Some((samples, truth)) = flight(name, imu) else { return };
        // Starts a multiple of half a second apart beat with the vibration.
        let (angle, speed, count) = medians(&samples, &truth, 9.81, 200, 17);
        eprintln!("{name}: {angle:.3} deg, {speed:.4} m/s after one second, medians of {count}");
        assert!(angle <= most_degrees && speed <= most_speed, "{name}: {angle} deg, {speed} m/s");
    }
}

/// Between its corrections the recorded truth is the integral of the samples, with Zurich's gravity: whoever made it did the
/// same as this filter, to the last printed digit. Over three samples most starts meet no correction. A rule that takes the
/// force of the sample before instead of the mean is off by four millimetres per second here.
#[test]
fn the_truth_between_its_corrections() {
    for (name, imu) in [("MH_04_difficult", "imu_MH04"), ("V1_02_medium", "imu_V102")] {
        let Some((samples, truth)) = flight(name, imu) else { return };
        let (angle, speed, count) = medians(&samples, &truth, 9.8081, 3, 17);
        eprintln!("{name}: {angle:.5} deg, {speed:.7} m/s after three samples, medians of {count}");
        // Printed: velocities to 1e-6 m/s, quaternions to 1e-6.
        assert!(angle < 2e-4 && speed < 1.5e-5, "{name}: {angle} deg, {speed} m/s");
    }
}

/// The same on samples of our own, whose noise is known. After a second the angle is a random walk of the gyroscope's density; the
/// speed is one of the accelerometer's, with what its bias has walked and what gravity does along axes that have tilted.
#[test]
fn a_second_of_generated_samples() {
    let imu = ImuModel { gyro_bias_sigma: 0.0, accel_bias_sigma: 0.0, ..ImuModel::default() };
    let scenario = Scenario {
        imus: vec![imu.clone()],
        room: RoomSettings { texture_size: 64, ..RoomSettings::default() },
        ..Scenario::default()
    };
    let simulation = Simulation::new(painting_flight(3, 60.0).unwrap(), scenario).unwrap();
    let recording = simulation.imu(0).unwrap();
    let samples = asl::read_imu(&asl::write_imu(&recording.samples)).unwrap();
    let mut truth = euroc::States::default();
    for sample in &samples {
        let motion = simulation.motion(sample.stamp).unwrap();
        truth.trajectory.push(sample.stamp, motion.world_from_body).unwrap();
        truth.velocities_in_world.push(motion.velocity_in_world);
        let (gyro, accel) = recording.biases_at(sample.stamp);
        truth.gyro_biases.push(gyro);
        truth.accel_biases.push(accel);
    }
    let truth = euroc::read(&euroc::write(&truth).unwrap()).unwrap();
    let (angle, speed, count) = medians(&samples, &truth, 9.81, 200, 17);
    // Medians of the length of a normal vector: 1.538 deviations of an axis.
    let noise = imu.noise;
    let degrees = (1.538 * noise.gyro_density).to_degrees();
    // Integrated random walks have a third of the variance. Two axes of three feel the tilt; the mean stands for them.
    let (walked, tilted) = (noise.accel_walk.powi(2) / 3.0, (9.81 * noise.gyro_density).powi(2) / 3.0);
    let metres = 1.538 * (noise.accel_density.powi(2) + walked + 2.0 / 3.0 * tilted).sqrt();
    eprintln!("{angle:.4} deg of {degrees:.4}, {speed:.5} m/s of {metres:.5}, medians of {count}");
    assert!((angle / degrees - 1.0).abs() < 0.15 && (speed / metres - 1.0).abs() < 0.15, "{angle} deg, {speed} m/s");
}
