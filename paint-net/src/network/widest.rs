//! Inner loops compiled for the registers of the processor at hand: programs are built for every processor, and the narrow registers of the
//! oldest, which cannot multiply and add in one step, take four times the time.
//!
//! `unsafe` stands in this file alone: a function that is compiled for wider registers may only be called where they are, which is what is
//! asked for in the line before. The results are the same to the last bit on every processor: products are added in one order, with
//! [`Real::mul_add`](super::real::Real::mul_add), which rounds once everywhere.
#![allow(unsafe_code, reason = "calls of functions for registers that were found; see above")]

/// A loop over blocks, `#[inline(always)]` with all that it calls.
pub(crate) trait Work {
    fn run(self);
}

/// Runs a loop with the widest registers that there are.
pub(crate) fn run(work: impl Work) {
    #[cfg(target_arch = "x86_64")]
    if has_wide() {
        // SAFETY: the processor has AVX2 and FMA.
        return unsafe { run_wide(work) };
    }
    work.run();
}

#[cfg(target_arch = "x86_64")]
fn has_wide() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_wide(work: impl Work) {
    work.run();
}

/// Sums of a block that fit the registers.
pub(crate) fn lanes() -> usize {
    #[cfg(target_arch = "x86_64")]
    if has_wide() {
        return 4;
    }
    if cfg!(target_feature = "avx") { 4 } else { 2 }
}
