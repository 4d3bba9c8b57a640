//! Doses that leave the wanted thickness on the surface itself: a painter sees a plane, where charts are stretched, seams lie apart,
//! and every spray stands upright.

use std::collections::HashMap;

use nalgebra::{Point3, UnitVector3};
use paint_planner::{Plan, Target};
use paint_sim::{SprayModel, Surface, Texel};

use super::decide::UNPAINTABLE_WEIGHT;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use crate::appearance::UNIT_THICKNESS;

/// Edge of a cell of the search for texels, metres: no less than the reach of a spray at the stand-off.
const CELL: f64 = 0.1;
/// Density of a spray that is left aside, as a share of its greatest at the stand-off.
const FAINT: f64 = 2e-3;
/// How far before a texel its shadow ray ends, metres.
const SHADOW_BIAS: f64 = 2e-3;
/// Multiplicative updates.
const ROUNDS: usize = 300;
/// Largest dose in medians of all: what would run is left thin instead, and shows in the report.
const MAX_DOSE: f64 = 4.0;

/// Changes the doses of all that the flights spray so that the thickness comes as near the wanted one as it can: least squares with
/// positive doses, by the image space reconstruction algorithm (Daube-Witherspoon and Muehllehner 1986). Each flight is its targets
/// with their plan.
///
/// Returns the deviation over the mean of the thickness that is then expected where the robot can paint.
pub(super) fn correct_doses(flights: &mut [(&mut [Target], &Plan)], task: &PaintingTask) -> f64 {
    let (texels, pixels) = task.surface.film_texels();
    let ink = task.appearance.ink();
    let wanted: Vec<f64> = pixels.iter().map(|&k| ink.inverse(task.wanted.data()[k]) * UNIT_THICKNESS).collect();
    let weight: Vec<f64> = pixels
        .iter()
        .zip(&texels)
        .map(|(&k, texel)| texel.area * if task.in_reach[k] { 1.0 } else { UNPAINTABLE_WEIGHT })
        .collect();
    let mut ways: Vec<Way> = Vec::new();
    let mut doses: Vec<f64> = Vec::new();
    for (flight, (targets, plan)) in flights.iter().enumerate() {
        for k in (0..targets.len().saturating_sub(1)).filter(|&k| plan.flow[k] > 0.0) {
            ways.push(Way::new(flight, k, targets, plan));
            doses.push(targets[k].dose);
        }
    }
    let response = Response::new(&ways, &texels, &spray_model(&task.settings), &task.surface.world);
    let mut volumes: Vec<f64> = ways.iter().zip(&doses).map(|(way, dose)| dose * way.length).collect();
    doses.sort_unstable_by(f64::total_cmp);
    let most = MAX_DOSE * doses.get(doses.len() / 2).copied().unwrap_or_default();

    let weighted = |thickness: &[f64]| thickness.iter().zip(&weight).map(|(t, w)| t * w).collect::<Vec<f64>>();
    let asked = response.adjoint(&weighted(&wanted));
    for _ in 0..ROUNDS {
        let got = response.adjoint(&weighted(&response.thickness(&volumes, texels.len())));
        for (((volume, asked), got), way) in volumes.iter_mut().zip(&asked).zip(got).zip(&ways) {
            if got > 0.0 {
                *volume = (*volume * asked / got).min(most * way.length);
            }
        }
    }
    let thickness = response.thickness(&volumes, texels.len());
    for (way, volume) in ways.iter().zip(volumes) {
        flights[way.flight].0[way.target].dose = volume / way.length;
    }
    let reached = (0..texels.len()).filter(|&k| task.in_reach[pixels[k]] && wanted[k] > 0.0);
    let (mut area, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for k in reached {
        let ratio = thickness[k] / wanted[k];
        area += texels[k].area;
        sum += texels[k].area * ratio;
        squares += texels[k].area * ratio * ratio;
    }
    (squares * area / (sum * sum) - 1.0).max(0.0).sqrt()
}

/// The way from a target to the next with the valve open.
struct Way {
    flight: usize,
    target: usize,
    length: f64,
    /// Nozzle and spray direction at a quarter and three quarters of it.
    sprays: [(Point3<f64>, UnitVector3<f64>); 2],
    middle: Point3<f64>,
    aim: Point3<f64>,
}

impl Way {
    fn new(flight: usize, target: usize, targets: &[Target], plan: &Plan) -> Self {
        let (a, b) = (&plan.nozzle[target], &plan.nozzle[target + 1]);
        let (p, q) = (&targets[target].point, &targets[target + 1].point);
        let between = |a: &Point3<f64>, b: &Point3<f64>, share: f64| a + (b - a) * share;
        let spray = |share: f64| {
            let nozzle = between(&a.position, &b.position, share);
            let direction = between(p, q, share) - nozzle;
            (nozzle, UnitVector3::try_new(direction, 1e-12).unwrap_or(a.direction))
        };
        Self {
            flight,
            target,
            length: (q - p).norm(),
            sprays: [spray(0.25), spray(0.75)],
            middle: between(&a.position, &b.position, 0.5),
            aim: between(p, q, 0.5),
        }
    }
}

/// Thickness on each texel by a unit volume on each way, sparse.
struct Response {
    /// Entries of each way: texel and thickness per volume, 1/m².
    rows: Vec<Vec<(u32, f64)>>,
}

impl Response {
    fn new(ways: &[Way], texels: &[Texel], spray: &SprayModel, surface: &dyn Surface) -> Self {
        let cell = |p: &Point3<f64>| [p.x, p.y, p.z].map(|c| (c / CELL).floor() as i64);
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (k, texel) in texels.iter().enumerate() {
            cells.entry(cell(&texel.point)).or_default().push(k as u32);
        }
        let row = |way: &Way| {
            let upright = way.middle - way.aim;
            let towards = UnitVector3::try_new(-upright, 1e-12).unwrap_or(way.sprays[0].1);
            let greatest = spray.density(&way.middle, &towards, &way.aim, &-towards);
            let [i, j, k] = cell(&way.aim);
            let near = (0..27).filter_map(|n| cells.get(&[i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1])).flatten();
            let entry = |&k: &u32| {
                let texel = &texels[k as usize];
                let density = |(nozzle, axis): &(Point3<f64>, UnitVector3<f64>)| {
                    0.5 * spray.density(nozzle, axis, &texel.point, &texel.normal)
                };
                let sum: f64 = way.sprays.iter().map(density).sum();
                (sum > FAINT * greatest && sees(surface, &way.middle, &texel.point)).then_some((k, sum))
            };
            near.filter_map(entry).collect()
        };
        Self { rows: ways.iter().map(row).collect() }
    }

    fn thickness(&self, volumes: &[f64], texels: usize) -> Vec<f64> {
        let mut thickness = vec![0.0; texels];
        for (row, volume) in self.rows.iter().zip(volumes) {
            for &(texel, density) in row {
                thickness[texel as usize] += density * volume;
            }
        }
        thickness
    }

    fn adjoint(&self, field: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| row.iter().map(|&(texel, density)| density * field[texel as usize]).sum()).collect()
    }
}

