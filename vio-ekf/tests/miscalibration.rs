//! What wrong calibrations and broken samples do to a run: error, consistency, what was said, and what `--calibrate` recovers.
//!
//! `PAINTCOPTER_DATA=... cargo test --release -p vio-ekf --test miscalibration -- --ignored --nocapture`. `FLIGHTS=room_7,V1_02_imu`
//! chooses flights (a name, `_`, the seed; `_imu`: recorded samples), `CASES=focal` the cases whose name holds that, `SECONDS=40` the
//! length, `CAMERAS=1` or `2` one table of both, `READOUT=30` the read-out of a rolling shutter, ms (of one camera).

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::camera::Distortion;
use vio_ekf::eval::{Alignment, Association, ate, heading_onto};
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::format::{asl, euroc};
use vio_ekf::imu_check::validate_samples;
use vio_ekf::run::{Event, Picture, RecordedFrame, Run, Runner, RunnerSettings, check_calibration};
use vio_ekf::sim::{
    RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, camera_ahead_right, painting_flight,
    swaying_flight,
};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Trajectory, Vio, nalgebra};

#[path = "it/support/recorded.rs"]
mod recorded;

/// Flights that no constant was chosen on come with other seeds.
const FLIGHTS: &str = "room_11,wall_12,V1_02_13,V1_02_imu,MH_04_imu";

/// What the filter is given.
#[derive(Clone)]
struct Given {
    cameras: [Camera; 2],
    time_offset_s: f64,
    row_time_s: f64,
    samples: Vec<Imu>,
    swapped: bool,
}

impl Given {
    fn calibrations(&self) -> [CameraCalibration; 2] {
        let Self { time_offset_s, row_time_s, .. } = *self;
        self.cameras.map(|camera| CameraCalibration { camera, rate_hz: None, time_offset_s, row_time_s })
    }
}

struct Shot<'a>(&'a [u8]);

impl Picture for Shot<'_> {
    fn view(&self) -> ImageView<'_> {
        ImageView::new(752, 480, self.0).unwrap()
    }
}

struct Flight {
    simulation: Simulation,
    given: Given,
    frames: Vec<(Stamp, [Vec<u8>; 2])>,
}

type Change = Box<dyn Fn(&mut Given)>;

fn degrees(angle: f64) -> f64 {
    angle.to_radians()
}

/// Samples that end at a reading.
fn clip(samples: &mut [Imu], range: f64) {
    for sample in samples {
        sample.accel.apply(|a| *a = a.clamp(-range, range));
    }
}

/// White noise of a density.
fn add_noise(samples: &mut [Imu], gyro: f64, accel: f64) {
    let mut state = 88_172_645_463_325_252_u64;
    let mut unit = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut normal = move || (0..12).map(|_| unit()).sum::<f64>() - 6.0;
    // 200 Hz.
    let rate = 200.0_f64.sqrt();
    for sample in samples {
        sample.gyro += Vector3::from_fn(|_, _| normal()) * (gyro * rate);
        sample.accel += Vector3::from_fn(|_, _| normal()) * (accel * rate);
    }
}

