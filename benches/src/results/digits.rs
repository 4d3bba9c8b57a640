//! Trainings of the thesis' network on digits: as printed, without its stop (Fig. 8.4), without the variation of volumes (Fig. 8.7).

use std::error::Error;
use std::path::Path;

use clap::Parser as _;
use paintcopter::paint_image::{Arguments, run};

use super::extent::Extent;
use super::program_report::ProgramReport;
use super::table::{Table, number};

/// Names the folder with MNIST's file of images.
const DATA: &str = "MNIST";
/// So few steps need other rates than the thesis'.
const SHORT: [&str; 4] = ["--steps=1200", "--batch=50", "--rate=4e-3", "--last-rate=1e-4"];

/// A training, and what is asked of `paint-image train` beside the usual.
const TRAININGS: [(&str, &[&str]); 4] = [
    ("ours", &[]),
    ("as printed", &["--as-printed"]),
    ("without a stop", &["--never-stops"]),
    ("without the variation term", &["--variation-weight=0"]),
];

/// The table; empty in a quick rerun, which needs no data, and without data.
///
/// # Errors
/// Those of `paint-image`, and a report without what is shown.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let (Extent::Whole, Some(data)) = (extent, std::env::var_os(DATA)) else {
        println!("digits: left out: {DATA} names the folder with MNIST's images, and a quick rerun trains nothing");
        return Ok(Vec::new());
    };
    let data = format!("--data={}", Path::new(&data).display());
    let head =
        ["training", "loss; nats", "KL divergence; nats", "sprays of 64", "painted over; %", "volumes change by"];
    let mut table = Table::new("digits", &head);
    for (k, (name, options)) in TRAININGS.iter().enumerate() {
        let folder = scratch.join(format!("digits-{k}"));
        let usual = ["paint-image", "train", "--preset=thesis-mnist", &data].map(String::from);
        let out = format!("--out={}", folder.display());
        let options = SHORT.iter().chain(*options).map(|option| (*option).to_string());
        run(&Arguments::try_parse_from(usual.into_iter().chain(options).chain([out]))?)?;
        let report = ProgramReport::read(&folder)?;
        let figure = |name: &str| report.figure(name);
        table.row([
            (*name).into(),
            number(figure("bce_nats_per_picture")?, 1),
            number(figure("kl_latent_nats_per_picture")?, 1),
            number(figure("steps_used_mean")?, 1),
            number(100.0 * figure("painted_over_share")?, 1),
            number(figure("volume_variation")?, 1),
        ]);
    }
    Ok(vec![table])
}
