//! Plan and flight of a mission as a table (CSV).

use std::path::Path;

use super::error::MissionError;
use super::fly::KEPT_STEP;
use super::run::{Mission, one_after_another};
use super::team::robot_file;
use super::written_file::write;

/// Seconds between two rows.
pub(super) const TRAJECTORY_STEP: f64 = KEPT_STEP;

/// `trajectory.csv` of each robot of some missions, the first paint's robots for all.
pub(super) fn save_trajectories(missions: &[&Mission], folder: &Path) -> Result<(), MissionError> {
    let robots = missions.first().map_or(1, |mission| mission.task.settings.team.robots);
    (0..robots).try_for_each(|robot| {
        write(&folder.join(robot_file("trajectory.csv", robot)), &trajectory_table(missions, robot))
    })
}

/// One row every [`TRAJECTORY_STEP`] seconds of a robot: what was planned, then what was flown, of the nozzle as well; missions one after the other.
fn trajectory_table(missions: &[&Mission], robot: usize) -> String {
    let mut text = String::from(
        "time_s,x_m,y_m,z_m,heading_rad,pan_rad,tilt_rad,flow_m3_per_s,target_x_m,target_y_m,target_z_m,flown_x_m,flown_y_m,\
         flown_z_m,flown_qx,flown_qy,flown_qz,flown_qw,flown_pan_rad,flown_tilt_rad,nozzle_x_m,nozzle_y_m,nozzle_z_m,axis_x,axis_y,axis_z,\
         nozzle_flow_m3_per_s\n",
    );
    for (start, f) in one_after_another(missions).filter(|(_, f)| f.turn.robot == robot) {
        for s in f.flight.every(TRAJECTORY_STEP) {
            let planned = f.plan.setpoint(s.time);
            let (p, aim) = (planned.sample.position, planned.aim);
            let (flown, q) = (s.world_from_body.translation, s.world_from_body.rotation.coords);
            let row = [
                [start + s.time, p.x, p.y, p.z, planned.sample.heading, planned.pan, planned.tilt].as_slice(),
                &[planned.flow, aim.x, aim.y, aim.z, flown.x, flown.y, flown.z],
                &[q.x, q.y, q.z, q.w, s.pan_tilt[0], s.pan_tilt[1]],
                &[s.nozzle.x, s.nozzle.y, s.nozzle.z, s.axis.x, s.axis.y, s.axis.z, s.flow],
            ]
            .concat();
            text += &cells(&row);
            text.push('\n');
        }
    }
    text
}

/// Numbers between commas, to the nanometre and the nanosecond.
pub(super) fn cells(row: &[f64]) -> String {
    let numbers: Vec<String> = row.iter().map(|value| format!("{value:.9}")).collect();
    numbers.join(",")
}