/// The cases; the first is sound.
fn cases() -> Vec<(String, Change)> {
    let mut cases: Vec<(String, Change)> = vec![("sound".into(), Box::new(|_| ()))];
    let mut add = |name: String, change: Change| cases.push((name, change));
    for percent in [2.0, -2.0, 5.0, -5.0] {
        for (which, count) in [("", 2), (" of the first", 1)] {
            add(
                format!("focal {percent:+}%{which}"),
                Box::new(move |g| {
                    for camera in &mut g.cameras[..count] {
                        camera.fx *= 1.0 + percent / 100.0;
                        camera.fy *= 1.0 + percent / 100.0;
                    }
                }),
            );
        }
    }
    add("centre 10 px".into(), Box::new(|g| g.cameras.iter_mut().for_each(|c| c.cx += 10.0)));
    add("centre -10 px in y".into(), Box::new(|g| g.cameras.iter_mut().for_each(|c| c.cy -= 10.0)));
    add("distortion 0".into(), Box::new(|g| g.cameras.iter_mut().for_each(|c| c.distortion = Distortion::None)));
    for angle in [2.0, 5.0] {
        add(
            format!("extrinsics {angle} deg"),
            Box::new(move |g| {
                let axis = nalgebra::Unit::new_normalize(Vector3::new(1.0, -0.7, 0.4));
                let turn = UnitQuaternion::from_axis_angle(&axis, degrees(angle));
                for camera in &mut g.cameras {
                    let pose = camera.body_from_camera;
                    camera.body_from_camera =
                        Isometry3::from_parts(Translation3::from(turn * pose.translation.vector), turn * pose.rotation);
                }
            }),
        );
    }
    for millis in [5.0, -5.0, 20.0, -20.0, 50.0, -50.0] {
        add(format!("clock {millis:+} ms"), Box::new(move |g| g.time_offset_s = millis * 1e-3));
    }
    for millis in [30.0, -30.0, 10.0, -10.0] {
        add(format!("shutter {millis:+} ms"), Box::new(move |g| g.row_time_s += millis * 1e-3 / 480.0));
    }
    add("swapped".into(), Box::new(|g| g.swapped = true));
    add("clipped".into(), Box::new(|g| clip(&mut g.samples, 10.5)));
    for percent in [5.0, -5.0] {
        let scale = Matrix3::identity() * (1.0 + percent / 100.0);
        add(
            format!("accelerometer {percent:+}%"),
            Box::new(move |g| g.samples.iter_mut().for_each(|s| s.accel = scale * s.accel)),
        );
    }
    for percent in [1.0, -2.0] {
        let scale = 1.0 + percent / 100.0;
        add(format!("gyroscope {percent:+}%"), Box::new(move |g| g.samples.iter_mut().for_each(|s| s.gyro *= scale)));
    }
    add("noise x10".into(), Box::new(|g| add_noise(&mut g.samples, 1.7e-3, 2e-2)));
    cases
}

fn cameras(name: &str) -> [Camera; 2] {
    match name {
        "wall" => [camera_ahead(), camera_ahead_right()],
        _ => [Camera::euroc(), Camera::euroc_right()],
    }
}

/// Flights at rest at first.
fn spline(name: &str, seed: u64, seconds: f64) -> Option<Spline> {
    let file = match name {
        "room" => {
            let phase = |k: u64| (seed.wrapping_mul(2_654_435_761).wrapping_add(k * 40_503) % 6283) as f64 * 1e-3;
            let phases: [Vector3<f64>; 4] =
                std::array::from_fn(|k| Vector3::from_fn(|r, _| phase(3 * k as u64 + r as u64)));
            return Some(rested(&swaying_flight(&phases, seconds).unwrap()));
        }
        "wall" => return Some(rested(&painting_flight(seed, seconds).unwrap())),
        "V1_02" => "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        _ => "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
    };
    let knots = if seed == 0 { 5_000_000 } else { 50_000_000 };
    let whole = euroc::read(&recorded::text(file)?).unwrap();
    // Its maker's fixes pulled at the truth here and there: what comes after a jump is shifted back by it.
    let (mut joined, mut shift) = (Trajectory::default(), Vector3::zeros());
    let mut last: Option<(Stamp, Vector3<f64>, Vector3<f64>)> = None;
    for ((stamp, pose), &velocity) in whole.trajectory.iter().zip(&whole.velocities_in_world) {
        if let Some((before, from, began)) = last {
            let jump = pose.translation.vector - from - (began + velocity) * (0.5 * stamp.secs_since(before));
            if jump.norm() > 1e-3 {
                shift -= jump;
            }
        }
        last = Some((stamp, pose.translation.vector, velocity));
        if stamp.secs_since(whole.trajectory.stamps()[0]) <= seconds {
            joined.push(stamp, Isometry3::from_parts((pose.translation.vector + shift).into(), pose.rotation)).unwrap();
        }
    }
    Some(Spline::from_trajectory(&joined, knots).unwrap())
}

/// The same flight after two seconds at rest, into which it is led.
fn rested(flight: &Spline) -> Spline {
    let (first, last) = flight.span();
    let knot = 50_000_000_i64;
    let count = ((last.nanos() - first.nanos()) / knot) as usize;
    let start = flight.sample(first).unwrap().world_from_body;
    let at = |k: usize| {
        let seconds = k as f64 * 0.05 - 2.0;
        // Time runs up from 0 to 1 within two seconds.
        let time = if seconds <= 0.0 {
            0.0
        } else if seconds < 2.0 {
            seconds * seconds / 4.0
        } else {
            seconds - 1.0
        };
        let stamp = first.plus_secs(time);
        if stamp <= last { flight.sample(stamp).unwrap().world_from_body } else { start }
    };
    Spline::new(first, knot, (0..count + 20).map(at).collect()).unwrap()
}

