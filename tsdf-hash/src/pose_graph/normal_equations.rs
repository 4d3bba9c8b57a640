//! The normal equations of a pose graph, in sparse blocks of 6 × 6.

use nalgebra::{DVector, Isometry3, Matrix6, Vector6};

use crate::error::Error;
use crate::pose_graph::block_cholesky::{BlockCholesky, Place, free_blocks};
use crate::pose_graph::factors::{BetweenFactor, PriorFactor};
use crate::pose_graph::se3::right_jacobian_inverse;

/// `H` and `b` of the poses that are not fixed.
pub(crate) struct NormalEquations {
    pub(crate) h: BlockCholesky,
    pub(crate) b: DVector<f64>,
    /// For each pose its block.
    pub(crate) blocks: Vec<Option<usize>>,
    /// For each factor between two poses that are free: where their block lies.
    places: Vec<Option<Place>>,
}

impl NormalEquations {
    /// With the pattern of a graph, and of more pairs of poses.
    pub(crate) fn new(fixed: &[bool], betweens: &[BetweenFactor], more: &[[usize; 2]]) -> Result<Self, Error> {
        let (blocks, count) = free_blocks(fixed);
        let pair = |f: &BetweenFactor| Some([blocks[f.first]?, blocks[f.second]?]);
        let more = more.iter().filter_map(|&[a, b]| Some([blocks[a]?, blocks[b]?]));
        let h = BlockCholesky::new(count, 6, betweens.iter().filter_map(pair).chain(more))?;
        let places = betweens.iter().map(|f| pair(f).map(|[a, b]| h.place(a, b))).collect();
        Ok(Self { h, b: DVector::zeros(6 * count), blocks, places })
    }

    /// Linearises all factors.
    pub(crate) fn assemble(&mut self, poses: &[Isometry3<f64>], betweens: &[BetweenFactor], priors: &[PriorFactor]) {
        let Self { h, b, blocks, places } = self;
        h.values.fill(0.0);
        b.fill(0.0);
        for (factor, &place) in betweens.iter().zip(places.iter()) {
            let [first, second] = [factor.first, factor.second].map(|k| blocks[k]);
            if first.is_none() && second.is_none() {
                continue;
            }
            let found = factor.linearise(&poses[factor.first], &poses[factor.second]);
            let weighted = found.second.transpose() * factor.information;
            let (_, weight) = factor.kernel.evaluate(found.residual.dot(&(factor.information * found.residual)));
            let (own, gradient) = (weight * weighted * found.second, weight * weighted * found.residual);
            if let Some(second) = second {
                add(h, b, second, &own, &gradient);
            }
            let across = found.transport.transpose() * own;
            if let Some(first) = first {
                add(h, b, first, &(across * found.transport), &-(found.transport.transpose() * gradient));
            }
            if let (Some(first), Some(second), Some(place)) = (first, second, place) {
                // The row of the block is the later pose.
                if first > second {
                    h.add(place, |row, column| -across[(row, column)]);
                } else {
                    h.add(place, |row, column| -across[(column, row)]);
                }
            }
        }
        for prior in priors {
            let Some(block) = blocks[prior.pose] else { continue };
            let residual = prior.residual(&poses[prior.pose]);
            let jacobian = right_jacobian_inverse(&residual);
            let weighted = jacobian.transpose() * prior.information;
            add(h, b, block, &(weighted * jacobian), &(weighted * residual));
        }
    }
}

fn add(h: &mut BlockCholesky, b: &mut DVector<f64>, block: usize, own: &Matrix6<f64>, gradient: &Vector6<f64>) {
    let place = h.place(block, block);
    h.add(place, |row, column| own[(row, column)]);
    let mut part = b.fixed_rows_mut::<6>(6 * block);
    part += gradient;
}
