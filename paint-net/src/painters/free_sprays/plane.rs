//! A single-precision image plane and its blur.

/// A picture in single precision without margins.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

/// Gaussian mean over each pixel's neighbours; the border goes on outside as it is.
pub(super) fn blur(plane: &Plane, sigma: f32) -> Plane {
    let (width, height) = (plane.width, plane.values.len() / plane.width);
    let longest = width.max(height);
    let radius = ((3.0 * sigma).ceil() as usize).min(longest);
    let taps: Vec<f32> =
        (0..=2 * radius).map(|k| (-0.5 * ((k as f32 - radius as f32) / sigma).powi(2)).exp()).collect();
    let total: f32 = taps.iter().sum();
    let mut out = Plane { width, values: vec![0.0; plane.values.len()] };
    let mut line = vec![0.0; width + 2 * radius];
    for (y, to) in out.values.chunks_exact_mut(width).enumerate() {
        // Down into the middle of the line, which is then continued to both sides and blurred along.
        let middle = &mut line[radius..radius + width];
        middle.fill(0.0);
        for (k, tap) in taps.iter().enumerate() {
            let j = (y + k).saturating_sub(radius).min(height - 1);
            let row = &plane.values[j * width..(j + 1) * width];
            middle.iter_mut().zip(row).for_each(|(l, v)| *l += tap / total * v);
        }
        let (first, last) = (line[radius], line[radius + width - 1]);
        line[..radius].fill(first);
        line[radius + width..].fill(last);
        for (k, tap) in taps.iter().enumerate() {
            to.iter_mut().zip(&line[k..]).for_each(|(o, v)| *o += tap / total * v);
        }
    }
    out
}
