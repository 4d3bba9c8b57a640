//! The binaries and what they share, from outside: one test binary, so that everything is linked once.
#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod area_fill;
mod bad_input;
#[cfg(feature = "vio")]
mod bags;
mod choices;
mod colour_missions;
#[cfg(all(feature = "programs", feature = "log"))]
mod command_lines;
mod designs_across_seams;
mod five_joint_arm;
mod flight_constraints;
mod flight_times;
mod gltf_meshes;
#[cfg(feature = "scan")]
mod gyroscope;
#[cfg(feature = "handheld")]
mod handheld;
mod independence;
#[cfg(all(feature = "programs", unix))]
mod interruptions;
mod layout;
mod line_art;
#[cfg(feature = "scan")]
mod live;
#[cfg(feature = "scan")]
mod mcap_recordings;
mod mesh_frames;
mod meshes;
mod mission;
mod mission_file;
mod module_graph;
#[cfg(feature = "vio")]
mod mutations;
#[cfg(feature = "scan")]
mod odometry_prior;
#[cfg(all(feature = "robot", unix))]
mod on_board;
mod onboard;
mod own_distances;
#[cfg(feature = "paint-image")]
mod paint_image;
#[cfg(all(feature = "robot", unix))]
mod pitched_plan;
mod placement;
mod recorded;
mod regions;
#[cfg(all(feature = "robot", unix))]
mod robot;
mod scan_flight;
mod scratch;
mod seams;
mod sensor_faults;
#[cfg(feature = "scan")]
mod sequences;
#[cfg(feature = "spray")]
mod spray;
#[cfg(feature = "scan")]
mod stored_maps;
#[cfg(feature = "scan")]
mod strange_recordings;
#[cfg(feature = "unwrap")]
mod unwrap;
#[cfg(feature = "vio")]
mod vio;
#[cfg(feature = "vr")]
mod vr;
#[cfg(feature = "vr")]
mod vr_client;
#[cfg(feature = "vr")]
mod vr_connections;
#[cfg(feature = "vr")]
mod vr_layers;
