//! A recorded motion of a nozzle, and the shots that it fires.

use nalgebra::{Point3, UnitVector3};
use paint_sim::Shot;

/// Longest time between two samples over which the nozzle is taken to have gone straight on, seconds.
const LONGEST_GAP: f64 = 0.5;

/// A nozzle at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NozzleSample {
    /// Seconds, from any beginning.
    pub time: f64,
    /// Tip of the nozzle, metres.
    pub position: Point3<f64>,
    /// Direction of the spray.
    pub axis: UnitVector3<f64>,
    /// Flow, m³/s.
    pub flow: f64,
}

/// A motion whose stamps rise, with what was left out of it.
#[derive(Debug, Clone, PartialEq)]
pub struct NozzleMotion {
    samples: Vec<NozzleSample>,
    /// Samples whose stamps repeat others or go back.
    pub left_out: usize,
    /// Times without samples over which the valve counts as shut.
    pub gaps: usize,
}

impl NozzleMotion {
    /// From samples as they were recorded.
    ///
    /// # Errors
    /// Fewer than two whose stamps rise; numbers that are not finite, a flow below zero.
    pub fn new(recorded: Vec<NozzleSample>) -> Result<Self, String> {
        let mut samples: Vec<NozzleSample> = Vec::with_capacity(recorded.len());
        let mut left_out = 0;
        for (k, sample) in recorded.into_iter().enumerate() {
            let numbers = sample.position.iter().chain(sample.axis.iter()).chain([&sample.time, &sample.flow]);
            if !numbers.into_iter().all(|v| v.is_finite()) || sample.flow < 0.0 {
                return Err(format!("sample {}: a number that is not finite, or a flow below zero", k + 1));
            }
            if samples.last().is_some_and(|last| sample.time <= last.time) {
                left_out += 1;
            } else {
                samples.push(sample);
            }
        }
        if samples.len() < 2 {
            return Err("fewer than two samples whose time stamps rise".into());
        }
        let gaps = samples.windows(2).filter(|pair| pair[1].time - pair[0].time > LONGEST_GAP).count();
        Ok(Self { samples, left_out, gaps })
    }

    /// From its first to its last sample, seconds.
    pub fn duration(&self) -> f64 {
        match (self.samples.first(), self.samples.last()) {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        }
    }

    /// The paint of every stretch between two samples in shots no farther apart than `step` metres, with their times after the first sample. The flow
    /// changes in proportion from sample to sample.
    pub fn shots(&self, step: f64) -> Vec<(f64, Shot)> {
        let start = self.samples.first().map_or(0.0, |sample| sample.time);
        let mut shots = Vec::new();
        for pair in self.samples.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            let seconds = b.time - a.time;
            if seconds > LONGEST_GAP || a.flow + b.flow <= 0.0 {
                continue;
            }
            let pieces = ((b.position - a.position).norm() / step).ceil().max(1.0) as usize;
            for k in 0..pieces {
                let share = (k as f64 + 0.5) / pieces as f64;
                let axis = a.axis.into_inner() + (b.axis.into_inner() - a.axis.into_inner()) * share;
                let shot = Shot {
                    origin: a.position + (b.position - a.position) * share,
                    axis: UnitVector3::try_new(axis, 1e-9).unwrap_or(a.axis),
                    volume: (a.flow + (b.flow - a.flow) * share) * seconds / pieces as f64,
                };
                shots.push((a.time + share * seconds - start, shot));
            }
        }
        shots
    }
}
