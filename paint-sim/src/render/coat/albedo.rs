//! How much of even light the coat reflects, tabulated over roughness and direction.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::microfacets::{LEAST_COSINE, fresnel, shadowing};

/// Parts of the table along roughness, and along the root of the cosine, as it is steep where one looks along the surface.
const ROUGHNESSES: usize = 16;
const COSINES: usize = 32;
/// Facets along and around for one entry.
const RINGS: usize = 64;
const SECTORS: usize = 32;
/// Of the mean over directions.
const STEPS: usize = 512;

pub(super) struct AlbedoTable {
    albedo: [[f64; COSINES + 1]; ROUGHNESSES + 1],
    /// Over all directions, by cosine.
    mean: [f64; ROUGHNESSES + 1],
}

impl AlbedoTable {
    pub(super) fn shared() -> &'static Self {
        static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::new);
        &TABLE
    }

    fn new() -> Self {
        let roughness = |row: usize| (row as f64 / ROUGHNESSES as f64).max(1e-3);
        let cosine = |k: usize| (k as f64 / COSINES as f64).powi(2).max(LEAST_COSINE);
        let albedo = std::array::from_fn(|row| std::array::from_fn(|k| albedo(roughness(row), cosine(k))));
        let cosines = || (0..STEPS).map(|k| (k as f64 + 0.5) / STEPS as f64);
        let mean = albedo.map(|row| cosines().map(|c| 2.0 * c * between(&row, c.sqrt())).sum::<f64>() / STEPS as f64);
        Self { albedo, mean }
    }

    pub(super) fn at(&self, roughness: f64, cosine: f64) -> f64 {
        let (row, share) = place(ROUGHNESSES, roughness);
        let [low, high] = [0, 1].map(|next| between(&self.albedo[row + next], cosine.sqrt()));
        low + share * (high - low)
    }

    pub(super) fn mean(&self, roughness: f64) -> f64 {
        between(&self.mean, roughness)
    }
}

/// Linear between values at equal steps from 0 to 1.
fn between(values: &[f64], at: f64) -> f64 {
    let (below, share) = place(values.len() - 1, at);
    values[below] + share * (values[below + 1] - values[below])
}

/// In which of equal parts of 0 to 1 a number lies, and where in it.
fn place(parts: usize, at: f64) -> (usize, f64) {
    let place = at * parts as f64;
    let below = (place as usize).min(parts - 1);
    (below, place - below as f64)
}

/// Mean over facets drawn evenly from their distribution (Walter et al. 2007, Eqs. (35) and (41)).
fn albedo(roughness: f64, eye: f64) -> f64 {
    let alpha2 = roughness * roughness;
    let level = (1.0 - eye * eye).max(0.0).sqrt();
    let mut sum = 0.0;
    for ring in 0..RINGS {
        let share = (ring as f64 + 0.5) / RINGS as f64;
        let cosine = ((1.0 - share) / (1.0 + (alpha2 - 1.0) * share)).sqrt();
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        for sector in 0..SECTORS {
            let around = ((sector as f64 + 0.5) * TAU / SECTORS as f64).cos();
            let to_facet = eye * cosine + level * sine * around;
            let light = 2.0 * to_facet * cosine - eye;
            if to_facet > 0.0 && light > 0.0 {
                sum += fresnel(to_facet.min(1.0)) * shadowing(alpha2, eye, light) * to_facet / (eye * cosine);
            }
        }
    }
    sum / (RINGS * SECTORS) as f64
}
