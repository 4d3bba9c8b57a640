//! Which way is up in a mesh.

use crate::min_area_rectangle::convex_hull;

/// What lies this share of the longest side above the lowest point still touches the ground.
const TOUCHES: f64 = 0.015;
/// A side on which a thing stands touches the ground with this share of its box, feet included.
const STANDS: f64 = 0.12;
/// It does so with this many times what any other side would.
const CLEARLY: f64 = 2.0;
/// Eastings and northings are this many times as large as heights.
const SURVEYED: f64 = 8.0;

/// An axis that points up, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Up {
    /// Unit vector along an axis of the file.
    pub direction: [f64; 3],
    /// What told so.
    pub evidence: UpEvidence,
}

/// What tells which way is up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UpEvidence {
    /// The mesh stands on a base or on feet, or is cut off flat below.
    Base,
    /// Two coordinates are large as those of a map, the third is small: the height.
    Surveyed,
}

/// The axis of the file that points up, as far as the mesh tells; `positions` are relative to `origin`. `None`: it does not, as a ball, a box or a
/// relief without a base. Fu et al. 2008, "Upright orientation of man-made objects", rank the sides on which a thing can stand; here one that
/// touches the ground far better than the other five is taken, and nothing is guessed otherwise.
pub fn up_axis(positions: &[[f32; 3]], faces: &[[u32; 3]], origin: [f64; 3]) -> Option<Up> {
    let mut seen = vec![false; positions.len()];
    for &v in faces.iter().flatten() {
        if let Some(seen) = seen.get_mut(v as usize) {
            *seen = true;
        }
    }
    let used: Vec<[f64; 3]> =
        positions.iter().zip(seen).filter(|(_, seen)| *seen).map(|(p, _)| p.map(f64::from)).collect();
    base(&used).or_else(|| surveyed(&used, origin))
}

/// The opposite of the side on which it stands.
fn base(points: &[[f64; 3]]) -> Option<Up> {
    let (low, high) = bounds(points)?;
    let extent = [0, 1, 2].map(|c| high[c] - low[c]);
    let near = TOUCHES * extent.iter().fold(0.0, |a: f64, b| a.max(*b));
    let mut sides: Vec<(f64, usize, f64)> = Vec::with_capacity(6);
    for axis in 0..3 {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let cross_section = extent[others[0]] * extent[others[1]];
        for (lowest, up) in [(low[axis], 1.0), (-high[axis], -1.0)] {
            let touching: Vec<[f64; 2]> =
                points.iter().filter(|p| up * p[axis] - lowest < near).map(|p| others.map(|c| p[c])).collect();
            let share = if cross_section > 0.0 { area(&convex_hull(&touching)) / cross_section } else { 1.0 };
            sides.push((share, axis, up));
        }
    }
    sides.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (share, axis, up) = sides[0];
    let mut direction = [0.0; 3];
    direction[axis] = up;
    (share >= STANDS && share >= CLEARLY * sides[1].0).then_some(Up { direction, evidence: UpEvidence::Base })
}

/// The axis along which a surveyed mesh is near zero.
fn surveyed(points: &[[f64; 3]], origin: [f64; 3]) -> Option<Up> {
    if origin == [0.0; 3] {
        return None;
    }
    let (low, high) = bounds(points)?;
    let away = [0, 1, 2].map(|c| (origin[c] + f64::midpoint(low[c], high[c])).abs());
    let height = (0..3).find(|&c| SURVEYED * away[c] < away[(c + 1) % 3].min(away[(c + 2) % 3]))?;
    let mut direction = [0.0; 3];
    direction[height] = 1.0;
    Some(Up { direction, evidence: UpEvidence::Surveyed })
}

fn bounds(points: &[[f64; 3]]) -> Option<([f64; 3], [f64; 3])> {
    let first = *points.first()?;
    let all = points.iter().all(|p| p.iter().all(|c| c.is_finite()));
    all.then(|| {
        points.iter().fold((first, first), |(low, high), p| {
            ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])))
        })
    })
}

/// Area of a convex polygon.
fn area(hull: &[[f64; 2]]) -> f64 {
    let next = hull.iter().cycle().skip(1);
    hull.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface of revolution about `axis`: radius over height from 0 to 1, as rings of 24 points.
    fn turned(axis: usize, up: f32, radius: impl Fn(f32) -> f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let (rings, n) = (40, 24_u32);
        let mut positions = Vec::new();
        for k in 0..=rings {
            let t = k as f32 / rings as f32;
            for i in 0..n {
                let (sin, cos) = (i as f32 / n as f32 * std::f32::consts::TAU).sin_cos();
                let mut p = [0.0; 3];
                p[axis] = up * t;
                p[(axis + 1) % 3] = radius(t) * cos;
                p[(axis + 2) % 3] = radius(t) * sin;
                positions.push(p);
            }
        }
        let faces =
            (0..rings as u32 * n).map(|v| [v, v + 1, v + n]).filter(|f| f[2] < (rings as u32 + 1) * n).collect();
        (positions, faces)
    }

    #[test]
    fn what_has_a_base_tells_which_way_is_up() {
        for axis in 0..3 {
            for up in [1.0, -1.0] {
                let (positions, faces) = turned(axis, up, |t| 0.3 * (1.0 - t * t).sqrt() + 0.001);
                let found = up_axis(&positions, &faces, [0.0; 3]).unwrap();
                let mut expected = [0.0; 3];
                expected[axis] = f64::from(up);
                assert_eq!(found, Up { direction: expected, evidence: UpEvidence::Base });
            }
        }
    }

    #[test]
    fn balls_and_columns_do_not_tell_and_a_map_does() {
        let ball = |t: f32| (0.25 - (t - 0.5).powi(2)).max(0.0).sqrt();
        let (positions, faces) = turned(2, 1.0, ball);
        assert_eq!(up_axis(&positions, &faces, [0.0; 3]), None);
        let (column, column_faces) = turned(0, 1.0, |_| 0.2);
        assert_eq!(up_axis(&column, &column_faces, [0.0; 3]), None);
        for (origin, direction) in
            [([431_250.0, 5_412_300.0, 212.0], [0.0, 0.0, 1.0]), ([431_250.0, 212.0, -5_412_300.0], [0.0, 1.0, 0.0])]
        {
            let found = up_axis(&positions, &faces, origin).unwrap();
            assert_eq!(found, Up { direction, evidence: UpEvidence::Surveyed });
        }
        assert_eq!(up_axis(&positions, &faces, [1e7; 3]), None);
        assert_eq!(up_axis(&[], &[], [0.0; 3]), None);
        assert_eq!(up_axis(&[[f32::NAN; 3]], &[[0, 0, 7]], [0.0; 3]), None);
    }
}
