//! From strokes in the picture plane to targets on the surface (thesis Eq. (8.1), the half that does not depend on the robot).

use crate::error::Error;
use crate::settings::Settings;
use crate::stroke_order::{StrokeEnds, order_strokes};
use crate::target::Target;
use nalgebra::{Point3, UnitVector3};

/// A surface laid out in a plane, in which strokes are drawn. The plane's unit is the caller's: texels, as a rule.
pub trait Chart {
    /// The point of the surface at a place of the plane, m, world frame, and the outward normal that a spray there should follow; `None`
    /// beside the surface.
    fn lift(&self, place: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)>;

    /// The same `offset` on from a place where the plane ends before that: beyond a seam the surface goes on elsewhere. `None` for a
    /// plane without seams, as it is here.
    fn lift_from(&self, place: [f64; 2], offset: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        let _ = (place, offset);
        None
    }
}

/// One spray of a stroke in the plane of a [`Chart`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spray {
    /// Where, in the plane's unit.
    pub place: [f64; 2],
    /// Paint, m³.
    pub volume: f64,
    /// As [`Target::stand_off`], m.
    pub stand_off: Option<f64>,
}

/// Strokes on a surface, in no order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LiftedStrokes {
    /// Targets of each; the dose of each ends with its last target.
    pub strokes: Vec<Vec<Target>>,
    /// Paint of sprays that found no surface under them, m³.
    pub lost_volume: f64,
}

impl LiftedStrokes {
    /// Lays strokes of the plane onto a surface, sprays `spacing` apart in the plane's unit.
    pub fn lift(chart: &dyn Chart, strokes: &[Vec<Spray>], spacing: f64) -> Self {
        let mut lost_volume = 0.0;
        let strokes = strokes.iter().map(|stroke| lift(chart, stroke, spacing, &mut lost_volume)).collect();
        Self { strokes, lost_volume }
    }

    /// As one route after `from`.
    ///
    /// # Errors
    /// As [`Route::ordered`].
    pub fn ordered(&self, from: Option<&Target>, settings: &Settings) -> Result<Route, Error> {
        Ok(Route { lost_volume: self.lost_volume, ..Route::ordered(&self.strokes, from, settings)? })
    }
}

/// Targets of strokes, joined by flights with the valve shut.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Targets in flying order.
    pub targets: Vec<Target>,
    /// Strokes among them.
    pub strokes: usize,
    /// Paint of sprays that found no surface under them, m³.
    pub lost_volume: f64,
    /// Estimated duration of the transits between strokes, s.
    pub transit_time: f64,
}

impl Route {
    /// Strokes in the order and the directions in which they are flown soonest after `from`; those of fewer than two targets are left
    /// out, and the dose after the last target of each is dropped.
    ///
    /// # Errors
    /// As [`order_strokes`].
    pub fn ordered(strokes: &[Vec<Target>], from: Option<&Target>, settings: &Settings) -> Result<Self, Error> {
        let strokes: Vec<&Vec<Target>> = strokes.iter().filter(|targets| targets.len() > 1).collect();
        let ends: Vec<StrokeEnds> =
            strokes.iter().map(|targets| StrokeEnds { first: targets[0], last: targets[targets.len() - 1] }).collect();
        let order = order_strokes(&ends, from, settings)?;
        let flown = order.strokes.iter().map(|stroke| {
            let targets = strokes[stroke.index];
            let mut flown = if stroke.reversed { reversed(targets) } else { targets.clone() };
            // Nothing is sprayed on the way to the next stroke.
            if let Some(last) = flown.last_mut() {
                last.dose = 0.0;
            }
            flown
        });
        let targets = flown.flatten().collect();
        Ok(Self { targets, strokes: ends.len(), lost_volume: 0.0, transit_time: order.transit_time })
    }

    /// Paint that the targets ask for, m³.
    pub fn volume(&self) -> f64 {
        self.targets.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum()
    }
}

