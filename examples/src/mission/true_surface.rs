//! The surface that is really there, where the robot knows no more of it than its map.

use paint_sim::{Surface, Texel, TriangleSurface};

/// What the map shows farther from the surface than this is no part of it, metres.
const FARTHEST: f64 = 0.1;

/// Moves the texels of a map onto the true surface, along their normals; those that have none within reach stay where the map has them.
/// The paint on a texel is then the paint at the place that the robot took it for.
pub(super) fn moved_onto(truth: &TriangleSurface, texels: Vec<Texel>) -> Vec<Texel> {
    let moved = |texel: Texel| {
        let outside = texel.point + texel.normal.as_ref() * FARTHEST;
        let Some(hit) = truth.cast(&outside, &-texel.normal.as_ref(), 2.0 * FARTHEST) else { return texel };
        let point = outside - texel.normal.as_ref() * hit.distance;
        // A face seen from behind has its normal on the other side.
        let side = hit.normal.dot(&texel.normal).signum();
        let normal = nalgebra::UnitVector3::try_new(hit.normal * side, 1e-9).unwrap_or(texel.normal);
        Texel { point, normal, ..texel }
    };
    texels.into_iter().map(moved).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};

    use super::*;

    #[test]
    fn texels_move_onto_the_truth_and_no_farther() {
        // A wall at x = 0 that faces -x, mapped 3 cm too near, and a place of the map beside it.
        let corners = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]];
        let truth = TriangleSurface::new(&corners, &[[0, 1, 2]]).unwrap();
        let tilted = UnitVector3::new_normalize(Vector3::new(-1.0, 0.1, 0.0));
        let texel = |y: f64| Texel { point: Point3::new(-0.03, y, 0.5), normal: tilted, area: 1e-4 };
        let moved = moved_onto(&truth, vec![texel(0.0), texel(5.0)]);
        assert!((moved[0].point - Point3::new(0.0, -0.003, 0.5)).norm() < 1e-9, "{}", moved[0].point);
        assert!((moved[0].normal.as_ref() - -Vector3::x()).norm() < 1e-9, "{}", moved[0].normal.as_ref());
        assert_eq!((moved[1].point, moved[1].normal), (texel(5.0).point, tilted));
    }
}
