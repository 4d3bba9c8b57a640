use paint_net::Image;
use serde::Serialize;

use super::{Choice, Figures, Job, PaintImageError};

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

/// Paints every picture with every painter, in turn, `runs` times.
pub fn compare(job: &Job, pictures: &[Image], runs: usize) -> Result<Vec<Row>, PaintImageError> {
    let mut rows = Vec::with_capacity(Choice::ALL.len());
    for painter in Choice::ALL {
        let job = Job { painter, ..job.clone() };
        let mut all: Vec<Figures> = Vec::with_capacity(pictures.len());
        for picture in pictures {
            let runs: Result<Vec<Figures>, _> =
                (0..runs.max(1)).map(|_| job.paint(picture, &mut |_| ()).map(|(_, figures)| figures)).collect();
            let mut runs = runs?;
            runs.sort_by(|a, b| a.cpu_ms.total_cmp(&b.cpu_ms));
            let median = runs.len() / 2;
            all.push(runs.swap_remove(median));
        }
        let mean = |of: &dyn Fn(&Figures) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        rows.push(Row {
            painter: all.first().map_or_else(String::new, |f| f.painter.to_string()),
            psnr_db: mean(&|f| f.psnr_db),
            ssim: mean(&|f| f.ssim),
            ciede2000: mean(&|f| f.ciede2000_mean),
            sprays: mean(&|f| f.sprays as f64),
            cpu_ms: mean(&|f| f.cpu_ms),
        });
    }
    Ok(rows)
}

/// The rows as a table for people.
pub fn print_table(rows: &[Row]) -> String {
    let head = format!(
        "{:14} {:>9} {:>7} {:>10} {:>8} {:>9}\n",
        "painter", "PSNR, dB", "SSIM", "CIEDE2000", "sprays", "CPU, ms"
    );
    let line = |r: &Row| {
        format!(
            "{:14} {:9.2} {:7.3} {:10.2} {:8.0} {:9.2}\n",
            r.painter, r.psnr_db, r.ssim, r.ciede2000, r.sprays, r.cpu_ms
        )
    };
    head + &rows.iter().map(line).collect::<String>()
}