/// One stroke on the surface. A spray stands for the paint of one cell of its stroke, half the way to its neighbours and `spacing` long
/// where it has none: the targets are the borders of the cells, and the dose between them is the spray's volume over the length on the
/// surface. What finds no surface under it is added to `lost`.
fn lift(chart: &dyn Chart, stroke: &[Spray], spacing: f64, lost: &mut f64) -> Vec<Target> {
    let mut targets: Vec<Target> = Vec::new();
    for (k, spray) in stroke.iter().enumerate() {
        let Some([start, end]) = spray_cell(chart, stroke, k, spacing) else {
            *lost += spray.volume;
            continue;
        };
        let dose = spray.volume / (end.point - start.point).norm();
        // Neighbouring sprays share a border; across a gap the stroke goes on with the valve shut.
        match targets.last_mut() {
            Some(last) if (last.point - start.point).norm() < 1e-3 => {
                last.dose = dose;
                // On the border of two cells the nozzle is half way between their distances.
                let half_way = last.stand_off.zip(start.stand_off).map(|(one, other)| 0.5 * (one + other));
                last.stand_off = half_way.or(last.stand_off).or(start.stand_off);
            }
            _ => {
                if k > 0 {
                    let [_, left] = half_cell(stroke, k - 1, spacing);
                    let [back, _] = half_cell(stroke, k, spacing);
                    let (from, to) = (added(stroke[k - 1].place, left), added(spray.place, back));
                    bridge(chart, from, to, spacing, &mut targets);
                }
                targets.push(Target { dose, ..start });
            }
        }
        targets.push(end);
    }
    targets
}

