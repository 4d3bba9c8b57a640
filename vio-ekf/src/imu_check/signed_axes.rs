//! Axes that are exchanged or turned round, and how they are called.

use nalgebra::Matrix3;

/// The other unit of rates.
pub(crate) const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

/// All 48 signed permutations of the axes, the identity first.
pub(crate) fn signed_permutations() -> impl Iterator<Item = Matrix3<f64>> {
    let orders = [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
    orders.into_iter().flat_map(|order| {
        (0..8_u8).map(move |signs| {
            Matrix3::from_fn(|r, c| match (order[r] == c, signs >> r & 1) {
                (false, _) => 0.0,
                (true, 0) => 1.0,
                (true, _) => -1.0,
            })
        })
    })
}

/// What the three readings would have to be, in terms of those given: `(z, -x, y)`.
pub(crate) fn axis_names(axes: &Matrix3<f64>) -> String {
    let row = |i: usize| {
        let column = (0..3).find(|&c| axes[(i, c)] != 0.0).unwrap_or(i);
        format!("{}{}", if axes[(i, column)] < 0.0 { "-" } else { "" }, ["x", "y", "z"][column])
    };
    format!("({}, {}, {})", row(0), row(1), row(2))
}
