//! Where a camera is by shape alone: what it has seen from a few poses against a surveyed surface, without keyframes
//! (thesis Paper II, section 6.3: global registration, then ICP).

mod iterative_closest_point;
mod local_cloud;
mod nearest_points;
mod oriented_point;
mod registration;
mod settings;

pub use local_cloud::LocalCloud;
pub use oriented_point::OrientedPoint;
pub use registration::{GlobalRegistration, Registered};
pub use settings::GlobalRegistrationSettings;
