//! All painters on the same pictures, in one table.

use std::fmt::Write;
use std::path::Path;

use paint_net::painters::LayerPlanning;
use paint_net::{Image, Painting};
use serde::Serialize;

use super::error::PaintImageError;
use super::files::write_text;
use super::ink::grey;
use super::job::{Figures, Job, PainterKind};
use crate::pictures::{TILE_SIDE, Tile, save_contact_sheet};

/// Pictures on the sheet: the first ones.
const SHOWN: usize = 8;

/// One painter over all pictures: means.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name of the painter.
    pub painter: String,
    /// Mean of the dB over the pictures.
    pub psnr_db: f64,
    /// Mean structural similarity.
    pub ssim: f64,
    /// Mean colour difference.
    pub ciede2000: f64,
    /// Mean number of sprays.
    pub sprays: f64,
    /// Mean over the pictures of the median time.
    pub cpu_ms: f64,
}

/// Paints every picture with every painter, in turn, `runs` times; writes `compare.md` and, with the wanted pictures and all
/// canvases side by side, `compare.png`.
pub fn compare(job: &Job, pictures: &[Image], runs: usize, folder: &Path) -> Result<Vec<Row>, PaintImageError> {
    let wanted = |picture| vec![Tile { caption: "wanted".to_string(), picture: grey(picture) }];
    let mut sheet: Vec<Vec<Tile>> = pictures.iter().take(SHOWN).map(wanted).collect();
    let mut jobs: Vec<Job> = PainterKind::FOR_ANY.map(|painter| Job { painter, ..job.clone() }).to_vec();
    // As the thesis has it: in layers, each planned by itself.
    jobs.push(Job { painter: PainterKind::Thesis, layers: Some(LayerPlanning::Sequential), ..job.clone() });
    let mut rows = Vec::with_capacity(jobs.len());
    for job in jobs {
        let mut all: Vec<Figures> = Vec::with_capacity(pictures.len());
        for (k, picture) in pictures.iter().enumerate() {
            let (painting, figures) = median_run(&job, picture, runs)?;
            if let Some(tiles) = sheet.get_mut(k) {
                let caption = format!("{}, {:.2} dB", figures.painter, figures.psnr_db);
                tiles.push(Tile { caption, picture: grey(&painting.ink) });
            }
            all.push(figures);
        }
        let mean = |of: &dyn Fn(&Figures) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        rows.push(Row {
            painter: job.name(),
            psnr_db: mean(&|f| f.psnr_db),
            ssim: mean(&|f| f.ssim),
            ciede2000: mean(&|f| f.ciede2000_mean),
            sprays: mean(&|f| f.sprays as f64),
            cpu_ms: mean(&|f| f.cpu_ms),
        });
    }
    write_text(&folder.join("compare.md"), &table(&rows))?;
    save_contact_sheet(&folder.join("compare.png"), &sheet, TILE_SIDE)?;
    Ok(rows)
}

/// The same painting every time; the time is the median's.
fn median_run(job: &Job, picture: &Image, runs: usize) -> Result<(Painting, Figures), PaintImageError> {
    let runs: Result<Vec<_>, _> = (0..runs.max(1)).map(|_| job.paint(picture, &mut |_| ())).collect();
    let mut runs = runs?;
    runs.sort_by(|a, b| a.1.cpu_ms.total_cmp(&b.1.cpu_ms));
    let median = runs.len() / 2;
    Ok(runs.swap_remove(median))
}

/// The rows as a table in Markdown that reads well as plain text too.
pub fn table(rows: &[Row]) -> String {
    let mut text = "\
| painter        | PSNR, dB |  SSIM | CIEDE2000 | sprays |  CPU, ms |
|----------------|---------:|------:|----------:|-------:|---------:|
"
    .to_string();
    for r in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {:14} | {:8.2} | {:5.3} | {:9.2} | {:6.0} | {:8.2} |",
            r.painter, r.psnr_db, r.ssim, r.ciede2000, r.sprays, r.cpu_ms
        );
    }
    text
}
