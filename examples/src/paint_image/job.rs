//! One picture in one paint: who paints it, how, and with what result.

use std::path::Path;

use clap::ValueEnum;
use paint_net::painters::{
    Centrelines, ClosedLoopPainter, FreeSprays, LayerPlanning, Layered, MatchingPursuit, SlewLimited, slew_violations,
};
use paint_net::path::ScanOrder;
use paint_net::thesis::{Network, ThesisPainter};
use paint_net::{Deconvolution, Feedback, Image, Limits, PaintProblem, Painter, Painting, SprayKernel, metrics};
use serde::Serialize;

use super::commands;
use super::cpu_timer::CpuTimer;
use super::error::PaintImageError;
use super::files::write_json;
use super::ink::{colour_difference, error_map, grey, level, ssim};
use super::progress_sheet::save_progress_sheet;
use crate::report::check_finite;

/// Who decides the sprays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PainterKind {
    /// The network with feedback from its canvas.
    Feedback,
    /// The same in three coats, each of which stays on the wall.
    ClosedLoop,
    /// Projected L-BFGS.
    Deconvolution,
    /// The same with strokes along the lines of the picture.
    Centrelines,
    /// Greedy matching pursuit.
    Pursuit,
    /// Few sprays at free places, of free spreads.
    FreeSprays,
    /// The thesis' network.
    Thesis,
}

impl PainterKind {
    /// Those for any picture.
    pub const FOR_ANY: [Self; 6] =
        [Self::Feedback, Self::ClosedLoop, Self::Deconvolution, Self::Pursuit, Self::FreeSprays, Self::Thesis];

    fn name(self) -> &'static str {
        match self {
            Self::Feedback => "feedback",
            Self::ClosedLoop => "closed-loop",
            Self::Deconvolution => "deconvolution",
            Self::Centrelines => "centrelines",
            Self::Pursuit => "pursuit",
            Self::FreeSprays => "free-sprays",
            Self::Thesis => "thesis",
        }
    }
}

/// How a picture is painted.
#[derive(Debug, Clone)]
pub struct Job {
    /// Who decides.
    pub painter: PainterKind,
    /// Passes of the network over its canvas.
    pub passes: usize,
    /// The nozzle, pixels.
    pub kernel: SprayKernel,
    /// Where sprays may lie.
    pub limits: Limits,
    /// Largest change of volume from one cell of the path to the next; `None` for any.
    pub slew_limit: Option<f64>,
    /// The path for which that holds.
    pub order: ScanOrder,
    /// Whether to paint in layers, a base coat first, and how they share the paint (thesis, Paper IV, section 3.2).
    pub layers: Option<LayerPlanning>,
    /// Threads of the network.
    pub threads: usize,
    /// The thesis' network; `None`: the shipped one.
    pub thesis: Option<Network>,
}

/// The figures of one picture; flat, units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// Name of the painter.
    pub painter: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Peak signal-to-noise ratio of the ink.
    pub psnr_db: f64,
    /// Structural similarity, 7x7 window; pictures smaller than the window have none, which is given as 0.
    pub ssim: f64,
    /// Cross-entropy.
    pub bce_nats_per_px: f64,
    /// Mean colour difference, ink taken as the grey values of sRGB.
    pub ciede2000_mean: f64,
    /// Number of sprays.
    pub sprays: usize,
    /// Passes of the network; 0 for painters that have none.
    pub passes: usize,
    /// Places on the path where the volume changes faster than was allowed; 0 if any change is allowed.
    pub slew_violations: usize,
    /// Sum of the volumes.
    pub volume_total: f64,
    /// CPU time of deciding on one thread, wall time on several.
    pub cpu_ms: f64,
    /// Threads.
    pub threads: usize,
}

impl Job {
    /// For tables.
    pub fn name(&self) -> String {
        let name = self.painter.name();
        if self.layers.is_some() { format!("{name}, layers") } else { name.to_string() }
    }

