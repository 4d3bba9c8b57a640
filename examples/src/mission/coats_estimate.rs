//! What decided paints come to: their looks on the wall, how long and how much; planned, but neither rehearsed nor flown.

use super::coats::{CoatTasks, Look, PaintTime, looks, time_of_paints};
use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::plan::unrehearsed;
use super::wet_surface::coats;

/// One paint of an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct PaintEstimate {
    /// Its name.
    pub name: String,
    /// What a usual film of it looks like on this wall, sRGB.
    pub srgb: [u8; 3],
    /// Paint that leaves the nozzle, as the reports of flights weigh it, kg.
    pub kilograms: f64,
    /// The same as it is in the can, with its solvent, litres.
    pub litres: f64,
    /// Time in the air, all of its coats together, s.
    pub flight_time_s: f64,
}

/// All paints of a design, in flying order.
pub struct CoatsEstimate {
    /// The paints.
    pub paints: Vec<PaintEstimate>,
    /// Time in the air, s.
    pub flight_time_s: f64,
    /// With tool changes and drying, s.
    pub mission_time_s: f64,
    /// Share of a picture in colour that these paints do not show on this wall.
    pub out_of_gamut_share: Option<f64>,
    /// What each texel will look like, row by row from above; `None` beside the surface.
    pub(super) expected: Vec<Option<Look>>,
}

impl CoatsEstimate {
    /// What each texel will look like, sRGB, row by row from above; `None` beside the surface.
    pub fn page(&self) -> impl Iterator<Item = Option<[u8; 3]>> {
        self.expected.iter().map(|look| look.as_ref().map(Look::srgb8))
    }
}

/// Plans every paint without a rehearsal in wind; `progress` hears the share done.
///
/// # Errors
/// As planning; no paints.
pub fn estimate_coats(tasks: &CoatTasks, progress: &dyn Fn(f64)) -> Result<CoatsEstimate, MissionError> {
    let first = tasks.coats.first().ok_or(MissionError::NothingToPaint("no paint is needed for it"))?;
    let (mut times, mut paints) = (Vec::new(), Vec::new());
    for coat in &tasks.coats {
        let task = &coat.task;
        let mission = unrehearsed(task)?;
        let (flights, once) = (&mission.flights, mission.duration());
        let (coats, drying) = coats(task);
        let (many, again) = (coats as f64, coats as f64 - 1.0);
        times.push(PaintTime { flown: many * once, waited: again * drying, drying });
        let (solids, liquid) = (flights.iter().map(|flight| flight.route.volume()).sum::<f64>(), &task.paint.liquid);
        paints.push(PaintEstimate {
            name: task.paint.name.clone(),
            srgb: task.appearance.srgb(1.0),
            kilograms: solids * liquid.density,
            litres: 1e3 * solids / liquid.solids,
            flight_time_s: many * once,
        });
        progress(times.len() as f64 / tasks.coats.len() as f64);
    }
    let canvas = |task: &PaintingTask| {
        task.layers.last().map_or_else(|| task.coverage.map(|_| 0.0), |layer| layer.canvas.clone())
    };
    let layers = tasks.coats.iter().map(|coat| (&coat.task.paint.paint, canvas(&coat.task)));
    let picture = tasks.picture.as_ref();
    Ok(CoatsEstimate {
        paints,
        flight_time_s: times.iter().map(|time| time.flown).sum(),
        mission_time_s: time_of_paints(&times),
        out_of_gamut_share: picture.map(super::picture_task::PictureTask::out_of_gamut_share),
        expected: looks(layers, &first.task.coverage, picture)?,
    })
}
