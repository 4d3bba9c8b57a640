//! Corners by the accelerated segment test: nine of sixteen pixels on a circle are all brighter, or all darker, than its middle
//! (FAST-9, Rosten and Drummond 2006).

use crate::place_recognition::grey_image::GreyImage;

/// The circle of radius three, in order.
const CIRCLE: [[isize; 2]; 16] = [
    [0, -3],
    [1, -3],
    [2, -2],
    [3, -1],
    [3, 0],
    [3, 1],
    [2, 2],
    [1, 3],
    [0, 3],
    [-1, 3],
    [-2, 2],
    [-3, 1],
    [-3, 0],
    [-3, -1],
    [-2, -2],
    [-1, -3],
];
const ARC: u32 = 9;
/// Contrast of a corner, grey levels (ours): rooms are dim, and what is noise does not come back.
const THRESHOLD: i32 = 12;
/// Cells along each side of an image among which corners are shared out, so that one poster does not take them all (ours).
const CELLS: usize = 8;

/// A corner, and how much it stands out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub(super) u: usize,
    pub(super) v: usize,
    pub(super) score: i32,
}

/// At most about `count` corners, `border` pixels from the rim or more: the best of each cell of a grid, no two touching.
pub(super) fn corners(image: &GreyImage, count: usize, border: usize) -> Vec<Corner> {
    let (w, h) = (image.width, image.height);
    let border = border.max(4);
    if w <= 2 * border || h <= 2 * border {
        return Vec::new();
    }
    let circle = CIRCLE.map(|[x, y]| y * w as isize + x);
    let mut scores = vec![0_i32; w * h];
    for v in border - 1..=h - border {
        for u in border - 1..=w - border {
            scores[v * w + u] = score(&image.pixels, v * w + u, &circle);
        }
    }
    let mut cells: Vec<Vec<Corner>> = vec![Vec::new(); CELLS * CELLS];
    for v in border..h - border {
        for u in border..w - border {
            let at = v * w + u;
            let score = scores[at];
            // Of equal neighbours the first one stays.
            let is_peak = score > 0
                && [at - w - 1, at - w, at - w + 1, at - 1].iter().all(|k| scores[*k] < score)
                && [at + 1, at + w - 1, at + w, at + w + 1].iter().all(|k| scores[*k] <= score);
            if is_peak {
                let cell = (v - border) * CELLS / (h - 2 * border) * CELLS + (u - border) * CELLS / (w - 2 * border);
                cells[cell].push(Corner { u, v, score });
            }
        }
    }
    shared_out(cells, count)
}

/// The best of each cell in turns until there are enough.
fn shared_out(mut cells: Vec<Vec<Corner>>, count: usize) -> Vec<Corner> {
    for cell in &mut cells {
        cell.sort_by_key(|c| (-c.score, c.v, c.u));
    }
    let mut out = Vec::new();
    for rank in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
        let mut round: Vec<Corner> = cells.iter().filter_map(|cell| cell.get(rank).copied()).collect();
        round.sort_by_key(|c| (-c.score, c.v, c.u));
        out.extend(round);
        if out.len() >= count {
            break;
        }
    }
    out.truncate(count);
    out
}

/// By how much the circle differs from its middle beyond the threshold; 0 where there is no arc.
fn score(pixels: &[u8], at: usize, circle: &[isize; 16]) -> i32 {
    let middle = i32::from(pixels[at]);
    let off = |k: usize| i32::from(pixels[at.wrapping_add_signed(circle[k])]) - middle;
    // Of every arc of nine, two neighbours among these four are part.
    let compass = [0, 4, 8, 12].map(off);
    let beyond = |sign: i32| compass.iter().filter(|o| sign * **o > THRESHOLD).count();
    if beyond(1) < 2 && beyond(-1) < 2 {
        return 0;
    }
    let all: [i32; 16] = std::array::from_fn(off);
    [1, -1]
        .map(|sign| {
            let mask = (0..16).fold(0_u32, |m, k| m | u32::from(sign * all[k] > THRESHOLD) << k);
            if !has_arc(mask) {
                return 0;
            }
            all.iter().map(|o| (sign * o - THRESHOLD).max(0)).sum()
        })
        .into_iter()
        .max()
        .unwrap_or(0)
}

/// Whether nine bits in a row are set, around the end too.
fn has_arc(mask: u32) -> bool {
    let around = mask | mask << 16;
    (1..ARC).fold(around, |run, k| run & around >> k) & 0xffff != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, grey: impl Fn(usize, usize) -> u8) -> GreyImage {
        GreyImage { width, height, pixels: (0..width * height).map(|k| grey(k % width, k / width)).collect() }
    }

    /// Wherever an arc begins, bright or dark; what differs besides does not hide it.
    #[test]
    fn a_corner_counts_what_its_circle_differs_by() {
        let circle: [isize; 16] = std::array::from_fn(|k| k as isize + 1);
        for (start, length, sign) in (0..16).flat_map(|s| [(s, 9, 1), (s, 9, -1), (s, 8, 1), (s, 13, -1)]) {
            let mut pixels = vec![100_u8; 17];
            for k in 0..length {
                pixels[1 + (start + k) % 16] = (100 + sign * (THRESHOLD + 10)) as u8;
            }
            let expected = if length < 9 { 0 } else { 10 * length as i32 };
            assert_eq!(score(&pixels, 0, &circle), expected, "{start} {length} {sign}");
        }
    }

    #[test]
    fn arcs_of_nine_are_found_wherever_they_begin() {
        for start in 0..16 {
            let arc = |length: u32| (0..length).fold(0_u32, |m, k| m | 1 << ((start + k) % 16));
            assert!(has_arc(arc(9)) && has_arc(arc(16)) && !has_arc(arc(8)), "{start}");
        }
        assert!(!has_arc(0b1111_0111_1011_1101));
    }

    /// A square has four corners; its edges and a plain wall have none.
    #[test]
    fn a_square_has_four_corners() {
        let square = image(80, 60, |u, v| if (30..50).contains(&u) && (20..40).contains(&v) { 200 } else { 50 });
        let mut found: Vec<(usize, usize)> = corners(&square, 100, 8).iter().map(|c| (c.u, c.v)).collect();
        found.sort_unstable();
        assert_eq!(found.len(), 4, "{found:?}");
        for ((u, v), (x, y)) in found.into_iter().zip([(30, 20), (30, 39), (49, 20), (49, 39)]) {
            assert!(u.abs_diff(x) <= 1 && v.abs_diff(y) <= 1, "{u} {v}");
        }
        assert!(corners(&image(80, 60, |u, _| if u < 40 { 50 } else { 200 }), 100, 8).is_empty(), "an edge");
        assert!(corners(&image(10, 10, |_, _| 0), 100, 8).is_empty(), "too small");
    }

    /// One busy corner of the image does not take all.
    #[test]
    fn corners_are_shared_out() {
        let busy = |u: usize, v: usize| if u < 40 && v < 30 && (u / 5 + v / 5).is_multiple_of(2) { 250 } else { 60 };
        let lone = |u: usize, v: usize| (100..110).contains(&u) && (70..80).contains(&v);
        let found = corners(&image(160, 120, |u, v| if lone(u, v) { 90 } else { busy(u, v) }), 12, 8);
        assert_eq!(found.len(), 12);
        assert!(found.iter().any(|c| c.u > 90), "{found:?}");
    }
}