fn added([x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> [f64; 2] {
    [x + dx, y + dy]
}

/// Where the paint of the `k`-th spray of a stroke begins and ends on the surface, without doses; `None` where there is none under it.
/// Sprays lie `spacing` apart.
pub fn spray_cell(chart: &dyn Chart, stroke: &[Spray], k: usize, spacing: f64) -> Option<[Target; 2]> {
    let [start, end] = half_cell(stroke, k, spacing).map(|offset| border(chart, stroke[k].place, offset));
    let stand_off = stroke[k].stand_off;
    let ends = start.zip(end).filter(|(start, end)| (end.point - start.point).norm() >= 1e-6);
    ends.map(|(start, end)| [start, end].map(|target| Target { stand_off, ..target }))
}

/// From a spray to the borders of its cell, backwards and forwards: half the way to a neighbour that is no farther than
/// one and a half cells, else half a cell on in the direction of the stroke.
fn half_cell(sprays: &[Spray], k: usize, spacing: f64) -> [[f64; 2]; 2] {
    let half_way = |a: usize, b: usize| [0, 1].map(|c| 0.5 * (sprays[b].place[c] - sprays[a].place[c]));
    let half_step = |[x, y]: [f64; 2]| {
        let stretch = 0.5 * spacing / x.hypot(y);
        [x * stretch, y * stretch]
    };
    let negative = |[x, y]: [f64; 2]| [-x, -y];
    let near = |[x, y]: &[f64; 2]| 2.0 * x.hypot(*y) <= 1.5 * spacing;
    let (before, after) = ((k > 0).then(|| half_way(k - 1, k)), (k + 1 < sprays.len()).then(|| half_way(k, k + 1)));
    let (touching, next) = (before.filter(near), after.filter(near));
    let back = touching.or(next).or_else(|| before.or(after).map(half_step)).unwrap_or([0.5 * spacing, 0.0]);
    let ahead = next.or(touching).or_else(|| after.or(before).map(half_step)).unwrap_or([0.5 * spacing, 0.0]);
    [negative(back), ahead]
}

/// The same stroke flown from its end: a target's dose belongs to the way to the next one.
fn reversed(stroke: &[Target]) -> Vec<Target> {
    let doses = stroke.iter().rev().skip(1).map(|target| target.dose).chain([0.0]);
    stroke.iter().rev().zip(doses).map(|(target, dose)| Target { dose, ..*target }).collect()
}

/// Targets with the valve shut between two places of a stroke, no farther apart than the others: a planner weighs steps.
fn bridge(chart: &dyn Chart, from: [f64; 2], to: [f64; 2], along: f64, targets: &mut Vec<Target>) {
    let stand_off = targets.last().and_then(|last| last.stand_off);
    let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / along).ceil() as usize;
    for k in 1..steps {
        let place = [0, 1].map(|c| from[c] + (to[c] - from[c]) * k as f64 / steps as f64);
        targets.extend(chart.lift(place).map(|(point, normal)| Target {
            point,
            normal,
            dose: 0.0,
            time: None,
            stand_off,
        }));
    }
}

/// The target `offset` from a spray, beyond a seam where one lies between; drawn back to the spray where the surface ends before it.
fn border(chart: &dyn Chart, place: [f64; 2], offset: [f64; 2]) -> Option<Target> {
    [1.0, 0.75, 0.5, 0.25, 0.0].iter().find_map(|share| {
        let offset = offset.map(|o| share * o);
        let (point, normal) = chart.lift(added(place, offset)).or_else(|| chart.lift_from(place, offset))?;
        Some(Target { point, normal, dose: 0.0, time: None, stand_off: None })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_stroke_flown_backwards_puts_the_same_paint_on_the_same_places() {
        let target = |y: f64, dose: f64| Target {
            point: Point3::new(0.0, y, 1.0),
            normal: -Vector3::x_axis(),
            dose,
            time: None,
            stand_off: None,
        };
        let stroke = [target(0.0, 1.0), target(0.1, 0.0), target(0.3, 3.0), target(0.6, 0.0)];
        let back = reversed(&stroke);
        let expected = [target(0.6, 3.0), target(0.3, 0.0), target(0.1, 1.0), target(0.0, 0.0)];
        assert_eq!(back, expected);
        assert_eq!(reversed(&back), stroke);
    }

    /// A wall that is drawn in metres.
    struct Wall;

    impl Chart for Wall {
        fn lift(&self, [x, y]: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
            Some((Point3::new(0.0, x, y), -Vector3::x_axis()))
        }
    }

    /// A spray by itself paints half a spacing to either side; one at an end goes on as its stroke does.
    #[test]
    fn a_spray_paints_half_a_spacing_to_either_side() {
        let spray = |x: f64, y: f64| Spray { place: [x, y], volume: 1e-9, stand_off: None };
        let cell =
            |stroke: &[Spray], k: usize| spray_cell(&Wall, stroke, k, 0.04).unwrap().map(|t| [t.point.y, t.point.z]);
        let near = |found: [[f64; 2]; 2], expected: [[f64; 2]; 2]| {
            let off = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{found:?} for {expected:?}");
        };
        near(cell(&[spray(1.0, 2.0)], 0), [[0.98, 2.0], [1.02, 2.0]]);
        let upwards = [spray(1.0, 2.0), spray(1.0, 2.05), spray(1.0, 3.0)];
        near(cell(&upwards, 0), [[1.0, 1.975], [1.0, 2.025]]);
        near(cell(&upwards, 1), [[1.0, 2.025], [1.0, 2.075]]);
        near(cell(&upwards, 2), [[1.0, 2.98], [1.0, 3.02]]);
    }

    /// Each spray's own distance in its cell, half way between two on their border, the last one's across a gap, nobody's where nobody asks.
    #[test]
    fn targets_ask_for_the_distances_of_their_sprays() {
        let spray = |x: f64, stand_off| Spray { place: [x, 0.0], volume: 1e-9, stand_off };
        let lifted = |stroke: &[Spray]| {
            let targets = lift(&Wall, stroke, 0.04, &mut 0.0);
            targets.iter().map(|target| target.stand_off).collect::<Vec<_>>()
        };
        let near = [spray(0.0, Some(0.06)), spray(0.04, Some(0.12)), spray(0.08, None)];
        assert_eq!(lifted(&near), [Some(0.06), Some(0.5 * (0.06 + 0.12)), Some(0.12), None]);
        let apart = lifted(&[spray(0.0, Some(0.06)), spray(0.2, Some(0.12))]);
        assert_eq!(apart[..apart.len() - 2], vec![Some(0.06); apart.len() - 2]);
        assert_eq!((apart.len() > 4, &apart[apart.len() - 2..]), (true, &[Some(0.12); 2][..]));
        assert!(lifted(&[spray(0.0, None), spray(0.04, None)]).iter().all(Option::is_none));
    }
}
