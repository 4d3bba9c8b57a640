//! The painters on pictures: quality and time, with valves of limited speed, and with noise.

use std::error::Error;
use std::path::PathBuf;

use paint_net::painters::{ClosedLoopPainter, FreeSprays, MatchingPursuit, SlewLimited, slew_violations};
use paint_net::path::ScanOrder;
use paint_net::procedural::Texture;
use paint_net::{
    Deconvolution, Feedback, Image, Limits, Observer, PaintProblem, Painter, Painting, Spray, SprayKernel, metrics,
};
use paintcopter::paint_image::{pictures_in, read_ink};
use serde_json::{Value, json};

use crate::Rng;
use crate::cpu::median_seconds;

/// Iterations at which the deconvolution is stopped, for the curve of quality over time.
const STOPS: [usize; 6] = [5, 10, 20, 40, 100, 200];
/// Noise of a spray: relative volume, and pixels beside the point.
const VOLUME_NOISE: f64 = 0.2;
const AIM_NOISE: f64 = 0.5;

/// Inks of the pictures at these places, with their names; the procedural ones if there are none.
fn pictures(images: &[PathBuf], size: usize) -> Result<Vec<(String, Image)>, Box<dyn Error>> {
    let mut pictures: Vec<(String, Image)> = Vec::new();
    for path in images {
        for file in pictures_in(path)? {
            let name = file.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            pictures.push((name, read_ink(&file)?));
        }
    }
    if images.is_empty() {
        pictures.extend(Texture::ALL.map(|t| (format!("proc-{t:?}").to_lowercase(), t.image(1000, size))));
    }
    Ok(pictures)
}

/// The peers' nozzle: σ = 2 px cut at 4 px.
fn nozzle() -> Result<SprayKernel, paint_net::Error> {
    SprayKernel::new(2.0, 2.0)
}

fn print(image: &str, method: &str, mut figures: Value) {
    figures["image"] = json!(image);
    figures["method"] = json!(format!("paint-net_{method}"));
    println!("{figures}");
}

/// Prints one JSON object per picture: the feedback network with so many passes.
pub fn run_feedback(images: &[PathBuf], size: usize, runs: usize, passes: usize) -> Result<(), Box<dyn Error>> {
    let (painter, kernel) = (Feedback { passes, ..Feedback::shipped()? }, nozzle()?);
    for (name, wanted) in pictures(images, size)? {
        let figures = measure(&painter, &wanted, &kernel, &Limits::default(), runs)?;
        print(&name, &format!("feedback_p{passes}"), figures);
    }
    Ok(())
}

