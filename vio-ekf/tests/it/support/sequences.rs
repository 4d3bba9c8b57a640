//! The motions on which the filter is judged, and what a point tracker or a camera records along them.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use vio_ekf::filter::PointObservation;
use vio_ekf::format::{euroc, tum};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::sim::{
    ImuModel, ImuRecording, RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, observe_points,
    painting_flight,
};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Stamp, Trajectory, nalgebra};

use super::recorded;
use super::rng::Rng;

/// Four recorded flights and two along a wall that is to be painted.
pub(crate) const SEQUENCES: [&str; 6] = ["MH_01", "MH_03", "MH_04", "V1_02", "paint_1", "paint_2"];

/// Recorded races of drones, at up to 20 m/s.
pub(crate) const RACES: [&str; 3] = ["indoor_3", "indoor_5", "outdoor_5"];

/// The motion of a sequence; `None` if its recording is absent.
pub(crate) fn motion(name: &str) -> Option<Spline> {
    let file = match name {
        "MH_01" => "trajectories/euroc/MH_01_easy.txt.gz",
        "MH_03" => "trajectories/euroc/MH_03_medium.txt.gz",
        "MH_04" => "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
        "V1_02" => "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        "indoor_3" => "trajectories/uzhfpv/indoor_forward_3_snapdragon_with_gt.txt.gz",
        "indoor_5" => "trajectories/uzhfpv/indoor_forward_5_snapdragon_with_gt.txt.gz",
        "outdoor_5" => "trajectories/uzhfpv/outdoor_forward_5_snapdragon_with_gt.txt.gz",
        "paint_1" => return Some(painting_flight(1, 60.0).unwrap()),
        _ => return Some(painting_flight(2, 60.0).unwrap()),
    };
    let text = recorded::text(file)?;
    let whole: Trajectory =
        if file.ends_with("csv.gz") { euroc::read(&text).unwrap().trajectory } else { tum::read(&text).unwrap() };
    Some(Spline::from_trajectory(&whole, 50_000_000).unwrap())
}

/// The camera of the sequences; on the robot that paints it looks ahead.
pub(crate) fn camera(name: &str) -> Camera {
    if name.starts_with("paint") { camera_ahead() } else { Camera::euroc() }
}

/// A sequence with its room and its inertial samples.
pub(crate) struct Sequence {
    pub(crate) simulation: Simulation,
    pub(crate) camera: Camera,
    pub(crate) imu: ImuRecording,
    points: Vec<Point3<f64>>,
    pub(crate) pixel_sigma: f64,
}

impl Sequence {
    /// With a scenario changed from that of the sequence; `textured` if images are wanted, points otherwise.
    pub(crate) fn new(name: &str, seed: u64, textured: bool, change: impl FnOnce(&mut Scenario)) -> Option<Self> {
        let camera = camera(name);
        let texture_size = if textured { RoomSettings::default().texture_size } else { 64 };
        let mut scenario = Scenario {
            seed,
            cameras: vec![SimulatedCamera { camera, ..SimulatedCamera::default() }],
            room: RoomSettings { texture_size, ..RoomSettings::default() },
            ..Scenario::default()
        };
        change(&mut scenario);
        let simulation = Simulation::new(motion(name)?, scenario).unwrap();
        let imu = simulation.imu(0).unwrap();
        let walls = simulation.room().walls;
        let (middle, half) = ((walls.min + walls.max) / 2.0, (walls.max - walls.min) / 2.0);
        let mut rng = Rng::new(seed);
        // So many that a good twenty-five are in sight from everywhere.
        let point = |_| {
            let mut unit = rng.vector();
            let axis = (rng.bits() % 3) as usize;
            unit[axis] = unit[axis].signum();
            Point3::from(middle + unit.component_mul(&half))
        };
        Some(Self { simulation, camera, imu, points: (0..500).map(point).collect(), pixel_sigma: 0.5 })
    }

    pub(crate) fn span(&self) -> (Stamp, Stamp) {
        self.simulation.spline().span()
    }

    /// What a tracker of points sees at a time; the noise comes from the time.
    pub(crate) fn see(&self, stamp: Stamp) -> Vec<PointObservation> {
        let mut rng = Rng::new(stamp.nanos() as u64);
        let world_from_body = self.simulation.motion(stamp).unwrap().world_from_body;
        let noise = || Vector2::new(rng.normal(), rng.normal()) * self.pixel_sigma;
        observe_points(&self.points, &self.camera, &world_from_body, 8.0, noise)
    }
}

/// The truth, less errors drawn from what the start admits.
pub(crate) fn drawn_start(simulation: &Simulation, stamp: Stamp, seed: u64) -> InitialState {
    let imu = ImuModel::default();
    let sigma =
        InitialSigma { gyro_bias: imu.gyro_bias_sigma, accel_bias: imu.accel_bias_sigma, ..InitialSigma::default() };
    let mut rng = Rng::new(seed);
    // A stamp that jitters may be a little before the beginning.
    let motion = simulation.motion(stamp.max(simulation.spline().span().0)).unwrap();
    let pose = motion.world_from_body;
    let tilt = rng.normals().component_mul(&Vector3::new(sigma.tilt, sigma.tilt, 0.0));
    InitialState {
        stamp,
        world_from_body: Isometry3::from_parts(pose.translation, so3::exp(&-tilt) * pose.rotation),
        velocity_in_body: pose.rotation.inverse() * motion.velocity_in_world - rng.normals() * sigma.velocity,
        // The simulator draws the biases around zero.
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma,
    }
}
