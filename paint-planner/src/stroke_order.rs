//! In which order, and in which direction, separate strokes are flown.
//!
//! Strokes are edges that must be travelled, transits between their ends the cost: a rural postman problem with one required
//! edge per stroke, solved as a travelling salesman over oriented strokes by greedy insertion, 2-opt and Or-opt. Its
//! [lower bound](transit_lower_bound) says how far from the best the result can be at most.

mod local_search;
mod lower_bound;
mod stroke;
mod transit_cost;

use crate::error::Error;
use crate::settings::Settings;
use crate::target::{Target, check_each};
use local_search::Tour;
pub use stroke::{OrderedStroke, StrokeEnds};
use transit_cost::TransitCost;

/// The order of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct StrokeOrder {
    /// Every stroke once.
    pub strokes: Vec<OrderedStroke>,
    /// Estimated duration of all transits, s: rest to rest within the limits of [`TimingSettings`](crate::timing::TimingSettings),
    /// obstacles left aside; at the speed of a stroke where the next one begins within `break_length`.
    pub transit_time: f64,
}

/// Orders strokes so that transits take little time. The first stroke is the one the flight best begins with; `from` is where
/// the vehicle's nozzle comes from, if that matters. Deterministic; about O(n^2) for n strokes.
///
/// # Errors
/// [`Error::Target`] with the index of the stroke, [`Error::Setting`].
pub fn order_strokes(strokes: &[StrokeEnds], from: Option<&Target>, settings: &Settings) -> Result<StrokeOrder, Error> {
    let cost = transit_cost(strokes, from, settings)?;
    let mut tour = Tour::greedy(&cost);
    tour.improve(&cost);
    Ok(StrokeOrder { transit_time: tour.duration(&cost), strokes: tour.into_strokes() })
}

/// No order of these strokes has transits of less than this duration, s: Lagrangian bound over spanning trees (Held and Karp
/// 1970), each end of a stroke being left or reached at most once. O(n^2) for each of `rounds`; more rounds, a tighter bound.
///
/// # Errors
/// As [`order_strokes`].
pub fn transit_lower_bound(
    strokes: &[StrokeEnds],
    from: Option<&Target>,
    settings: &Settings,
    rounds: usize,
) -> Result<f64, Error> {
    let cost = transit_cost(strokes, from, settings)?;
    Ok(lower_bound::held_karp(&cost, Tour::greedy(&cost).duration(&cost), rounds))
}

fn transit_cost(strokes: &[StrokeEnds], from: Option<&Target>, settings: &Settings) -> Result<TransitCost, Error> {
    settings.check()?;
    for (index, stroke) in strokes.iter().enumerate() {
        check_each(&[stroke.first, stroke.last], settings.nozzle.distances()).map_err(|error| match error {
            Error::Target { what, .. } => Error::Target { index, what },
            other => other,
        })?;
    }
    if let Some(from) = from {
        check_each(&[*from], settings.nozzle.distances())?;
    }
    Ok(TransitCost::new(strokes, from, settings))
}

#[cfg(test)]
mod tests;
