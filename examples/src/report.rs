//! What a run found: `report.json` for programs, `report.md` for people.

mod check;
mod film;
mod identified;
mod localisation;
mod pictures;
mod reach;
mod team;
mod times;

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use crate::whole_file;

pub use check::{Check, Requirement, Unit};
pub use film::{CleanFigures, FilmFigures};
pub use identified::IdentifiedFigures;
pub use localisation::LocalisationReport;
use pictures::PICTURES;
pub use reach::ReachNeeds;
pub use team::TeamFigures;
pub use times::TimeFigures;
pub(crate) use times::not_flown;

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
    /// Share of the surface that the robot can paint.
    pub reach_share: f64,
    /// What the rest would need, where it is more than 3 % of the surface.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub reach_needs: Option<ReachNeeds>,
    /// Share of the surface that it could paint but for keep-out volumes and tether.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_to_constraints_share: Option<f64>,
    /// Share of the wanted paint that no pose of the robot can spray.
    pub unreachable_paint_share: f64,
    /// Targets with paint. What is flown once more counts once.
    pub targets: usize,
    /// Those of them that are not served.
    pub targets_not_served: usize,
    /// Targets that keep more clearance since the rehearsal in wind.
    pub targets_kept_off: usize,
    /// Targets given up in the rehearsal.
    pub targets_left_bare: usize,
    /// Distance between the point hit and the point meant, root mean square, valve open, preset `mocap`.
    pub hit_error_rms_m: f64,
    /// The same, 95th percentile.
    pub hit_error_p95_m: f64,
    /// The same, root mean square, preset `slam_7cm`.
    pub hit_error_rms_slam_m: f64,
    /// Standard deviation of the distance from nozzle to surface along the spray.
    pub nozzle_distance_std_m: f64,
    /// Hit error of the smoothing planner's path with pan and tilt at zero.
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
    /// Who flies.
    #[serde(flatten)]
    pub team: TeamFigures,
    /// What makes it that long.
    #[serde(flatten)]
    pub times: TimeFigures,
    /// Share of the time in the air with the valve open.
    pub valve_open_share: f64,
    /// Share of the time in which the plan asks for paint for which the interlock kept the valve shut.
    pub valve_held_share: f64,
    /// Estimated time of the transits between strokes, as their order was chosen by.
    pub transit_s: f64,
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
    /// The painter's own canvas where the robot can paint.
    pub psnr_canvas_in_reach_db: f64,
    /// The Gaussian-filtered wanted picture there.
    pub psnr_ideal_in_reach_db: f64,
    /// Painted surface against the wanted picture.
    pub psnr_painted_db: f64,
    /// Structural similarity of the painter's own canvas.
    pub ssim_canvas: f64,
    /// Structural similarity of the painted surface.
    pub ssim_painted: f64,
    /// The same two where the robot can paint.
    pub ssim_canvas_in_reach: f64,
    /// As above.
    pub ssim_painted_in_reach: f64,
    /// Mean CIEDE2000 between painted and wanted.
    pub ciede2000_mean: f64,
    /// Moments at which the flown robot touched the surface.
    pub collisions: usize,
    /// Moments at which the plan exceeds a limit of velocity, acceleration or joint angle.
    pub limit_violations: usize,
    /// Mean distance between the mesh that a depth camera maps after painting and the true surface.
    pub scan_error_mean_m: f64,
    /// Position error of the drifting localisation after rigid alignment, root mean square (ATE).
    pub slam_ate_rms_m: f64,
    /// Painter `fill`: share of what can be reached and shall have paint, by area, whose thickness is 50 % to 150 % of the wanted one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill_coverage_share: Option<f64>,
    /// Its share with less.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill_thin_share: Option<f64>,
    /// Standard deviation of thickness over wanted thickness there, over its mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill_deviation: Option<f64>,
    /// That mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill_mean_ratio: Option<f64>,
    /// What the robot's own localisation was worth.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub localisation: Option<LocalisationReport>,
    /// Flights that tank, battery, or what ended one in the air have cut the plans into.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sorties: Option<usize>,
    /// Time of the plans that was not flown, as the robot could not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_flown_s: Option<f64>,
    /// What became of the film.
    #[serde(flatten)]
    pub film: FilmFigures,
    /// What an excitation flight told.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub identified: Option<IdentifiedFigures>,
    /// Share of the surface's pixels that came out 15 grey levels darker than the darkest that is wanted within 3 cm.
    pub darker_than_wanted_share: f64,
    /// Length of all seams on the surface.
    pub seam_length_m: f64,
    /// Structural similarity of the painted surface within 3 cm of a seam, where the robot can paint; windows go on beyond the seams.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ssim_painted_at_seams: Option<f64>,
    /// The same farther from the seams.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ssim_painted_off_seams: Option<f64>,
    /// Layers of paint.
    pub layers: usize,
    /// Strokes over all layers.
    pub strokes: usize,
    /// Wall-clock time of the whole run.
    pub wall_s: f64,
    /// Largest resident memory.
    pub peak_rss_bytes: u64,
}

