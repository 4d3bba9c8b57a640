//! How dark a pixel may become: not much darker than what is wanted near it on the surface, across seams as well.

use crate::error::Error;
use crate::image::Image;
use crate::nearby::least_near;

/// Ink that is allowed above the darkest that is wanted near a pixel: a fifth of 15 grey levels, the rest is left to the flight.
const MARGIN: f64 = 0.02;

/// Ink that no pixel shall exceed (for [`PaintProblem::with_ceiling`](crate::PaintProblem::with_ceiling)): .02 more than the darkest that is wanted within 3 cm
/// of it, measured through space. `points` are places in metres, `pixels` the pixel of each; 1 beside the surface.
///
/// # Errors
/// [`Error::Mismatch`] for lists of different lengths or pixels beside the picture.
pub fn ink_ceiling(wanted: &Image, points: &[[f64; 3]], pixels: &[usize]) -> Result<Image, Error> {
    let all = wanted.data().len();
    if pixels.len() != points.len() || pixels.iter().any(|&pixel| pixel >= all) {
        return Err(Error::Mismatch { what: "points", found: (points.len(), 1), expected: (pixels.len(), 1) });
    }
    let bare: Vec<f64> = pixels.iter().map(|&pixel| -wanted.data()[pixel]).collect();
    let mut ceiling = wanted.map(|_| 1.0);
    for (&pixel, least) in pixels.iter().zip(least_near(points, &bare)) {
        ceiling.data_mut()[pixel] = (MARGIN - least).min(1.0);
    }
    Ok(ceiling)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four pixels: two neighbours on the surface that lie apart in the picture, one alone, one beside the surface.
    #[test]
    fn the_darkest_near_on_the_surface_counts() {
        let wanted = Image::from_fn(4, 1, |x, _| [0.7, 0.1, 0.2, 0.9][x]);
        let points = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.029, 0.0]];
        let ceiling = ink_ceiling(&wanted, &points, &[0, 1, 2]).unwrap();
        let expected = [0.72, 0.12, 0.72, 1.0];
        assert!(ceiling.data().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", ceiling.data());
        assert!(ink_ceiling(&wanted, &points, &[0, 1, 4]).is_err() && ink_ceiling(&wanted, &points, &[0, 1]).is_err());
    }
}