impl Flight {
    fn new(name: &str, seconds: f64, count: usize, readout_s: f64) -> Option<Self> {
        let (name, seed) = name.rsplit_once('_').unwrap();
        let seed = if seed == "imu" { 0 } else { seed.parse().unwrap() };
        let (both, row_time_s) = (cameras(name), readout_s / 480.0);
        let scenario = Scenario {
            seed: seed.max(5),
            cameras: both.map(|camera| SimulatedCamera { camera, row_time_s, ..SimulatedCamera::default() }).to_vec(),
            room: RoomSettings::default(),
            ..Scenario::default()
        };
        let simulation = Simulation::new(spline(name, seed, seconds)?, scenario).unwrap();
        let samples = if seed == 0 {
            let file = match name {
                "V1_02" => "vio/euroc_imu_gt/V1_02_medium/imu_V102.txt.gz",
                _ => "vio/euroc_imu_gt/MH_04_difficult/imu_MH04.txt.gz",
            };
            let (first, last) = simulation.spline().span();
            let mut samples = asl::read_imu(&recorded::text(file)?).unwrap();
            samples.retain(|sample| (first..=last).contains(&sample.stamp));
            samples
        } else {
            simulation.imu(0).unwrap().samples
        };
        let mut frames = Vec::new();
        for index in 0..simulation.frame_count(0) {
            let Some(first) = simulation.frame(0, index).unwrap() else { continue };
            let second = if count == 2 { simulation.frame(1, index).unwrap().unwrap().data } else { Vec::new() };
            frames.push((first.stamp, [first.data, second]));
        }
        let given = Given { cameras: both, time_offset_s: 0.0, row_time_s, samples, swapped: false };
        Some(Self { simulation, given, frames })
    }

    /// A run as the binary makes it.
    fn run(&self, given: &Given, settings: &Settings, count: usize) -> (Result<Run, String>, Vec<String>) {
        let mut runner = Runner::new(Self::filter(given, settings, count), RunnerSettings::default());
        let found = validate_samples(&given.samples, 200.0, 9.81);
        let mut said: Vec<String> = match found {
            Ok(found) => found.warnings.iter().map(ToString::to_string).collect(),
            Err(error) => vec![error.to_string()],
        };
        let mut samples = given.samples.iter().copied();
        for (stamp, images) in &self.frames {
            if runner.imu_until(*stamp, &mut samples).is_err() {
                break;
            }
            let [first, second] = [0, 1].map(|k| if given.swapped { 1 - k } else { k });
            let view = |k: usize| {
                let data = if images[k].is_empty() { &images[0] } else { &images[k] };
                ImageView::new(752, 480, data).unwrap()
            };
            let outcome = if count == 2 {
                runner.image_pair(*stamp, &view(first), &view(second))
            } else {
                runner.image(*stamp, &view(0))
            };
            match outcome {
                Ok(outcome) => said.extend(outcome.events.iter().filter_map(|event| match event {
                    Event::Started | Event::Skipped(_) => None,
                    event => Some(event.to_string()),
                })),
                Err(error) => return (Err(error.to_string()), said),
            }
        }
        let run = runner.finish();
        if let Ok(Run { doubt: Some(doubt), .. }) = &run
            && !said.iter().any(|line| line.ends_with(&doubt.to_string()))
        {
            said.push(format!("at the end: {doubt}"));
        }
        (run.map_err(|error| error.to_string()), said)
    }

    fn filter(given: &Given, settings: &Settings, count: usize) -> Vio {
        let imu = ImuCalibration { noise: ImuNoise::default(), rate_hz: 200.0, body_from_imu: Isometry3::identity() };
        Vio::from_calibration(&given.calibrations()[..count], &imu, *settings).unwrap()
    }

