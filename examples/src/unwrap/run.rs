//! From a mesh file to an atlas in a folder.

use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use uv_param::atlas::{
    AtlasLayout, AtlasQuality, AtlasUpdate, ChartSettings, PackSettings, PageTexels, Turns, update_atlas,
};
use uv_param::parametrizer::Progress;
use uv_param::{Atlas, AtlasSettings, unwrap_atlas};

use super::arguments::Arguments;
use super::error::UnwrapError;
use super::files::{FileFrame, save, suffix};
use super::page_picture::{CarriedPictures, carried_over, checkerboard};
use super::previous;
use super::report::UnwrapReport;
use crate::mesh_frame::{Subject, scale_of, up_of};
use crate::mesh_io::{TriangleMesh, read_mesh};
use crate::mesh_placement::UpAxis;
use crate::picture_file::open_upright;
use crate::pictures::write_png;
use crate::progress::Stage;
use crate::report::save_figures;
use crate::run_folder;
use crate::{result, say};

/// Stretch up to which the bound is relaxed: a spot of spray is an ellipse of two to one there, on a rough surface many to a spot.
const RELAXED_STRETCH: f64 = 2.0;

/// Does what the command line asks for.
///
/// # Errors
/// [`UnwrapError`]; after [`UnwrapError::Broken`] the files are there, but not to be used.
pub fn run(arguments: &Arguments) -> Result<(), UnwrapError> {
    let (wall, folder) = (Instant::now(), arguments.out.as_path());
    let mut mesh = read_mesh(&arguments.mesh)?;
    let frame = frame(&mesh, arguments)?;
    if let Some(region) = &arguments.region {
        let scene = region.split(mesh, arguments.texel / frame.scale, frame.scale);
        mesh = scene.map_err(|source| UnwrapError::Region { path: arguments.mesh.clone(), source })?.canvas;
    }
    let seams = arguments.seams.as_deref().map(read_seams).transpose()?.unwrap_or_default();
    mesh.notes.iter().for_each(|note| say!("{}: {note}", arguments.mesh.display()));
    let carried = read_pictures(&mesh, arguments)?;
    let earlier = arguments.previous.as_deref().map(previous::read).transpose()?;
    run_folder::begin(folder, "unwrap").map_err(|e| UnwrapError::unwritable(folder, &e))?;

    let (atlas, update, cpu_s) = unwrap(&mesh, frame.scale, &seams, arguments, earlier.as_ref())?;

    let stage = Stage::start("write");
    let charts = chart_settings(arguments);
    let bounds = [charts.max_stretch, charts.worst_stretch];
    // Half of the gutter belongs to each of two charts; a texel more does no harm where there is room.
    let pages = PageTexels::of(&atlas, arguments.gutter.div_ceil(2).max(1));
    let mut textures = Vec::with_capacity(pages.len());
    for (page, texels) in pages.iter().enumerate() {
        let board = checkerboard(&atlas, texels, bounds);
        let path = folder.join(format!("charts{}.png", suffix(page)));
        write_png(&path, &board, board.dimensions().into()).map_err(|e| UnwrapError::unwritable(&path, &e))?;
        textures.push(match (&carried, &mesh.uv) {
            (Some(carried), Some(uv)) => carried_over(&atlas, texels, uv, carried),
            _ => board,
        });
    }
    save(&atlas, &mesh, frame, &textures, folder)?;
    previous::write(&atlas.layout(), folder)?;
    let report = UnwrapReport::new(&atlas, &charts, update, wall.elapsed().as_secs_f64(), cpu_s);
    save_figures(&report, folder)?;
    if report.stretch_relaxed {
        let usual = charts.max_stretch;
        eprintln!(
            "{}: lengths on the pages are off by {:.0} % in the mean: to save seams the bound {usual} of the stretch was relaxed; \
             --max-stretch {usual} keeps it",
            arguments.mesh.display(),
            100.0 * report.length_error_mean
        );
    }
    stage.done(&format!("{} page(s) of {} x {} texels", report.pages, report.page_width_px, report.page_height_px));
    result!("{}", folder.join("atlas.obj").display());
    if report.flips + report.flips_f32 + report.overlaps > 0 {
        return Err(UnwrapError::Broken { flips: report.flips.max(report.flips_f32), overlaps: report.overlaps });
    }
    Ok(())
}

/// Where to cut: as asked, or relaxed where that saves seams.
fn chart_settings(arguments: &Arguments) -> ChartSettings {
    let usual = ChartSettings { worst_stretch: arguments.worst_stretch, up: arguments.up, ..ChartSettings::default() };
    match arguments.max_stretch {
        Some(max_stretch) => ChartSettings { max_stretch, ..usual },
        None => ChartSettings { relaxed_stretch: Some(RELAXED_STRETCH), ..usual },
    }
}

