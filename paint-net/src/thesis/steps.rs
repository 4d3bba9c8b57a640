use super::read;
use super::rollout::{Noise, Rollout};
use super::spray::Aim;
use super::{Network, Shape};
use crate::error::Error;
use crate::image::Image;

/// One step of the network: where it looked and what it sprayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// READ's window.
    pub window: Window,
    /// Place of the spray: column and row, pixels.
    pub place: (f64, f64),
    /// Standard deviation of the spray, pixels.
    pub sigma: f64,
    /// Depth that it adds at its centre, the gate included.
    pub volume: f64,
    /// `σ(z_paint)`.
    pub gate: f64,
}

/// Where READ looked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Centre: column and row, pixels.
    pub centre: (f64, f64),
    /// From the first filter to the last, pixels.
    pub extent: f64,
    /// Standard deviation of the filters, pixels.
    pub sigma: f64,
}

impl Network {
    /// Paints pictures of `side` x `side` pixels, without noise: for each the steps up to the stop. `pictures`: wanted ink in
    /// `[0, 1]` and the depth of paint that is there already.
    pub fn paint(&self, pictures: &[(Image, Option<Image>)]) -> Result<Vec<Vec<Step>>, Error> {
        if pictures.is_empty() {
            return Ok(Vec::new());
        }
        let shape = self.shape();
        let expected = (shape.side, shape.side);
        let (mut wanted, mut before) = (Vec::new(), Vec::new());
        for (picture, canvas) in pictures {
            let there = canvas.clone().unwrap_or_else(|| picture.map(|_| 0.0));
            for (what, image) in [("picture", picture), ("canvas", &there)] {
                if image.size() != expected {
                    return Err(Error::Mismatch { what, found: image.size(), expected });
                }
            }
            picture.check_range("picture", 0.0, 1.0, "ink in [0, 1]")?;
            there.check_range("canvas", 0.0, f64::MAX, "a depth of 0 or more")?;
            wanted.extend(picture.data().iter().map(|&v| v as f32));
            // Beyond a depth of 20, tanh is 1 in every digit.
            before.extend(there.data().iter().map(|&v| v.min(20.0) as f32));
        }
        let mut rollout = Rollout::new(&shape, wanted, before, Noise::none(&shape, pictures.len()));
        rollout.run(&self.model(), true);
        Ok((0..pictures.len()).map(|k| rollout.steps_of(k)).collect())
    }
}

impl Rollout<f32> {
    /// The steps of a sample, up to the stop.
    pub(crate) fn steps_of(&self, k: usize) -> Vec<Step> {
        (0..self.shape.steps).take_while(|&t| self.paints(t, k)).map(|t| self.step_of(t, k)).collect()
    }

    fn step_of(&self, t: usize, k: usize) -> Step {
        let shape: &Shape = &self.shape;
        let window = read::Window::new(shape, &self.attention.at(t)[5 * k..5 * k + 5]);
        let aim = Aim::new(shape, &self.spray.at(t)[4 * k..4 * k + 4]);
        let pair = |x: f32, y: f32| (f64::from(x), f64::from(y));
        Step {
            window: Window {
                centre: pair(window.x, window.y),
                extent: (shape.read - 1) as f64 * f64::from(window.spacing),
                sigma: f64::from(window.variance).sqrt(),
            },
            place: pair(aim.x, aim.y),
            sigma: f64::from(aim.sigma),
            volume: f64::from(self.volume.at(t)[k]),
            gate: f64::from(self.gate(t, k)),
        }
    }
}
