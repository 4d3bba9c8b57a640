//! What the binaries share: the adapters between the PaintCopter crates, the built-in world, files in and out, pictures, and the
//! mission that runs them all.

pub mod adapters;
pub mod air;
pub mod appearance;
#[cfg(all(feature = "autopilot", unix))]
pub mod autopilot;
#[cfg_attr(not(feature = "vr"), allow(dead_code, reason = "only what is designed on a page is given up halfway"))]
mod cancellation;
pub mod colour_design;
pub mod colour_picture;
pub mod console;
pub mod design;
mod design_places;
pub mod exit;
#[cfg(feature = "handheld")]
pub mod handheld;
pub mod interruption;
pub mod light;
#[cfg(feature = "log")]
mod log;
#[cfg_attr(not(feature = "programs"), allow(dead_code, reason = "each program reads and writes some of the messages"))]
mod mcap_messages;
#[cfg(not(feature = "log"))]
mod log {
    //! Built without the feature `log`: nothing is said.
    pub(crate) fn subscribe(verbose: u8) {
        if verbose > 0 || std::env::var_os("RUST_LOG").is_some() {
            eprintln!("warning: this program was built without the feature `log`: -v and RUST_LOG do nothing");
        }
    }
}
pub mod mesh_frame;
pub mod mesh_io;
pub mod mesh_placement;
pub mod mission;
pub mod mission_arguments;
pub mod mission_file;
pub mod mission_paint;
pub mod mural;
pub mod onboard;
#[cfg(feature = "paint-image")]
pub mod paint_image;
pub mod paint_set;
pub mod palette_choice;
pub mod picture_file;
pub mod picture_placement;
pub mod pictures;
pub mod progress;
pub mod projection;
pub mod recording;
pub mod region;
mod relative_path;
pub mod report;
#[cfg(all(feature = "robot", unix))]
pub mod robot;
pub mod run_folder;
#[cfg(feature = "scan")]
pub mod scan;
pub mod scan_flight;
pub mod simulated_sensors;
#[cfg(any(feature = "robot", feature = "scan", feature = "vr"))]
pub mod socket_address;
#[cfg(feature = "spray")]
pub mod spray;
mod srgb;
pub mod surface;
pub mod surroundings;
pub mod textured_mesh;
#[cfg(feature = "unwrap")]
pub mod unwrap;
#[cfg(feature = "svg")]
pub mod vector_drawing;
#[cfg(feature = "vio")]
pub mod vio;
#[cfg(feature = "vr")]
pub mod vr;
pub mod wall;
pub mod whole_file;
pub mod worker_threads;
pub mod world;

/// The code in the README and in the book compiles.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../README.md")]
    mod readme {}
    #[doc = include_str!("../../docs/src/frames.md")]
    mod frames {}
    #[doc = include_str!("../../docs/src/extending.md")]
    mod extending {}
    #[doc = include_str!("../../docs/src/tsdf-hash.md")]
    mod tsdf_hash {}
    #[doc = include_str!("../../docs/src/vio-ekf.md")]
    mod vio_ekf {}
    #[doc = include_str!("../../docs/src/vio-fusion.md")]
    mod vio_fusion {}
}
