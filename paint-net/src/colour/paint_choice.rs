//! Which paints, and in which order they lie over each other: the combinations are too many to try them all.

use crate::error::{Error, require};

/// Smaller shares of the cost are no gain: what is flown first has to be good reason.
const LEAST_GAIN: f64 = 1e-3;

/// Chooses `count` of `available` paints: forward selection, then exchanges of one for another as long as they make `cost` smaller. `cost` judges paints
/// by their numbers, the lowest film first.
///
/// # Errors
/// None to choose, more than there are, and those of `cost`.
pub fn choose_paints<E: From<Error>>(
    available: usize,
    count: usize,
    cost: &mut dyn FnMut(&[usize]) -> Result<f64, E>,
) -> Result<Vec<usize>, E> {
    require("count", count as f64, (1..=available).contains(&count), "it must be from 1 to the number of paints")?;
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count {
        let with = |paint: usize| {
            let mut more = chosen.clone();
            more.push(paint);
            more.sort_unstable();
            more
        };
        let candidates = (0..available).filter(|paint| !chosen.contains(paint)).map(with).collect();
        chosen = cheapest(candidates, cost)?.map(|(paints, _)| paints).unwrap_or_default();
    }
    let exchanged = |chosen: &[usize]| {
        let pairs = (0..chosen.len()).flat_map(|slot| (0..available).map(move |paint| (slot, paint)));
        let others = pairs.filter(|(_, paint)| !chosen.contains(paint));
        others
            .map(|(slot, paint)| {
                let mut other = chosen.to_vec();
                other[slot] = paint;
                other.sort_unstable();
                other
            })
            .collect()
    };
    improve(chosen, &exchanged, cost)
}

/// The order of paints, the lowest film first, that makes `cost` smallest among those that moving one paint leads to, again and again; from `first` on.
///
/// # Errors
/// Those of `cost`.
pub fn best_order<E>(first: &[usize], cost: &mut dyn FnMut(&[usize]) -> Result<f64, E>) -> Result<Vec<usize>, E> {
    let moved = |order: &[usize]| {
        let pairs = (0..order.len()).flat_map(|from| (0..order.len()).map(move |to| (from, to)));
        pairs
            .filter(|(from, to)| from != to)
            .map(|(from, to)| {
                let mut other = order.to_vec();
                let paint = other.remove(from);
                other.insert(to, paint);
                other
            })
            .collect()
    };
    improve(first.to_vec(), &moved, cost)
}

/// The best of the neighbours, as long as one is better.
fn improve<E>(
    first: Vec<usize>,
    neighbours: &dyn Fn(&[usize]) -> Vec<Vec<usize>>,
    cost: &mut dyn FnMut(&[usize]) -> Result<f64, E>,
) -> Result<Vec<usize>, E> {
    let mut best = (cost(&first)?, first);
    while let Some((paints, value)) = cheapest(neighbours(&best.1), cost)? {
        if value >= best.0 * (1.0 - LEAST_GAIN) {
            break;
        }
        best = (value, paints);
    }
    Ok(best.1)
}

fn cheapest<E>(
    candidates: Vec<Vec<usize>>,
    cost: &mut dyn FnMut(&[usize]) -> Result<f64, E>,
) -> Result<Option<(Vec<usize>, f64)>, E> {
    let mut best: Option<(Vec<usize>, f64)> = None;
    for candidate in candidates {
        let value = cost(&candidate)?;
        if best.as_ref().is_none_or(|(_, least)| value < *least) {
            best = Some((candidate, value));
        }
    }
    Ok(best)
}
