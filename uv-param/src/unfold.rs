//! Beside a seam: the texels that lie there, and where the surface goes on.

use nalgebra::Vector2;

/// Farther than this beyond a seam nothing is looked up, in sides of a texel; filtering reaches half as far.
pub(crate) const MAX_REACH: usize = 64;

/// Where the nearest point of a chart's rim lies from a texel beside it.
#[derive(Clone, Copy)]
pub(crate) struct Nearest {
    /// Sides of a texel.
    pub(crate) distance: f64,
    pub(crate) half_edge: u32,
    /// Where on the edge, from its start (0) to its end (1).
    pub(crate) along: f64,
}

/// Notes the edge from `a` to `b` (texels) at every texel within `reach`, and one more, to which no other one is nearer.
pub(crate) fn note_edge(
    [a, b]: [[f64; 2]; 2],
    half_edge: u32,
    reach: usize,
    size: [usize; 2],
    nearest: &mut [Option<Nearest>],
) {
    // A box that left some of them out would leave them to an edge that is farther away.
    for_texels([a, b, b], reach + 1, size, |texel, centre| {
        let (along, distance) = on_segment(a, b, centre);
        if distance <= reach as f64 + 1.0 && nearest[texel].is_none_or(|found| distance < found.distance) {
            nearest[texel] = Some(Nearest { distance, half_edge, along });
        }
    });
}

/// The place in the plane of the other side of an edge. `here` and `there` are its ends on the two sides, in the order of this one. Along
/// the edge both sides are measured by its own length, so that they agree on it whatever their stretch.
pub(crate) fn across([from, to]: [[f64; 2]; 2], there: [[f64; 2]; 2], at: [f64; 2]) -> [f64; 2] {
    let [from, to] = [from, to].map(Vector2::from);
    let there = there.map(Vector2::from);
    let (edge, other) = (to - from, there[1] - there[0]);
    let offset = Vector2::from(at) - from;
    let along = offset.dot(&edge) / edge.norm_squared();
    let beyond = edge.perp(&offset) / edge.norm();
    (there[0] + along * other + beyond * Vector2::new(-other.y, other.x).normalize()).into()
}

/// Calls `visit` with every texel (index, centre in texels) of the box of three points, widened by `margin`.
pub(crate) fn for_texels(
    corners: [[f64; 2]; 3],
    margin: usize,
    [width, height]: [usize; 2],
    mut visit: impl FnMut(usize, [f64; 2]),
) {
    let range = |k: usize, count: usize| {
        let low = corners[0][k].min(corners[1][k]).min(corners[2][k]) - margin as f64 - 0.5;
        let high = corners[0][k].max(corners[1][k]).max(corners[2][k]) + margin as f64 - 0.5;
        (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).clamp(0.0, count as f64) as usize)
    };
    for level in range(1, height) {
        for column in range(0, width) {
            visit((height - 1 - level) * width + column, [column as f64 + 0.5, level as f64 + 0.5]);
        }
    }
}

/// Place along a segment (0 to 1) of the point nearest to `at`, and the distance.
fn on_segment(a: [f64; 2], b: [f64; 2], at: [f64; 2]) -> (f64, f64) {
    let (a, b, at) = (Vector2::from(a), Vector2::from(b), Vector2::from(at));
    let along = ((at - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    (along, (a + along * (b - a) - at).norm())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The other side is turned by a quarter and half as long again: the share of the edge stays, and so does the distance from it.
    #[test]
    fn a_place_beyond_an_edge_keeps_its_share_and_its_distance() {
        let (here, there) = ([[0.0, 0.0], [2.0, 0.0]], [[5.0, 5.0], [5.0, 8.0]]);
        for (at, expected) in
            [([0.0, 0.0], [5.0, 5.0]), ([2.0, 0.0], [5.0, 8.0]), ([1.0, 0.5], [4.5, 6.5]), ([3.0, -0.25], [5.25, 9.5])]
        {
            let found = across(here, there, at);
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{at:?}: {found:?} for {expected:?}");
        }
    }

    /// Every texel whose centre is within the reach of an edge, and no other, has it, at its distance from the segment.
    #[test]
    fn edges_are_noted_at_the_texels_around_them() {
        let (size, reach) = ([20, 15], 3);
        let (a, b) = ([4.2, 6.1], [13.7, 9.4]);
        let mut nearest = vec![None; size[0] * size[1]];
        note_edge([a, b], 7, reach, size, &mut nearest);
        for (k, found) in nearest.iter().enumerate() {
            let centre = [(k % size[0]) as f64 + 0.5, (size[1] - 1 - k / size[0]) as f64 + 0.5];
            // By brute force along the segment.
            let to = |s: f64| (a[0] + s * (b[0] - a[0]) - centre[0]).hypot(a[1] + s * (b[1] - a[1]) - centre[1]);
            let distance = (0..=10_000).map(|s| to(f64::from(s) / 10_000.0)).fold(f64::INFINITY, f64::min);
            match found {
                Some(Nearest { distance: d, half_edge, along }) => {
                    assert!(*half_edge == 7 && (d - distance).abs() < 1e-3 && (to(*along) - d).abs() < 1e-12);
                }
                None => assert!(distance > reach as f64 + 1.0 - 1e-3, "texel {k} at {distance}"),
            }
        }
        assert!(nearest.iter().flatten().count() > 60);
    }
}
