//! Texels that wait until there are as many of one kind as are worked on at once.

use super::texel_share::{LANES, Points};

/// Texels, or what stands for them, by their points. The order in which they leave fixes that of a shot's shares, and so their sum.
#[derive(Default)]
pub(super) struct Waiting([([u32; LANES], usize); 3]);

impl Waiting {
    /// Adds one; `claim` takes those of its kind once they are enough.
    #[inline(always)]
    pub(super) fn push(&mut self, index: u32, points: Points, claim: &mut impl FnMut(&[u32], Points)) {
        let (lanes, count) = &mut self.0[points as usize];
        lanes[*count] = index;
        *count += 1;
        if *count == LANES {
            claim(lanes, points);
            *count = 0;
        }
    }

    /// `claim` takes what is left.
    pub(super) fn finish(self, claim: &mut impl FnMut(&[u32], Points)) {
        for (points, (lanes, count)) in Points::ALL.into_iter().zip(self.0) {
            claim(&lanes[..count], points);
        }
    }
}
