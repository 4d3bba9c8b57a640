//! From the thickness of a film to its readings, with the derivative.

use super::burst::{Coating, Response};
use crate::colour::{BANDS, Spectrum, spectrum_linear_srgb};
use crate::km;

/// Most channels of a reading.
pub(super) const CHANNELS: usize = 3;
/// Values of all channels; those that are not there are zero.
pub(super) type Channels = [f64; CHANNELS];

/// Nodes of a table; cubic pieces between them (Hermite) are within 1e-6 of the curve up to an optical depth of about 20.
const NODES: usize = 257;
/// A film of this thickness, m, hides everything.
const OPAQUE: f64 = 1e3;

/// Readings and their derivative by the thickness.
pub(super) trait Reading {
    /// Both at a thickness in metres.
    fn at(&self, thickness: f64) -> (Channels, Channels);
}

/// Readings that are the thickness itself.
pub(super) struct Thickness;

impl Reading for Thickness {
    fn at(&self, thickness: f64) -> (Channels, Channels) {
        ([thickness, 0.0, 0.0], [1.0, 0.0, 0.0])
    }
}

/// Reflectances, band by band.
pub(super) struct Film {
    coating: Coating,
    /// Bands that count, with their share in each channel.
    weights: Vec<(usize, Channels)>,
}

impl Film {
    pub(super) fn new(coating: &Coating) -> Self {
        let weights = match coating.response {
            Response::Band(band) => vec![(band, [1.0, 0.0, 0.0])],
            Response::LinearSrgb => {
                let alone = |band: usize| -> Spectrum { std::array::from_fn(|k| f64::from(u8::from(k == band))) };
                (0..BANDS).map(|band| (band, spectrum_linear_srgb(&alone(band)))).collect()
            }
        };
        Self { coating: *coating, weights }
    }

    /// The readings of a film that hides the card.
    pub(super) fn opaque(&self) -> Channels {
        self.at(OPAQUE).0
    }
}

impl Reading for Film {
    fn at(&self, thickness: f64) -> (Channels, Channels) {
        let Coating { paint, card, .. } = &self.coating;
        let (mut values, mut slopes) = ([0.0; CHANNELS], [0.0; CHANNELS]);
        for (band, weights) in &self.weights {
            let (k, s, ground) = (paint.absorption()[*band], paint.scattering()[*band], card.reflectance()[*band]);
            let value = km::reflectance(k, s, thickness, ground);
            // Riccati's equation, Kubelka and Munk 1931.
            let slope = s - 2.0 * (k + s) * value + s * value * value;
            for channel in 0..CHANNELS {
                values[channel] += weights[channel] * value;
                slopes[channel] += weights[channel] * slope;
            }
        }
        (values, slopes)
    }
}

/// A [`Film`] tabulated up to a thickness, and itself beyond.
pub(super) struct Table {
    film: Film,
    per_metre: f64,
    /// Values, and derivatives by the node.
    nodes: Vec<(Channels, Channels)>,
}

impl Table {
    pub(super) fn new(film: Film, thickest: f64) -> Self {
        let step = thickest / (NODES - 1) as f64;
        let node = |k: usize| {
            let (value, slope) = film.at(k as f64 * step);
            (value, slope.map(|s| s * step))
        };
        Self { per_metre: 1.0 / step, nodes: (0..NODES).map(node).collect(), film }
    }
}

impl Reading for Table {
    #[inline]
    fn at(&self, thickness: f64) -> (Channels, Channels) {
        let place = thickness * self.per_metre;
        // A saturating cast: what is not finite lies beyond the table.
        let index = place as usize;
        let Some([(a, da), (b, db)]) = self.nodes.get(index..index.saturating_add(2)).and_then(|n| n.first_chunk())
        else {
            return self.film.at(thickness);
        };
        let t = place - index as f64;
        let (mut values, mut slopes) = ([0.0; CHANNELS], [0.0; CHANNELS]);
        for c in 0..CHANNELS {
            let rise = b[c] - a[c];
            let (u, v) = (3.0 * rise - 2.0 * da[c] - db[c], da[c] + db[c] - 2.0 * rise);
            values[c] = a[c] + t * (da[c] + t * (u + t * v));
            slopes[c] = (da[c] + t * (2.0 * u + 3.0 * t * v)) * self.per_metre;
        }
        (values, slopes)
    }
}
