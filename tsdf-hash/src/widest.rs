//! Inner loops compiled for the registers of the processor at hand: programs are built for every processor, and the narrow registers of the
//! oldest take twice the time.
//!
//! `unsafe` stands in this file alone: a function that is compiled for wider registers may only be called where they are, which is what is
//! asked for in the line before. The results are the same to the last bit: every operation stays what it is, and none is fused.
#![allow(unsafe_code, reason = "calls of functions for registers that were found; see above")]

/// A loop, `#[inline(always)]` with all that it calls.
pub(crate) trait Work {
    type Output;

    fn run(self) -> Self::Output;
}

/// Runs a loop with the widest registers that there are.
pub(crate) fn run<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { run_avx2(work) };
    }
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<W: Work>(work: W) -> W::Output {
    work.run()
}
