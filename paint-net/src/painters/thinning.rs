//! Thinning of a mask to lines one pixel wide.

/// Offsets of the eight neighbours, clockwise from the one above.
pub(super) const AROUND: [(isize, isize); 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// The neighbour of a pixel at an offset, if it lies in the picture.
pub(super) fn neighbour(k: usize, (dx, dy): (isize, isize), width: usize, pixels: usize) -> Option<usize> {
    let x = (k % width).checked_add_signed(dx).filter(|&x| x < width)?;
    let y = (k / width).checked_add_signed(dy).filter(|&y| y < pixels / width)?;
    Some(y * width + x)
}

/// Takes pixels off the borders of a mask until only lines are left that hold together as the mask did (Zhang and Suen 1984,
/// with the condition of Lü and Wang 1986 that keeps diagonal lines of two pixels), and makes those one pixel wide.
pub(super) fn thin(mask: &[bool], width: usize) -> Vec<bool> {
    let mut left = mask.to_vec();
    loop {
        let mut changed = false;
        for pass in 0..2 {
            let goes: Vec<usize> = (0..left.len()).filter(|&k| left[k] && is_border(&left, k, width, pass)).collect();
            changed |= !goes.is_empty();
            for k in goes {
                left[k] = false;
            }
        }
        if !changed {
            break;
        }
    }
    // What is left is two pixels wide on diagonals and at ends.
    for k in 0..left.len() {
        left[k] = left[k] && !is_spare(&left, k, width);
    }
    left
}

fn ring(mask: &[bool], k: usize, width: usize) -> [bool; 8] {
    AROUND.map(|at| neighbour(k, at, width, mask.len()).is_some_and(|n| mask[n]))
}

/// Whether the neighbours of a pixel hold together without it, by sides or corners (Hilditch's crossing number), and it is no end.
fn is_spare(mask: &[bool], k: usize, width: usize) -> bool {
    let around = ring(mask, k, width);
    let parts = [0, 2, 4, 6].iter().filter(|&&i| !around[i] && (around[i + 1] || around[(i + 2) % 8])).count();
    parts == 1 && around.iter().filter(|&&set| set).count() >= 2
}

fn is_border(mask: &[bool], k: usize, width: usize, pass: usize) -> bool {
    let around = ring(mask, k, width);
    let count = around.iter().filter(|&&set| set).count();
    let rises = (0..8).filter(|&i| !around[i] && around[(i + 1) % 8]).count();
    let [above, _, right, _, below, _, left, _] = around;
    // The first pass takes borders at the right and below, the second those at the left and above.
    let inside = if pass == 0 { right && below && (above || left) } else { above && left && (right || below) };
    (3..=6).contains(&count) && rises == 1 && !inside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Vec<bool> {
        rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect()
    }

    #[test]
    fn a_bar_becomes_its_middle_and_a_ring_stays_a_ring() {
        let bar = mask(&["............", ".##########.", ".##########.", ".##########.", "............"]);
        let thinned = thin(&bar, 12);
        assert!((3..9).all(|x| thinned[2 * 12 + x]), "the middle row");
        assert!((0..12).all(|x| !thinned[12 + x] && !thinned[3 * 12 + x]), "only the middle row");
        let ring = |x: usize, y: usize| {
            let r = (x as f64 - 15.0).hypot(y as f64 - 15.0);
            (7.0..12.0).contains(&r)
        };
        let disc: Vec<bool> = (0..31 * 31).map(|k| ring(k % 31, k / 31)).collect();
        let thinned = thin(&disc, 31);
        let kept: Vec<usize> = (0..31 * 31).filter(|&k| thinned[k]).collect();
        for &k in &kept {
            let r = ((k % 31) as f64 - 15.0).hypot((k / 31) as f64 - 15.0);
            assert!((8.0..11.0).contains(&r), "radius {r}");
            let neighbours = AROUND.iter().filter_map(|&at| neighbour(k, at, 31, thinned.len()));
            assert!(neighbours.filter(|&n| thinned[n]).count() >= 2, "the ring is not cut");
        }
        assert!(kept.len() > 50);
    }
}
