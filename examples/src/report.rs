//! What a run found: `report.json` for programs, `report.md` for people.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

/// The figures of one mission. Flat, SI units in the names; every number is finite.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that was painted: `rock` or the file's name.
    pub surface: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Area of the painted chart.
    pub surface_area_m2: f64,
    /// Triangles of the painted chart.
    pub faces: usize,
    /// Triangles whose image in the plane is turned over or flat.
    pub uv_flips: usize,
    /// Area-weighted symmetric Dirichlet energy over its minimum: 1 is an isometry.
    pub uv_symmetric_dirichlet: f64,
    /// Mean deviation of the nozzle from the surface normal, `|n x (p - t)|`, optimal planner.
    pub normal_deviation_mean_m: f64,
    /// Largest such deviation.
    pub normal_deviation_max_m: f64,
    /// Mean of the same for the smoothing planner.
    pub smoothing_normal_deviation_mean_m: f64,
    /// Share of the targets whose normal the pan-tilt unit cannot reach (excluded from the three figures above).
    pub unreachable_normal_share: f64,
    /// Share of the wanted paint that no pose of the robot can spray.
    pub unreachable_paint_share: f64,
    /// Distance between the point hit and the point meant, root mean square, valve open, preset `mocap`.
    pub hit_error_rms_m: f64,
    /// The same, 95th percentile.
    pub hit_error_p95_m: f64,
    /// The same, root mean square, preset `slam_7cm`.
    pub hit_error_rms_slam_m: f64,
    /// Standard deviation of the distance from nozzle to surface along the spray.
    pub nozzle_distance_std_m: f64,
    /// Hit error with the pan-tilt unit locked forward.
    pub ptu_locked_hit_error_rms_m: f64,
    /// Pan: actual minus desired, root mean square.
    pub pan_error_rms_rad: f64,
    /// Tilt: actual minus desired, root mean square.
    pub tilt_error_rms_rad: f64,
    /// Planning time on one core per metre of planned path.
    pub planning_s_per_m: f64,
    /// Planning time over flight time.
    pub planning_per_flight_time: f64,
    /// Length of the vehicle's path.
    pub path_length_m: f64,
    /// Time in the air.
    pub flight_time_s: f64,
    /// Paint that left the nozzle.
    pub paint_emitted_kg: f64,
    /// Paint that stayed on the surface.
    pub paint_deposited_kg: f64,
    /// Paint that went past it.
    pub paint_overspray_kg: f64,
    /// |emitted - deposited - overspray| / emitted.
    pub mass_balance_relative: f64,
    /// Painter's own canvas against the wanted picture.
    pub psnr_canvas_db: f64,
    /// The Gaussian-filtered wanted picture against the wanted picture: the papers' ideal.
    pub psnr_ideal_db: f64,
    /// Painted surface against the wanted picture.
    pub psnr_painted_db: f64,
    /// Structural similarity of the painter's own canvas.
    pub ssim_canvas: f64,
    /// Structural similarity of the painted surface.
    pub ssim_painted: f64,
    /// Mean CIEDE2000 between painted and wanted.
    pub ciede2000_mean: f64,
    /// Moments at which the flown robot touched the surface.
    pub collisions: usize,
    /// Moments at which the plan exceeds a limit of velocity, acceleration or joint angle.
    pub limit_violations: usize,
    /// Layers of paint.
    pub layers: usize,
    /// Strokes over all layers.
    pub strokes: usize,
    /// Wall-clock time of the whole run.
    pub wall_s: f64,
    /// Largest resident memory.
    pub peak_rss_bytes: u64,
}

