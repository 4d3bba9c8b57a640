//! From strokes in the picture plane to targets on the surface (thesis Eq. (8.1), the half that does not depend on the robot).

use paint_net::{Spray, SprayKernel, Stroke};
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
    let ends: Vec<StrokeEnds> =
        lifted.iter().map(|targets| StrokeEnds { first: targets[0], last: targets[targets.len() - 1] }).collect();
    let order = order_strokes(&ends, from, settings)?;
    let flown = order.strokes.iter().map(|stroke| {
        let targets = &lifted[stroke.index];
        if stroke.reversed { reversed(targets) } else { targets.clone() }
    });
    Ok(Route { targets: flown.flatten().collect(), strokes: ends.len(), lost, transit_s: order.transit_time })
}

/// One stroke on the surface. A spray of depth `v` stands for the paint of one cell of its row, `spacing` pixels long: the
/// targets are the borders of the cells, and the dose between them is the spray's volume `v · mass · texel² · unit` over the
/// length on the surface. What finds no surface under it is added to `lost`.
fn lift(surface: &PaintSurface, stroke: &Stroke, kernel: &SprayKernel, spacing: f64, lost: &mut f64) -> Vec<Target> {
    let texel = surface.texels.texel_m;
    let volume = |s: &Spray| s.volume * kernel.mass() * texel * texel * UNIT_THICKNESS;
    let forward = stroke.sprays.len() < 2 || stroke.sprays[1].x > stroke.sprays[0].x;
    let half = if forward { 0.5 } else { -0.5 } * spacing;
    let mut targets: Vec<Target> = Vec::new();
    for (k, spray) in stroke.sprays.iter().enumerate() {
        let cell = border(surface, spray, -half).zip(border(surface, spray, half));
        let Some((start, end)) = cell.filter(|(start, end)| (end.point - start.point).norm() >= 1e-6) else {
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
                    bridge(surface, before.x + half, spray.x - half, spray.y, spacing, &mut targets);
                }
                targets.push(Target { dose, ..start });
            }
        }
        targets.push(end);
    }
    targets
}

/// The same stroke flown from its end: a target's dose belongs to the way to the next one.
fn reversed(stroke: &[Target]) -> Vec<Target> {
    let doses = stroke.iter().rev().skip(1).map(|target| target.dose).chain([0.0]);
    stroke.iter().rev().zip(doses).map(|(target, dose)| Target { dose, ..*target }).collect()
}

/// Targets with the valve shut between two places of a row, no farther apart than the others: a planner weighs steps.
fn bridge(surface: &PaintSurface, from: f64, to: f64, y: f64, along: f64, targets: &mut Vec<Target>) {
    let steps = ((to - from).abs() / along).ceil() as usize;
    for k in 1..steps {
        let x = from + (to - from) * k as f64 / steps as f64;
        targets.extend(surface.lift(x, y).map(|(point, normal)| Target { point, normal, dose: 0.0, time: None }));
    }
}

/// The target `offset` pixels along the row from a spray; drawn back to the spray where the surface ends before it.
fn border(surface: &PaintSurface, spray: &Spray, offset: f64) -> Option<Target> {
    [1.0, 0.75, 0.5, 0.25, 0.0].iter().find_map(|share| {
        let (point, normal) = surface.lift(spray.x + share * offset, spray.y)?;
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
