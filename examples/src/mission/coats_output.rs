//! What a mission with several paints leaves beside the results of each: pictures of all paints over each other, and the sums.

use std::fmt::Write as _;
use std::path::Path;

use paint_net::Image;
use paint_sim::colour::ciede2000;
use paint_sim::surface::Hit;
use serde::Serialize;

use super::coats::{Coats, Look, PaintTime, Wall, linear, time_of_paints};
use super::error::MissionError;
use super::figures::mean;
use super::kept_clean::kept_clean;
use super::mission_output::{save, save_flights, save_flown_path};
use super::painted_mesh::save_painted_mesh;
use super::painted_views::save_painted_views;
use super::picture_figures::{PictureFigures, save_out_of_gamut, wanted_looks};
use super::progress_views::ProgressViews;
use super::run::Mission;
use super::sagging::{sagging_share, save_sagging};
use super::shading::shading_of_colours;
use super::written_file::{unwritable, write};
use crate::pictures::{COLOUR_DIFFERENCE, Rgb, save_error_map};
use crate::progress::Stage;
use crate::report::{CleanFigures, Report, TeamFigures, not_flown, save_figures};

/// Depth from which a paint counts as wanted.
const WANTED: f64 = 0.05;

/// The figures of all paints together. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct CoatsFigures {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that was painted.
    pub surface: String,
    /// Seed of everything random.
    pub seed: u64,
    /// The paints in flying order.
    pub paints: Vec<String>,
    /// Folder of each one's results.
    pub folders: Vec<String>,
    /// Time in the air of each.
    pub flight_time_s_by_paint: Vec<f64>,
    /// Paint of each that stayed on the surface.
    pub paint_deposited_kg_by_paint: Vec<f64>,
    /// Share of what is wanted of each that was not planned.
    pub unreachable_paint_share_by_paint: Vec<f64>,
    /// Structural similarity of each one's film to what is wanted of it.
    pub ssim_painted_by_paint: Vec<f64>,
    /// Time in the air.
    pub flight_time_s: f64,
    /// Who flies.
    #[serde(flatten)]
    pub team: TeamFigures,
    /// Times that the tank is changed.
    pub tool_changes: usize,
    /// From the first start to the last landing: in the air, and on the ground while a film dries and the tank is changed.
    pub mission_time_s: f64,
    /// Time of the plans that was not flown, as the robot could not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_flown_s: Option<f64>,
    /// Length of the vehicle's paths.
    pub path_length_m: f64,
    /// Paint that stayed on the surface.
    pub paint_deposited_kg: f64,
    /// Share by area of the painted surface on which a paint was so thick that it ran.
    pub sagging_share: f64,
    /// What should stay clean.
    #[serde(flatten)]
    pub clean: CleanFigures,
    /// Strokes of all.
    pub strokes: usize,
    /// Moments at which the flown robot touched the surface.
    pub collisions: usize,
    /// Moments at which a plan exceeds a limit.
    pub limit_violations: usize,
    /// Mean CIEDE2000 between what is on the wall and what is wanted, all paints over each other.
    pub ciede2000_mean: f64,
    /// The same where paint is wanted.
    pub ciede2000_mean_where_wanted: f64,
    /// What a picture in colour came to.
    #[serde(flatten)]
    pub picture: Option<PictureFigures>,
}

