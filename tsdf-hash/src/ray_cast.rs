//! What the map looks like from a pose.

pub(crate) mod camera;
pub(crate) mod caster;
mod cell;
pub(crate) mod depth_comparison;
mod forward_projection;
pub(crate) mod incremental;
pub(crate) mod lanes;
pub(crate) mod march;
pub(crate) mod pixel;
pub(crate) mod settings;
pub(crate) mod single_ray;
mod splat;
pub(crate) mod tiles;
pub(crate) mod unpacked;
pub(crate) mod view;

pub use depth_comparison::DepthComparison;
pub use incremental::{IncrementalRayCast, IncrementalRayCastSettings};
pub use settings::RayCastSettings;
pub use single_ray::SurfaceHit;
pub use view::View;
