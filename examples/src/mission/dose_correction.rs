//! Doses that leave the wanted thickness on the surface itself: a painter sees a plane, where charts are stretched, seams lie apart,
//! and every spray stands upright.

use nalgebra::{Point3, UnitVector3};
use paint_net::PaintProblem;
use paint_net::painters::{DoseCorrection, DoseFootprint, SurfaceFootprint, VolumeFit};
use paint_planner::{Plan, Target};
use paint_sim::{Film, Shot};

use super::decide::ceiling;
use super::error::MissionError;
use super::nozzle::{kernel, spray_model};
use super::painting_task::PaintingTask;
use crate::appearance::UNIT_THICKNESS;

/// Updates of the volumes.
const ROUNDS: usize = 300;
/// Weight of the differences from the painter's volumes against the ink, and steps of that fit.
const PROXIMITY: f64 = 0.05;
const ITERATIONS: usize = 40;
/// Largest dose in medians of all: what would run is left thin instead, and shows in the report.
const MAX_DOSE: f64 = 4.0;
/// Shares do not depend on it, m³.
const ANY_VOLUME: f64 = 1e-9;
/// Places on the way to the next target from which it is sprayed.
const SHARES: [f64; 2] = [0.25, 0.75];

/// Changes the doses of all that the flights spray so that the thickness comes as near the wanted one as it can. Each flight is its targets
/// with their plan.
///
/// Returns the deviation over the mean of the thickness that is then expected where the robot can paint.
pub(super) fn correct_doses(flights: &mut [(&mut [Target], &Plan)], task: &PaintingTask) -> Result<f64, MissionError> {
    let (texels, pixels) = task.surface.film_texels();
    let ink = task.appearance.ink();
    let wanted: Vec<f64> = pixels.iter().map(|&k| ink.inverse(task.wanted.data()[k]) * UNIT_THICKNESS).collect();
    let in_reach = |place: usize| task.in_reach[pixels[place]];
    let weigh = |(place, texel): (usize, &paint_sim::Texel)| texel.area * task.canvas().weight(pixels[place]);
    let weight: Vec<f64> = texels.iter().enumerate().map(weigh).collect();
    let film = Film::new(texels)?;
    let sprayed = sprayed(flights);
    let thickness = |&(place, share): &(u32, f64)| (place, share / film.texels()[place as usize].area);
    let shares = shares(flights, &sprayed, &film, task)?;
    let footprints: Vec<DoseFootprint> =
        shares.iter().map(|of_target| of_target.iter().map(thickness).collect()).collect();

    let doses: Vec<f64> = sprayed.iter().map(|&(flight, k, _)| flights[flight].0[k].dose).collect();
    let mut volumes: Vec<f64> = sprayed.iter().zip(&doses).map(|((_, _, length), dose)| dose * length).collect();
    let most = MAX_DOSE * median(doses);
    let most: Vec<f64> = sprayed.iter().map(|(_, _, length)| most * length).collect();
    let correction = DoseCorrection { footprints: &footprints, wanted: &wanted, weight: &weight, rounds: ROUNDS };
    let expected = correction.solve(&mut volumes, &most)?;
    for (&(flight, k, length), volume) in sprayed.iter().zip(volumes) {
        flights[flight].0[k].dose = volume / length;
    }
    let places = (0..wanted.len()).filter(|&place| in_reach(place) && wanted[place] > 0.0);
    Ok(deviation_over_mean(places.map(|place| (expected[place] / wanted[place], film.texels()[place].area))))
}

/// Changes the doses so that the ink on the surface comes as near the wanted one as it can from where the nozzle is planned to be: it stands
/// nearer than painters think where a joint ends, and its spots are smaller and darker there.
pub(super) fn correct_ink(flights: &mut [(&mut [Target], &Plan)], task: &PaintingTask) -> Result<(), MissionError> {
    let PaintingTask { settings, surface, appearance, .. } = task;
    let (texels, pixels) = surface.film_texels();
    let film = Film::new(texels)?;
    let sprayed = sprayed(flights);
    let kernel = kernel(settings)?;
    let area = kernel.mass() * settings.texel * settings.texel;
    let depth = |&(place, share): &(u32, f64)| {
        (pixels[place as usize] as u32, (share * area / film.texels()[place as usize].area) as f32)
    };
    let shares = shares(flights, &sprayed, &film, task)?;
    let footprints: Vec<SurfaceFootprint> =
        shares.iter().map(|of_target| of_target.iter().map(depth).collect()).collect();

    let (weight, ceiling) = (task.canvas().weights(), ceiling(&task.wanted, surface)?);
    let problem = PaintProblem::new(&task.wanted)
        .with_weight(&weight)
        .with_ceiling(&ceiling)
        .with_ghosts(&surface.beyond_seams)
        .with_kernel(&kernel)
        .with_saturation(appearance.ink())
        .with_limits(&settings.limits);
    let heeded = task.layers.first().and_then(|layer| layer.missing_weight.as_ref());
    let problem = PaintProblem { missing_weight: heeded, ..problem };
    let unit = area * UNIT_THICKNESS;
    let mut volumes: Vec<f64> =
        sprayed.iter().map(|&(flight, k, length)| flights[flight].0[k].dose * length / unit).collect();
    let fit = VolumeFit {
        problem: &problem,
        footprints: &footprints,
        proximity: PROXIMITY,
        iterations: ITERATIONS,
        tolerance: 1e-4,
    };
    fit.solve(&mut volumes, &mut |_| ())?;
    for (&(flight, k, length), volume) in sprayed.iter().zip(volumes) {
        flights[flight].0[k].dose = volume * unit / length;
    }
    Ok(())
}

