//! Sizes that an image can have.

use crate::error::{Error, invalid};

/// Longest image side that is plausible.
const MAX_SIDE: usize = 1 << 15;

/// Refuses an image side that no camera has.
pub(crate) fn check_side(name: &'static str, side: usize) -> Result<(), Error> {
    if (1..=MAX_SIDE).contains(&side) {
        Ok(())
    } else {
        Err(invalid(name, side as f64, "must be between 1 and 32768 pixels"))
    }
}
