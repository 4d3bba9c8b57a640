//! How much of the handheld robot's overdose its sensor makes necessary: what the best of all even coats would leave, beside what ours
//! leaves. A planner that lays a heavier line along the rim is not bounded by it.

use std::error::Error;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::path::Path;

use paintcopter::handheld::HandheldSettings;
use paintcopter::handheld::cube::{CIRCLE, SIDE};

use super::extent::Extent;
use super::handheld::{figure, report};
use super::table::{Table, number};

/// Thickness above the target that is an overdose, in coats.
const OVERDOSE: f64 = 0.1;
/// Paint that is asked for inside the circles, of what is wanted there.
const INSIDE: f64 = 0.9;
/// Steps of the search: shift of the rim in spots, mean of the coat.
const SHIFT: f64 = 0.02;
const MEAN: f64 = 0.005;

/// The rows of three flows.
///
/// # Errors
/// Those of `handheld`.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let (flows, seconds): (&[f64], Option<&str>) = match extent {
        Extent::Whole => (&[0.5, 0.25, 0.125], None),
        Extent::Quick => (&[0.5], Some("--seconds=5")),
    };
    let usual = HandheldSettings::default();
    // On a surface that the nozzle faces, m.
    let spot = usual.stand_off * usual.spray.sigma.tan();
    let head = ["flow; mm³/s", "painting; min", "books off; RMS; % of a coat", "inside; %", "overdosed; %", "least; %"];
    let mut table = Table::new("overdose", &head);
    for flow in flows {
        let option = format!("--flow={flow}e-9");
        let options: Vec<&str> = [option.as_str()].into_iter().chain(seconds).collect();
        let painted = report(scratch, "handheld-overdose", &options)?;
        let books = figure(&painted, "believed_thickness_error_fraction")?;
        let percent = |share: f64| number(100.0 * share, 2);
        table.row([
            flow.to_string(),
            number(figure(&painted, "painting_s")? / 60.0, 0),
            number(100.0 * books, 1),
            number(100.0 * figure(&painted, "paint_inside_fraction")?, 1),
            percent(figure(&painted, "overdosed_texels_fraction")?),
            percent(least_overdosed(books, spot, INSIDE)),
        ]);
    }
    Ok(vec![table])
}

/// The least share of the cube's surface that is overdosed by a coat which is even but for what the books do not know, and ends like a
/// straight rim sprayed with this spot (m), with at least so much of the wanted paint inside: over all means and places of the rim.
/// `books`: standard deviation of the coat that the books do not know of, in coats.
fn least_overdosed(books: f64, spot: f64, inside: f64) -> f64 {
    let shifts = (-50..=150).map(|k| f64::from(k) * SHIFT);
    let coats = shifts.flat_map(|shift| (160..=220).map(move |k| [shift, f64::from(k) * MEAN]));
    let found = coats.map(|[shift, mean]| coat(books, spot, shift, mean)).filter(|(reached, _)| *reached >= inside);
    found.map(|(_, overdosed)| overdosed).fold(f64::INFINITY, f64::min)
}

/// Paint inside, of what is wanted, and share of the surface that is overdosed, of an even coat whose rim lies `shift` spots inside that
/// of the circles.
fn coat(books: f64, spot: f64, shift: f64, mean: f64) -> (f64, f64) {
    const RING: f64 = 1e-4;
    let rim = 0.5 * CIRCLE;
    let (mut lacking, mut overdosed) = (0.0, 0.0);
    for ring in 0..(1.5 * rim / RING) as usize {
        let radius = (ring as f64 + 0.5) * RING;
        let area = 2.0 * PI * radius * RING;
        let thickness = mean * normal((rim - radius) / spot - shift);
        // The errors of many passes add up as their squares.
        let deviation = books * thickness.max(1e-9).sqrt();
        let target = f64::from(u8::from(radius < rim));
        overdosed += area * normal((thickness - target - OVERDOSE) / deviation);
        let below = (target - thickness) / deviation;
        let density = (-0.5 * below * below).exp() / (2.0 * PI).sqrt();
        lacking += target * area * deviation * (below * normal(below) + density);
    }
    (1.0 - lacking / (PI * rim * rim), 3.0 * overdosed / (6.0 * SIDE * SIDE))
}

/// The normal distribution, within 1e-7 (Abramowitz and Stegun, 7.1.26).
fn normal(z: f64) -> f64 {
    let x = z.abs() * FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let poly = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    let tail = 0.5 * poly.iter().rev().fold(0.0, |sum, c| (sum + c) * t) * (-x * x).exp();
    if z < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// Places drawn on the upper faces, each with a coat drawn as the bound thinks of it.
    #[test]
    fn a_coat_is_what_draws_of_it_give() {
        let (books, spot, shift, mean) = (0.08, 0.84e-3, 0.4, 0.98);
        let mut rng = Rng::new(7);
        let (mut inside, mut wanted, mut overdosed, draws) = (0.0, 0.0, 0.0, 400_000);
        for _ in 0..draws {
            let [x, y] = [(); 2].map(|()| rng.between(-0.03, 0.03));
            let off = f64::hypot(x, y) - 0.5 * CIRCLE;
            // Twelve uniform numbers make nearly a normal one.
            let mut drawn = || (0..12).map(|_| rng.between(-0.5, 0.5)).sum::<f64>();
            let covered = mean * normal(-off / spot - shift);
            let thickness = covered + books * covered.sqrt() * drawn();
            let target = f64::from(u8::from(off < 0.0));
            wanted += target;
            inside += target * thickness.min(1.0);
            overdosed += f64::from(u8::from(thickness > target + 0.1));
        }
        let (reached, share) = coat(books, spot, shift, mean);
        assert!((reached - inside / wanted).abs() < 3e-3, "{reached} {}", inside / wanted);
        // Three of the six faces carry circles.
        let drawn = 0.5 * overdosed / f64::from(draws);
        assert!((share - drawn).abs() < 0.03 * drawn, "{share} {drawn}");
    }

    /// With books that know everything only the rim is left, and nothing if less paint is asked inside.
    #[test]
    fn better_books_and_less_paint_bring_it_down() {
        let least = |books, inside| least_overdosed(books, 0.84e-3, inside);
        assert!(least(0.064, 0.9) > 0.01 && least(0.032, 0.9) < 0.005);
        assert!(least(1e-3, 0.9) > 0.001 && least(1e-3, 0.8) < 1e-4);
        // By tables of the normal distribution.
        for (z, share) in [(0.0, 0.5), (1.0, 0.841_344_746), (-2.0, 0.022_750_132), (3.5, 0.999_767_371)] {
            assert!((normal(z) - share).abs() < 2e-7, "{z}");
        }
    }
}
