//! A page to design a mission on (thesis, chapter 8; Paper II, section 6.2): a picture is placed on the surface, parts of it are chosen or kept clean, and
//! what would come out is shown after every change.
//!
//! [`session::DesignSession`] is the design without a network, a function of what the page says; [`estimator::Estimator`] tells what a mission comes
//! to, with the functions of `paintcopter --preview`; a thread of its own does that, for the newest design only.

mod design_error;
mod estimate_message;
mod estimator;
mod figures;
mod message;
mod mission_folder;
mod picture_store;
mod serve;
mod session;
mod surface_message;
#[cfg(test)]
mod tests;
mod worker;

pub(super) use serve::design;
