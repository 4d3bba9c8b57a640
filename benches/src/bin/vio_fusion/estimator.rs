//! The estimators that are compared, behind one interface.

use nalgebra::{Isometry3, Vector3};
use paintcopter_benches::Rng;
use paintcopter_benches::flight::{Arrival, Flight, PIXEL_SIGMA, normals};
use vio_ekf::filter::LandmarkSettings;
use vio_ekf::fusion::{
    AlignmentSettings, ExtrinsicsSettings, FusionSettings, ImuPair, ImuPairSettings, PoseFusion, PoseMeasurement,
    PoseSource, UnifiedSettings, UnifiedVio,
};
use vio_ekf::inertial::{ImuSettings, InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::trajectory::Motion;
use vio_ekf::{Error, Odometry, Settings, Vio, nalgebra};

use super::arguments::Arguments;

type AnyError = Box<dyn std::error::Error>;

/// What is fed to which filter.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Way {
    Odometry,
    /// The second inertial sensor and the poses of the map, in a fusion filter.
    MapOnly,
    /// The odometry's poses, with those of the map or not, into a fusion filter that knows that an odometry drifts, or not.
    Cascade {
        map: bool,
        drifts: bool,
    },
    Unified {
        second: bool,
        map: bool,
    },
}

/// The three kinds. The cascade estimates the autopilot's sensor as its body, the others that of the head.
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub(crate) enum Estimator {
    Odometry {
        vio: Vio,
        start: Option<InitialState>,
    },
    Cascade {
        vio: Option<Vio>,
        fusion: PoseFusion,
        start: Option<(InitialState, InitialState)>,
        settings: CascadeSettings,
    },
    Unified {
        vio: UnifiedVio,
        start: Option<InitialState>,
        second: bool,
        map: bool,
    },
}

pub(crate) struct CascadeSettings {
    map: bool,
    sigma: [f64; 2],
}

impl Estimator {
    pub(crate) fn new(way: Way, flight: &Flight, arguments: &Arguments, seed: u64) -> Result<Self, AnyError> {
        let noise = [flight.imus[0].noise, flight.imus[1].noise];
        let body_from_second = flight.imus[1].body_from_imu;
        let landmarks = LandmarkSettings { pixel_sigma: PIXEL_SIGMA, ..LandmarkSettings::default() };
        let settings = Settings {
            landmarks,
            imu: ImuSettings { buffer_samples: 512, ..ImuSettings::default() },
            ..Settings::default()
        };
        let start = |body_from_imu: &Isometry3<f64>, share: [f64; 2]| start(flight, seed, body_from_imu, share);
        let here = Isometry3::identity();
        Ok(match way {
            Way::Odometry => Self::Odometry {
                vio: Vio::new(flight.camera, noise[0], settings)?,
                start: Some(start(&here, [0.0; 2])?),
            },
            Way::MapOnly | Way::Cascade { .. } => {
                let extrinsics = ExtrinsicsSettings {
                    body_from_sensor: body_from_second.inverse(),
                    ..ExtrinsicsSettings::default()
                };
                let walks = if matches!(way, Way::Cascade { drifts: false, .. }) {
                    [0.0; 2]
                } else {
                    [arguments.odometry_walk_m, arguments.odometry_walk_rad]
                };
                let alignment =
                    AlignmentSettings { position_walk: walks[0], yaw_walk: walks[1], ..AlignmentSettings::default() };
                let sources = [
                    PoseSource { extrinsics, ..PoseSource::default() },
                    PoseSource { extrinsics, alignment, ..PoseSource::default() },
                ];
                let vio = match way {
                    Way::MapOnly => None,
                    _ => Some(Vio::new(flight.camera, noise[0], settings)?),
                };
                let map = !matches!(way, Way::Cascade { map: false, .. });
                let sigma = [arguments.odometry_sigma_m, arguments.odometry_sigma_rad];
                Self::Cascade {
                    vio,
                    fusion: PoseFusion::new(noise[1], &sources, FusionSettings::default())?,
                    start: Some((start(&here, [0.0; 2])?, start(&body_from_second, [1.0; 2])?)),
                    settings: CascadeSettings { map, sigma },
                }
            }
            Way::Unified { second, map } => {
                let pair = ImuPairSettings {
                    first: noise[0],
                    second: noise[1],
                    body_from_second,
                    ..ImuPairSettings::default()
                };
                let share = if second { ImuPair::new(pair)?.bias_shares() } else { [0.0; 2] };
                let unified = UnifiedSettings {
                    imu: noise[0],
                    imu_pair: second.then_some(pair),
                    lag_s: if map { arguments.delay } else { 0.0 },
                    ..UnifiedSettings::default()
                };
                Self::Unified {
                    vio: UnifiedVio::new(flight.camera, settings, unified)?,
                    start: Some(start(&here, share)?),
                    second,
                    map,
                }
            }
        })
    }