/// Prints one JSON object per picture and figure.
pub fn run(images: &[PathBuf], size: usize, runs: usize) -> Result<(), Box<dyn Error>> {
    let (pictures, kernel) = (pictures(images, size)?, nozzle()?);
    // The figures that are quoted are those of eight passes, wherever nothing else is said.
    let feedback = Feedback { passes: 8, ..Feedback::shipped()? };
    for (name, wanted) in &pictures {
        let print = |method: String, figures: Value| print(name, &method, figures);
        let mut painters: Vec<(String, Box<dyn Painter>)> = Vec::new();
        for passes in [2, 3, 4, 5, 6, 8, 12] {
            painters.push((format!("feedback_p{passes}"), Box::new(Feedback { passes, ..feedback.clone() })));
        }
        painters.push(("closed_loop_plan".into(), Box::new(ClosedLoopPainter::new(feedback.clone()))));
        for iterations in STOPS {
            let stopped = Deconvolution { iterations, tolerance: 0.0 };
            painters.push((format!("deconvolution_it{iterations}"), Box::new(stopped)));
        }
        painters.push(("pursuit".into(), Box::new(MatchingPursuit::default())));
        for (method, painter) in &painters {
            print(method.clone(), measure(&**painter, wanted, &kernel, &Limits::default(), runs)?);
        }
        // Free sprays are not cut, as the peers have it; and with the cut nozzle.
        for sprays in [400, 1600] {
            let painter = FreeSprays { sprays, ..FreeSprays::default() };
            let whole = SprayKernel::new(2.0, 6.0)?;
            print(format!("free_sprays_{sprays}"), measure(&painter, wanted, &whole, &Limits::default(), runs)?);
            print(format!("free_sprays_{sprays}_cut"), measure(&painter, wanted, &kernel, &Limits::default(), 1)?);
        }
        for (limit, along, order) in [
            (0.05, 2, ScanOrder::Boustrophedon),
            (0.02, 2, ScanOrder::Boustrophedon),
            (0.05, 2, ScanOrder::ContextBased),
            (0.02, 2, ScanOrder::ContextBased),
            (0.05, 1, ScanOrder::Boustrophedon),
            (0.02, 1, ScanOrder::Boustrophedon),
        ] {
            let name = format!("slew{limit}_every{along}px_{order:?}").to_lowercase();
            print(name, limited(&feedback, wanted, &kernel, (limit, along, order))?);
        }
        for (method, gain, painter) in [
            ("noise_open", 1.0, None),
            ("noise_closed", 1.0, Some(ClosedLoopPainter::new(feedback.clone()))),
            ("noise_closed_gain0.7", 0.7, Some(ClosedLoopPainter::new(feedback.clone()))),
            ("noise_closed_gain1.3", 1.3, Some(ClosedLoopPainter::new(feedback.clone()))),
        ] {
            print(method.into(), noisy(&feedback, painter.as_ref(), wanted, &kernel, gain)?);
        }
    }
    seams(&feedback, &kernel, &pictures)
}

fn quality(painting: &Painting, wanted: &Image) -> Result<Value, paint_net::Error> {
    Ok(json!({
        "psnr": metrics::psnr(&painting.ink, wanted, None)?,
        "ssim": metrics::ssim(&painting.ink, wanted, None)?,
        "ssim_g": metrics::ssim_gaussian(&painting.ink, wanted, None)?,
        "bce": metrics::binary_cross_entropy(&painting.ink, wanted)?,
        "sprays": painting.sprays.len(),
    }))
}

fn measure(
    painter: &dyn Painter,
    wanted: &Image,
    kernel: &SprayKernel,
    limits: &Limits,
    runs: usize,
) -> Result<Value, paint_net::Error> {
    let problem = PaintProblem::new(wanted).with_kernel(kernel).with_limits(limits);
    let run = || painter.paint(&problem);
    let mut figures = quality(&run()?, wanted)?;
    figures["cpu_s"] = json!(median_seconds(runs, run));
    Ok(figures)
}

/// A valve that changes by at most a share of its range per waypoint. The range is one and a half times the 99th percentile
/// of the volumes that L-BFGS would spray without limit, as the peers have it.
fn limited(
    feedback: &Feedback,
    wanted: &Image,
    kernel: &SprayKernel,
    (share, along, order): (f64, usize, ScanOrder),
) -> Result<Value, paint_net::Error> {
    let limits = Limits { spray_spacing: along, ..Limits::default() };
    let problem = PaintProblem::new(wanted).with_kernel(kernel);
    let free = Deconvolution::default().paint(&problem.with_limits(&limits))?;
    let (columns, rows) = (wanted.width().div_ceil(along), wanted.height().div_ceil(limits.row_spacing));
    let mut volumes: Vec<f64> = free.sprays.iter().map(|s| s.volume).collect();
    volumes.resize(columns * rows, 0.0);
    volumes.sort_unstable_by(f64::total_cmp);
    let top = 1.5 * volumes[(0.99 * (volumes.len() - 1) as f64) as usize];
    let painter = SlewLimited { order, ..SlewLimited::new(feedback, share * top) };
    let limits = Limits { max_volume: top, ..limits };
    let run = || painter.paint(&problem.with_limits(&limits));
    let painting = run()?;
    let mut figures = quality(&painting, wanted)?;
    figures["violations"] = json!(slew_violations(&painting.waypoints, share * top));
    figures["waypoints"] = json!(painting.waypoints.len());
    figures["cpu_s"] = json!(median_seconds(1, run));
    Ok(figures)
}

