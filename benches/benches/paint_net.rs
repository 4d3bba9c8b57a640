//! The painters on procedural pictures of 128 x 128 pixels, with the thesis' nozzle and ink.

use paint_net::painters::{Layered, MatchingPursuit};
use paint_net::procedural::Texture;
use paint_net::{Deconvolution, Error, Feedback, PaintProblem, Painter, SprayKernel, metrics};
use paintcopter_benches::criterion;

/// Side of the pictures, pixels.
const SIDE: usize = 128;
/// Seed of the pictures, that of the peers' procedural set.
const SEED: u64 = 1000;

fn main() -> Result<(), Error> {
    // σ = 2 px, cut at 4 px.
    let kernel = SprayKernel::new(2.0, 2.0)?;
    let feedback = Feedback::shipped()?;
    let painters: [&dyn Painter; 3] = [&feedback, &Deconvolution::default(), &MatchingPursuit::default()];

    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("paint-net");
    for (name, texture) in [("clouds", Texture::Fbm), ("brick", Texture::Brick)] {
        let wanted = texture.image(SEED, SIDE);
        let problem = PaintProblem::new(&wanted).with_kernel(&kernel);
        for painter in painters {
            painter.paint(&problem)?;
            group.bench_function(format!("{} of {name}", painter.name()), |b| {
                b.iter(|| painter.paint(&problem));
            });
        }
        let layered = Layered::new(Deconvolution::default());
        layered.paint(&problem)?;
        group.bench_function(format!("layered deconvolution of {name}"), |b| {
            b.iter(|| layered.paint(&problem));
        });
    }
    let (one, other) = (Texture::Fbm.image(SEED, SIDE), Texture::Brick.image(SEED, SIDE));
    metrics::ssim(&one, &other, None)?;
    group.bench_function("structural similarity", |b| b.iter(|| metrics::ssim(&one, &other, None)));
    group.finish();
    criterion.final_summary();
    Ok(())
}
