//! What noise settings are tuned on, and what a point costs there.

use vio_ekf::run::evaluate_run;
use vio_ekf::sim::ImuModel;
use vio_ekf::tune::{NoisePoint, PointRecording, Score, with_factors};
use vio_ekf::{Camera, ImuNoise, Settings};

use crate::vio::error::VioError;
use crate::vio::recording::Recording;
use crate::vio::run::{RunSettings, run};
use crate::vio::simulate::{Flight, flight_spline};

/// Standard deviation of the simulated points, pixels.
const PIXEL_SIGMA: f64 = 1.0;

/// What the settings are tuned on.
pub enum TuningData {
    /// Simulated flights before points.
    Points(Vec<PointRecording>),
    /// Recordings whose true motion is known.
    Recordings(Vec<Recording>),
}

impl TuningData {
    /// As many simulated flights of so many seconds, before points.
    ///
    /// # Errors
    /// [`VioError::Library`] for lengths that cannot be.
    pub fn simulated(flights: usize, seconds: f64, seed: u64) -> Result<Self, VioError> {
        let one = |k: u64| {
            let spline = flight_spline(&Flight::Room, seconds, seed + k)?;
            let recording =
                PointRecording::simulate(&spline, &Camera::euroc(), &ImuModel::default(), PIXEL_SIGMA, 9.81, seed + k)?;
            Ok(recording)
        };
        (0..flights.max(1) as u64).map(one).collect::<Result<_, VioError>>().map(Self::Points)
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Points(points) => points.len(),
            Self::Recordings(recordings) => recordings.len(),
        }
    }

    pub(super) fn score(&self, index: usize, point: &NoisePoint) -> Result<Score, VioError> {
        match self {
            Self::Points(points) => Ok(points[index].score(&ImuNoise::default(), &Settings::default(), point)?),
            Self::Recordings(recordings) => score_recording(&recordings[index], point),
        }
    }
}

/// A recording that cannot be followed at all costs the most, but is no reason to stop the search.
fn score_recording(recording: &Recording, point: &NoisePoint) -> Result<Score, VioError> {
    let lost = Score { ate: 1.0, nees: [3.0; 3], lost: 1.0 };
    let Some(truth) = &recording.truth else {
        let why = "has no truth to be tuned against: give one with the recording".into();
        return Err(VioError::Unusable { recording: recording.name.clone(), why });
    };
    let (noise, filter) = with_factors(&recording.imu.noise, &Settings::default(), point);
    let settings = RunSettings { filter, noise: Some(noise), threads: 1, quiet: true };
    let timed = match run(recording, &settings) {
        Ok(timed) => timed,
        Err(VioError::Unusable { .. }) => return Ok(lost),
        Err(error) => return Err(error),
    };
    let Some(evaluation) = evaluate_run(&timed.run, truth)? else { return Ok(lost) };
    let nees = [evaluation.nees_position, evaluation.nees_attitude, evaluation.nees_velocity.unwrap_or(3.0)];
    Ok(Score { ate: evaluation.ate_yaw, nees, lost: 1.0 - evaluation.coverage })
}