/// What is wrong with a report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A figure is NaN or infinite.
    #[error("figure {0} is not finite: the run is not usable")]
    NotFinite(String),
    /// The figures could not be written as JSON.
    #[error("the report could not be encoded: {0}")]
    Encoding(#[from] serde_json::Error),
    /// A file could not be written.
    #[error("{path}: cannot be written ({source}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Report {
    /// Writes `report.json` and `report.md` into a folder. Refuses figures that are not finite.
    pub fn save(&self, folder: &Path) -> Result<(), ReportError> {
        let figures = serde_json::to_value(self)?;
        // serde_json writes NaN and infinity as null.
        if let Some((name, _)) = figures.as_object().and_then(|o| o.iter().find(|(_, v)| v.is_null())) {
            return Err(ReportError::NotFinite(name.clone()));
        }
        write(&folder.join("report.json"), &(serde_json::to_string_pretty(self)? + "\n"))?;
        write(&folder.join("report.md"), &self.markdown())
    }

    /// The rows of the table: figure, value, floor, what the papers report, whether the floor holds.
    fn rows(&self) -> Vec<(&'static str, String, String, &'static str, bool)> {
        let cm = |m: f64| format!("{:.2} cm", 100.0 * m);
        let at_most =
            |name, value: f64, limit: f64, paper| (name, cm(value), format!("≤ {}", cm(limit)), paper, value <= limit);
        let smoothing_ratio = self.smoothing_normal_deviation_mean_m / self.normal_deviation_mean_m;
        let locked_ratio = self.ptu_locked_hit_error_rms_m / self.hit_error_rms_m;
        let ssim_ratio = self.ssim_painted / self.ssim_canvas;
        let percent = 100.0 * self.unreachable_normal_share;
        vec![
            at_most("Nozzle off the normal, mean", self.normal_deviation_mean_m, 0.004, "0.4 cm"),
            at_most("Nozzle off the normal, largest", self.normal_deviation_max_m, 0.02, "2 cm"),
            (
                "Smoothing planner, mean, ratio to ours",
                format!("{} ({smoothing_ratio:.1}x)", cm(self.smoothing_normal_deviation_mean_m)),
                "≥ 5x".into(),
                "4.5 cm",
                smoothing_ratio >= 5.0,
            ),
            ("Targets whose normal is out of reach", format!("{percent:.1} %"), "≤ 10 %".into(), "-", percent <= 10.0),
            at_most("Hit error in flight, RMS", self.hit_error_rms_m, 0.015, "2.12 cm"),
            at_most("Hit error in flight, 95 %", self.hit_error_p95_m, 0.03, "4 cm"),
            ("Hit error with 7 cm SLAM, RMS", cm(self.hit_error_rms_slam_m), "-".into(), "-", true),
            at_most("Nozzle distance, standard deviation", self.nozzle_distance_std_m, 0.015, "1.88 cm"),
            (
                "Hit error, pan-tilt unit locked",
                format!("{} ({locked_ratio:.1}x)", cm(self.ptu_locked_hit_error_rms_m)),
                "≥ 3x".into(),
                "about 4x",
                locked_ratio >= 3.0,
            ),
            (
                "Planning per metre of path",
                format!("{:.2} ms", 1e3 * self.planning_s_per_m),
                "≤ 100 ms".into(),
                "356 ms",
                self.planning_s_per_m <= 0.1,
            ),
            (
                "Paint books, relative",
                format!("{:.1e}", self.mass_balance_relative),
                "≤ 1e-12".into(),
                "-",
                self.mass_balance_relative <= 1e-12,
            ),
            (
                "Canvas against wanted, PSNR",
                format!("{:.2} dB", self.psnr_canvas_db),
                format!("≥ {:.2} dB (Gaussian-filtered)", self.psnr_ideal_db),
                "the ideal",
                self.psnr_canvas_db >= self.psnr_ideal_db,
            ),
            (
                "Painted against wanted, SSIM over the canvas'",
                format!("{:.3} ({ssim_ratio:.2}x)", self.ssim_painted),
                "≥ 0.90x".into(),
                "-",
                ssim_ratio >= 0.9,
            ),
            ("Mean colour difference, CIEDE2000", format!("{:.2}", self.ciede2000_mean), "-".into(), "-", true),
            ("Collisions", self.collisions.to_string(), "0".into(), "-", self.collisions == 0),
            ("Limit violations", self.limit_violations.to_string(), "0".into(), "-", self.limit_violations == 0),
        ]
    }

    /// The main figures on a few lines.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        for (figure, value, floor, _, holds) in self.rows() {
            let _ =
                writeln!(text, "  {figure:44} {value:>24}   {floor:34}{}", if holds { "" } else { "  NOT REACHED" });
        }
        text
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# {} painted\n\n{} layers, {} strokes, {:.0} m flown in {:.0} min, {:.3} kg of paint on {:.1} m²; computed in \
             {:.0} s. Seed {}, version {}.\n\n",
            self.surface,
            self.layers,
            self.strokes,
            self.path_length_m,
            self.flight_time_s / 60.0,
            self.paint_deposited_kg,
            self.surface_area_m2,
            self.wall_s,
            self.seed,
            self.version
        );
        for (file, caption) in [
            ("painted_view.png", "The painted surface as a camera sees it"),
            ("wanted.png", "Wanted"),
            ("painted.png", "Painted"),
            ("error.png", "Difference"),
            ("path.png", "Flown path: vehicle orange, nozzle blue"),
            ("angles.png", "Pan, tilt, distance and normal deviation over time"),
        ] {
            let _ = writeln!(text, "**{caption}**\n\n![{caption}]({file})\n");
        }
        text.push_str("| figure | this run | asked for | papers | |\n|---|---|---|---|---|\n");
        for (figure, value, floor, paper, holds) in self.rows() {
            let _ =
                writeln!(text, "| {figure} | {value} | {floor} | {paper} | {} |", if holds { "yes" } else { "**no**" });
        }
        let _ = writeln!(
            text,
            "\nThe figures asked for are for the built-in rock; on other surfaces they are for orientation. All of them, in SI \
             units, are in [report.json](report.json). The recording [mission.mcap](mission.mcap) opens in Foxglove and \
             Rerun, the painted mesh [surface.ply](surface.ply) in any mesh viewer."
        );
        text
    }
}

fn write(path: &Path, text: &str) -> Result<(), ReportError> {
    std::fs::write(path, text).map_err(|source| ReportError::Unwritable { path: path.display().to_string(), source })
}
