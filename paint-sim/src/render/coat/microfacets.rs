//! What a facet of the coat reflects, and how much of it its neighbours hide.

/// Refractive index of the coat: that of the binders of paint.
const INDEX: f64 = 1.5;
/// Below this cosine to the eye or a light everything looks as it does here.
pub(super) const LEAST_COSINE: f64 = 1e-3;

/// Smith's joint shadowing and masking for GGX.
pub(super) fn shadowing(alpha2: f64, eye: f64, light: f64) -> f64 {
    let reach = |cosine: f64| (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt();
    2.0 * eye * light / (eye * reach(light) + light * reach(eye))
}

/// Fresnel reflectance of unpolarised light.
pub(super) fn fresnel(cosine: f64) -> f64 {
    let g = (INDEX * INDEX - 1.0 + cosine * cosine).sqrt();
    let across = (g - cosine) / (g + cosine);
    let along = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    0.5 * across * across * (1.0 + along * along)
}
