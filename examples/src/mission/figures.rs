//! The figures of a mission.

use paint_net::{ideal, metrics};
use paint_planner::Plan;
use paint_sim::flight::FlightLog;
use paint_sim::flight::FlightStatistics;
use paint_sim::spray::QUANTUM;

use super::collisions::collisions;
use super::compared_flight::hit_error_rms;
use super::darker_than_wanted;
use super::error::MissionError;
use super::fly::LayerFlight;
use super::inspect::Inspection;
use super::kept_clean::kept_clean;
use super::run::Mission;
use super::sagging::sagging_share;
use super::seams::likeness;
use super::settings::{MissionSettings, PainterChoice};
use super::team::flown_team;
use crate::adapters::MeshSurface;
use crate::onboard::LocalisationFigures;
use crate::report::{FilmFigures, LocalisationReport, Report, TimeFigures, peak_resident_bytes};

/// Step of the dense check of the planned limits, seconds; the certificates do not depend on it.
const LIMIT_STEP: f64 = 0.02;

/// All figures, with those of the inspection.
pub fn report(mission: &Mission, inspection: &Inspection) -> Result<Report, MissionError> {
    let quality = mission.task.surface.chart.quality();
    let deviations = normal_deviations(mission);
    let flown = FlightStatistics::of(&mission.flights.iter().map(|f| f.flight.samples.as_slice()).collect::<Vec<_>>());
    let own = mission.flights.iter().filter_map(|f| f.localisation).reduce(LocalisationFigures::and);
    let planned_time: f64 = mission.flights.iter().map(|f| f.plan.trajectory.duration()).sum();
    let in_the_air: f64 = mission.flights.iter().map(LayerFlight::duration).sum();
    let path: f64 = mission.flights.iter().map(|f| f.plan.path_length()).sum();

    let balance = mission.film.mass_balance();
    let on_texels: u64 = mission.film.volumes().iter().sum();
    let kilograms = |quanta: u64| quanta as f64 * QUANTUM * mission.task.paint.liquid.density;
    let unaccounted =
        (i128::from(balance.emitted) - i128::from(on_texels) - i128::from(balance.overspray + balance.dripped)).abs();

    let canvas = mission.task.layers.last().map_or(&mission.task.wanted, |l| &l.ink);
    let filtered = ideal(&mission.task.wanted, mission.task.settings.spot / mission.task.settings.texel)?;
    let painted = mission.painted_ink();
    let weight = Some(&mission.task.coverage);
    let in_reach = mission.task.coverage_in_reach();
    let in_reach = Some(&in_reach);
    let fill = (mission.task.settings.painter == PainterChoice::Fill).then(|| evenness(mission));
    let seams = likeness(mission)?;
    let met = MeshSurface(mission.task.met());
    let obstacles = mission.task.settings.constraints.around(&met);
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        surface: mission.task.name.clone(),
        seed: mission.task.settings.seed,
        surface_area_m2: mission.task.surface.disk().area(),
        faces: mission.task.surface.disk().faces().len(),
        uv_flips: quality.flips,
        uv_symmetric_dirichlet: quality.symmetric_dirichlet,
        normal_deviation_mean_m: deviations.mean,
        normal_deviation_max_m: deviations.max,
        smoothing_normal_deviation_mean_m: deviations.smoothing_mean,
        unreachable_normal_share: deviations.unreachable,
        reach_share: mission.task.share_in_reach(),
        reach_needs: mission.task.reach_needs,
        lost_to_constraints_share: mission.task.share_lost_to_constraints(),
        unreachable_paint_share: mission.share_out_of_reach(),
        targets: mission.outcomes.targets,
        targets_not_served: mission.outcomes.not_served(),
        targets_kept_off: mission.kept_off,
        targets_left_bare: mission.left_bare,
        hit_error_rms_m: flown.hit_error_rms,
        hit_error_p95_m: flown.hit_error_p95,
        hit_error_rms_slam_m: hit_error_rms(mission.flights.iter().map(|f| &f.slam)),
        nozzle_distance_std_m: flown.nozzle_distance_std,
        ptu_locked_hit_error_rms_m: hit_error_rms(mission.flights.iter().map(|f| &f.locked)),
        pan_error_rms_rad: flown.pan_error_rms,
        tilt_error_rms_rad: flown.tilt_error_rms,
        planning_s_per_m: mission.planning / path,
        planning_per_flight_time: mission.planning / planned_time,
        path_length_m: path,
        flight_time_s: mission.flight_time(),
        team: flown_team(mission),
        times: TimeFigures::of(mission.flights.iter().map(|f| &f.plan), &mission.task.settings.planner.timing),
        valve_open_share: mission.flights.iter().map(|f| f.plan.open_time()).sum::<f64>() / planned_time,
        valve_held_share: share_held(mission),
        transit_s: mission.flights.iter().map(|f| f.route.transit_time).sum(),
        paint_emitted_kg: kilograms(balance.emitted),
        paint_deposited_kg: kilograms(on_texels),
        paint_overspray_kg: kilograms(balance.overspray + balance.dripped),
        mass_balance_relative: unaccounted as f64 / balance.emitted.max(1) as f64,
        psnr_canvas_db: metrics::psnr(canvas, &mission.task.wanted, weight)?,
        psnr_ideal_db: metrics::psnr(&filtered, &mission.task.wanted, weight)?,
        psnr_canvas_in_reach_db: metrics::psnr(canvas, &mission.task.wanted, in_reach)?,
        psnr_ideal_in_reach_db: metrics::psnr(&filtered, &mission.task.wanted, in_reach)?,
        psnr_painted_db: metrics::psnr(&painted, &mission.task.wanted, weight)?,
        ssim_canvas: metrics::ssim(canvas, &mission.task.wanted, weight)?,
        ssim_painted: metrics::ssim(&painted, &mission.task.wanted, weight)?,
        ssim_canvas_in_reach: metrics::ssim(canvas, &mission.task.wanted, in_reach)?,
        ssim_painted_in_reach: metrics::ssim(&painted, &mission.task.wanted, in_reach)?,
        ciede2000_mean: mean(mission.colour_difference().into_iter().flatten()),
        collisions: mission.flights.iter().map(|f| collisions(&mission.task.robot, &obstacles, &f.flight)).sum(),
        limit_violations: mission
            .flights
            .iter()
            .map(|f| limit_violations(&f.plan, &f.flight, &mission.task.settings))
            .sum(),
        scan_error_mean_m: inspection.mesh_error,
        slam_ate_rms_m: inspection.slam_ate,
        fill_coverage_share: fill.as_ref().map(|f| f.covered),
        fill_thin_share: fill.as_ref().map(|f| f.thin),
        fill_deviation: fill.as_ref().map(|f| f.deviation),
        fill_mean_ratio: fill.as_ref().map(|f| f.mean),
        localisation: own.map(|own| LocalisationReport::of(&own, in_the_air)),
        sorties: mission.sorties(),
        not_flown_s: mission.grounded.as_ref().map(|grounded| grounded.left_s),
        film: film_figures(mission),
        identified: mission.identified.as_ref().map(|told| told.figures(&mission.task.settings.airframe)),
        darker_than_wanted_share: darker_than_wanted::share(mission)?,
        seam_length_m: mission.task.surface.disk().seam_length(),
        ssim_painted_at_seams: seams.as_ref().map(|s| s.near),
        ssim_painted_off_seams: seams.as_ref().map(|s| s.far),
        layers: mission.task.layers.len(),
        strokes: mission.flights.iter().map(|f| f.route.strokes).sum(),
        wall_s: mission.task.started.elapsed().as_secs_f64(),
        peak_rss_bytes: peak_resident_bytes(),
    })
}

