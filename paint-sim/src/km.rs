//! Kubelka-Munk theory of a paint film of finite thickness, in forms that stay exact where `coth` loses every digit.

mod domain;
mod gradient;
mod layer;
mod reflectance;

pub(crate) use domain::tanhc;
pub use gradient::{Gradient, gradient};
pub use layer::{Layer, saunderson, saunderson_inverse};
pub use reflectance::{absorption_over_scattering, opaque_reflectance, reflectance, reflectance_f32};