/// Unit and up axis of the file, which are told.
fn frame(mesh: &TriangleMesh, arguments: &Arguments) -> Result<FileFrame, UnwrapError> {
    let subject = if arguments.region.is_some() { Subject::Place } else { Subject::Object };
    let (scale, scale_said) = scale_of(mesh, arguments.scale, subject);
    if !(scale.is_finite() && scale > 0.0) {
        let must_be = "a scale must be positive and finite";
        return Err(UnwrapError::Option { option: "--scale", value: scale, must_be });
    }
    let (up, up_said) = up_of(mesh, &arguments.mesh, arguments.up.map(UpAxis::of_direction));
    say!("{}: {} faces, {scale_said}, {up_said}", arguments.mesh.display(), mesh.faces.len());
    Ok(FileFrame { scale, up })
}

/// The atlas, what became of an earlier one, and the processor time that it took, seconds.
fn unwrap(
    mesh: &TriangleMesh,
    scale: f64,
    seams: &[[u32; 2]],
    arguments: &Arguments,
    earlier: Option<&AtlasLayout>,
) -> Result<(Atlas, Option<AtlasUpdate>, f64), UnwrapError> {
    let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(|c| f64::from(c) * scale)).collect();
    let settings = AtlasSettings {
        charts: chart_settings(arguments),
        pack: PackSettings {
            texel_m: arguments.texel,
            gutter: arguments.gutter,
            page: arguments.page,
            turns: if arguments.up.is_some() { Turns::None } else { Turns::Any },
            utilisation: arguments.utilisation,
        },
    };
    let stage = Stage::start("unwrap");
    let progress = |at: Progress| match at.stage {
        uv_param::parametrizer::Stage::Seam => stage.tell(&format!("{} seams tried", at.iteration)),
        uv_param::parametrizer::Stage::Level => {
            stage.tell(&format!("{} charts of the fine surface tried", at.iteration));
        }
        uv_param::parametrizer::Stage::Chart => stage.tell(&format!("{} charts finished", at.iteration)),
        _ => {}
    };
    let cpu = ProcessTime::try_now().ok();
    let laid_out = match earlier {
        None => unwrap_atlas(&positions, &mesh.faces, seams, &settings, progress).map(|atlas| (atlas, None)),
        Some(earlier) => update_atlas(earlier, &positions, &mesh.faces, seams, &settings, progress)
            .map(|(atlas, update)| (atlas, Some(update))),
    };
    let (atlas, update) = laid_out.map_err(|source| UnwrapError::Atlas { path: arguments.mesh.clone(), source })?;
    let cpu_s = cpu.and_then(|start| start.try_elapsed().ok()).unwrap_or_default().as_secs_f64();
    let quality = AtlasQuality::of(&atlas);
    stage.done(&format!(
        "{} charts of {} part(s), seams {:.2} m, stretch {:.3} (99 %), {:.3} (all), {:.0} % of the page used",
        quality.charts,
        atlas.report().parts,
        quality.seam_length_m,
        quality.stretch_p99,
        quality.stretch_max,
        100.0 * quality.utilisation
    ));
    if let Some(update) = &update {
        result!(
            "{} of {} faces as before; {} charts kept, {} changed, {} new",
            update.kept_faces,
            atlas.surface().faces().len(),
            update.kept_charts,
            update.changed_charts,
            update.new_charts
        );
    }
    Ok((atlas, update, cpu_s))
}

/// Pairs of vertex numbers, one on each line; what follows a `#` is passed over.
fn read_seams(path: &Path) -> Result<Vec<[u32; 2]>, UnwrapError> {
    let text = std::fs::read_to_string(path).map_err(|e| UnwrapError::unreadable(path, &e))?;
    let mut seams = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split('#').next().unwrap_or("").split_whitespace().collect();
        let numbers: Vec<u32> = words.iter().filter_map(|w| w.parse().ok()).collect();
        match (words.len(), &numbers[..]) {
            (0, _) => {}
            (2, &[a, b]) => seams.push([a, b]),
            _ => {
                let why = format!("line {}: expected two vertex numbers, counted from 0, found \"{line}\"", k + 1);
                return Err(UnwrapError::unreadable(path, &why));
            }
        }
    }
    Ok(seams)
}

/// The picture of `--texture`, else those that the mesh file names.
fn read_pictures(mesh: &TriangleMesh, arguments: &Arguments) -> Result<Option<CarriedPictures>, UnwrapError> {
    if let Some(path) = arguments.texture.as_deref() {
        if mesh.uv.is_none() {
            return Err(UnwrapError::NoCoordinates(arguments.mesh.clone()));
        }
        let picture = open_upright(path).map_err(|e| UnwrapError::unreadable(path, &e))?.to_rgb8();
        return Ok(Some(CarriedPictures { pictures: vec![picture], faces: vec![0; mesh.faces.len()] }));
    }
    let Some(materials) = mesh.materials.as_ref().filter(|m| m.textured() && mesh.uv.is_some()) else {
        return Ok(None);
    };
    let rgb = |picture| image::DynamicImage::ImageRgba8(picture).to_rgb8();
    let pictures = materials.materials.iter().map(|m| m.picture().map(rgb)).collect::<Result<_, _>>()?;
    Ok(Some(CarriedPictures { pictures, faces: materials.faces.clone() }))
}
