//! Poses from measurements alone: the chordal relaxation of the rotations, then the positions (Martinec and Pajdla 2007; Carlone et
//! al. 2015, section III).

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::error::Error;
use crate::pose_graph::block_cholesky::{BlockCholesky, free_blocks};
use crate::pose_graph::factors::{BetweenFactor, PriorFactor};

pub(crate) fn initialise(
    poses: &[Isometry3<f64>],
    fixed: &[bool],
    betweens: &[BetweenFactor],
    priors: &[PriorFactor],
) -> Result<Vec<Isometry3<f64>>, Error> {
    let (blocks, count) = free_blocks(fixed);
    if count == 0 {
        return Ok(poses.to_vec());
    }
    let rotations = rotations(poses, &blocks, betweens, priors, count)?;
    let positions = positions(poses, &blocks, betweens, priors, &rotations, count)?;
    Ok(rotations.into_iter().zip(positions).map(|(r, p)| Isometry3::from_parts(Translation3::from(p), r)).collect())
}

/// A linear system of three right sides in blocks, one row of blocks for each pose that is free.
struct System {
    h: BlockCholesky,
    side: usize,
    right: Vec<f64>,
}

impl System {
    fn new(count: usize, side: usize, blocks: &[Option<usize>], betweens: &[BetweenFactor]) -> Result<Self, Error> {
        let pairs = betweens.iter().filter_map(|f| Some([blocks[f.first]?, blocks[f.second]?]));
        Ok(Self { h: BlockCholesky::new(count, side, pairs)?, side, right: vec![0.0; 3 * count * side] })
    }

    fn add_diagonal(&mut self, block: usize, weight: f64) {
        let place = self.h.place(block, block);
        self.h.add(place, |row, column| if row == column { weight } else { 0.0 });
    }

    /// `value(row, right side)`.
    fn add_right(&mut self, block: usize, value: impl Fn(usize, usize) -> f64) {
        let size = self.right.len() / 3;
        for k in 0..3 {
            for row in 0..self.side {
                self.right[k * size + block * self.side + row] += value(row, k);
            }
        }
    }

    /// `x(block, row, right side)`.
    fn solve(mut self) -> Result<impl Fn(usize, usize, usize) -> f64, Error> {
        self.h.factorise()?;
        self.h.solve(&mut self.right);
        let (size, side, right) = (self.right.len() / 3, self.side, self.right);
        Ok(move |block: usize, row: usize, k: usize| right[k * size + block * side + row])
    }
}

/// Minimises `Σ w ‖R_second − R_first Z‖²` over matrices, and takes the rotations nearest to them.
fn rotations(
    poses: &[Isometry3<f64>],
    blocks: &[Option<usize>],
    betweens: &[BetweenFactor],
    priors: &[PriorFactor],
    count: usize,
) -> Result<Vec<UnitQuaternion<f64>>, Error> {
    // The unknowns are the transposes, so that a measurement multiplies from the left.
    let matrix = |r: &UnitQuaternion<f64>| r.to_rotation_matrix().into_inner();
    let mut system = System::new(count, 3, blocks, betweens)?;
    for factor in betweens {
        let weight = factor.information.fixed_view::<3, 3>(0, 0).trace() / 3.0;
        let z = matrix(&factor.first_from_second.rotation);
        let (first, second) = (blocks[factor.first], blocks[factor.second]);
        if let Some(first) = first {
            system.add_diagonal(first, weight);
        }
        if let Some(second) = second {
            system.add_diagonal(second, weight);
        }
        match (first, second) {
            (Some(first), Some(second)) => {
                let place = system.h.place(first, second);
                system.h.add(place, |row, column| {
                    -weight * if first > second { z[(row, column)] } else { z[(column, row)] }
                });
            }
            (None, Some(second)) => {
                let known = z.transpose() * matrix(&poses[factor.first].rotation).transpose();
                system.add_right(second, |row, k| weight * known[(row, k)]);
            }
            (Some(first), None) => {
                let known = z * matrix(&poses[factor.second].rotation).transpose();
                system.add_right(first, |row, k| weight * known[(row, k)]);
            }
            (None, None) => {}
        }
    }
    for prior in priors {
        let Some(block) = blocks[prior.pose] else { continue };
        let weight = prior.information.fixed_view::<3, 3>(0, 0).trace() / 3.0;
        let known = matrix(&prior.world_from_body.rotation).transpose();
        system.add_diagonal(block, weight);
        system.add_right(block, |row, k| weight * known[(row, k)]);
    }
    let x = system.solve()?;
    let nearest = |block: usize| {
        let relaxed = Matrix3::from_fn(|row, k| x(block, k, row));
        let svd = relaxed.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return UnitQuaternion::identity() };
        let sign = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * sign * v_t))
    };
    Ok(poses.iter().zip(blocks).map(|(pose, block)| block.map_or(pose.rotation, nearest)).collect())
}

/// Minimises `Σ w ‖p_second − p_first − R_first z‖²`.
fn positions(
    poses: &[Isometry3<f64>],
    blocks: &[Option<usize>],
    betweens: &[BetweenFactor],
    priors: &[PriorFactor],
    rotations: &[UnitQuaternion<f64>],
    count: usize,
) -> Result<Vec<Vector3<f64>>, Error> {
    let mut system = System::new(count, 1, blocks, betweens)?;
    for factor in betweens {
        let weight = factor.information.fixed_view::<3, 3>(3, 3).trace() / 3.0;
        let shift = rotations[factor.first] * factor.first_from_second.translation.vector;
        let ends = [(factor.first, factor.second, -shift), (factor.second, factor.first, shift)];
        for (end, other, shift) in ends {
            let Some(block) = blocks[end] else { continue };
            system.add_diagonal(block, weight);
            let known = if blocks[other].is_none() { poses[other].translation.vector } else { Vector3::zeros() };
            system.add_right(block, |_, k| weight * (known[k] + shift[k]));
        }
        if let (Some(first), Some(second)) = (blocks[factor.first], blocks[factor.second]) {
            let place = system.h.place(first, second);
            system.h.add(place, |_, _| -weight);
        }
    }
    for prior in priors {
        let Some(block) = blocks[prior.pose] else { continue };
        let weight = prior.information.fixed_view::<3, 3>(3, 3).trace() / 3.0;
        system.add_diagonal(block, weight);
        system.add_right(block, |_, k| weight * prior.world_from_body.translation.vector[k]);
    }
    let x = system.solve()?;
    let found = |block: usize| Vector3::from_fn(|k, _| x(block, 0, k));
    Ok(poses.iter().zip(blocks).map(|(pose, block)| block.map_or(pose.translation.vector, found)).collect())
}
