//! Whole plans and missions on analytic worlds. `own_*`: what each trait asks of whoever brings his own.

mod constraints;
mod continuation;
mod control;
mod gantry;
mod identification;
mod missions;
mod own_deposit_model;
mod own_planner;
mod own_rehearsal;
mod own_surface;
mod own_tool;
mod own_vehicle;
mod paper_exact;
mod plans;
mod readme;
mod stand_off;
mod teams;
mod teleop;
mod teleop_states;
mod told_of_plans;
mod transits;
mod walls;
mod worlds;