    /// As the binary does it with `--calibrate`: checks until nothing is doubted; how many, and the settings of the run then.
    fn calibrated(&self, given: &Given, count: usize) -> (Given, usize, Settings) {
        let (mut given, mut checks, mut settings) = (given.clone(), 0, Settings::default());
        for _ in 0..4 {
            let filter = Self::filter(&given, &Settings::default(), count);
            let frames = || {
                self.frames.iter().map(|(stamp, images)| {
                    let [first, second] = [0, 1].map(|k| if given.swapped { 1 - k } else { k });
                    let picture = |k: usize| Shot(&images[k]);
                    if count == 2 {
                        RecordedFrame { stamp: *stamp, picture: Ok(picture(first)), second: Some(Ok(picture(second))) }
                    } else {
                        RecordedFrame::single(*stamp, picture(0))
                    }
                })
            };
            let Some(doubt) = check_calibration(&filter, &given.samples, frames) else { break };
            checks += 1;
            if std::env::var_os("VERBOSE").is_some() {
                println!("    {doubt}");
            }
            let mut calibrations = given.calibrations();
            doubt.correct(&mut calibrations);
            doubt.correct_samples(&mut given.samples);
            given.cameras = calibrations.map(|c| c.camera);
            (given.time_offset_s, given.row_time_s) = (calibrations[0].time_offset_s, calibrations[0].row_time_s);
            settings = doubt.freed(&settings);
            if doubt.found.is_none() {
                break;
            }
        }
        (given, checks, settings)
    }

    /// Position error after alignment, m, NEES of the position, share of images with a pose; of the longest segment.
    fn judge(&self, run: &Run) -> (f64, f64, f64) {
        let segment = run.segments.iter().max_by_key(|segment| segment.estimates.len()).unwrap();
        let (mut truth, mut estimate, mut moved) = (Trajectory::default(), Trajectory::default(), None);
        let mut squares = Vec::new();
        for found in &segment.estimates {
            let odometry = &found.odometry;
            let Ok(motion) = self.simulation.motion(odometry.stamp) else { continue };
            let moved = *moved.get_or_insert_with(|| heading_onto(&odometry.world_from_body, &motion.world_from_body));
            let pose = moved * motion.world_from_body;
            truth.push(odometry.stamp, pose).unwrap();
            estimate.push(odometry.stamp, odometry.world_from_body).unwrap();
            let error = pose.translation.vector - odometry.world_from_body.translation.vector;
            // A millimetre of the truth.
            let block = odometry.covariance.fixed_view::<3, 3>(0, 0) + Matrix3::identity() * 1e-6;
            squares.push(block.cholesky().map_or(f64::NAN, |factor| error.dot(&factor.solve(&error))));
        }
        let pairs = Association::default().pair_up(&truth, &estimate).unwrap();
        let error = ate(&pairs.reference, &pairs.estimate, Alignment::Se3).map_or(f64::NAN, |ate| ate.position.rmse);
        let nees = squares.iter().sum::<f64>() / squares.len() as f64;
        (error, nees, run.poses() as f64 / self.frames.len() as f64)
    }
}

#[test]
#[ignore = "minutes; prints a table"]
fn wrong_calibrations() {
    let variable = |name: &str, default: &str| std::env::var(name).unwrap_or_else(|_| default.into());
    let seconds: f64 = variable("SECONDS", "40").parse().unwrap();
    let (wanted, count) = (variable("CASES", ""), variable("CAMERAS", "1,2"));
    let readout_s = 1e-3 * variable("READOUT", "0").parse::<f64>().unwrap();
    for name in variable("FLIGHTS", FLIGHTS).split(',') {
        let Some(flight) = Flight::new(name, seconds, if count == "1" { 1 } else { 2 }, readout_s) else { continue };
        for count in count.split(',').map(|count| count.parse::<usize>().unwrap()) {
            println!("\n{name}, {count} camera(s): ATE mm, NEES, poses; with --calibrate; its doubts; what was said");
            for (case, change) in cases() {
                // Two cameras, or a rolling shutter.
                let impossible = if count == 1 { case == "swapped" } else { case.starts_with("shutter") };
                if !case.contains(&wanted) || impossible {
                    continue;
                }
                let mut given = flight.given.clone();
                change(&mut given);
                let figures = |run: &Result<Run, String>| match run {
                    Ok(run) => {
                        let (error, nees, poses) = flight.judge(run);
                        let lost = if run.tracking_at_end { "" } else { " LOST" };
                        format!("{:6.1} {nees:7.1} {:3.0}%{lost}", 1e3 * error, 100.0 * poses)
                    }
                    Err(why) => format!("failed: {why}"),
                };
                let (plain, mut said) = flight.run(&given, &Settings::default(), count);
                let (found, checks, settings) = flight.calibrated(&given, count);
                let (calibrated, _) = flight.run(&found, &settings, count);
                let [plain, calibrated] = [&plain, &calibrated].map(figures);
                said.dedup();
                println!("{case:24} | {plain:24} | {calibrated:24} | {checks} | {}", said.join("; "));
            }
        }
    }
}
