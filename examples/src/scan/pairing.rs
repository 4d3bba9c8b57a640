//! Which image of one list belongs to an image of another.

/// Colour belongs to the depth image within this time, seconds (the TUM tools' value).
pub(super) const NEAREST: f64 = 0.02;

/// Index of the stamp nearest to another one, of a sorted list, if it is near enough.
pub(super) fn nearest(stamps: &[f64], stamp: f64, within: f64) -> Option<usize> {
    let after = stamps.partition_point(|t| *t < stamp);
    let apart = |k: usize| (stamps[k] - stamp).abs();
    let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|k| *k < stamps.len());
    near.min_by(|a, b| apart(*a).total_cmp(&apart(*b))).filter(|k| apart(*k) <= within)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn the_nearest_stamp_is_found_on_either_side() {
        let stamps = [1.0, 1.1, 1.2];
        for (stamp, expected) in [
            (0.99, Some(0)),
            (0.9, None),
            (1.04, None),
            (1.09, Some(1)),
            (1.115, Some(1)),
            (1.21, Some(2)),
            (1.3, None),
        ] {
            assert_eq!(nearest(&stamps, stamp, 0.02), expected, "{stamp}");
        }
        assert_eq!(nearest(&[], 1.0, 1.0), None);
    }
}
