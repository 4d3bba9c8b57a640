//! Odometry from a driver of one's own: samples and images go in as they come, poses and events come out.
//! `cargo run --release -p vio-ekf --example odometry`

use vio_ekf::run::{Run, RunnerSettings};
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
use vio_ekf::{Error, ImuNoise, Runner, Settings, Vio};

/// Your driver; here a simulated robot that flies along a wall.
pub fn driver() -> Result<Simulation, Error> {
    let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    Simulation::new(painting_flight(1, 4.0)?, Scenario { cameras, room, ..Scenario::default() })
}

/// What the odometry makes of it.
pub fn track(driver: &Simulation) -> Result<Run, Error> {
    // `Vio::from_calibration` takes what Kalibr writes, `Vio::stereo` two cameras.
    let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default())?;
    let mut runner = Runner::new(vio, RunnerSettings::default());
    let mut samples = driver.imu(0)?.samples.into_iter();
    for frame in driver.frames(0) {
        let frame = frame?;
        // On a robot: `runner.imu(&sample)` for each as it comes, after which `runner.output()` is the estimate at its time.
        runner.imu_until(frame.stamp, &mut samples)?;
        let outcome = runner.image(frame.stamp, &frame.view())?;
        for event in &outcome.events {
            println!("{} {event}", frame.stamp); // started, lost, poses taken back, image skipped
        }
        if let Some(now) = outcome.odometry {
            // Metres, in a world whose z is up and that begins with the segment.
            println!("{} {}", now.stamp, now.world_from_body.translation.vector.transpose());
        }
    }
    runner.finish()
}

fn main() -> Result<(), Error> {
    let run = track(&driver()?)?;
    println!("{} poses of {} images in {} segments", run.poses(), run.frames, run.segments.len());
    Ok(())
}
