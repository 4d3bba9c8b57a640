//! The binaries and what they share, from outside: one test binary, so that everything is linked once.
#![allow(clippy::unwrap_used)]

mod area_fill;
mod bad_input;
mod bags;
mod five_joint_arm;
mod flight_constraints;
mod gltf_meshes;
mod gyroscope;
mod handheld;
mod independence;
mod line_art;
mod live;
mod mcap_recordings;
mod meshes;
mod mission;
mod mission_file;
mod module_graph;
mod mutations;
mod odometry_prior;
mod paint_image;
mod placement;
mod recorded;
mod regions;
mod scan_flight;
mod scratch;
mod seams;
mod sequences;
mod stored_maps;
mod strange_recordings;
mod unwrap;
mod vio;
mod vr;
