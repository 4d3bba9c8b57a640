//! The motions on which the filter is judged, and what a point tracker or a camera records along them.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use vio_ekf::sim::{CameraModel, ImuRecording, RoomSettings, Scenario, Simulation};
use vio_ekf::{Camera, PointObservation, Spline, Stamp, Trajectory, euroc, nalgebra, so3, tum};

use super::{Rng, recorded};

/// Four recorded flights and two along a wall that is to be painted.
pub(crate) const SEQUENCES: [&str; 6] = ["MH_01", "MH_03", "MH_04", "V1_02", "paint_1", "paint_2"];

/// The motion of a sequence; `None` if its recording is absent.
pub(crate) fn motion(name: &str) -> Option<Spline> {
    let file = match name {
        "MH_01" => "trajectories/euroc/MH_01_easy.txt.gz",
        "MH_03" => "trajectories/euroc/MH_03_medium.txt.gz",
        "MH_04" => "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
        "V1_02" => "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        "paint_1" => return Some(painting(1)),
        _ => return Some(painting(2)),
    };
    let text = recorded(file)?;
    let whole: Trajectory =
        if file.ends_with("csv.gz") { euroc::read(&text).unwrap().trajectory } else { tum::read(&text).unwrap() };
    Some(Spline::from_trajectory(&whole, 50_000_000).unwrap())
}

/// A robot that paints: rows along a wall to and fro at up to 0.8 m/s, each a little higher, held against gusts, the nose to
/// the wall and swaying.
fn painting(seed: u64) -> Spline {
    let mut rng = Rng(seed);
    let phases: Vec<Vector3<f64>> = (0..3).map(|_| rng.vector() * std::f64::consts::PI).collect();
    let row_s = 8.0;
    let knots = (0..1200).map(|k| {
        let t = f64::from(k) * 0.05;
        let wave = |amplitude: f64, hertz: f64, phase: &Vector3<f64>| {
            Vector3::from_fn(|i, _| {
                amplitude * (std::f64::consts::TAU * hertz * (1.0 + 0.17 * i as f64) * t + phase[i]).sin()
            })
        };
        // A sine to and fro has the speed 0.8 m/s in the middle of each row.
        let along = 2.0 * (std::f64::consts::PI * t / row_s).cos();
        let position = Vector3::new(0.0, along, 0.05 * t) + wave(0.03, 0.7, &phases[0]) + wave(0.12, 0.21, &phases[1]);
        let tilt = wave(0.05, 0.6, &phases[2]);
        // Leaning into the acceleration, as a multirotor must.
        let lean = 0.5 * along * (std::f64::consts::PI / row_s).powi(2) / 9.81;
        let rotation = so3::exp(&Vector3::new(tilt.x + lean, tilt.y, 2.0 * tilt.z));
        Isometry3::from_parts(Translation3::from(position), rotation)
    });
    Spline::new(Stamp::from_nanos(1_000_000_000), 50_000_000, knots.collect()).unwrap()
}

/// The camera of the sequences; on the robot that paints it looks ahead.
pub(crate) fn camera(name: &str) -> Camera {
    if !name.starts_with("paint") {
        return Camera::euroc();
    }
    let ahead = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0));
    let rotation = UnitQuaternion::from_rotation_matrix(&ahead);
    Camera { body_from_camera: Isometry3::from_parts(Translation3::new(0.1, 0.0, 0.05), rotation), ..Camera::euroc() }
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
            cameras: vec![CameraModel { camera, ..CameraModel::default() }],
            room: RoomSettings { texture_size, ..RoomSettings::default() },
            ..Scenario::default()
        };
        change(&mut scenario);
        let simulation = Simulation::new(motion(name)?, scenario).unwrap();
        let imu = simulation.imu(0).unwrap();
        let walls = simulation.room().walls;
        let (middle, half) = ((walls.min + walls.max) / 2.0, (walls.max - walls.min) / 2.0);
        let mut rng = Rng(seed);
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
        let mut rng = Rng(stamp.nanos() as u64);
        let camera_from_world =
            (self.simulation.motion(stamp).unwrap().world_from_body * self.camera.body_from_camera).inverse();
        let mut seen = Vec::new();
        for (id, point) in self.points.iter().enumerate() {
            let noise = Vector2::new(rng.normal(), rng.normal()) * self.pixel_sigma;
            if let Some(pixel) = self.camera.project(&(camera_from_world * point).coords)
                && self.camera.contains(&pixel, 8.0)
            {
                seen.push(PointObservation { id: id as u64, pixel: pixel + noise });
            }
        }
        seen
    }
}