    /// The painter that was chosen.
    pub fn painter(&self) -> Result<Box<dyn Painter>, PaintImageError> {
        let feedback = || Feedback::shipped().map(|f| Feedback { passes: self.passes, threads: self.threads, ..f });
        let painter: Box<dyn Painter> = match self.painter {
            PainterKind::Feedback => Box::new(feedback()?),
            PainterKind::ClosedLoop => Box::new(ClosedLoopPainter::new(feedback()?)),
            PainterKind::Deconvolution => Box::new(Deconvolution::default()),
            PainterKind::Centrelines => Box::new(Centrelines::default()),
            PainterKind::Pursuit => Box::new(MatchingPursuit::default()),
            PainterKind::FreeSprays => Box::new(FreeSprays {
                sprays: self.limits.max_sprays.unwrap_or(FreeSprays::default().sprays),
                ..FreeSprays::default()
            }),
            PainterKind::Thesis => Box::new(match &self.thesis {
                Some(network) => ThesisPainter::new(network.clone()),
                None => ThesisPainter::shipped()?,
            }),
        };
        Ok(match self.layers {
            Some(planning) => Box::new(Layered { planning, ..Layered::new(painter) }),
            None => painter,
        })
    }

    /// Decides the sprays for a wanted picture of ink.
    pub fn paint(&self, wanted: &Image, progress: &mut dyn FnMut(f64)) -> Result<(Painting, Figures), PaintImageError> {
        if self.painter == PainterKind::Centrelines && self.slew_limit.is_some() {
            // The slow valve follows the cells of a grid, on which strokes along lines do not lie.
            let why =
                "--slew-limit: its path leads over a grid, the strokes of centrelines do not; choose another painter";
            return Err(PaintImageError::Settings(why.to_string()));
        }
        let painter = self.painter()?;
        let timer = CpuTimer::start(self.threads);
        let problem = PaintProblem::new(wanted).with_kernel(&self.kernel).with_limits(&self.limits);
        let mut observer = |share| progress(share);
        let (painting, slew_violations) = match self.slew_limit {
            None => (painter.paint_observed(&problem, &mut observer)?, 0),
            Some(limit) => {
                let slow = SlewLimited { order: self.order, ..SlewLimited::new(painter, limit) };
                let painting = slow.paint_observed(&problem, &mut observer)?;
                let violations = slew_violations(&painting.waypoints, limit);
                (painting, violations)
            }
        };
        let cpu_ms = timer.milliseconds();
        let passes = match self.painter {
            PainterKind::Feedback | PainterKind::ClosedLoop => self.passes,
            PainterKind::Deconvolution
            | PainterKind::Centrelines
            | PainterKind::Pursuit
            | PainterKind::FreeSprays
            | PainterKind::Thesis => 0,
        };
        let figures = Figures {
            painter: self.name(),
            width: wanted.width(),
            height: wanted.height(),
            psnr_db: metrics::psnr(&painting.ink, wanted, None)?,
            ssim: ssim(&painting.ink, wanted)?,
            bce_nats_per_px: metrics::binary_cross_entropy(&painting.ink, wanted)?,
            ciede2000_mean: colour_difference(&painting.ink, wanted),
            sprays: painting.sprays.len(),
            passes,
            slew_violations,
            volume_total: painting.sprays.iter().map(|s| s.volume).sum(),
            cpu_ms,
            threads: self.threads,
        };
        check_finite(&figures)?;
        Ok((painting, figures))
    }

    /// Writes `commands.json`, `commands.mcap`, `rendered.png`, `error.png`, `progress.png` and `report.json`.
    pub fn save(
        &self,
        folder: &Path,
        wanted: &Image,
        painting: &Painting,
        figures: &Figures,
    ) -> Result<(), PaintImageError> {
        let model = serde_json::json!({
            "ink": "tanh(sum of volume * exp(-d^2 / (2 sigma_px^2)))", "cut_sigma": self.kernel.cut(),
            "footprint": "pixels no more than cut_sigma * sigma_px away along each axis",
        });
        let sprays: Vec<_> = commands::commands(&painting.sprays, 0).collect();
        commands::save(folder, (wanted.width(), wanted.height()), &model, &["black"], &sprays)?;
        write_json(&folder.join("report.json"), figures)?;
        grey(&painting.ink).save(&folder.join("rendered.png"))?;
        error_map(&painting.ink, wanted).save(&folder.join("error.png"))?;
        let show = |depths: &[f64]| [level(depths[0].tanh()); 3];
        save_progress_sheet(&folder.join("progress.png"), grey(wanted), &[&painting.sprays], &self.kernel, &show)
    }
}
