//! Sprays joined to strokes.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::error::{Error, require};
use crate::model::Spray;

/// A run of sprays along a row or a line, in flying order.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// Its sprays; never empty.
    pub sprays: Vec<Spray>,
}

/// How sprays are joined to strokes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StrokeSettings {
    /// A gap between sprays longer than this ends a stroke, pixels. Default 8 (10 cm at the thesis' scale), ours.
    pub max_gap: f64,
    /// Sprays in a given order that are nearer to each other than this become one, pixels. Default 1, ours: a nozzle that stays where it is
    /// has no way to spray along.
    pub min_gap: f64,
    /// A turn sharper than this ends a stroke of sprays in a given order, radians. Default π/2, ours: the paint of a spray lies along the way
    /// through it, which is short where the way comes back.
    pub max_turn: f64,
}

impl Default for StrokeSettings {
    fn default() -> Self {
        Self { max_gap: 8.0, min_gap: 1.0, max_turn: FRAC_PI_2 }
    }
}

impl StrokeSettings {
    fn check(&self, sprays: &[Spray]) -> Result<(), Error> {
        require("max_gap", self.max_gap, self.max_gap > 0.0, "it must be positive")?;
        let broken = |s: &Spray| ![s.x, s.y, s.volume, s.sigma].iter().all(|v| v.is_finite());
        let Some(x) = sprays.iter().position(broken) else { return Ok(()) };
        let (what, range) = ("spray list", "finite x, y, volume and sigma");
        Err(Error::Pixel { what, x, y: 0, value: sprays[x].volume, range })
    }
}

/// Joins sprays to strokes in boustrophedon order: row by row from the top, every other row backwards, cut at long gaps. Every
/// spray is in exactly one stroke.
pub fn boustrophedon(sprays: &[Spray], settings: &StrokeSettings) -> Result<Vec<Stroke>, Error> {
    settings.check(sprays)?;
    let mut ordered = sprays.to_vec();
    ordered.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
    let mut strokes = Vec::new();
    for (index, row) in ordered.chunk_by(|a, b| a.y == b.y).enumerate() {
        let mut row = row.to_vec();
        if index % 2 == 1 {
            row.reverse();
        }
        for run in row.chunk_by(|a, b| (a.x - b.x).abs() <= settings.max_gap) {
            strokes.push(Stroke { sprays: run.to_vec() });
        }
    }
    Ok(strokes)
}

/// Joins sprays to strokes in the order in which they are given, cut at long gaps and sharp turns. One that is near to the last becomes one with it, of the
/// paint, the centre and the second moment of both, each the paint `2 π σ² v` of a round spot.
pub fn in_order(sprays: &[Spray], settings: &StrokeSettings) -> Result<Vec<Stroke>, Error> {
    settings.check(sprays)?;
    let StrokeSettings { max_gap, min_gap, max_turn } = *settings;
    require("min_gap", min_gap, (0.0..max_gap).contains(&min_gap), "it must be 0 or more, and less than max_gap")?;
    require("max_turn", max_turn, (0.0..=PI).contains(&max_turn), "it must lie in [0, π]")?;
    let mut strokes: Vec<Stroke> = Vec::new();
    for spray in sprays {
        let Some(stroke) = strokes.last_mut() else {
            strokes.push(Stroke { sprays: vec![*spray] });
            continue;
        };
        let last = stroke.sprays.len() - 1;
        let way = distance(&stroke.sprays[last], spray);
        if way < min_gap {
            stroke.sprays[last] = as_one(&stroke.sprays[last], spray);
        } else if way > max_gap || turn(&stroke.sprays, spray) > max_turn {
            strokes.push(Stroke { sprays: vec![*spray] });
        } else {
            stroke.sprays.push(*spray);
        }
    }
    Ok(strokes)
}

fn distance(a: &Spray, b: &Spray) -> f64 {
    (a.x - b.x).hypot(a.y - b.y)
}

/// How far the way turns at the end of a stroke to go on to a spray, radians.
fn turn(stroke: &[Spray], to: &Spray) -> f64 {
    let [.., before, last] = stroke else { return 0.0 };
    let heading = |from: &Spray, to: &Spray| (to.y - from.y).atan2(to.x - from.x);
    let turn = heading(last, to) - heading(before, last);
    ((turn + PI).rem_euclid(2.0 * PI) - PI).abs()
}