    /// Takes what arrives; an estimate after each sample of the sensor that is the body.
    pub(crate) fn take(&mut self, arrival: &Arrival) -> Result<Option<Odometry>, AnyError> {
        match self {
            Self::Odometry { vio, start } => match arrival {
                Arrival::PrimaryImu(sample) => {
                    vio.imu(sample)?;
                    if let Some(start) = start.take() {
                        vio.initialize(&start)?;
                    }
                    return Ok(vio.output());
                }
                Arrival::Points(stamp, points) => drop(vio.points(*stamp, points)?),
                _ => {}
            },
            Self::Cascade { vio, fusion, start, settings } => match arrival {
                Arrival::PrimaryImu(sample) => {
                    if let Some(vio) = vio {
                        vio.imu(sample)?;
                        if let Some((start, _)) = start {
                            vio.initialize(start)?;
                        }
                    }
                }
                Arrival::SecondaryImu(sample) => {
                    fusion.imu(sample)?;
                    if let Some((_, start)) = start.take() {
                        fusion.initialize(&start)?;
                    }
                    return Ok(fusion.output());
                }
                Arrival::Points(stamp, points) => {
                    if let Some(vio) = vio {
                        vio.points(*stamp, points)?;
                        let odometry = vio.output().ok_or("the odometry is not running")?;
                        let [position, attitude] = settings.sigma;
                        let pose = odometry.world_from_body;
                        fusion.pose(&PoseMeasurement::isotropic(1, odometry.stamp, pose, position, attitude))?;
                    }
                }
                Arrival::Pose(pose) => {
                    if settings.map {
                        fusion.pose(pose)?;
                    }
                }
            },
            Self::Unified { vio, start, second, map } => match arrival {
                Arrival::PrimaryImu(sample) => {
                    vio.imu(sample)?;
                    if let Some(wanted) = start {
                        match vio.initialize(wanted) {
                            // With two sensors there is no sample before both have spoken.
                            Err(Error::TooFew { .. }) => {}
                            done => {
                                done?;
                                *start = None;
                            }
                        }
                    }
                    return Ok(vio.output());
                }
                Arrival::SecondaryImu(sample) if *second => drop(vio.second_imu(sample)?),
                Arrival::Points(stamp, points) => vio.points(*stamp, points)?,
                Arrival::Pose(pose) if *map => vio.pose(pose)?,
                _ => {}
            },
        }
        Ok(None)
    }

    /// Pose and velocity of the body that this one estimates.
    pub(crate) fn truth(
        &self,
        flight: &Flight,
        odometry: &Odometry,
    ) -> Result<(Isometry3<f64>, Vector3<f64>), AnyError> {
        let body_from_imu = match self {
            Self::Cascade { .. } => flight.imus[1].body_from_imu,
            _ => Isometry3::identity(),
        };
        Ok(moved(&flight.spline.sample(odometry.stamp)?, &body_from_imu))
    }
}

/// Pose and velocity, in its own axes, of a sensor on a moving body.
fn moved(motion: &Motion, body_from_imu: &Isometry3<f64>) -> (Isometry3<f64>, Vector3<f64>) {
    let velocity = motion.world_from_body.rotation.inverse() * motion.velocity_in_world
        + motion.rate_in_body.cross(&body_from_imu.translation.vector);
    (motion.world_from_body * body_from_imu, body_from_imu.rotation.inverse() * velocity)
}

/// The truth, less errors drawn from what the start admits; position and yaw are what is measured from. The bias is
/// `b₁ − κ (b₁ − b₂)`: of the first sensor, of the second, or of a pair.
fn start(
    flight: &Flight,
    seed: u64,
    body_from_imu: &Isometry3<f64>,
    share: [f64; 2],
) -> Result<InitialState, AnyError> {
    let stamp = flight.spline.span().0;
    let (pose, velocity) = moved(&flight.spline.sample(stamp)?, body_from_imu);
    let mut rng = Rng::new(seed);
    let admitted = |sigma: f64, share: f64| sigma * (1.0 - share).hypot(share);
    let sigma = InitialSigma {
        gyro_bias: admitted(flight.imus[0].gyro_bias_sigma, share[0]),
        accel_bias: admitted(flight.imus[0].accel_bias_sigma, share[1]),
        ..InitialSigma::default()
    };
    let tilt = normals(&mut rng).component_mul(&Vector3::new(sigma.tilt, sigma.tilt, 0.0));
    let slip = body_from_imu.rotation.inverse() * normals(&mut rng) * sigma.velocity;
    Ok(InitialState {
        stamp,
        world_from_body: Isometry3::from_parts(pose.translation, so3::exp(&-tilt) * pose.rotation),
        velocity_in_body: velocity - slip,
        // The simulator draws the biases around zero.
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma,
    })
}
