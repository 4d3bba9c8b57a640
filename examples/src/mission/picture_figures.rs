//! What a picture in colour came to.

use std::fmt::Write as _;
use std::path::Path;

use paint_sim::colour::ciede2000;
use serde::Serialize;

use super::coats::{Coats, Look};
use super::error::MissionError;
use super::figures::mean;
use super::picture_task::PictureTask;
use crate::pictures::Rgb;

/// What hides the places of a picture that paints do not show.
const OUTSIDE: [u8; 3] = [255, 0, 200];
/// Pixels from stripe to stripe there.
const STRIPES: usize = 4;

/// The figures of a picture. Flat, SI units in the names. The gamut is that of these paints on this wall: what they show within a CIEDE2000 of 2, each
/// texel by itself; where the robot paints nothing, nothing is judged.
#[derive(Debug, Clone, Serialize)]
pub struct PictureFigures {
    /// Mean CIEDE2000 between what is on the wall and the picture, inside the gamut.
    pub ciede2000_in_gamut_mean: f64,
    /// The same of the best that all paints together can be with sprays of this size.
    pub ciede2000_optimum_mean: f64,
    /// Mean over all texels that the robot paints.
    pub ciede2000_in_reach_mean: f64,
    /// Share of the picture that these paints do not show on this wall.
    pub out_of_gamut_share: f64,
    /// Wet paint that leaves the nozzle, of each paint.
    pub paint_l_by_paint: Vec<f64>,
}

impl PictureFigures {
    pub(super) fn new(coats: &Coats, picture: &PictureTask, painted: &[Option<Look>]) -> Self {
        let in_reach = coats.missions().next().map_or(&[][..], |(_, mission)| &mission.task.in_reach);
        let painted = |k: usize| painted[picture.pixels[k]].map(|look| look.lab);
        let reached = (0..picture.pixels.len()).filter(|&k| in_reach.get(picture.pixels[k]) == Some(&true));
        let litres = |mission: &super::run::Mission| {
            let emitted = mission.film.mass_balance().emitted as f64 * paint_sim::spray::QUANTUM;
            1e3 * emitted / mission.task.paint.liquid.solids
        };
        Self {
            ciede2000_in_gamut_mean: picture.difference_in_gamut(in_reach, painted),
            ciede2000_optimum_mean: picture.difference_in_gamut(in_reach, |k| Some(picture.optimum[k])),
            ciede2000_in_reach_mean: mean(reached.filter_map(|k| Some(ciede2000(painted(k)?, picture.wanted[k])))),
            out_of_gamut_share: picture.out_of_gamut_share(),
            paint_l_by_paint: coats.missions().map(|(_, mission)| litres(mission)).collect(),
        }
    }

    pub(super) fn summary(&self) -> String {
        format!(
            "  picture    CIEDE2000 {:.2} in gamut, {:.2} at best with this spot; {:.1} % out of gamut\n",
            self.ciede2000_in_gamut_mean,
            self.ciede2000_optimum_mean,
            100.0 * self.out_of_gamut_share
        )
    }

    pub(super) fn markdown(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(
            text,
            "Inside the gamut of these paints on this wall the mean CIEDE2000 is {:.2}, at best {:.2} with a spot of this size. {:.1} % of the picture lie \
             outside:\n\n![Out of gamut](out_of_gamut.png)\n",
            self.ciede2000_in_gamut_mean,
            self.ciede2000_optimum_mean,
            100.0 * self.out_of_gamut_share
        );
        text
    }
}

/// The picture itself on the page.
pub(super) fn wanted_looks(picture: &PictureTask, pixels: usize) -> Vec<Option<Look>> {
    let mut looks = vec![None; pixels];
    for (k, &pixel) in picture.pixels.iter().enumerate() {
        looks[pixel] = Some(Look { linear: picture.wanted_linear[k], lab: picture.wanted[k] });
    }
    looks
}

/// The picture with stripes over what paints do not show.
pub(super) fn save_out_of_gamut(
    picture: &PictureTask,
    wanted: &[Option<Look>],
    [width, height]: [usize; 2],
    folder: &Path,
) -> Result<(), MissionError> {
    let mut colours: Vec<Option<[u8; 3]>> = wanted.iter().map(|look| look.as_ref().map(Look::srgb8)).collect();
    for (&pixel, _) in picture.pixels.iter().zip(&picture.in_gamut).filter(|(_, inside)| !**inside) {
        if (pixel % width + pixel / width) % STRIPES < STRIPES / 2 {
            colours[pixel] = Some(OUTSIDE);
        }
    }
    Ok(Rgb::of_page(width, height, colours).save(&folder.join("out_of_gamut.png"))?)
}
