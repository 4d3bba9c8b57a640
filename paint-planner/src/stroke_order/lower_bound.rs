//! What no order of strokes can undercut.

use super::transit_cost::{End, TransitCost};

/// Lagrangian lower bound of the transits, s; `upper` is the duration of a known order.
///
/// The transits of an order join all strokes without a circle, and use each end at most once. The first alone asks for a
/// spanning tree over strokes, which is found exactly; the second is priced: multipliers `p >= 0` on the ends, raised where
/// the tree uses an end more than once (subgradient ascent, Held, Wolfe and Crowder 1974).
pub(super) fn held_karp(cost: &TransitCost, upper: f64, rounds: usize) -> f64 {
    let ends = 2 * cost.strokes();
    let mut price = vec![0.0; ends];
    let mut best = 0.0_f64;
    let mut step = 1.0;
    let mut since = 0;
    for _ in 0..rounds {
        let (weight, degree) = spanning_tree(cost, &price);
        let bound = weight - price.iter().sum::<f64>();
        since += 1;
        if bound > best {
            (best, since) = (bound, 0);
        } else if since >= 10 {
            (step, since) = (0.7 * step, 0);
        }
        let excess: Vec<f64> = degree.iter().map(|&degree| f64::from(degree) - 1.0).collect();
        // A free end below its price of zero cannot pull it down further.
        let norm: f64 = excess.iter().zip(&price).filter(|(e, p)| **e > 0.0 || **p > 0.0).map(|(e, _)| e * e).sum();
        if norm == 0.0 {
            break;
        }
        let length = step * (1.01 * upper - bound).max(1e-6 * upper) / norm;
        for (price, excess) in price.iter_mut().zip(&excess) {
            *price = (*price + length * excess).max(0.0);
        }
    }
    best
}

/// Prim's tree over strokes (and the place the flight comes from) with prices added at the ends: its weight, and how often
/// each end is used.
fn spanning_tree(cost: &TransitCost, price: &[f64]) -> (f64, Vec<u32>) {
    let count = cost.strokes();
    let mut degree = vec![0; 2 * count];
    // Of every stroke outside the tree: weight of the best edge to it, the end it leaves in the tree, the end it reaches.
    let mut reach: Vec<(f64, Option<End>, End)> = (0..count)
        .map(|stroke| {
            let [a, b] = [2 * stroke, 2 * stroke + 1].map(|end| (cost.first(end) + price[end], end));
            let (weight, end) = if b.0 < a.0 { b } else { a };
            (weight, None, end)
        })
        .collect();
    let mut inside = vec![false; count];
    let mut weight = 0.0;
    for round in 0..count {
        let next = (0..count).filter(|&k| !inside[k]).min_by(|&a, &b| reach[a].0.total_cmp(&reach[b].0));
        let Some(next) = next else { break };
        let (length, from, to) = reach[next];
        // A flight that may begin anywhere pays nothing for its first stroke, and prices no end for it.
        let free = round == 0 && !cost.has_start();
        if !free {
            weight += length;
            degree[to] += 1;
            if let Some(from) = from {
                degree[from] += 1;
            }
        }
        inside[next] = true;
        for stroke in (0..count).filter(|&k| !inside[k]) {
            for to in [2 * stroke, 2 * stroke + 1] {
                for from in [2 * next, 2 * next + 1] {
                    let length = cost.between(from, to) + price[from] + price[to];
                    let better = length < reach[stroke].0 || (reach[stroke].1.is_none() && !cost.has_start());
                    if better {
                        reach[stroke] = (length, Some(from), to);
                    }
                }
            }
        }
    }
    (weight, degree)
}
