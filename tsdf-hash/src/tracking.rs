//! Where the camera is: the new frame against the map, as the last pose sees it (thesis Paper I, section 4.1).

pub(crate) mod direct_search;
pub(crate) mod directions;
pub(crate) mod drift;
pub(crate) mod image_level;
pub(crate) mod likeness;
pub(crate) mod model_points;
pub(crate) mod normal_equations;
pub(crate) mod observability;
pub(crate) mod outcome;
pub(crate) mod pose;
pub(crate) mod registration;
pub(crate) mod relocaliser;
pub(crate) mod residual_scale;
pub(crate) mod residuals;
pub(crate) mod settings;
pub(crate) mod tracker;
pub(crate) mod truncated_cost;

pub use drift::Drift;
pub use outcome::{PosePrior, TrackingOutcome, TrackingStatus};
pub use relocaliser::{Relocalisation, Relocaliser};
pub use settings::TrackingSettings;
pub use tracker::Tracker;
