//! Pictures in several paints, as `paint_baselines.py colour` has them.

use std::error::Error;
use std::path::PathBuf;

use paint_net::SprayKernel;
use paint_net::colour::{ColourProblem, ColourSeparation};
use paintcopter::paint_image::{Glazes, compare_colours, pictures_in, read_picture};
use serde_json::json;

use crate::cpu::median_seconds;

/// Prints one JSON object per picture and palette.
pub fn run(images: &[PathBuf], runs: usize) -> Result<(), Box<dyn Error>> {
    let kernel = SprayKernel::new(2.0, 2.0)?;
    let painter = ColourSeparation::default();
    for path in images {
        for file in pictures_in(path)? {
            let wanted = read_picture(&file)?;
            for (name, glazes) in [("cmy", Glazes::Cmy), ("cmyk", Glazes::Cmyk), ("six", Glazes::Six)] {
                let palette = glazes.palette()?;
                let problem = ColourProblem::new(&wanted, &palette).with_kernel(&kernel);
                let run = || painter.paint(&problem);
                let painting = run()?;
                let (psnr, mean, p95) = compare_colours(&painting.image, &wanted);
                let volume: f64 = painting.sprays.iter().flatten().map(|s| s.volume).sum();
                println!(
                    "{}",
                    json!({
                        "image": file.file_stem().map(|n| n.to_string_lossy()), "method": format!("paint-net_colour_{name}"),
                        "psnr": psnr, "de00_mean": mean, "de00_p95": p95, "cpu_s": median_seconds(runs, run),
                        "paint": volume * kernel.mass() / wanted.data().len() as f64,
                    })
                );
            }
        }
    }
    Ok(())
}
