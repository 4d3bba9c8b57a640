//! Deposit, colours and a picture of the rock on a GPU, beside the processor on one thread: wall time, because the work is done elsewhere.
//! `--adapter NAME` picks one; without a real GPU a software one stands in.

use std::error::Error;
use std::time::Instant;

use clap::Parser;
use nalgebra::{Point3, Vector3};
use paint_sim::paint::{FilmColours, GpuFilmColours};
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::GpuOptions;
use paint_sim::surface::{GpuSurface, Hit, Surface};
use paint_sim::{Camera, Film, Paint, Shot, SprayModel, Substrate, render};
use paintcopter::mission::MissionSettings;
use paintcopter_benches::rock;

const SHOTS: usize = 1000;
const FILMS: usize = 1_000_000;
/// Of which the median counts.
const RUNS: usize = 5;

#[derive(Parser)]
struct Args {
    /// Part of the adapter's name.
    #[arg(long, default_value = "")]
    adapter: String,
    /// What cargo passes on.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Median of the wall time of a job, milliseconds, and its last result.
fn median_ms<T>(mut run: impl FnMut() -> Result<T, Box<dyn Error>>) -> Result<(f64, T), Box<dyn Error>> {
    let mut once = || -> Result<(f64, T), Box<dyn Error>> {
        let start = Instant::now();
        let result = run()?;
        Ok((1e3 * start.elapsed().as_secs_f64(), result))
    };
    let mut runs = (0..RUNS).map(|_| once()).collect::<Result<Vec<_>, _>>()?;
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(runs.swap_remove(RUNS / 2))
}

fn print<T: PartialEq>(what: &str, (processor, expected): (f64, T), (device, found): (f64, T)) {
    println!("  {what}: processor {processor:9.2} ms   device {device:9.2} ms   equal: {}", expected == found);
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let options = GpuOptions { adapter: args.adapter, software: true, ..GpuOptions::default() };
    let surface = rock::rock()?;
    let gpu = GpuSurface::new(&surface.world, &options)?;
    println!("{}", gpu.name());

    let stand_off = MissionSettings::default().planner.nozzle.stand_off;
    let spray =
        SprayModel { sigma: (MissionSettings::default().spot / stand_off).atan(), cut: 4.0, ..SprayModel::default() };
    let shot = |t: &paint_planner::Target| Shot {
        origin: t.point + t.normal.into_inner() * stand_off,
        axis: -t.normal,
        volume: t.dose * 0.025,
    };
    let shots: Vec<Shot> = rock::stroke(&surface, SHOTS).iter().map(shot).collect();
    let bare = Film::new(surface.film_texels().0)?;
    let sprayer = bare.gpu_spray(&options)?;
    let on_processor = || {
        let mut film = bare.layer();
        film.deposit(&shots, &spray, &surface.world, 1, &mut |_, _| ())?;
        Ok((film.volumes().to_vec(), film.mass_balance()))
    };
    let on_device = || {
        let mut film = bare.layer();
        film.deposit_on(&sprayer, &shots, &spray, &gpu, 1, &mut |_, _| ())?;
        Ok((film.volumes().to_vec(), film.mass_balance()))
    };
    print(&format!("{SHOTS} shots on {} texels", bare.texels().len()), median_ms(on_processor)?, median_ms(on_device)?);
    println!("  {:?}", gpu.rays());

    let films = FilmColours::stacked(&[Paint::white(20e-6)?, Paint::yellow(20e-6)?], &Substrate::grey(0.5)?);
    let colours = GpuFilmColours::new(&films, &options)?;
    let depths: Vec<f32> = (0..2 * FILMS).map(|k| 60e-6 * (k % 1009) as f32 / 1009.0).collect();
    let on_processor = median_ms(|| {
        let mut out = vec![[0; 3]; FILMS];
        Ok(films.srgb8(&depths, &mut out).map(|()| out)?)
    })?;
    let on_device = median_ms(|| {
        let mut out = vec![[0; 3]; FILMS];
        Ok(colours.srgb8(&depths, &mut out).map(|()| out)?)
    })?;
    let other = on_processor.1.iter().zip(&on_device.1).filter(|(a, b)| a != b).count();
    print("colours of two films, 1e6 places", on_processor, on_device);
    println!("  {other} places have another code");

    let camera =
        Camera::looking_at(&Point3::new(0.3, -3.5, 2.6), &Point3::new(0.0, 0.0, 2.4), &Vector3::z(), 1.2, (640, 480))?;
    let shade = |hit: &Hit| Shading::matt([0.6; 3], hit.normal);
    let picture = |surface: &dyn Surface| Ok(render(surface, &camera, &shade, &Lights::default(), 1, 1)?);
    print("picture of 640 x 480", median_ms(|| picture(&surface.world))?, median_ms(|| picture(&gpu))?);
    println!("  {:?}", gpu.rays());
    Ok(())
}
