//! What runs on a GPU against what the processor computes.

mod film_colours;
mod render;
mod spray;
mod surface;

use paint_sim::Error;
use paint_sim::surface::GpuOptions;

/// Any adapter, also one that is a program.
pub(crate) fn options() -> GpuOptions {
    GpuOptions { software: true, ..GpuOptions::default() }
}

/// What was opened; `None`, and a line that says so, where there is no adapter and none is demanded.
pub(crate) fn available<T>(opened: Result<T, Error>) -> Option<T> {
    match opened {
        Ok(opened) => Some(opened),
        Err(error) => {
            assert!(std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// Numbers from 0 to 1 that depend on their place alone (`SplitMix64`).
pub(crate) fn random(place: u64) -> f64 {
    let mut word = place.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (word ^ (word >> 31)) as f64 / u64::MAX as f64
}