/// Where the valve is open: flight, target, and how far it is to the next one.
pub(super) fn sprayed(flights: &[(&mut [Target], &Plan)]) -> Vec<(usize, usize, f64)> {
    let of_flight = |(flight, (targets, plan)): (usize, &(&mut [Target], &Plan))| {
        let open = (0..targets.len().saturating_sub(1)).filter(|&k| plan.flow[k] > 0.0);
        open.map(|k| (flight, k, (targets[k + 1].point - targets[k].point).norm())).collect::<Vec<_>>()
    };
    flights.iter().enumerate().flat_map(of_flight).collect()
}

/// Which share of what is sprayed after each target falls on which place of a film.
pub(super) fn shares(
    flights: &[(&mut [Target], &Plan)],
    sprayed: &[(usize, usize, f64)],
    film: &Film,
    task: &PaintingTask,
) -> Result<Vec<Vec<(u32, f64)>>, MissionError> {
    let shot = |&(flight, k, _): &(usize, usize, f64)| {
        SHARES.map(|share| shot_between(flights[flight].0, flights[flight].1, k, share))
    };
    let shots: Vec<Shot> = sprayed.iter().flat_map(shot).collect();
    let shares = film.shares(&shots, &spray_model(&task.settings), &task.surface.world, task.settings.threads)?;
    let part = |&(place, share): &(u32, f64)| (place, share / SHARES.len() as f64);
    Ok(shares.chunks(SHARES.len()).map(|of_target| of_target.iter().flatten().map(part).collect()).collect())
}

/// The spray from a share of the way between a target and the next.
fn shot_between(targets: &[Target], plan: &Plan, k: usize, share: f64) -> Shot {
    let between = |a: &Point3<f64>, b: &Point3<f64>| a + (b - a) * share;
    let origin = between(&plan.nozzle[k].position, &plan.nozzle[k + 1].position);
    let aim = between(&targets[k].point, &targets[k + 1].point);
    let axis = UnitVector3::try_new(aim - origin, 1e-12).unwrap_or(plan.nozzle[k].direction);
    Shot { origin, axis, volume: ANY_VOLUME }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Of values with weights; 0 of none.
fn deviation_over_mean(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let add = |[all, sum, squares]: [f64; 3], (value, weight): (f64, f64)| {
        [all + weight, sum + weight * value, squares + weight * value * value]
    };
    let [all, sum, squares] = values.fold([0.0; 3], add);
    (squares * all / (sum * sum) - 1.0).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use ptu_kinematics::Ptu;

    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::adapters::Robot;

    #[test]
    fn the_deviation_is_that_of_the_weights() {
        let deviation = |values: &[(f64, f64)]| deviation_over_mean(values.iter().copied());
        assert!((deviation(&[(1.0, 1.0), (3.0, 1.0)]) - 0.5).abs() < 1e-12);
        // Mean 1.5, variance (3 * 0.25 + 2.25) / 4.
        assert!((deviation(&[(1.0, 3.0), (3.0, 1.0)]) - 0.75_f64.sqrt() / 1.5).abs() < 1e-12);
        assert!(deviation(&[(2.0, 0.3), (2.0, 7.0)]) < 1e-7);
        assert_eq!(median(vec![5.0, 1.0, 3.0]), 3.0);
    }

    #[test]
    fn a_shot_leaves_from_its_share_of_the_way() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let plan = test_panel::plan(&surface, &Robot::new(Ptu::new(settings.ptu).unwrap()), &settings);
        let targets = test_panel::targets();
        let nozzle = |k: usize| plan.nozzle[k].position;
        let shot = shot_between(&targets, &plan, 7, 0.25);
        assert!((shot.origin - (nozzle(7) + 0.25 * (nozzle(8) - nozzle(7)))).norm() < 1e-12);
        let aim = targets[7].point + 0.25 * (targets[8].point - targets[7].point);
        let way: Vector3<f64> = aim - shot.origin;
        assert!((shot.axis.into_inner() - way.normalize()).norm() < 1e-12);
    }
}
