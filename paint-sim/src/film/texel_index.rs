//! Texels with the tree that finds them.

use super::ball_tree::BallTree;
use super::texel::Texel;

/// The texels and the index over them: shared by all films on one surface.
#[derive(Debug)]
pub(super) struct TexelIndex {
    pub(super) texels: Vec<Texel>,
    pub(super) tree: BallTree,
}