fn film_figures(mission: &Mission) -> FilmFigures {
    let looked = &mission.looked;
    FilmFigures {
        sagging_share: sagging_share(&[mission]),
        clean: kept_clean(&[mission]),
        film_estimate_error_share: looked.map(|looked| looked.film_error),
        film_estimate_seen_share: looked.map(|looked| looked.film_seen),
        paint_missing_kg: looked.map(|looked| looked.missing * mission.task.paint.liquid.density),
    }
}

/// How even a coat is where it is wanted and can be reached, by area.
struct Evenness {
    /// Share within 50 % to 150 % of the wanted thickness.
    covered: f64,
    /// Share below.
    thin: f64,
    /// Mean of thickness over wanted thickness.
    mean: f64,
    /// Its standard deviation over its mean.
    deviation: f64,
}

fn evenness(mission: &Mission) -> Evenness {
    let ratios = mission.thickness_ratio();
    let (mut area, mut covered, mut thin, mut sum, mut squares) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (&pixel, texel) in mission.pixels.iter().zip(mission.film.texels()) {
        let Some(ratio) = ratios[pixel] else { continue };
        area += texel.area;
        covered += if (0.5..=1.5).contains(&ratio) { texel.area } else { 0.0 };
        thin += if ratio < 0.5 { texel.area } else { 0.0 };
        sum += texel.area * ratio;
        squares += texel.area * ratio * ratio;
    }
    let all = f64::max(area, f64::MIN_POSITIVE);
    let mean = sum / all;
    let deviation = (squares / all - mean * mean).max(0.0).sqrt() / mean.max(f64::MIN_POSITIVE);
    Evenness { covered: covered / all, thin: thin / all, mean, deviation }
}

