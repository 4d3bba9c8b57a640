//! Pixels that came out darker than anything wanted near them: drips at rims, teeth along seams.

use nalgebra::Point3;

use super::ink_ceiling::least_near;
use super::run::Mission;

/// How much darker, grey levels of 255.
const DARKER: f64 = 15.0;

/// Share of the surface's pixels that are darker by 15 grey levels than the darkest that is wanted within 3 cm, measured through space: across
/// seams as well.
pub(super) fn share(mission: &Mission) -> f64 {
    let dark = darker_than_wanted(mission);
    dark.iter().filter(|&&dark| dark).count() as f64 / dark.len().max(1) as f64
}

/// Which texels of the film they are.
fn darker_than_wanted(mission: &Mission) -> Vec<bool> {
    let task = &mission.task;
    let grey = |depth: f64| {
        let [r, g, b] = task.appearance.srgb(depth).map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let points: Vec<Point3<f64>> = mission.film.texels().iter().map(|texel| texel.point).collect();
    let painted: Vec<f64> = mission.painted_depth().data().iter().map(|&depth| grey(depth)).collect();
    let wanted: Vec<f64> = mission.wanted_depth().data().iter().map(|&depth| grey(depth)).collect();
    let on_film = |greys: &[f64]| mission.pixels.iter().map(|&pixel| greys[pixel]).collect::<Vec<f64>>();
    darker(&points, &on_film(&painted), &on_film(&wanted))
}

/// Whether each point's grey is darker than the darkest of `wanted` within 3 cm of it.
fn darker(points: &[Point3<f64>], painted: &[f64], wanted: &[f64]) -> Vec<bool> {
    let darkest = least_near(points, wanted);
    painted.iter().zip(darkest).map(|(painted, darkest)| painted + DARKER < darkest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of pixels every centimetre, white; one dark pixel painted, and something dark wanted at a distance.
    fn dark(wanted_at: f64) -> usize {
        let points: Vec<Point3<f64>> =
            (0..400).map(|k| Point3::new(0.01 * f64::from(k % 20), -0.01 * f64::from(k / 20), 0.0)).collect();
        let at = |x: f64| points.iter().position(|p| (p.x - x).abs() < 1e-9 && (p.y + 0.1).abs() < 1e-9).unwrap();
        let (mut painted, mut wanted) = (vec![200.0; 400], vec![200.0; 400]);
        painted[at(0.1)] = 100.0;
        wanted[at(wanted_at)] = 114.0;
        darker(&points, &painted, &wanted).iter().filter(|&&dark| dark).count()
    }

    #[test]
    fn only_what_is_far_from_all_that_is_as_dark_counts() {
        assert_eq!([0.1, 0.12, 0.07, 0.14, 0.0].map(dark), [0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_few_levels_are_nothing() {
        let point = [Point3::origin()];
        assert_eq!(darker(&point, &[185.1], &[200.0]), [false]);
        assert_eq!(darker(&point, &[184.9], &[200.0]), [true]);
    }
}