impl CoatsFigures {
    /// A line for each paint, and one for all.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        for (k, paint) in self.paints.iter().enumerate() {
            let (minutes, kilograms) = (self.flight_time_s_by_paint[k] / 60.0, self.paint_deposited_kg_by_paint[k]);
            let (missing, ssim) = (100.0 * self.unreachable_paint_share_by_paint[k], self.ssim_painted_by_paint[k]);
            let _ = writeln!(
                text,
                "  {paint:10} {minutes:6.1} min, {kilograms:.3} kg, {missing:.1} % not planned, SSIM {ssim:.3}"
            );
        }
        let (minutes, difference) = (self.flight_time_s / 60.0, self.ciede2000_mean_where_wanted);
        text += &self.team.summary();
        let hours = self.mission_time_s / 3600.0;
        let _ = writeln!(
            text,
            "  all        {minutes:6.1} min in the air, {hours:.1} h with tool changes and drying, CIEDE2000 {difference:.2} where paint is wanted"
        );
        if let Some(picture) = &self.picture {
            text += &picture.summary();
        }
        text
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# {} painted in {} paints\n\n{}![The painted surface](painted_view.png)\n\n**Wanted**\n\n![Wanted](wanted.png)\n\n**Painted**\n\n\
             ![Painted](painted.png)\n\nMean CIEDE2000 {:.2}, {:.2} where paint is wanted; {} collisions, {} limit violations.\n\n{}\
             | paint | results | minutes | kg | not planned | SSIM |\n|---|---|---|---|---|---|\n",
            self.surface,
            self.paints.len(),
            self.team.summary() + &not_flown(self.not_flown_s),
            self.ciede2000_mean,
            self.ciede2000_mean_where_wanted,
            self.collisions,
            self.limit_violations,
            self.picture.as_ref().map_or_else(String::new, PictureFigures::markdown)
        );
        for (k, (paint, folder)) in self.paints.iter().zip(&self.folders).enumerate() {
            let (minutes, kilograms) = (self.flight_time_s_by_paint[k] / 60.0, self.paint_deposited_kg_by_paint[k]);
            let (missing, ssim) = (100.0 * self.unreachable_paint_share_by_paint[k], self.ssim_painted_by_paint[k]);
            let _ = writeln!(
                text,
                "| {paint} | [{folder}]({folder}/report.md) | {minutes:.1} | {kilograms:.3} | {missing:.1} % | {ssim:.3} |"
            );
        }
        text
    }
}

/// Writes the results of every paint into its folder, those of all into `folder`; the report last.
pub fn save_coats(coats: &Coats, folder: &Path) -> Result<CoatsFigures, MissionError> {
    let mut reports = Vec::new();
    for (folder, mission) in coats.missions() {
        std::fs::create_dir_all(folder).map_err(unwritable(folder))?;
        reports.push(save(mission, folder)?);
    }
    let stage = Stage::start("all paints");
    let painted = coats.painted()?;
    let wanted = match &coats.picture {
        Some(picture) => wanted_looks(picture, painted.len()),
        None => coats.wanted()?,
    };
    save_pictures(coats, &wanted, &painted, folder)?;
    let figures = figures(coats, &reports, &wanted, &painted);
    write(&folder.join("report.md"), &figures.markdown())?;
    save_figures(&figures, folder)?;
    stage.done(&folder.display().to_string());
    Ok(figures)
}

fn save_pictures(
    coats: &Coats,
    wanted: &[Option<Look>],
    painted: &[Option<Look>],
    folder: &Path,
) -> Result<(), MissionError> {
    let Some((_, mission)) = coats.missions().next() else { return Ok(()) };
    let task = &mission.task;
    let (width, height) = (task.wanted.width(), task.wanted.height());
    for (walls, name) in [(wanted, "wanted.png"), (painted, "painted.png")] {
        let page = walls.iter().map(|look| look.as_ref().map(Look::srgb8));
        Rgb::of_page(width, height, page).save(&folder.join(name))?;
    }
    if let Some(picture) = &coats.picture {
        save_out_of_gamut(picture, wanted, [width, height], folder)?;
    }
    let colours: [Image; 3] = linear(painted, width, height)?;
    let shade = |hit: &Hit| shading_of_colours(task, &colours, hit);
    save_painted_views(task, &shade, folder)?;
    save_flown_path(mission, &shade, folder)?;
    save_progress(coats, &folder.join("progress.png"))?;
    let texel = (task.settings.texel, "m");
    save_error_map(&folder.join("error.png"), width, &differences(wanted, painted), texel, &COLOUR_DIFFERENCE)?;
    let page: Vec<_> = painted.iter().map(|look| look.as_ref().map(Look::srgb8)).collect();
    let vertices = save_painted_mesh(task, &page, folder)?;
    let missions: Vec<&Mission> = coats.missions().map(|(_, mission)| mission).collect();
    save_sagging(&missions, folder)?;
    save_flights(&missions, &vertices, folder)
}

