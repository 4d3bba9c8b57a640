//! The painters on pictures: quality and time, with valves of limited speed, and with noise.

use std::error::Error;
use std::path::PathBuf;

use paint_net::procedural::Texture;
use paint_net::{
    Coats, Deconvolution, Feedback, FreeSplats, Image, Limits, MatchingPursuit, Painter, Painting, Route, Saturation,
    SlewLimited, Spray, SprayKernel, Task, metrics, slew_violations,
};
use paintcopter_examples::paint_image::{pictures_in, read_ink};
use serde_json::{Value, json};

use crate::Rng;
use crate::cpu::median_seconds;

/// Iterations at which the deconvolution is stopped, for the curve of quality over time.
const STOPS: [usize; 6] = [5, 10, 20, 40, 100, 200];
/// Noise of a spray: relative volume, and pixels beside the point.
const VOLUME_NOISE: f64 = 0.2;
const AIM_NOISE: f64 = 0.5;

/// Prints one JSON object per picture and figure.
pub fn run(images: &[PathBuf], size: usize, runs: usize) -> Result<(), Box<dyn Error>> {
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
    // The peers' nozzle: σ = 2 px cut at 4 px.
    let kernel = SprayKernel::new(2.0, 2.0)?;
    // The figures that are quoted are those of eight passes, wherever nothing else is said.
    let feedback = Feedback { passes: 8, ..Feedback::shipped()? };
    for (name, wanted) in &pictures {
        let print = |method: String, mut figures: Value| {
            figures["image"] = json!(name);
            figures["method"] = json!(format!("paint-net_{method}"));
            println!("{figures}");
        };
        let mut painters: Vec<(String, Box<dyn Painter>)> = Vec::new();
        for passes in [2, 3, 4, 5, 6, 8, 12] {
            painters.push((format!("feedback_p{passes}"), Box::new(Feedback { passes, ..feedback.clone() })));
        }
        painters.push(("additive_coats".into(), Box::new(Coats::new(feedback.clone()))));
        for iterations in STOPS {
            let stopped = Deconvolution { iterations, tolerance: 0.0 };
            painters.push((format!("deconvolution_it{iterations}"), Box::new(stopped)));
        }
        painters.push(("pursuit".into(), Box::new(MatchingPursuit::default())));
        for (method, painter) in &painters {
            print(method.clone(), measure(&**painter, wanted, &kernel, &Limits::default(), runs)?);
        }
        // Splats are not cut, as the peers have it; and with the cut nozzle.
        for sprays in [400, 1600] {
            let splats = FreeSplats { sprays, ..FreeSplats::default() };
            let whole = SprayKernel::new(2.0, 6.0)?;
            print(format!("splats_{sprays}"), measure(&splats, wanted, &whole, &Limits::default(), runs)?);
            print(format!("splats_{sprays}_cut"), measure(&splats, wanted, &kernel, &Limits::default(), 1)?);
        }
        for (limit, along, route) in [
            (0.05, 2, Route::Rows),
            (0.02, 2, Route::Rows),
            (0.05, 2, Route::Alike),
            (0.02, 2, Route::Alike),
            (0.05, 1, Route::Rows),
            (0.02, 1, Route::Rows),
        ] {
            let name = format!("slew{limit}_every{along}px_{route:?}").to_lowercase();
            print(name, limited(&feedback, wanted, &kernel, (limit, along, route))?);
        }
        for (method, gain, painter) in [
            ("noise_open", 1.0, None),
            ("noise_closed", 1.0, Some(Coats::new(feedback.clone()))),
            ("noise_closed_gain0.7", 0.7, Some(Coats::new(feedback.clone()))),
            ("noise_closed_gain1.3", 1.3, Some(Coats::new(feedback.clone()))),
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
    let task = Task::on_bare_wall(wanted);
    let run = || painter.paint(&task, kernel, &Saturation::Tanh, limits, &mut |_| ());
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
    (share, along, route): (f64, usize, Route),
) -> Result<Value, paint_net::Error> {
    let task = Task::on_bare_wall(wanted);
    let limits = Limits { along, ..Limits::default() };
    let free = Deconvolution::default().paint(&task, kernel, &Saturation::Tanh, &limits, &mut |_| ())?;
    let (columns, rows) = (wanted.width().div_ceil(along), wanted.height().div_ceil(limits.row_spacing));
    let mut volumes: Vec<f64> = free.sprays.iter().map(|s| s.volume).collect();
    volumes.resize(columns * rows, 0.0);
    volumes.sort_unstable_by(f64::total_cmp);
    let top = 1.5 * volumes[(0.99 * (volumes.len() - 1) as f64) as usize];
    let painter = SlewLimited { route, ..SlewLimited::new(feedback, share * top) };
    let limits = Limits { max_volume: top, ..limits };
    let run = || painter.fly(&task, kernel, &Saturation::Tanh, &limits, &mut |_| ());
    let (waypoints, painting) = run()?;
    let mut figures = quality(&painting, wanted)?;
    figures["violations"] = json!(slew_violations(&waypoints, share * top));
    figures["waypoints"] = json!(waypoints.len());
    figures["cpu_s"] = json!(median_seconds(1, run));
    Ok(figures)
}

/// Sprays with noise: all at once without looking, or in coats.
fn noisy(
    feedback: &Feedback,
    coats: Option<&Coats<Feedback>>,
    wanted: &Image,
    kernel: &SprayKernel,
    gain: f64,
) -> Result<Value, paint_net::Error> {
    let (task, limits, ink) = (Task::on_bare_wall(wanted), Limits::default(), Saturation::Tanh);
    let mut wall = wanted.map(|_| 0.0);
    let mut rng = Rng::new(0);
    let mut spray = |sprays: &[Spray]| {
        for s in sprays {
            deposit(&mut wall, s, gain, kernel, &mut rng);
        }
        Ok(wall.map(f64::tanh))
    };
    let (seen, found) = match coats {
        None => (spray(&feedback.paint(&task, kernel, &ink, &limits, &mut |_| ())?.sprays)?, 1.0),
        Some(coats) => {
            let coated = coats.paint_watched(&task, kernel, &ink, &limits, &mut spray)?;
            (wall.map(f64::tanh), coated.gain)
        }
    };
    Ok(json!({ "psnr": metrics::psnr(&seen, wanted, None)?, "gain": gain, "gain_found": found }))
}

fn deposit(wall: &mut Image, s: &Spray, gain: f64, kernel: &SprayKernel, rng: &mut Rng) {
    let mut normal = || (-2.0 * (1.0 - rng.unit()).ln()).sqrt() * (std::f64::consts::TAU * rng.unit()).cos();
    let (x, y) = (s.x + AIM_NOISE * normal(), s.y + AIM_NOISE * normal());
    let volume = gain * s.volume * (1.0 + VOLUME_NOISE * normal()).max(0.0);
    let (width, height, reach) = (wall.width(), wall.height(), kernel.radius());
    let range =
        |centre: f64, end: usize| (centre as usize).saturating_sub(reach)..(centre as usize + reach + 1).min(end);
    for j in range(s.y, height) {
        for i in range(s.x, width) {
            let squared = (i as f64 - x).powi(2) + (j as f64 - y).powi(2);
            wall.data_mut()[j * width + i] += volume * (-squared / (2.0 * kernel.sigma().powi(2))).exp();
        }
    }
}

/// A large picture in tiles and whole: difference in all, and in the strips of 4 px on both sides of the tiles' borders.
fn seams(feedback: &Feedback, kernel: &SprayKernel, pictures: &[(String, Image)]) -> Result<(), Box<dyn Error>> {
    const SIDE: usize = 2048;
    let Some((name, picture)) = pictures.first() else { return Ok(()) };
    let wanted = Image::from_fn(SIDE, SIDE, |x, y| picture.at(x % picture.width(), y % picture.height()));
    let task = Task::on_bare_wall(&wanted);
    let run = |tile: usize, threads: usize| {
        let painter = Feedback { tile, threads, ..feedback.clone() };
        painter.paint(&task, kernel, &Saturation::Tanh, &Limits::default(), &mut |_| ())
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
