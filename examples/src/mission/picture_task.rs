//! A picture in colour on a wall: the wanted colours, the paints, and how much of each lies where.

use std::collections::BTreeMap;

use paint_net::colour::{Separated, TexelSeparation, best_order, choose_paints};
use paint_sim::Substrate;
use paint_sim::colour::{ciede2000, linear_srgb_lab, spectrum_linear_srgb};
use paint_sim::paint::{Bands, FilmStack};

use super::error::MissionError;
use super::figures::mean;
use super::painting_task::PaintingTask;
use crate::adapters::FilmsOnWall;
use crate::appearance::{DEEPEST, UNIT_THICKNESS};
use crate::paint_set::NamedPaint;
use crate::palette_choice::PaletteCandidates;
use crate::progress::Stage;
use crate::say;
use crate::wall::WallSpectra;

/// CIEDE2000 up to which paints show a colour: two patches side by side that differ as little are told apart with care.
const SHOWN: f64 = 2.0;
/// Edge of the cells of CIELAB that a picture's colours are gathered in to choose paints by, and how many of them count.
const CELL: f64 = 9.0;
const CELLS: usize = 64;
/// Share of the cost that a white ground has to save to be worth a coat.
const WORTH: f64 = 0.1;

/// A picture in colour on the texels of a surface.
pub struct PictureTask {
    /// The paints, the lowest film first.
    pub(super) paints: Vec<NamedPaint>,
    pub(super) stack: FilmStack,
    pub(super) wall: WallSpectra,
    bands: Vec<Bands>,
    /// Pixel of every texel of the film.
    pub(super) pixels: Vec<usize>,
    /// What is wanted there, linear sRGB and CIELAB.
    pub(super) wanted_linear: Vec<[f64; 3]>,
    pub(super) wanted: Vec<[f64; 3]>,
    /// The nearest colour that the paints show, each texel by itself.
    pub(super) nearest: Vec<[f64; 3]>,
    /// Whether that is as good as the wanted one.
    pub(super) in_gamut: Vec<bool>,
    /// Depths there, paint after paint, one for each texel.
    pub(super) separated: Vec<Vec<f64>>,
    /// The best colours that sprays of this size leave of it.
    pub(super) optimum: Vec<[f64; 3]>,
}

impl PictureTask {
    /// Chooses the paints, their order, and the depths of each on every texel by itself. `picture` is linear sRGB with opacity, one for each pixel
    /// of the page; where it is transparent the wall shows.
    pub(super) fn separate(
        task: &PaintingTask,
        picture: &[[f32; 4]],
        candidates: &PaletteCandidates,
        wall: WallSpectra,
        pixels: Vec<usize>,
    ) -> Result<Self, MissionError> {
        let stage = Stage::start("separate");
        let bare: Vec<[f64; 3]> = wall.spectra.iter().map(spectrum_linear_srgb).collect();
        // The wall shows also where it stays clean.
        let picture = |pixel: usize| if task.clean[pixel] { [0.0; 4] } else { picture[pixel] };
        let over_wall = |(&pixel, &of): (&usize, &u32)| {
            let [r, g, b, opacity] = picture(pixel).map(f64::from);
            let below = bare[of as usize].map(|c| c.clamp(0.0, 1.0) * (1.0 - opacity));
            [r + below[0], g + below[1], b + below[2]]
        };
        let wanted_linear: Vec<[f64; 3]> = pixels.iter().zip(&wall.of_place).map(over_wall).collect();
        let wanted: Vec<[f64; 3]> = wanted_linear.iter().map(|&linear| linear_srgb_lab(linear)).collect();
        let bands: Vec<Bands> = wall.spectra.iter().map(FilmStack::bands).collect();
        let separation =
            TexelSeparation { deepest: DEEPEST, threads: task.settings.threads, ..TexelSeparation::default() };
        let opaque: Vec<bool> = pixels.iter().map(|&pixel| picture(pixel)[3] > 0.0).collect();
        let colours = usual_colours(&wanted, &opaque);
        if colours.is_empty() {
            return Err(MissionError::NothingToPaint("the picture does not lie on it"));
        }
        let (paints, stack) = choose(candidates, &colours, &bands[..1], &separation)?;
        stage.share(0.3);
        let model = FilmsOnWall { stack: &stack, grounds: &bands, of_pixel: &wall.of_place };
        let asked: Vec<Option<[f64; 3]>> =
            wanted.iter().zip(&opaque).map(|(lab, opaque)| opaque.then_some(*lab)).collect();
        let Separated { depths, lab } = separation.separate(&asked, &model)?;
        let in_gamut: Vec<bool> =
            lab.iter().zip(&wanted).map(|(shown, wanted)| ciede2000(*shown, *wanted) <= SHOWN).collect();
        let outside = in_gamut.iter().filter(|shown| !**shown).count() as f64 / in_gamut.len().max(1) as f64;
        let names: Vec<&str> = paints.iter().map(|paint| paint.name.as_str()).collect();
        stage.done(&format!("{}; {:.1} % out of gamut", names.join(", "), 100.0 * outside));
        if outside > 0.5 {
            say!(
                "{:.0} % of the picture cannot be shown with these paints on this wall: see out_of_gamut.png",
                100.0 * outside
            );
        }
        Ok(Self {
            paints,
            stack,
            wall,
            bands,
            pixels,
            wanted_linear,
            wanted,
            optimum: lab.clone(),
            nearest: lab,
            in_gamut,
            separated: depths,
        })
    }

