//! Values from outside: the hash, textures and metrics against numpy and scikit-image, closed forms, an outside optimiser.

use paint_net::painters::MatchingPursuit;
use paint_net::procedural::{Texture, lattice};
use paint_net::{Deconvolution, Image, Limits, PaintProblem, Painter, SprayKernel, ideal, metrics};

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

#[test]
fn hash_and_textures_match_numpy() {
    // Hex floats 0x1.138825713c12p-3 and 0x1.7190186e79c35p-1.
    assert_eq!(lattice(1000, 0, 0), f64::from_bits(0x3FC1_3882_5713_C120));
    assert_eq!(lattice(1000, 3, -2), f64::from_bits(0x3FE7_1901_86E7_9C35));
    // numpy, 128 x 128, seed 1000: mean, standard deviation, value at column 10, row 20.
    let expected = [
        (Texture::Fbm, 0.48899, 0.223707, 0.598635),
        (Texture::Worley, 0.52833, 0.206035, 0.566857),
        (Texture::Brick, 0.515474, 0.21892, 0.591762),
        (Texture::Stripes, 0.500312, 0.318529, 0.110525),
        (Texture::Glyph, 0.318742, 0.400974, 0.0),
    ];
    for (texture, mean, deviation, value) in expected {
        let image = texture.image(1000, 128);
        let n = image.data().len() as f64;
        let m = image.data().iter().sum::<f64>() / n;
        let v = image.data().iter().map(|x| (x - m).powi(2)).sum::<f64>() / n;
        close(m, mean, 1e-5);
        close(v.sqrt(), deviation, 1e-5);
        close(image.at(10, 20), value, 1e-6);
    }
}

#[test]
fn metrics_match_scikit_image() {
    let y = Image::from_fn(16, 16, |x, y| (x + y) as f64 / 31.0);
    let o = y.map(|v| 0.9 * v);
    close(metrics::psnr(&o, &y, None).unwrap(), 25.553996013, 1e-8);
    close(metrics::ssim(&o, &y, None).unwrap(), 0.989286219, 1e-8);
    close(metrics::ssim_gaussian(&o, &y, None).unwrap(), 0.989511019, 1e-8);
    let bce = metrics::binary_cross_entropy(&o, &y).unwrap();
    close(bce, 0.602073756, 1e-8);
    close(bce - metrics::binary_cross_entropy(&y, &y).unwrap(), 0.006871504, 1e-8);
}

/// Mean PSNR of a painter over the five textures of 128 x 128 pixels, nozzle σ = 2 px cut at 4 px, cells every 2 px.
fn mean_psnr(painter: &dyn Painter, limits: &Limits) -> f64 {
    let kernel = SprayKernel::new(2.0, 2.0).unwrap();
    let total: f64 = Texture::ALL
        .iter()
        .map(|texture| {
            let wanted = texture.image(1000, 128);
            let painting = painter.paint(&PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(limits)).unwrap();
            metrics::psnr(&painting.ink, &wanted, None).unwrap()
        })
        .sum();
    total / 5.0
}

#[test]
fn deconvolution_reaches_scipys_optimum() {
    // `scipy.optimize` L-BFGS-B, 200 iterations, same problem: 29.15 dB in the mean; the Gaussian-filtered pictures: 22.50 dB.
    let reached = mean_psnr(&Deconvolution::default(), &Limits::default());
    assert!(reached >= 29.10, "mean PSNR {reached}");
    let filtered: f64 = Texture::ALL
        .iter()
        .map(|t| {
            let wanted = t.image(1000, 128);
            metrics::psnr(&ideal(&wanted, 2.0).unwrap(), &wanted, None).unwrap()
        })
        .sum();
    close(filtered / 5.0, 22.50, 0.01);
}

#[test]
fn pursuit_reaches_the_greedy_baseline() {
    // numpy greedy on a grid of 1 px, 1600 placements: 22.99 dB, after a joint refit 26.12 dB.
    let limits = Limits { spray_spacing: 1, row_spacing: 1, ..Limits::default() };
    let greedy = MatchingPursuit { placements: 1600, min_gain: 1e-12, refit: 0, ..MatchingPursuit::default() };
    close(mean_psnr(&greedy, &limits), 22.99, 0.15);
    let refitted = mean_psnr(&MatchingPursuit { refit: 200, ..greedy }, &limits);
    assert!(refitted > 26.0, "mean PSNR {refitted}");
}