/// The papers give no such figure.
const NOT_REPORTED: &str = "-";

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
        save_figures(self, folder)?;
        write(&folder.join("report.md"), &self.markdown(folder))
    }

    /// Every figure that is asked for, with what is asked of it: the one place where the floors stand.
    pub fn checks(&self) -> Vec<Check> {
        use Requirement::{AtLeast, AtMost, Open};
        use Unit::{Centimetres, Count, Decibels, Index, Milliseconds, Percent, Ratio, Relative};
        let check = |figure, value: f64, unit, requirement, papers| Check {
            figure,
            value,
            unit,
            requirement,
            papers,
            detail: None,
        };
        let beside = |check: Check, unit: Unit, value: f64| Check { detail: Some(unit.show(value)), ..check };
        let smoothing = self.smoothing_normal_deviation_mean_m;
        let locked = self.ptu_locked_hit_error_rms_m;
        let fill = self.fill_coverage_share.zip(self.fill_deviation).map(|(covered, deviation)| {
            [
                check("Filled within 50 to 150 % of the thickness", covered, Percent, AtLeast(0.99), NOT_REPORTED),
                check("Thickness, deviation over mean", deviation, Percent, AtMost(0.1), NOT_REPORTED),
            ]
        });
        let mut checks = vec![
            check("Nozzle off the normal, mean", self.normal_deviation_mean_m, Centimetres, AtMost(0.004), "0.4 cm"),
            check("Nozzle off the normal, largest", self.normal_deviation_max_m, Centimetres, AtMost(0.02), "2 cm"),
            beside(
                check(
                    "Smoothing planner off the normal, ratio to ours",
                    smoothing / self.normal_deviation_mean_m,
                    Ratio,
                    AtLeast(5.0),
                    "4.5 cm",
                ),
                Centimetres,
                smoothing,
            ),
            check(
                "Targets whose normal is out of reach",
                self.unreachable_normal_share,
                Percent,
                AtMost(0.1),
                NOT_REPORTED,
            ),
            check("Hit error in flight, RMS", self.hit_error_rms_m, Centimetres, AtMost(0.015), "2.12 cm"),
            check("Hit error in flight, 95 %", self.hit_error_p95_m, Centimetres, AtMost(0.03), "4 cm"),
            check("Hit error with 7 cm SLAM, RMS", self.hit_error_rms_slam_m, Centimetres, Open, NOT_REPORTED),
            check(
                "Nozzle distance, standard deviation",
                self.nozzle_distance_std_m,
                Centimetres,
                AtMost(0.015),
                "1.88 cm",
            ),
            beside(
                check(
                    "Hit error of smoothing plan with gun locked, ratio",
                    locked / self.hit_error_rms_m,
                    Ratio,
                    AtLeast(3.0),
                    "about 4x",
                ),
                Centimetres,
                locked,
            ),
            check("Planning per metre of path", self.planning_s_per_m, Milliseconds, AtMost(0.1), "356 ms"),
            check("Paint mass balance, relative", self.mass_balance_relative, Relative, AtMost(1e-12), NOT_REPORTED),
            beside(
                check(
                    "Canvas over the Gaussian-filtered ideal, PSNR",
                    self.psnr_canvas_in_reach_db - self.psnr_ideal_in_reach_db,
                    Decibels,
                    AtLeast(0.0),
                    "the ideal",
                ),
                Decibels,
                self.psnr_canvas_in_reach_db,
            ),
            beside(
                check(
                    "Painted over canvas, SSIM against wanted",
                    self.ssim_painted / self.ssim_canvas,
                    Ratio,
                    AtLeast(0.9),
                    NOT_REPORTED,
                ),
                Index,
                self.ssim_painted,
            ),
            check(
                "Pixels darker than anything wanted near them",
                self.darker_than_wanted_share,
                Percent,
                AtMost(1e-3),
                NOT_REPORTED,
            ),
            check("Mean colour difference, CIEDE2000", self.ciede2000_mean, Index, Open, NOT_REPORTED),
            check("Collisions", self.collisions as f64, Count, AtMost(0.0), NOT_REPORTED),
            check("Limit violations", self.limit_violations as f64, Count, AtMost(0.0), NOT_REPORTED),
        ];
        checks.extend(fill.into_iter().flatten());
        checks
    }

    /// The main figures on a few lines.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        for check in self.checks() {
            let mark = if check.holds() { "" } else { "  NOT REACHED" };
            let (figure, value, requirement) = (check.figure, check.value_text(), check.requirement_text());
            let _ = writeln!(text, "  {figure:48} {value:>20}   {requirement:12}{mark}");
        }
        text
    }

    /// With the pictures that lie in the folder: of one paint of several there are fewer.
    fn markdown(&self, folder: &Path) -> String {
        let mut text = format!(
            "# {} painted\n\n{} layer(s), {} strokes, {:.0} m flown in {:.0} min with the valve open {:.0} % of the time, {:.3} \
             kg of paint on {:.1} m²; computed in {:.0} s. Seed {}, version {}.\n\n",
            self.surface,
            self.layers,
            self.strokes,
            self.path_length_m,
            self.flight_time_s / 60.0,
            100.0 * self.valve_open_share,
            self.paint_deposited_kg,
            self.surface_area_m2,
            self.wall_s,
            self.seed,
            self.version
        );
        text += &(self.team.summary() + &times::in_sorties(self.sorties) + &not_flown(self.not_flown_s));
        for (file, caption) in PICTURES {
            if folder.join(file).exists() {
                let _ = writeln!(text, "**{caption}**\n\n![{caption}]({file})\n");
            }
        }
        text.push_str("| figure | this run | asked for | papers | |\n|---|---|---|---|---|\n");
        for check in self.checks() {
            let mark = if check.holds() { "yes" } else { "**no**" };
            let (figure, value, requirement) = (check.figure, check.value_text(), check.requirement_text());
            let _ = writeln!(text, "| {figure} | {value} | {requirement} | {} | {mark} |", check.papers);
        }
        text += "\nThe figures asked for are for the built-in rock; on other surfaces they are for orientation. All of them, in SI units, are in \
                 [report.json](report.json).\n";
        if folder.join("mission.mcap").exists() {
            text += "The recording [mission.mcap](mission.mcap) opens in Foxglove and Rerun, the painted mesh [painted.glb](painted.glb) and the \
                     depth camera's map of it [scan.ply](scan.ply) in any mesh viewer; [trajectory.csv](trajectory.csv) has plan and flight as \
                     a table.\n";
        }
        text
    }
}

