//! Pixels that came out darker than anything wanted near them: drips at rims, teeth along seams.

use crate::error::Error;
use crate::nearby::least_near;

/// Whether each place is darker by more than `by` than the darkest of `wanted` within 3 cm of it, through space: across seams as well. Brightness
/// of any scale; `points` in metres.
///
/// # Errors
/// [`Error::Mismatch`] for lists of different lengths.
pub fn darker_than_wanted(points: &[[f64; 3]], painted: &[f64], wanted: &[f64], by: f64) -> Result<Vec<bool>, Error> {
    for (what, list) in [("painted", painted), ("wanted", wanted)] {
        if list.len() != points.len() {
            return Err(Error::Mismatch { what, found: (list.len(), 1), expected: (points.len(), 1) });
        }
    }
    let darkest = least_near(points, wanted);
    Ok(painted.iter().zip(darkest).map(|(painted, darkest)| painted + by < darkest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of pixels every centimetre, white; one dark pixel painted, and something dark wanted at a distance.
    fn dark(wanted_at: f64) -> usize {
        let points: Vec<[f64; 3]> =
            (0..400).map(|k| [0.01 * f64::from(k % 20), -0.01 * f64::from(k / 20), 0.0]).collect();
        let at = |x: f64| points.iter().position(|p| (p[0] - x).abs() < 1e-9 && (p[1] + 0.1).abs() < 1e-9).unwrap();
        let (mut painted, mut wanted) = (vec![200.0; 400], vec![200.0; 400]);
        painted[at(0.1)] = 100.0;
        wanted[at(wanted_at)] = 114.0;
        darker_than_wanted(&points, &painted, &wanted, 15.0).unwrap().iter().filter(|&&dark| dark).count()
    }

    #[test]
    fn only_what_is_far_from_all_that_is_as_dark_counts() {
        assert_eq!([0.1, 0.12, 0.07, 0.14, 0.0].map(dark), [0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_few_levels_are_nothing() {
        let dark = |painted: f64| darker_than_wanted(&[[0.0; 3]], &[painted], &[200.0], 15.0);
        assert_eq!([185.1, 184.9].map(|painted| dark(painted).unwrap()), [[false], [true]]);
        assert!(darker_than_wanted(&[[0.0; 3]], &[], &[200.0], 15.0).is_err());
    }
}
