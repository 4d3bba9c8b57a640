//! Sizes of the thesis' network, and where its parameters lie.

use std::ops::Range;

use crate::error::{Error, require};
use crate::network::layout::Part;

/// Sizes of the thesis' network: a row of its Table 8.1, and what the table leaves open.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Architecture {
    /// Side of the picture, pixels.
    pub side: usize,
    /// Most steps `T`, one spray each.
    pub steps: usize,
    /// Size of the latent code `z`.
    pub latent: usize,
    /// Size of both recurrent layers.
    pub hidden: usize,
    /// READ's filters along each axis, at least 2.
    pub read: usize,
    /// Spray radius, pixels; σ of a spray lies between a quarter and three quarters of it.
    pub radius: f64,
    /// `Δ_stop`: the network stops when the sum of `1 - σ(z_paint)` exceeds it.
    pub stop: f64,
    /// Width of PAINT's hidden layer; 64 (ours, the thesis does not tell).
    pub paint: usize,
}

impl Architecture {
    /// Table 8.1, first row.
    pub const MNIST: Self =
        Self { side: 28, steps: 64, latent: 100, hidden: 256, read: 3, radius: 3.0, stop: 25.0, paint: 64 };
    /// Table 8.1, second row.
    pub const PAINT: Self =
        Self { side: 32, steps: 100, latent: 200, hidden: 400, read: 6, radius: 4.0, stop: 45.0, paint: 64 };

    /// Number of weights.
    pub fn parameters(&self) -> usize {
        self.layers().stop.range().end
    }

    pub(crate) fn pixels(&self) -> usize {
        self.side * self.side
    }

    /// Numbers that READ gives: the picture and what is missing, each `read` by `read`.
    pub(crate) fn glimpse(&self) -> usize {
        2 * self.read * self.read
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |name, value: usize, low: usize, high: usize, rule| {
            require(name, value as f64, (low..=high).contains(&value), rule)
        };
        within("side", self.side, 4, 256, "it must lie in 4..=256 pixels")?;
        within("steps", self.steps, 1, 10_000, "it must lie in 1..=10000")?;
        within("latent", self.latent, 1, 4096, "it must lie in 1..=4096")?;
        within("hidden", self.hidden, 1, 4096, "it must lie in 1..=4096")?;
        within("read", self.read, 2, self.side, "it must lie between 2 and the picture's side")?;
        within("paint", self.paint, 1, 4096, "it must lie in 1..=4096")?;
        require("radius", self.radius, self.radius > 0.0 && self.radius <= 1e3, "it must lie in (0, 1000] pixels")?;
        require("stop", self.stop, self.stop >= 0.0 && self.stop <= 1e6, "it must lie in [0, 1e6]")
    }

    /// The layers' weights and biases as named tensors.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let of = |layer: Layer| {
            let part = |name, extents, range| (format!("{}.{name}", layer.name), extents, range);
            [
                part("weight", vec![layer.inputs, layer.outputs], layer.weight()),
                part("bias", vec![layer.outputs], layer.bias()),
            ]
        };
        self.layers().all().into_iter().flat_map(of).collect()
    }

    pub(crate) fn layers(&self) -> Layers {
        let mut at = 0;
        let mut next = |name, inputs: usize, outputs: usize| {
            let layer = Layer { name, inputs, outputs, at };
            at = layer.range().end;
            layer
        };
        let h = self.hidden;
        Layers {
            attention: next("attention", h, 5),
            encoder: next("encoder", self.glimpse() + 2 * h, 4 * h),
            latent: next("latent", h, 2 * self.latent),
            decoder: next("decoder", self.latent + h, 4 * h),
            paint: next("paint", h, self.paint),
            spray: next("spray", self.paint, 4),
            stop: next("stop", h, 1),
        }
    }
}

/// A linear layer `y = x W + b`: `W` row by row (a row per input), then `b`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layer {
    pub(crate) name: &'static str,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    at: usize,
}

impl Layer {
    pub(crate) fn range(&self) -> Range<usize> {
        self.at..self.bias().end
    }

    pub(crate) fn weight(&self) -> Range<usize> {
        self.at..self.at + self.inputs * self.outputs
    }

    pub(crate) fn bias(&self) -> Range<usize> {
        let from = self.weight().end;
        from..from + self.outputs
    }
}

/// All layers, in the order of their weights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layers {
    /// Decoder state to READ's window: centre x, y, log variance, log spacing, log intensity.
    pub(crate) attention: Layer,
    /// `[glimpse, decoder state, own state]` to the gates input, forget, output, update.
    pub(crate) encoder: Layer,
    /// Encoder state to mean and log deviation of `z`.
    pub(crate) latent: Layer,
    /// `[z, own state]` to the gates.
    pub(crate) decoder: Layer,
    /// Decoder state to PAINT's hidden layer.
    pub(crate) paint: Layer,
    /// Hidden layer to x, y, spread, volume.
    pub(crate) spray: Layer,
    /// Decoder state to the logit of painting on.
    pub(crate) stop: Layer,
}

impl Layers {
    pub(crate) fn all(&self) -> [Layer; 7] {
        [self.attention, self.encoder, self.latent, self.decoder, self.paint, self.spray, self.stop]
    }
}
