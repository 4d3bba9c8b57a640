//! Colour separation for six paints over each other on sandstone, 36 bands, one core: pixel by pixel, and one step of the fit of all sprays.

use std::error::Error;

use criterion::Throughput;
use paint_net::colour::{ColourFit, FootprintSet, TexelSeparation};
use paint_net::painters::SurfaceFootprint;
use paint_sim::colour::linear_srgb_lab;
use paint_sim::paint::FilmStack;
use paint_sim::{Paint, Substrate};
use paintcopter::adapters::FilmsOnWall;
use paintcopter::mural::Mural;
use paintcopter::palette_choice::PaletteChoice;
use paintcopter_benches::criterion;

/// Texels of the mural, and texels across.
const TEXELS: usize = 100_000;
const WIDTH: usize = 460;
/// Side of the picture whose sprays are fitted, texels; a spray on every second.
const SIDE: usize = 128;

fn main() -> Result<(), Box<dyn Error>> {
    let paints: Vec<Paint> = PaletteChoice::Six.candidates(None)?.paints.iter().map(|paint| paint.paint).collect();
    let stack = FilmStack::new(&paints, 20e-6, 4.0)?;
    let ground = [FilmStack::bands(Substrate::sandstone().reflectance())];
    let of_pixel = vec![0; TEXELS];
    let model = FilmsOnWall { stack: &stack, grounds: &ground, of_pixel: &of_pixel };
    let place = |k: usize, width: usize| [k % width, k / width].map(|c| 0.01 * c as f64);
    let colour = |at: [f64; 2], extent: [f64; 2]| linear_srgb_lab(Mural { seed: 1 }.colour(at, extent));
    let wanted: Vec<_> = (0..TEXELS).map(|k| Some(colour(place(k, WIDTH), [4.6, 2.2]))).collect();

    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("separation");
    group.throughput(Throughput::Elements(TEXELS as u64));
    let separation = TexelSeparation::default();
    separation.separate(&wanted, &model)?;
    group.bench_function("1e5 texels, 6 paints", |b| b.iter(|| separation.separate(&wanted, &model)));

    let square: Vec<[f64; 3]> = (0..SIDE * SIDE).map(|k| colour(place(k, SIDE), [1.28, 1.28])).collect();
    let weight = vec![1.0; SIDE * SIDE];
    let spots = FootprintSet::of((0..SIDE * SIDE / 4).map(spot))?;
    let fit = ColourFit {
        wanted: &square,
        weight: &weight,
        model: &model,
        footprints: &[&spots; 6],
        min_volume: 0.0,
        max_volume: 4.0,
        paint_weight: 0.3,
        prices: &[],
        iterations: 80,
        tolerance: 3e-4,
        threads: 1,
    };
    let start = vec![vec![0.05; spots.len()]; 6];
    fit.solve(&mut start.clone(), &mut |_| ())?;
    group.bench_function("all sprays of 128 x 128 texels, 6 paints", |b| {
        b.iter(|| fit.solve(&mut start.clone(), &mut |_| ()));
    });
    group.finish();
    criterion.final_summary();
    Ok(())
}

/// A round spot of two texels' deviation about every second texel of every second row.
fn spot(cell: usize) -> SurfaceFootprint {
    let [x, y] = [cell % (SIDE / 2), cell / (SIDE / 2)].map(|c| 2 * c as i64);
    let share = |dx: i64, dy: i64| (-((dx * dx + dy * dy) as f64) / 8.0).exp() as f32;
    let around = (-6..=6).flat_map(|dy| (-6..=6).map(move |dx| (dx, dy)));
    let inside = around.filter(|(dx, dy)| {
        (0..SIDE as i64).contains(&(x + dx)) && (0..SIDE as i64).contains(&(y + dy)) && dx * dx + dy * dy <= 49
    });
    inside.map(|(dx, dy)| (((y + dy) * SIDE as i64 + x + dx) as u32, share(dx, dy))).collect()
}
