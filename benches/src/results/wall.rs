//! The same picture on the built-in wall by several painters: in one flight, in the thesis' layers, by the thesis' network (its Fig. 8.9).

use std::error::Error;

use paint_net::painters::LayerPlanning;
use paintcopter::design::Design;
use paintcopter::mission::{Mission, MissionSettings, PainterChoice, PaintingTask, inspect, report};
use paintcopter::region::Scene;
use paintcopter::world::rock_wall;

use super::extent::Extent;
use super::table::{Table, number};

/// Of wall, picture and wind.
const SEED: u64 = 1;

/// Name, painter, and how layers are decided, if it paints in layers.
const PAINTERS: [(&str, PainterChoice, Option<LayerPlanning>); 4] = [
    ("one flight whose flow carries the picture", PainterChoice::Feedback, None),
    ("wide and narrow rows", PainterChoice::AdaptiveRows, None),
    ("layers cut at the thesis' thresholds; strokes ordered", PainterChoice::Feedback, Some(LayerPlanning::Joint)),
    ("the thesis' network", PainterChoice::Thesis, None),
];

/// The table; of a quick rerun the first row.
///
/// # Errors
/// Those of the missions.
pub fn tables(extent: Extent) -> Result<Vec<Table>, Box<dyn Error>> {
    let head = ["painter", "flight time; s", "path; m", "valve open; %", "SSIM painted"];
    let mut table = Table::new("wall", &head);
    let rows = if extent == Extent::Quick { &PAINTERS[..1] } else { &PAINTERS[..] };
    for (name, painter, layers) in rows {
        let usual = MissionSettings { seed: SEED, ..MissionSettings::default() };
        let settings = MissionSettings { painter: *painter, layered: *layers, ..usual };
        let design = Design::Strata { seed: SEED };
        let mission =
            PaintingTask::new("rock", &Scene::whole(rock_wall(SEED)), &design, settings).and_then(Mission::run)?;
        let report = report(&mission, &inspect(&mission)?)?;
        let open = number(100.0 * report.valve_open_share, 0);
        let (time, path) = (number(report.flight_time_s, 0), number(report.path_length_m, 0));
        table.row([(*name).into(), time, path, open, number(report.ssim_painted, 3)]);
    }
    Ok(vec![table])
}
