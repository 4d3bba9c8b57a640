//! Inner loops compiled for the registers of the processor at hand: programs are built for every processor, and the narrow registers of the
//! oldest take twice the time.
//!
//! `unsafe` stands in this file alone: a function that is compiled for wider registers may only be called where they are, which is what is
//! asked for in the line before. The results are the same to the last bit, since multiplications and additions stay what they are, in their order.
#![allow(unsafe_code, reason = "calls of functions for registers that were found; see above")]

/// A loop over blocks, `#[inline(always)]` with all that it calls.
pub(crate) trait Work {
    fn run(self);
}

/// Runs a loop with the widest registers that there are.
pub(crate) fn run(work: impl Work) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { run_avx2(work) };
    }
    work.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: impl Work) {
    work.run();
}

/// Sums of a block that fit the registers.
pub(crate) fn lanes() -> usize {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        return 4;
    }
    if cfg!(target_feature = "avx") { 4 } else { 2 }
}
