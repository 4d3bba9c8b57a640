//! A mission: strokes on a surface become flights that have been rehearsed, and every target that stays bare has its reason.
//!
//! The stages, each usable by itself: strokes of a picture are lifted onto the surface and ordered ([`Route`]), planned by any
//! [`Planner`](crate::Planner), flown in the caller's simulation and planned again with more clearance where that came too near
//! ([`Rehearsal`]); what a plan gives up although a pose reaches it becomes a flight of its own ([`MissionPlanner`]). Several robots
//! ([`Team`]) divide the strokes ([`Cells`]) and fly when none comes too near to another.
//! [`reachable_targets`] and [`reachable_texels`] tell a painter beforehand what cannot be served.

mod cells;
mod flights;
mod planner;
mod reach;
mod rehearse;
mod retry;
mod schedule;
mod strokes;
mod target_outcomes;
mod team;
mod texel_reach;
mod upright;

pub use cells::Cells;
pub use flights::{MissionFlight, MissionPlan};
pub use planner::{MissionPlanner, MissionSettings, plan_mission};
pub use reach::reachable_targets;
pub use rehearse::{MarginRehearsal, NearMiss, NoRehearsal, Rehearsal, gap};
pub use schedule::{Track, nearest_approach};
pub use strokes::{Chart, LiftedStrokes, Route, Spray, spray_cell};
pub use target_outcomes::TargetOutcomes;
pub use team::{Team, Turn};
pub use texel_reach::reachable_texels;
pub use upright::{UprightSpray, upright, upright_steps};
