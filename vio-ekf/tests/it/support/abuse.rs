//! Recordings of a flight that goes wrong for a while, and what the filter makes of them.

use nalgebra::{Isometry3, Vector3};
use vio_ekf::eval::chi2;
use vio_ekf::lie::so3;
use vio_ekf::sim::{Gain, ImuModel, RoomSettings, Scenario, SimulatedCamera, Simulation, Vibration, camera_ahead};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Odometry, Settings, Stamp, Status, Vio, nalgebra};

use super::rng::Rng;
use super::sequences::{SEQUENCES, drawn_start, motion};

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Abuse {
    /// Two seconds without light.
    Black,
    /// Two seconds of eightfold exposure: most of the image is white.
    Overexposed,
    /// Three of ten frames are lost.
    Dropped,
    /// Half of the walls are bare.
    Bare,
    /// A turn by 150 degrees within 0.6 seconds.
    WhipPan,
    /// A gyroscope that ends at 0.8 rad/s, and a turn by 40 degrees within 0.6 seconds, at more than twice that.
    Saturated,
    /// Propellers shake the sensor: 6 m/s² and 0.15 rad/s at 87 and 174 Hz.
    Vibration,
    /// Stamps of images and samples that are off by 5 ms and 1 ms.
    Jitter,
}

pub(crate) const ABUSES: [Abuse; 8] = [
    Abuse::Black,
    Abuse::Overexposed,
    Abuse::Dropped,
    Abuse::Bare,
    Abuse::WhipPan,
    Abuse::Saturated,
    Abuse::Vibration,
    Abuse::Jitter,
];

/// What became of the estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outcome {
    /// Not flagged, and at the end within 0.2 m/s and 0.5 m, or within 1 m and the claimed covariance (99.9 %).
    pub(crate) survived: bool,
    pub(crate) flagged: bool,
    pub(crate) position_error: f64,
    pub(crate) velocity_error: f64,
    /// Most of an estimate's parts that were not finite.
    pub(crate) finite: bool,
}

/// A part of a recorded or generated flight, turned about the vertical on the way if so abused.
fn part(abuse: Abuse, name: &str, from: f64, seconds: f64) -> Option<Spline> {
    let whole = motion(name)?;
    let (first, last) = whole.span();
    let begin = first.nanos() + ((last.secs_since(first) - seconds - 1.0) * from * 1e9) as i64;
    let angle = match abuse {
        Abuse::WhipPan => 150_f64.to_radians(),
        Abuse::Saturated => 40_f64.to_radians(),
        _ => 0.0,
    };
    let knots = (0..(seconds / 0.05) as i64 + 3).map(|k| {
        let pose = whole.sample(Stamp::from_nanos(begin + k * 50_000_000)).unwrap().world_from_body;
        // Smoothly there, and two seconds later back.
        let ramp = |at: f64| {
            let u = ((k as f64 * 0.05 - at) / 0.6).clamp(0.0, 1.0);
            u * u * (3.0 - 2.0 * u)
        };
        let yaw = so3::exp(&(Vector3::z() * (angle * (ramp(5.0) - ramp(7.6)))));
        Isometry3::from_parts(pose.translation, yaw * pose.rotation)
    });
    Some(Spline::new(Stamp::from_nanos(1_000_000_000), 50_000_000, knots.collect()).unwrap())
}

/// A recording of `seconds`, abused from the fifth second on; `halves` is how often the image is halved in size.
fn simulation(abuse: Abuse, name: &str, seed: u64, seconds: f64, halves: u32) -> Option<Simulation> {
    let mut rng = Rng::new(seed);
    let spline = part(abuse, name, 0.5 + 0.5 * rng.signed(), seconds)?;
    let (mut imu, mut room) = (ImuModel::default(), RoomSettings::default());
    let lens = if name.starts_with("paint") { camera_ahead() } else { Camera::euroc() };
    let mut camera = SimulatedCamera { camera: smaller(&lens, halves), ..SimulatedCamera::default() };
    let gain = |factor| vec![Gain { from_s: 5.0, until_s: 7.0, factor, offset: 0.0 }];
    match abuse {
        Abuse::Black => camera.photometry.gains = gain(0.0),
        Abuse::Overexposed => camera.photometry.gains = gain(8.0),
        Abuse::Dropped => camera.drop_probability = 0.3,
        Abuse::Bare => (0..3).for_each(|_| room.blank[(rng.bits() % 6) as usize] = true),
        Abuse::WhipPan => (),
        Abuse::Saturated => imu.limits.gyro_range = 0.8,
        Abuse::Vibration => {
            let line = |frequency_hz| Vibration { frequency_hz, gyro_amplitude: 0.15, accel_amplitude: 6.0 };
            imu.vibrations = vec![line(87.0), line(174.0)];
        }
        Abuse::Jitter => {
            camera.stamp_jitter_s = 0.005;
            imu.limits.stamp_jitter_s = 0.001;
        }
    }
    let scenario = Scenario { seed, imus: vec![imu], cameras: vec![camera], room, ..Scenario::default() };
    Some(Simulation::new(spline, scenario).unwrap())
}

