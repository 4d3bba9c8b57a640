//! How alike two pictures are. Inks in `[0, 1]`; the first picture is clipped there first.

mod darker;

pub use darker::darker_than_wanted;

use crate::error::Error;
use crate::image::Image;

/// Peak signal-to-noise ratio in dB: `-10 log10 mean (o - y)²`, over the pixels of positive weight.
pub fn psnr(picture: &Image, reference: &Image, weight: Option<&Image>) -> Result<f64, Error> {
    check(picture, reference, weight)?;
    let (mut sum, mut count) = (0.0, 0.0);
    for (k, (o, y)) in picture.data().iter().zip(reference.data()).enumerate() {
        if weight.is_none_or(|w| w.data()[k] > 0.0) {
            sum += (o.clamp(0.0, 1.0) - y).powi(2);
            count += 1.0;
        }
    }
    // 200 dB stands for identical pictures.
    Ok(-10.0 * (sum / count + 1e-20).log10())
}

/// Binary cross-entropy in nats per pixel, inks clipped to `[1e-6, 1 - 1e-6]`.
pub fn binary_cross_entropy(picture: &Image, reference: &Image) -> Result<f64, Error> {
    check(picture, reference, None)?;
    let sum: f64 = picture
        .data()
        .iter()
        .zip(reference.data())
        .map(|(o, y)| {
            let o = o.clamp(1e-6, 1.0 - 1e-6);
            -(y * o.ln() + (1.0 - y) * (-o).ln_1p())
        })
        .sum();
    Ok(sum / picture.data().len() as f64)
}

/// Structural similarity with a uniform 7x7 window and sample covariance (Wang et al. 2004; K₁ = 0.01, K₂ = 0.03), mean over
/// the pixels whose window lies inside the picture and on pixels of positive weight.
pub fn ssim(picture: &Image, reference: &Image, weight: Option<&Image>) -> Result<f64, Error> {
    windowed_ssim(picture, reference, weight, None, &[1.0 / 7.0; 7], 49.0 / 48.0)
}

/// [`ssim`] as the mean over the windows about some pixels only.
pub fn ssim_at(picture: &Image, reference: &Image, weight: Option<&Image>, centres: &[bool]) -> Result<f64, Error> {
    windowed_ssim(picture, reference, weight, Some(centres), &[1.0 / 7.0; 7], 49.0 / 48.0)
}

/// Structural similarity with an 11x11 Gaussian window of σ = 1.5 and population covariance.
pub fn ssim_gaussian(picture: &Image, reference: &Image, weight: Option<&Image>) -> Result<f64, Error> {
    let taps: Vec<f64> = (-5..=5).map(|d: i32| (-f64::from(d * d) / 4.5).exp()).collect();
    let total: f64 = taps.iter().sum();
    let taps: Vec<f64> = taps.iter().map(|t| t / total).collect();
    windowed_ssim(picture, reference, weight, None, &taps, 1.0)
}

/// The windows of [`ssim`]: the pixel in the middle of each, and the similarity there.
pub(crate) fn ssim_windows(
    picture: &Image,
    reference: &Image,
    weight: Option<&Image>,
) -> Result<Vec<(usize, f64)>, Error> {
    windows(picture, reference, weight, &[1.0 / 7.0; 7], 49.0 / 48.0)
}

fn windowed_ssim(
    picture: &Image,
    reference: &Image,
    weight: Option<&Image>,
    centres: Option<&[bool]>,
    taps: &[f64],
    covariance_scale: f64,
) -> Result<f64, Error> {
    check(picture, reference, weight)?;
    let (width, height) = picture.size();
    if let Some(centres) = centres.filter(|centres| centres.len() != width * height) {
        return Err(Error::Mismatch { what: "centres", found: (centres.len(), 1), expected: (width, height) });
    }
    let mut all = windows(picture, reference, weight, taps, covariance_scale)?;
    all.retain(|(centre, _)| centres.is_none_or(|centres| centres[*centre]));
    if all.is_empty() {
        return Err(Error::EmptyProblem("no window of the similarity lies wholly on weighted pixels"));
    }
    Ok(all.iter().map(|(_, similarity)| similarity).sum::<f64>() / all.len() as f64)
}

/// Windows of which no pixel is left out, each with its middle.
fn windows(
    picture: &Image,
    reference: &Image,
    weight: Option<&Image>,
    taps: &[f64],
    covariance_scale: f64,
) -> Result<Vec<(usize, f64)>, Error> {
    check(picture, reference, weight)?;
    let (width, height) = picture.size();
    let n = taps.len();
    if width < n || height < n {
        return Err(Error::Mismatch {
            what: "picture (smaller than the window)",
            found: (width, height),
            expected: (n, n),
        });
    }
    let clipped = picture.map(|v| v.clamp(0.0, 1.0));
    let (x, y) = (&clipped, reference);
    // Local weighted mean over the window whose top-left corner is (i, j), in two passes.
    let local = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let mut across = vec![0.0; (width - n + 1) * height];
        for j in 0..height {
            for i in 0..=width - n {
                across[j * (width - n + 1) + i] =
                    taps.iter().enumerate().map(|(k, t)| t * value(j * width + i + k)).sum();
            }
        }
        let columns = width - n + 1;
        let mut out = vec![0.0; columns * (height - n + 1)];
        for j in 0..=height - n {
            for i in 0..columns {
                out[j * columns + i] = taps.iter().enumerate().map(|(k, t)| t * across[(j + k) * columns + i]).sum();
            }
        }
        out
    };
    let mean_x = local(&|k| x.data()[k]);
    let mean_y = local(&|k| y.data()[k]);
    let xx = local(&|k| x.data()[k] * x.data()[k]);
    let yy = local(&|k| y.data()[k] * y.data()[k]);
    let xy = local(&|k| x.data()[k] * y.data()[k]);
    let left_out = weight.map(|w| local(&|k| f64::from(u8::from(w.data()[k] <= 0.0))));
    let (c1, c2) = (0.01_f64.powi(2), 0.03_f64.powi(2));
    let columns = width - n + 1;
    let similarity = |k: usize| {
        let (mx, my) = (mean_x[k], mean_y[k]);
        let (vx, vy) = (covariance_scale * (xx[k] - mx * mx), covariance_scale * (yy[k] - my * my));
        let vxy = covariance_scale * (xy[k] - mx * my);
        (2.0 * mx * my + c1) * (2.0 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    };
    let counts = |k: &usize| left_out.as_ref().is_none_or(|left_out| left_out[*k] <= 1e-12);
    let middle = |k: usize| (k / columns + n / 2) * width + k % columns + n / 2;
    Ok((0..mean_x.len()).filter(counts).map(|k| (middle(k), similarity(k))).collect())
}

fn check(picture: &Image, reference: &Image, weight: Option<&Image>) -> Result<(), Error> {
    let expected = reference.size();
    for (what, size) in [("picture", picture.size()), ("weight", weight.map_or(expected, Image::size))] {
        if size != expected {
            return Err(Error::Mismatch { what, found: size, expected });
        }
    }
    if weight.is_some_and(|w| w.data().iter().all(|&v| v <= 0.0)) {
        return Err(Error::EmptyProblem("every pixel has weight 0"));
    }
    Ok(())
}