    /// What films look like on the texels.
    pub(super) fn model(&self) -> FilmsOnWall<'_> {
        FilmsOnWall { stack: &self.stack, grounds: &self.bands, of_pixel: &self.wall.of_place }
    }

    /// What sprays shall come near to: the wanted colour, or the nearest that paints show.
    pub(super) fn aims(&self) -> Vec<[f64; 3]> {
        let aim = |k: usize| if self.in_gamut[k] { self.wanted[k] } else { self.nearest[k] };
        (0..self.wanted.len()).map(aim).collect()
    }

    /// Leaves the paints out that are not among these.
    pub(super) fn keep(&mut self, names: &[String]) {
        let kept: Vec<usize> = (0..self.paints.len()).filter(|&k| names.contains(&self.paints[k].name)).collect();
        self.stack = self.stack.select(&kept);
        self.separated = kept.iter().map(|&k| self.separated[k].clone()).collect();
        self.paints = kept.into_iter().map(|k| self.paints[k].clone()).collect();
    }

    /// Mean CIEDE2000 between the picture and what is found on the texels, inside the gamut and where the robot paints.
    pub(super) fn difference_in_gamut(&self, in_reach: &[bool], found: impl Fn(usize) -> Option<[f64; 3]>) -> f64 {
        let counts = |k: &usize| self.in_gamut[*k] && in_reach.get(self.pixels[*k]) == Some(&true);
        let inside = (0..self.pixels.len()).filter(counts);
        mean(inside.filter_map(|k| Some(ciede2000(found(k)?, self.wanted[k]))))
    }

    /// Share of the texels that paints do not show.
    pub(super) fn out_of_gamut_share(&self) -> f64 {
        let outside = self.in_gamut.iter().filter(|inside| !**inside).count();
        outside as f64 / self.in_gamut.len().max(1) as f64
    }

    /// The wall as it is in the mean.
    pub(super) fn mean_wall(&self) -> Result<Substrate, paint_sim::Error> {
        Substrate::new(self.wall.spectra[0])
    }
}

/// The colours of a picture, gathered, with the share of each.
fn usual_colours(wanted: &[[f64; 3]], opaque: &[bool]) -> Vec<([f64; 3], f64)> {
    let mut cells: BTreeMap<[i32; 3], ([f64; 3], f64)> = BTreeMap::new();
    for (lab, _) in wanted.iter().zip(opaque).filter(|(_, opaque)| **opaque) {
        let (sum, count) = cells.entry(lab.map(|v| (v / CELL).round() as i32)).or_default();
        sum.iter_mut().zip(lab).for_each(|(sum, v)| *sum += v);
        *count += 1.0;
    }
    let mut colours: Vec<([f64; 3], f64)> =
        cells.into_values().map(|(sum, count)| (sum.map(|v| v / count), count)).collect();
    colours.sort_by(|a, b| b.1.total_cmp(&a.1));
    colours.truncate(CELLS);
    let all: f64 = colours.iter().map(|(_, count)| count).sum();
    for (_, count) in &mut colours {
        *count /= all;
    }
    colours
}

/// The paints of a palette for some colours on a wall, in their order, with their films.
fn choose(
    candidates: &PaletteCandidates,
    colours: &[([f64; 3], f64)],
    wall: &[Bands],
    separation: &TexelSeparation,
) -> Result<(Vec<NamedPaint>, FilmStack), MissionError> {
    let PaletteCandidates { paints, choose, underpaint } = candidates;
    let mut paints: Vec<NamedPaint> = underpaint.iter().chain(paints).cloned().collect();
    // What hides most lies lowest before anything better is known.
    let hides = |paint: &NamedPaint| paint.paint.scattering().iter().sum::<f64>();
    paints.sort_by(|a, b| hides(b).total_cmp(&hides(a)));
    let films = paints.iter().map(|paint| paint.paint);
    let all = films.map(|film| FilmStack::new(&[film], UNIT_THICKNESS, DEEPEST)).collect::<Result<Vec<_>, _>>()?;
    let mut cost = |order: &[usize]| -> Result<f64, MissionError> {
        let stack = FilmStack::stacked(order.iter().map(|&k| &all[k]));
        Ok(separation.cost(colours, &FilmsOnWall { stack: &stack, grounds: wall, of_pixel: &[0] })?)
    };
    let chosen = match (choose, underpaint) {
        (Some(count), _) => choose_paints(paints.len(), *count, &mut cost)?,
        (None, None) => (0..paints.len()).collect(),
        (None, Some(white)) => {
            let with: Vec<usize> = (0..paints.len()).collect();
            let without: Vec<usize> = with.iter().copied().filter(|&k| paints[k].name != white.name).collect();
            let worth = cost(&with)? < (1.0 - WORTH) * cost(&without)?;
            if worth {
                say!("the wall is too dark for these paints alone: {} lies under them", white.name);
            }
            if worth { with } else { without }
        }
    };
    let order = best_order(&chosen, &mut cost)?;
    let stack = FilmStack::stacked(order.iter().map(|&k| &all[k]));
    Ok((order.into_iter().map(|k| paints[k].clone()).collect(), stack))
}