fn sees(surface: &dyn Surface, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    let way = to - from;
    let distance = way.norm();
    let Some(direction) = UnitVector3::try_new(way, 1e-12) else { return true };
    surface.cast(from, &direction, distance - SHADOW_BIAS).is_none()
}

#[cfg(test)]
mod tests {
    use ptu_kinematics::Ptu;

    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::adapters::Robot;

    /// The simulator, which rounds to quanta and integrates over texels, puts the same paint on the same places.
    #[test]
    fn the_response_is_that_of_the_simulator() {
        let settings = MissionSettings::default();
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let (targets, plan) = (test_panel::targets(), test_panel::plan(&surface, &robot, &settings));
        let ways: Vec<Way> = (0..targets.len() - 1).map(|k| Way::new(0, k, &targets, &plan)).collect();
        let (texels, _) = surface.film_texels();
        let spray = spray_model(&settings);
        let response = Response::new(&ways, &texels, &spray, &surface.world);
        let volumes: Vec<f64> = (0..ways.len()).map(|k| 1e-9 * (1 + k % 5) as f64).collect();
        let predicted = response.thickness(&volumes, texels.len());
        let shots: Vec<paint_sim::Shot> = ways
            .iter()
            .zip(&volumes)
            .flat_map(|(way, volume)| {
                way.sprays.map(|(origin, axis)| paint_sim::Shot { origin, axis, volume: 0.5 * volume })
            })
            .collect();
        let film = paint_sim::spray(texels, &shots, &spray, &surface.world, 1).unwrap();
        let most = predicted.iter().copied().fold(0.0, f64::max);
        assert!(most > 1e-7, "{most}");
        for (k, predicted) in predicted.iter().enumerate() {
            let off = (film.thickness(k) - predicted).abs();
            assert!(off < 0.02 * most, "texel {k}: {predicted} for {}", film.thickness(k));
        }
    }
}
