//! The main job: a mesh and a design in, a painted surface and its figures out.

mod coats;
mod coats_output;
mod decide;
mod dose_correction;
mod error;
mod figures;
mod fly;
mod footprints;
mod inspect;
mod look;
mod mission_output;
mod nozzle;
mod painting_task;
mod path_view;
mod plan;
mod plan_output;
mod planned_flight;
mod planned_mission;
mod preview;
mod reach;
mod rehearsal;
mod run;
mod seams;
mod settings;
mod shading;
mod simulated_flight;
#[cfg(test)]
mod test_panel;
mod touch_up;
mod trajectory_table;
mod true_surface;
mod view;

pub use coats::{Coat, Coats};
pub use coats_output::{CoatsFigures, save_coats};
pub use error::MissionError;
pub use figures::report;
pub use fly::LayerFlight;
pub use inspect::{Inspection, inspect};
pub use mission_output::save;
pub use painting_task::PaintingTask;
pub use plan_output::{PlanFigures, save_plan};
pub use planned_flight::{FlownFigures, PlannedFlight};
pub use planned_mission::PlannedMission;
pub use preview::{Preview, preview};
pub use run::Mission;
pub use settings::{ControllerChoice, LocalisationChoice, MissionSettings, PainterChoice};