/// Refuses figures of which one is NaN or infinite.
///
/// # Errors
/// [`ReportError::NotFinite`] names the figure.
pub fn check_finite(figures: &impl Serialize) -> Result<(), ReportError> {
    // serde_json makes null of NaN and infinity.
    fn first_null(value: &serde_json::Value, name: &str) -> Option<String> {
        let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
        match value {
            serde_json::Value::Null => Some(name.to_owned()),
            serde_json::Value::Object(fields) => fields.iter().find_map(|(key, v)| first_null(v, &below(key))),
            serde_json::Value::Array(all) => {
                all.iter().enumerate().find_map(|(k, v)| first_null(v, &below(&k.to_string())))
            }
            _ => None,
        }
    }
    first_null(&serde_json::to_value(figures)?, "").map_or(Ok(()), |name| Err(ReportError::NotFinite(name)))
}

/// Writes flat figures as `report.json` into a folder.
///
/// # Errors
/// [`ReportError::NotFinite`] names the figure that is NaN or infinite.
pub fn save_figures<T: Serialize>(figures: &T, folder: &Path) -> Result<(), ReportError> {
    check_finite(figures)?;
    write(&folder.join("report.json"), &(serde_json::to_string_pretty(figures)? + "\n"))
}

/// Largest resident memory of this process so far, bytes; 0 where the system does not tell.
pub fn peak_resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("");
    line.split_whitespace().next().and_then(|kb| kb.parse::<u64>().ok()).unwrap_or(0) * 1024
}

fn write(path: &Path, text: &str) -> Result<(), ReportError> {
    whole_file::write(path, text).map_err(|source| ReportError::Unwritable { path: path.display().to_string(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Figures {
        error_m: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        drift_m: Option<f64>,
        rows: Vec<[f64; 2]>,
    }

    #[test]
    fn a_report_with_a_figure_that_is_not_finite_is_named_and_not_written() {
        let folder = std::env::temp_dir().join(format!("paintcopter-report-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let save = |error_m: f64, drift_m: Option<f64>, row: f64| {
            save_figures(&Figures { error_m, drift_m, rows: vec![[0.0; 2], [1.0, row]] }, &folder)
        };
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (figures, name) in [
                (save(bad, None, 0.0), "error_m"),
                (save(1.0, Some(bad), 0.0), "drift_m"),
                (save(1.0, None, bad), "rows.1.1"),
            ] {
                let Err(ReportError::NotFinite(found)) = figures else { panic!("{bad} was written") };
                assert_eq!(found, name);
            }
        }
        assert!(!folder.join("report.json").exists());
        save(1.0, None, 2.0).unwrap();
        let text = std::fs::read_to_string(folder.join("report.json")).unwrap();
        assert_eq!(text.split_whitespace().collect::<String>(), r#"{"error_m":1.0,"rows":[[0.0,0.0],[1.0,2.0]]}"#);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