fn as_one(a: &Spray, b: &Spray) -> Spray {
    let paint = |s: &Spray| s.volume * s.sigma * s.sigma;
    let whole = paint(a) + paint(b);
    if whole <= 0.0 {
        return *a;
    }
    let share = paint(b) / whole;
    let mean = |a: f64, b: f64| a + share * (b - a);
    // The spread of the centres counts by half: one of the two axes has it.
    let spread = 0.5 * share * (1.0 - share) * distance(a, b).powi(2);
    let variance = mean(a.sigma * a.sigma, b.sigma * b.sigma) + spread;
    Spray { x: mean(a.x, b.x), y: mean(a.y, b.y), volume: whole / variance, sigma: variance.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spray(x: f64, y: f64, volume: f64, sigma: f64) -> Spray {
        Spray { x, y, volume, sigma }
    }

    #[test]
    fn the_given_order_is_kept_and_cut_at_long_ways_and_sharp_turns() {
        let places =
            [(0.0, 0.0), (3.0, 4.0), (3.0, 6.0), (3.0, 14.5), (8.0, 14.5), (4.0, 15.0), (1.0, 12.5), (1.0, 15.0)];
        let sprays = places.map(|(x, y)| spray(x, y, 0.2, 2.0));
        // A gap of 8.5, then a way back by 173 degrees, then a turn by 130.
        let lengths = |settings: &StrokeSettings| -> Vec<usize> {
            in_order(&sprays, settings).unwrap().iter().map(|stroke| stroke.sprays.len()).collect()
        };
        assert_eq!(lengths(&StrokeSettings::default()), [3, 2, 2, 1]);
        assert_eq!(lengths(&StrokeSettings { max_turn: 2.3, ..StrokeSettings::default() }), [3, 2, 3]);
        let strokes = in_order(&sprays, &StrokeSettings::default()).unwrap();
        let flown: Vec<Spray> = strokes.into_iter().flat_map(|stroke| stroke.sprays).collect();
        assert_eq!(flown, sprays);
    }

    /// Moments of the sum of two Gaussians, each of the mass `2 π σ² v`, against a sum over a fine grid.
    #[test]
    fn near_sprays_become_one_of_their_paint_centre_and_second_moment() {
        let (a, b) = (spray(10.0, 10.0, 0.3, 1.5), spray(10.6, 9.5, 0.8, 2.5));
        let strokes = in_order(&[a, b], &StrokeSettings::default()).unwrap();
        let [one] = strokes[0].sprays[..] else { panic!("{strokes:?}") };
        let step = 0.1;
        let mut sums = [0.0; 4];
        for j in 0..500 {
            for i in 0..500 {
                let (x, y) = (step * f64::from(i) - 15.0, step * f64::from(j) - 15.0);
                let of =
                    |s: &Spray| s.volume * (-0.5 * ((x - s.x).powi(2) + (y - s.y).powi(2)) / s.sigma.powi(2)).exp();
                let depth = of(&a) + of(&b);
                for (sum, moment) in sums.iter_mut().zip([1.0, x, y, x * x + y * y]) {
                    *sum += depth * moment;
                }
            }
        }
        let [mass, x, y, second] = [sums[0] * step * step, sums[1] / sums[0], sums[2] / sums[0], sums[3] / sums[0]];
        let variance = 0.5 * (second - x * x - y * y);
        let near = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        near(one.x, x);
        near(one.y, y);
        near(one.sigma.powi(2), variance);
        near(std::f64::consts::TAU * one.sigma.powi(2) * one.volume, mass);
    }

    #[test]
    fn gaps_that_contradict_each_other_and_sprays_that_are_none_are_refused() {
        let settings = StrokeSettings { max_gap: 2.0, min_gap: 2.0, ..StrokeSettings::default() };
        assert!(in_order(&[], &settings).unwrap_err().to_string().contains("min_gap"));
        // Rows join nothing and turn nowhere.
        assert!(boustrophedon(&[], &settings).is_ok());
        let broken = [spray(0.0, 0.0, 0.1, 1.0), spray(1.0, 0.0, 0.1, f64::NAN)];
        assert!(in_order(&broken, &StrokeSettings::default()).unwrap_err().to_string().contains("(1, 0)"));
    }
}