fn normal_deviations(mission: &Mission) -> Deviations {
    let (mut ours, mut smoothing, mut out_of_reach, mut total) = (Vec::new(), Vec::new(), 0, 0);
    for f in &mission.flights {
        for (k, target) in f.route.targets.iter().enumerate().filter(|(_, t)| t.dose > 0.0) {
            total += 1;
            let heading = 0.0;
            let joints = mission.task.robot.chain.inverse_unlimited(&target.point, &-target.normal, heading).joints;
            // Any heading will do: only the tilt is decided by the normal.
            if !mission.task.settings.ptu.tilt_limits.contains(joints.tilt) {
                out_of_reach += 1;
                continue;
            }
            if f.plan.reachable[k] {
                ours.push(target.normal_deviation(&f.plan.nozzle[k].position));
            }
            smoothing.extend(f.smoothing_deviations[k]);
        }
    }
    Deviations {
        mean: mean(ours.iter().copied()),
        max: ours.iter().fold(0.0, |m, &d| m.max(d)),
        smoothing_mean: mean(smoothing.iter().copied()),
        unreachable: f64::from(out_of_reach) / f64::from(total.max(1)),
    }
}

/// Share of the samples with paint asked for in which the interlock kept the valve shut.
fn share_held(mission: &Mission) -> f64 {
    let samples = || mission.flights.iter().flat_map(|f| &f.flight.samples);
    let held = samples().filter(|s| s.held).count();
    held as f64 / samples().filter(|s| s.held || s.flow > 0.0).count().max(1) as f64
}

/// Moments at which the plan exceeds a limit of speed, acceleration, heading rate or joint rate, or the flown gun its joint limits.
pub(super) fn limit_violations(plan: &Plan, flight: &FlightLog, settings: &MissionSettings) -> usize {
    let planned = plan.limit_violations(&settings.planner.timing, LIMIT_STEP);
    let ptu = &settings.ptu;
    // The servo's steps do not divide the limits: allow one half step.
    let margin = 0.5 * settings.servo.resolution;
    let inside = |angle: f64, range: ptu_kinematics::Range| angle >= range.min - margin && angle <= range.max + margin;
    let joints = flight
        .samples
        .iter()
        .filter(|s| !inside(s.pan_tilt[0], ptu.pan_limits) || !inside(s.pan_tilt[1], ptu.tilt_limits));
    planned + joints.count()
}

struct Deviations {
    mean: f64,
    max: f64,
    smoothing_mean: f64,
    unreachable: f64,
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::test_panel;
    use super::*;
    use ptu_kinematics::{PtuSettings, Range};

    /// None where the planner kept clear, all of them for a robot that is larger than its distance from the wall.
    #[test]
    fn limit_violations_are_counted() {
        let settings = MissionSettings::default();
        let (plan, flight) = test_panel::flown(&settings);
        assert_eq!(limit_violations(&plan, &flight, &settings), 0);
        // The same flight judged by a unit whose pan ends at 0.05 rad, which this stroke needs more than.
        let narrow = PtuSettings { pan_limits: Range::symmetric(0.05), ..settings.ptu };
        let judged = MissionSettings { ptu: narrow, ..settings.clone() };
        let margin = 0.05 + 0.5 * settings.servo.resolution;
        let beyond = flight.samples.iter().filter(|s| s.pan_tilt[0].abs() > margin).count();
        assert!(beyond > 10, "the flight must leave the narrow limits");
        assert_eq!(limit_violations(&plan, &flight, &judged), beyond);
        let flat = PtuSettings { tilt_limits: Range::symmetric(0.02), ..settings.ptu };
        assert!(limit_violations(&plan, &flight, &MissionSettings { ptu: flat, ..settings.clone() }) > 0);
        // And by a vehicle that may fly only half as fast, or accelerate a tenth.
        let mut slow = settings.clone();
        slow.planner.timing.max_speed = 0.5 * plan.report.extrema.speed;
        assert!(limit_violations(&plan, &flight, &slow) > 0);
        let mut stiff = settings.clone();
        stiff.planner.timing.max_joint_rate = 0.5 * plan.report.joint_rate;
        assert!(limit_violations(&plan, &flight, &stiff) > 0);
        let mut gentle = settings;
        gentle.planner.timing.max_acceleration = 0.1 * plan.report.extrema.acceleration;
        assert!(limit_violations(&plan, &flight, &gentle) > 0);
    }
}
