//! The figures of a session.

use paint_net::Image;
use serde::Serialize;

use super::canvas::Canvas;
use super::counters::Traffic;
use super::error::VrError;
use super::session::Session;
use crate::appearance::{Appearance, UNIT_THICKNESS};

/// Paint thinner than this is not looked at, in units of a coat.
const THIN: f64 = 0.02;

/// Pixels about the paint that are looked at as well.
const WINDOW: usize = 12;

/// `report.json`: SI units in the names.
#[derive(Debug, Serialize)]
pub(super) struct VrFigures {
    pub(super) surface: String,
    pub(super) session_s: f64,
    pub(super) events: u64,
    pub(super) states: u64,
    pub(super) states_not_later: u64,
    pub(super) ticks: u64,
    pub(super) missing_ticks: u64,
    pub(super) repeated_events: u64,
    pub(super) event_gaps: u64,
    pub(super) refused_events: u64,
    pub(super) refused_states_waiting: u64,
    pub(super) refused_states_queue_full: u64,
    pub(super) refused_states_far: u64,
    pub(super) taken_back_states: u64,
    pub(super) malformed_messages: u64,
    pub(super) rate_limited_messages: u64,
    pub(super) refused_connections: u64,
    pub(super) connections: u64,
    pub(super) unsent_messages: u64,
    pub(super) work_per_state_ms: f64,
    pub(super) plans: u64,
    pub(super) paint_tasks: u64,
    pub(super) continued_tasks: u64,
    pub(super) refused_tasks: u64,
    pub(super) refused_paint: u64,
    pub(super) targets: u64,
    pub(super) targets_served: u64,
    pub(super) planning_median_ms: f64,
    pub(super) planning_max_ms: f64,
    pub(super) latency_time_min_s: f64,
    pub(super) latency_time_median_s: f64,
    pub(super) latency_time_max_s: f64,
    pub(super) latency_distance_max_m: f64,
    pub(super) paint_seen_ml: f64,
    pub(super) paint_flown_ml: f64,
    /// Likeness of what the robot has sprayed and what the person saw, where either has paint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) ssim_flown_seen: Option<f64>,
    /// Share of the paint that the mission file lacks: it is thicker than the scale of ink.
    pub(super) mission_left_out_share: f64,
    pub(super) peak_memory_mb: f64,
    pub(super) seed: u64,
    pub(super) version: &'static str,
}

/// Gathers the figures.
pub(super) fn figures(session: &Session, traffic: &Traffic, appearance: &Appearance) -> Result<VrFigures, VrError> {
    let (counts, queue, clock) = session.counts();
    let curves = session.curves();
    let [seen, flown] = session.canvases();
    let times = || curves.time.iter().map(|(_, latency)| *latency);
    Ok(VrFigures {
        surface: session.world().name.clone(),
        session_s: session.time(),
        events: counts.events,
        states: clock.states,
        states_not_later: clock.not_later,
        ticks: clock.ticks,
        missing_ticks: clock.missing_ticks,
        repeated_events: counts.repeated,
        event_gaps: counts.gaps,
        refused_events: counts.refused,
        refused_states_waiting: queue.refused_waiting,
        refused_states_queue_full: queue.refused_full,
        refused_states_far: queue.far,
        taken_back_states: counts.taken_back,
        malformed_messages: traffic.malformed,
        rate_limited_messages: traffic.too_many,
        refused_connections: traffic.refused,
        connections: traffic.connections,
        unsent_messages: traffic.unsent,
        work_per_state_ms: 1e3 * traffic.work_per_event(),
        plans: counts.plans,
        paint_tasks: counts.paint_tasks,
        continued_tasks: counts.continued,
        refused_tasks: counts.refused_tasks,
        refused_paint: counts.refused_paint,
        targets: counts.targets,
        targets_served: counts.targets_served,
        planning_median_ms: 1e3 * median(curves.planning.clone()),
        planning_max_ms: 1e3 * curves.planning.iter().copied().fold(0.0, f64::max),
        latency_time_min_s: times().reduce(f64::min).unwrap_or(0.0),
        latency_time_median_s: median(times().collect()),
        latency_time_max_s: times().reduce(f64::max).unwrap_or(0.0),
        latency_distance_max_m: curves.distance.iter().map(|(_, lag)| *lag).fold(0.0, f64::max),
        paint_seen_ml: 1e6 * seen.volume(),
        paint_flown_ml: 1e6 * flown.volume(),
        ssim_flown_seen: likeness(session, appearance)?,
        mission_left_out_share: 0.0,
        peak_memory_mb: crate::report::peak_resident_bytes() as f64 / 1e6,
        seed: session.settings().seed,
        version: env!("CARGO_PKG_VERSION"),
    })
}

/// SSIM of the two pictures' ink where either has paint: the bare wall around would only flatter it. `None` without paint.
fn likeness(session: &Session, appearance: &Appearance) -> Result<Option<f64>, VrError> {
    let (columns, rows) = (session.world().surface.width(), session.world().surface.height());
    let [seen, flown] = session.canvases().map(Canvas::thickness);
    let painted: Vec<bool> = seen.iter().zip(&flown).map(|(a, b)| a.max(*b) > THIN * UNIT_THICKNESS).collect();
    if !painted.contains(&true) {
        return Ok(None);
    }
    // The window of the similarity must fit about a thin line.
    let near = widened(&painted, columns, rows, WINDOW);
    let coverage = session.world().surface.coverage();
    let weight = near.iter().zip(coverage.data()).map(|(near, on)| f64::from(u8::from(*near)) * on).collect();
    let ink = |thickness: Vec<f64>| {
        let ink = thickness.into_iter().map(|t| appearance.ink().forward(t / UNIT_THICKNESS)).collect();
        Image::new(columns, rows, ink)
    };
    let weight = Image::new(columns, rows, weight)?;
    Ok(Some(paint_net::metrics::ssim(&ink(flown)?, &ink(seen)?, Some(&weight))?))
}

/// The middle of some numbers; 0 of none.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// A mask with `by` pixels more on every side, diagonals included.
fn widened(mask: &[bool], columns: usize, rows: usize, by: usize) -> Vec<bool> {
    let near = |at: usize, end: usize| at.saturating_sub(by)..(at + by + 1).min(end);
    let across: Vec<bool> =
        (0..mask.len()).map(|k| near(k % columns, columns).any(|x| mask[k / columns * columns + x])).collect();
    (0..mask.len()).map(|k| near(k / columns, rows).any(|y| across[y * columns + k % columns])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_widened_on_all_sides_and_not_around_the_edge() {
        let mut mask = vec![false; 20];
        mask[5] = true; // column 0, row 1 of five columns
        let wide = widened(&mask, 5, 4, 1);
        let expected = [0, 1, 5, 6, 10, 11];
        assert!((0..20).all(|k| wide[k] == expected.contains(&k)), "{wide:?}");
    }
}