/// Sprays with noise: open loop, or closed loop.
fn noisy(
    feedback: &Feedback,
    closed: Option<&ClosedLoopPainter<Feedback>>,
    wanted: &Image,
    kernel: &SprayKernel,
    gain: f64,
) -> Result<Value, paint_net::Error> {
    let problem = PaintProblem::new(wanted).with_kernel(kernel);
    let mut wall = NoisyWall { canvas: wanted.map(|_| 0.0), gain, kernel, rng: Rng::new(0) };
    let found = match closed {
        None => {
            wall.deposit(&feedback.paint(&problem)?.sprays);
            1.0
        }
        Some(closed) => closed.paint_observed(&problem, &mut wall)?.flow_gain,
    };
    let seen = wall.canvas.map(f64::tanh);
    Ok(json!({ "psnr": metrics::psnr(&seen, wanted, None)?, "gain": gain, "gain_found": found }))
}

/// A wall and a nozzle with noise and a gain of its own.
struct NoisyWall<'a> {
    canvas: Image,
    gain: f64,
    kernel: &'a SprayKernel,
    rng: Rng,
}

impl Observer for NoisyWall<'_> {
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, paint_net::Error> {
        self.deposit(sprays);
        Ok(Some(self.canvas.map(f64::tanh)))
    }
}

impl NoisyWall<'_> {
    fn deposit(&mut self, sprays: &[Spray]) {
        for s in sprays {
            let rng = &mut self.rng;
            let (x, y) = (s.x + AIM_NOISE * rng.normal(), s.y + AIM_NOISE * rng.normal());
            let volume = self.gain * s.volume * (1.0 + VOLUME_NOISE * rng.normal()).max(0.0);
            let (width, height, reach) = (self.canvas.width(), self.canvas.height(), self.kernel.radius());
            let range = |centre: f64, end: usize| {
                (centre as usize).saturating_sub(reach)..(centre as usize + reach + 1).min(end)
            };
            for j in range(s.y, height) {
                for i in range(s.x, width) {
                    let squared = (i as f64 - x).powi(2) + (j as f64 - y).powi(2);
                    self.canvas.data_mut()[j * width + i] +=
                        volume * (-squared / (2.0 * self.kernel.sigma().powi(2))).exp();
                }
            }
        }
    }
}

/// A large picture in tiles and whole: difference in all, and in the strips of 4 px on both sides of the tiles' borders.
fn seams(feedback: &Feedback, kernel: &SprayKernel, pictures: &[(String, Image)]) -> Result<(), Box<dyn Error>> {
    const SIDE: usize = 2048;
    let Some((name, picture)) = pictures.first() else { return Ok(()) };
    let wanted = Image::from_fn(SIDE, SIDE, |x, y| picture.at(x % picture.width(), y % picture.height()));
    let problem = PaintProblem::new(&wanted).with_kernel(kernel);
    let run = |tile: usize, threads: usize| {
        let painter = Feedback { tile, threads, ..feedback.clone() };
        painter.paint(&problem)
    };
    let (whole, tiled) = (run(SIDE, 1)?, run(64, 2)?);
    let strip = Image::from_fn(SIDE, SIDE, |x, y| {
        let near = |k: usize| (4..SIDE - 4).contains(&k) && (k + 4) % 128 < 8;
        f64::from(u8::from(near(x) || near(y)))
    });
    let difference = |weight: Option<&Image>| -> Result<f64, paint_net::Error> {
        Ok(metrics::psnr(&tiled.ink, &wanted, weight)? - metrics::psnr(&whole.ink, &wanted, weight)?)
    };
    println!(
        "{}",
        json!({
            "image": format!("{name}-2048"), "method": "paint-net_tiled_minus_whole", "psnr": difference(None)?,
            "strip_psnr": difference(Some(&strip))?, "same_bytes": tiled == whole,
            "cpu_s": median_seconds(1, || run(64, 1)),
        })
    );
    Ok(())
}
