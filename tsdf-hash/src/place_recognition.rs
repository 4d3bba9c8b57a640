//! Finds places again by binary features and a vocabulary tree (thesis Paper I, section 4.5; Gálvez-López and Tardós 2012).

pub(crate) mod alignment;
mod clustering;
mod corners;
pub(crate) mod descriptor;
pub(crate) mod features;
mod grey_image;
pub(crate) mod inverse_index;
pub(crate) mod vocabulary;

pub use crate::keyframes::index::{KeyframeIndex, KeyframeMatch, RecognisedPlace};
pub use vocabulary::Vocabulary;