/// The bare surface, and after each paint.
fn save_progress(coats: &Coats, path: &Path) -> Result<(), MissionError> {
    let Some((_, first)) = coats.missions().next() else { return Ok(()) };
    let task = &first.task;
    let mut wall = Wall::bare(&task.coverage, coats.picture.as_ref())?;
    let mut views = ProgressViews::new(task)?;
    let mut show = |caption: &str, wall: &Wall| {
        let colours = linear(&wall.looks(), task.wanted.width(), task.wanted.height())?;
        views.show(caption.to_string(), &|hit: &Hit| shading_of_colours(task, &colours, hit))
    };
    show("bare", &wall)?;
    for (_, mission) in coats.missions() {
        wall.paint(&mission.task.paint.paint, &mission.painted_depth())?;
        show(&mission.task.paint.name, &wall)?;
    }
    views.save(path)
}

/// CIEDE2000 per pixel, `None` beside the surface.
fn differences(wanted: &[Option<Look>], painted: &[Option<Look>]) -> Vec<Option<f64>> {
    let difference =
        |(wanted, painted): (&Option<Look>, &Option<Look>)| Some(ciede2000((*painted)?.lab, (*wanted)?.lab));
    wanted.iter().zip(painted).map(difference).collect()
}

fn figures(coats: &Coats, reports: &[Report], wanted: &[Option<Look>], painted: &[Option<Look>]) -> CoatsFigures {
    let of = |value: fn(&Report) -> f64| reports.iter().map(value).collect::<Vec<f64>>();
    let sum = |value: fn(&Report) -> f64| reports.iter().map(value).sum::<f64>();
    let is_wanted = |k: usize| coats.wanted.iter().any(|(_, depth)| depth.data()[k] > WANTED);
    let differences = differences(wanted, painted);
    let difference = |k: usize| differences[k];
    let flight_times = of(|r| r.flight_time_s);
    let time = |(flown, (_, mission)): (&f64, (_, &Mission))| {
        let [waited, drying] = mission.ground_times;
        PaintTime { flown: *flown, waited, drying }
    };
    let times: Vec<PaintTime> = flight_times.iter().zip(coats.missions()).map(time).collect();
    let missions: Vec<&Mission> = coats.missions().map(|(_, mission)| mission).collect();
    let name = |folder: &Path| folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    CoatsFigures {
        version: env!("CARGO_PKG_VERSION"),
        surface: reports.first().map_or_else(String::new, |report| report.surface.clone()),
        seed: reports.first().map_or(0, |report| report.seed),
        paints: coats.missions().map(|(_, mission)| mission.task.paint.name.clone()).collect(),
        folders: coats.missions().map(|(folder, _)| name(folder)).collect(),
        flight_time_s_by_paint: flight_times,
        paint_deposited_kg_by_paint: of(|r| r.paint_deposited_kg),
        unreachable_paint_share_by_paint: of(|r| r.unreachable_paint_share),
        ssim_painted_by_paint: of(|r| r.ssim_painted),
        flight_time_s: sum(|r| r.flight_time_s),
        team: TeamFigures::of_all(reports.iter().map(|report| report.team)),
        tool_changes: times.len().saturating_sub(1),
        mission_time_s: time_of_paints(&times),
        not_flown_s: coats.grounded().map(|grounded| grounded.left_s),
        path_length_m: sum(|r| r.path_length_m),
        paint_deposited_kg: sum(|r| r.paint_deposited_kg),
        sagging_share: sagging_share(&missions),
        clean: kept_clean(&missions),
        strokes: reports.iter().map(|r| r.strokes).sum(),
        collisions: reports.iter().map(|r| r.collisions).sum(),
        limit_violations: reports.iter().map(|r| r.limit_violations).sum(),
        ciede2000_mean: mean((0..wanted.len()).filter_map(difference)),
        ciede2000_mean_where_wanted: mean((0..wanted.len()).filter(|k| is_wanted(*k)).filter_map(difference)),
        picture: coats.picture.as_ref().map(|picture| PictureFigures::new(coats, picture, painted)),
    }
}
