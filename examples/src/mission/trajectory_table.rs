//! Plan and flight of a mission as a table (CSV).

use std::path::Path;

use super::error::MissionError;
use super::run::{Mission, one_after_another};
use super::team::robot_file;
use super::written_file::write;

/// `trajectory.csv` of each robot of some missions, the first paint's robots for all.
pub(super) fn save_trajectories(missions: &[&Mission], folder: &Path) -> Result<(), MissionError> {
    let robots = missions.first().map_or(1, |mission| mission.task.settings.team.robots);
    (0..robots).try_for_each(|robot| {
        write(&folder.join(robot_file("trajectory.csv", robot)), &trajectory_table(missions, robot))
    })
}

/// One row after another of a robot: what was planned, then what was flown, of the nozzle as well; missions one after the other.
fn trajectory_table(missions: &[&Mission], robot: usize) -> String {
    let mut text = String::from(
        "time_s,x_m,y_m,z_m,heading_rad,pan_rad,tilt_rad,flow_m3_per_s,target_x_m,target_y_m,target_z_m,flown_x_m,flown_y_m,\
         flown_z_m,flown_qx,flown_qy,flown_qz,flown_qw,flown_pan_rad,flown_tilt_rad,nozzle_x_m,nozzle_y_m,nozzle_z_m,axis_x,axis_y,axis_z,\
         nozzle_flow_m3_per_s\n",
    );
    let [step, _] = missions.first().map(|mission| mission.task.settings.record_steps()).unwrap_or_default();
    for (start, f) in one_after_another(missions).filter(|(_, f)| f.turn.robot == robot) {
        for s in f.flight.every(step) {
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

#[cfg(test)]
mod tests {
    use super::super::settings::MissionSettings;
    use super::super::{MissionError, PaintingTask, test_panel};
    use super::*;
    use crate::design::Design;
    use crate::region::Scene;

    /// Every fifth row where a fifth is asked for; what no recording has is refused.
    #[test]
    fn as_many_rows_as_are_asked_for() {
        let with = |record_hz| MissionSettings { threads: 1, record_hz, ..MissionSettings::default() };
        let task =
            |settings| PaintingTask::new("panel", &Scene::whole(test_panel::mesh()), &Design::Gradient, settings);
        let mut mission = Mission::run(task(with(None)).unwrap()).unwrap();
        assert_eq!(mission.flights.len(), 1);
        let rows = |mission: &Mission| -> Vec<String> {
            trajectory_table(&[mission], 0).lines().skip(1).map(str::to_owned).collect()
        };
        let usual = rows(&mission);
        mission.task.settings.record_hz = Some(4.0);
        assert!(usual.len() > 100);
        assert_eq!(rows(&mission), usual.into_iter().step_by(5).collect::<Vec<_>>());
        assert!(matches!(task(with(Some(1e9))), Err(MissionError::Recorded { .. })));
    }
}