fn smaller(camera: &Camera, halves: u32) -> Camera {
    let scale = 0.5_f64.powi(halves as i32);
    let centre = |c: f64| (c + 0.5) * scale - 0.5;
    Camera {
        width: camera.width >> halves,
        height: camera.height >> halves,
        fx: camera.fx * scale,
        fy: camera.fy * scale,
        cx: centre(camera.cx),
        cy: centre(camera.cy),
        ..*camera
    }
}

/// Runs the filter over case `k` of the suite; `None` if the recording that it needs is absent.
pub(crate) fn run(k: u64, seconds: f64, halves: u32) -> Option<(Abuse, &'static str, Outcome)> {
    let abuse = ABUSES[k as usize % ABUSES.len()];
    let name = SEQUENCES[(k as usize / ABUSES.len()) % SEQUENCES.len()];
    let outcome = follow(&simulation(abuse, name, k + 1, seconds, halves)?, name, halves, k);
    Some((abuse, name, outcome))
}

fn follow(simulation: &Simulation, name: &str, halves: u32, seed: u64) -> Outcome {
    let camera = smaller(&super::sequences::camera(name), halves);
    let imu = ImuModel::default();
    let mut settings = Settings::default();
    // What the data sheets say.
    match ABUSES[seed as usize % ABUSES.len()] {
        Abuse::Saturated => settings.imu.gyro_range = 0.8,
        Abuse::Jitter => settings.calibration.stamp_jitter_s = 0.005,
        _ => (),
    }
    let mut vio = Vio::new(camera, imu.noise, settings).unwrap();
    let samples = simulation.imu(0).unwrap().samples;
    let mut samples = samples.iter();
    let first = samples.next().unwrap();
    vio.imu(first).unwrap();
    vio.initialize(&drawn_start(simulation, first.stamp, seed)).unwrap();
    let mut finite = true;
    for frame in simulation.frames(0) {
        let frame = frame.unwrap();
        for sample in samples.by_ref() {
            vio.imu(sample).unwrap();
            if sample.stamp >= frame.stamp {
                break;
            }
        }
        // An image whose stamp jitters to before the one before it is refused, and that is all.
        let _ = vio.image(frame.stamp, &frame.view());
        let o = vio.output().unwrap();
        finite &= o.covariance.iter().chain(o.velocity_in_body.iter()).all(|v| v.is_finite());
        finite &= o.world_from_body.translation.vector.iter().all(|v| v.is_finite());
        if std::env::var_os("VIO_TRACE").is_some() {
            trace(simulation, &vio, &o);
        }
    }
    let o = vio.output().unwrap();
    let (position_error, velocity_error) = errors(simulation, &o);
    let flagged = matches!(vio.status(), Status::Diverged(_));
    let claimed = o.covariance.fixed_view::<3, 3>(0, 0).into_owned().cholesky().is_some_and(|factor| {
        let off = offset(simulation, &o);
        off.dot(&factor.solve(&off)) < chi2::quantile(0.999, 3).unwrap()
    });
    let near = position_error < 0.5 || position_error < 1.0 && claimed;
    let survived = !flagged && near && velocity_error < 0.2;
    Outcome { survived, flagged, position_error, velocity_error, finite }
}

fn errors(simulation: &Simulation, o: &Odometry) -> (f64, f64) {
    let stamp = o.stamp.min(simulation.spline().span().1);
    let truth = simulation.motion(stamp).unwrap();
    let velocity = truth.world_from_body.rotation.inverse() * truth.velocity_in_world - o.velocity_in_body;
    (offset(simulation, o).norm(), velocity.norm())
}

fn offset(simulation: &Simulation, o: &Odometry) -> Vector3<f64> {
    let stamp = o.stamp.min(simulation.spline().span().1);
    simulation.motion(stamp).unwrap().world_from_body.translation.vector - o.world_from_body.translation.vector
}

fn trace(simulation: &Simulation, vio: &Vio, o: &Odometry) {
    let (position, velocity) = errors(simulation, o);
    let sigma = |row: usize| o.covariance[(row, row)].sqrt();
    eprintln!("{} {position:.3} m ({:.3}), {velocity:.3} m/s ({:.3}), {:?}", o.stamp, sigma(0), sigma(3), vio.status());
}
