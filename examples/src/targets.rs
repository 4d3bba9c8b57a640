//! From strokes in the picture plane to targets on the surface (thesis Eq. (8.1), the half that does not depend on the robot).

use paint_net::{Spray, SprayKernel, Stroke};
use paint_planner::Target;

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
}

impl Route {
    /// Paint that the targets ask for, m³.
    pub fn paint(&self) -> f64 {
        self.targets.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum()
    }
}

/// Lays strokes onto the surface. A spray of depth `v` stands for the paint of one cell of its row, `along` pixels long: the
/// targets are the borders of the cells, and the dose between them is the spray's volume `v · mass · texel² · unit` over the
/// length on the surface.
pub fn route(surface: &PaintSurface, strokes: &[Stroke], kernel: &SprayKernel, along: usize) -> Route {
    let texel = surface.texels.texel_m;
    let volume = |s: &Spray| s.volume * kernel.mass() * texel * texel * UNIT_THICKNESS;
    let mut route = Route { targets: Vec::new(), strokes: 0, lost: 0.0 };
    for stroke in strokes {
        let forward = stroke.sprays.len() < 2 || stroke.sprays[1].x > stroke.sprays[0].x;
        let half = if forward { 0.5 } else { -0.5 } * along as f64;
        let before = route.targets.len();
        for (k, spray) in stroke.sprays.iter().enumerate() {
            let (start, end) = (border(surface, spray, -half), border(surface, spray, half));
            let (Some(start), Some(end)) = (start, end) else {
                route.lost += volume(spray);
                continue;
            };
            let length = (end.point - start.point).norm();
            if length < 1e-6 {
                route.lost += volume(spray);
                continue;
            }
            let dose = volume(spray) / length;
            // Neighbouring sprays share a border; across a gap the stroke goes on with the valve shut.
            match route.targets.last_mut() {
                Some(last) if (last.point - start.point).norm() < 1e-3 => last.dose = dose,
                _ => {
                    if k > 0 {
                        let before = &stroke.sprays[k - 1];
                        bridge(surface, before.x + half, spray.x - half, spray.y, along as f64, &mut route.targets);
                    }
                    route.targets.push(Target { dose, ..start });
                }
            }
            route.targets.push(end);
        }
        route.strokes += usize::from(route.targets.len() > before);
    }
    route
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
