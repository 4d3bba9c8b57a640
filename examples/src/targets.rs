//! From strokes in the picture plane to targets on the surface (thesis Eq. (8.1), the half that does not depend on the robot).

use paint_net::path::Stroke;
use paint_net::{Spray, SprayKernel};
use paint_planner::{Settings, StrokeEnds, Target, order_strokes};

use crate::appearance::UNIT_THICKNESS;
use crate::surface::PaintSurface;

/// The targets of one layer, strokes joined by flights with the valve shut.
pub struct Route {
    /// Targets in flying order.
    pub targets: Vec<Target>,
    /// Strokes among them.
    pub strokes: usize,
    /// Paint of sprays that found no surface under them, m³.
    pub lost: f64,
    /// Estimated duration of the transits between strokes, seconds.
    pub transit_s: f64,
}

impl Route {
    /// Strokes of at least two targets each, in the order and the directions in which they are flown soonest after `from`.
    pub fn ordered(
        strokes: &[Vec<Target>],
        from: Option<&Target>,
        settings: &Settings,
    ) -> Result<Self, paint_planner::Error> {
        let ends: Vec<StrokeEnds> =
            strokes.iter().map(|targets| StrokeEnds { first: targets[0], last: targets[targets.len() - 1] }).collect();
        let order = order_strokes(&ends, from, settings)?;
        let flown = order.strokes.iter().map(|stroke| {
            let targets = &strokes[stroke.index];
            if stroke.reversed { reversed(targets) } else { targets.clone() }
        });
        Ok(Self { targets: flown.flatten().collect(), strokes: ends.len(), lost: 0.0, transit_s: order.transit_time })
    }

    /// Paint that the targets ask for, m³.
    pub fn paint(&self) -> f64 {
        self.targets.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum()
    }
}

/// Lays strokes onto the surface, in the order and the directions in which they are flown soonest after `from`.
pub fn route(
    surface: &PaintSurface,
    strokes: &[Stroke],
    kernel: &SprayKernel,
    spray_spacing: usize,
    from: Option<&Target>,
    settings: &Settings,
) -> Result<Route, paint_planner::Error> {
    let mut lost = 0.0;
    let lifted = strokes.iter().map(|stroke| lift(surface, stroke, kernel, spray_spacing as f64, &mut lost));
    let lifted: Vec<Vec<Target>> = lifted.filter(|targets| targets.len() > 1).collect();
    Ok(Route { lost, ..Route::ordered(&lifted, from, settings)? })
}

/// One stroke on the surface. A spray of depth `v` stands for the paint of one cell of its stroke, half the way to its
/// neighbours and `spacing` pixels long where it has none: the targets are the borders of the cells, and the dose between
/// them is the spray's volume `v · mass · texel² · unit` over the length on the surface. What finds no surface under it is
/// added to `lost`.
fn lift(surface: &PaintSurface, stroke: &Stroke, kernel: &SprayKernel, spacing: f64, lost: &mut f64) -> Vec<Target> {
    let texel = surface.texels.texel_m;
    let volume = |s: &Spray| s.volume * kernel.mass() * texel * texel * UNIT_THICKNESS;
    let mut targets: Vec<Target> = Vec::new();
    for (k, spray) in stroke.sprays.iter().enumerate() {
        let Some([start, end]) = cell(surface, &stroke.sprays, k, spacing) else {
            *lost += volume(spray);
            continue;
        };
        let dose = volume(spray) / (end.point - start.point).norm();
        // Neighbouring sprays share a border; across a gap the stroke goes on with the valve shut.
        match targets.last_mut() {
            Some(last) if (last.point - start.point).norm() < 1e-3 => last.dose = dose,
            _ => {
                if k > 0 {
                    let before = &stroke.sprays[k - 1];
                    let [_, left] = half_cell(&stroke.sprays, k - 1, spacing);
                    let [back, _] = half_cell(&stroke.sprays, k, spacing);
                    let from = [before.x + left[0], before.y + left[1]];
                    bridge(surface, from, [spray.x + back[0], spray.y + back[1]], spacing, &mut targets);
                }
                targets.push(Target { dose, ..start });
            }
        }
        targets.push(end);
    }
    targets
}

/// Where the paint of a spray of a stroke begins and ends, on the surface; `None` where there is none under it.
pub(crate) fn cell(surface: &PaintSurface, stroke: &[Spray], k: usize, spacing: f64) -> Option<[Target; 2]> {
    let [start, end] = half_cell(stroke, k, spacing).map(|offset| border(surface, &stroke[k], offset));
    start.zip(end).filter(|(start, end)| (end.point - start.point).norm() >= 1e-6).map(|(start, end)| [start, end])
}

/// From a spray to the borders of its cell, backwards and forwards, pixels: half the way to a neighbour that is no farther than
/// one and a half cells, else half a cell on in the direction of the stroke.
fn half_cell(sprays: &[Spray], k: usize, spacing: f64) -> [[f64; 2]; 2] {
    let half_way = |a: usize, b: usize| [0.5 * (sprays[b].x - sprays[a].x), 0.5 * (sprays[b].y - sprays[a].y)];
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
fn bridge(surface: &PaintSurface, from: [f64; 2], to: [f64; 2], along: f64, targets: &mut Vec<Target>) {
    let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / along).ceil() as usize;
    for k in 1..steps {
        let [x, y] = [0, 1].map(|c| from[c] + (to[c] - from[c]) * k as f64 / steps as f64);
        targets.extend(surface.lift(x, y).map(|(point, normal)| Target { point, normal, dose: 0.0, time: None }));
    }
}

/// The target `offset` pixels from a spray, beyond a seam where one lies between; drawn back to the spray where the surface ends before it.
fn border(surface: &PaintSurface, spray: &Spray, offset: [f64; 2]) -> Option<Target> {
    [1.0, 0.75, 0.5, 0.25, 0.0].iter().find_map(|share| {
        let offset = offset.map(|o| share * o);
        let (point, normal) = surface
            .lift(spray.x + offset[0], spray.y + offset[1])
            .or_else(|| surface.lift_from([spray.x, spray.y], offset))?;
        Some(Target { point, normal, dose: 0.0, time: None })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use paint_planner::nalgebra::{Point3, Vector3};

    #[test]
    fn a_stroke_flown_backwards_puts_the_same_paint_on_the_same_places() {
        let target = |y: f64, dose: f64| Target {
            point: Point3::new(0.0, y, 1.0),
            normal: -Vector3::x_axis(),
            dose,
            time: None,
        };
        let stroke = [target(0.0, 1.0), target(0.1, 0.0), target(0.3, 3.0), target(0.6, 0.0)];
        let back = reversed(&stroke);
        let expected = [target(0.6, 3.0), target(0.3, 0.0), target(0.1, 1.0), target(0.0, 0.0)];
        assert_eq!(back, expected);
        assert_eq!(reversed(&back), stroke);
    }
}
