//! Distance of every pixel to the nearest one of a set.

/// Distance of two places.
pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Euclidean distances in pixels to the nearest pixel that is set, infinite where none is: lower envelopes of parabolas along
/// columns, then along rows (Felzenszwalb and Huttenlocher 2012).
pub(super) fn distances(set: &[bool], width: usize) -> Vec<f64> {
    let height = set.len() / width;
    let mut squares: Vec<f64> = set.iter().map(|&s| if s { 0.0 } else { f64::INFINITY }).collect();
    let mut line = vec![0.0; height];
    for x in 0..width {
        (0..height).for_each(|y| line[y] = squares[y * width + x]);
        for (y, square) in envelope(&line).into_iter().enumerate() {
            squares[y * width + x] = square;
        }
    }
    for row in squares.chunks_exact_mut(width) {
        let lowest = envelope(row);
        row.copy_from_slice(&lowest);
    }
    squares.iter().map(|square| square.sqrt()).collect()
}

/// `min_q (p - q)² + f(q)` for every `p`.
fn envelope(f: &[f64]) -> Vec<f64> {
    // Apex of each parabola of the envelope, and where it begins to be the lowest.
    let mut parabolas: Vec<(usize, f64)> = Vec::new();
    for (q, &height) in f.iter().enumerate().filter(|(_, height)| height.is_finite()) {
        let from = loop {
            let Some(&(apex, begin)) = parabolas.last() else { break f64::NEG_INFINITY };
            let (a, b) = (apex as f64, q as f64);
            let meet = (height + b * b - f[apex] - a * a) / (2.0 * (b - a));
            if meet > begin {
                break meet;
            }
            parabolas.pop();
        };
        parabolas.push((q, from));
    }
    let mut current = 0;
    let lowest = |p: usize| {
        while parabolas.get(current + 1).is_some_and(|&(_, begin)| begin < p as f64) {
            current += 1;
        }
        parabolas.get(current).map_or(f64::INFINITY, |&(apex, _)| (p as f64 - apex as f64).powi(2) + f[apex])
    };
    (0..f.len()).map(lowest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    #[test]
    fn distances_are_those_of_brute_force() {
        let (width, height) = (23, 17);
        let set: Vec<bool> = (0..width * height).map(|k| lattice(7, k as i64, 3) > 0.97).collect();
        assert!(set.contains(&true));
        let found = distances(&set, width);
        for (k, found) in found.iter().enumerate() {
            let to =
                |q: usize| ((k % width) as f64 - (q % width) as f64).hypot((k / width) as f64 - (q / width) as f64);
            let expected = (0..set.len()).filter(|&q| set[q]).map(to).fold(f64::INFINITY, f64::min);
            assert!((found - expected).abs() < 1e-9, "pixel {k}: {found} for {expected}");
        }
        assert!(distances(&[false; 6], 3).iter().all(|d| d.is_infinite()));
    }
}
