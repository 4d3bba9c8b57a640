//! What a plan leaves in its folder: for people, for an autopilot, for a viewer.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use paint_planner::Plan;
use paint_planner::mission::TargetOutcomes;
use paint_planner::plan::Setpoint;
use paint_sim::surface::Hit;
use ptu_kinematics::{Joints, PitchingJoints};
use serde::Serialize;

use super::error::MissionError;
use super::figures::mean;
use super::painting_task::PaintingTask;
use super::path_view::{FlownWay, save_path};
use super::plan::PlannedLayer;
use super::planned_mission::{PlannedMission, share_out_of_reach};
use super::planned_robot::PlannedRobot;
use super::preview::expected_depth;
use super::settings::{KEPT_STEP, RECORDING_STEP};
use super::shading::{shading, vertex_colours};
use super::team::{first_of_each_cell, planned_team, robot_file};
use super::trajectory_table::cells;
use super::written_file::write;
use crate::progress::Stage;
use crate::recording::{ColouredMesh, RobotState, save_recording};
use crate::report::{TeamFigures, TimeFigures, save_figures};

/// The figures of a plan. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct PlanFigures {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that is to be painted.
    pub surface: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Flights: layers of paint.
    pub layers: usize,
    /// Strokes over all layers.
    pub strokes: usize,
    /// Targets with paint. What is flown once more counts once.
    pub targets: usize,
    /// Those of them that are not served; the reasons follow, and the sum of these is that number.
    pub targets_not_served: usize,
    /// The joints do not reach their normal.
    pub targets_out_of_reach: usize,
    /// Something stands in front of them.
    pub targets_hidden: usize,
    /// The robot fits at no heading, or cannot go on to the next from any.
    pub targets_without_heading: usize,
    /// The trajectory came too near something there.
    pub targets_too_near: usize,
    /// No flight to them was found.
    pub targets_without_transit: usize,
    /// The planned motion misses them: the valve stays shut.
    pub targets_missed: usize,
    /// The rehearsal in wind gave them up: those of `targets_left_bare` that have paint before them or after them and no other flight.
    pub targets_left_in_wind: usize,
    /// Targets that keep more clearance since the rehearsal in wind.
    pub targets_kept_off: usize,
    /// Targets given up in the rehearsal, with paint and without, in all flights.
    pub targets_left_bare: usize,
    /// Share of the surface in reach but for keep-out volumes and tether.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_to_constraints_share: Option<f64>,
    /// Share of the wanted paint that is not planned.
    pub unreachable_paint_share: f64,
    /// Time in the air.
    pub flight_time_s: f64,
    /// Who flies.
    #[serde(flatten)]
    pub team: TeamFigures,
    /// What makes it that long.
    #[serde(flatten)]
    pub times: TimeFigures,
    /// Length of the vehicle's way.
    pub path_length_m: f64,
    /// Share of the time with the valve open.
    pub valve_open_share: f64,
    /// Paint that leaves the nozzle.
    pub paint_kg: f64,
    /// Mean deviation of the nozzle from the normal, `|n x (p - t)|`, over the targets that are served.
    pub normal_deviation_mean_m: f64,
    /// Largest such deviation.
    pub normal_deviation_max_m: f64,
    /// Certified bound of the vehicle's speed.
    pub max_speed_m_per_s: f64,
    /// Certified bound of its acceleration.
    pub max_acceleration_m_per_s2: f64,
    /// Greatest planned rate of pan or tilt.
    pub max_joint_rate_rad_per_s: f64,
    /// Greatest planned pitch of a vehicle that hovers pitched.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_pitch_rad: Option<f64>,
    /// How much of the clearance asked for may be missing along the planned motion; 0: certified, between targets too.
    pub clearance_missing_m: f64,
    /// Planning time on one core.
    pub planning_s: f64,
    /// Wall-clock time of everything.
    pub wall_s: f64,
    #[serde(skip)]
    outcomes: TargetOutcomes,
}

impl PlanFigures {
    /// One line for people.
    pub fn summary(&self) -> String {
        format!(
            "{:.1} min in the air, {:.0} m, valve open {:.0} % of the time, {:.2} kg of paint; {}",
            self.flight_time_s / 60.0,
            self.path_length_m,
            100.0 * self.valve_open_share,
            self.paint_kg,
            self.outcomes.summary()
        )
    }
}

/// Writes `plan.csv`, `path.png`, `robot.urdf`, `plan.mcap` and `report.json` into an existing folder; the report last.
pub fn save_plan(mission: &PlannedMission, folder: &Path) -> Result<PlanFigures, MissionError> {
    let stage = Stage::start("export");
    let task = &mission.task;
    for robot in 0..task.settings.team.robots {
        write(&folder.join(robot_file("plan.csv", robot)), &table(mission, robot))?;
    }
    stage.share(0.2);
    let depth = expected_depth(task);
    let ways = first_of_each_cell(mission.layers().map(|(_, layer)| (layer.turn, layer))).map(|layer| {
        let along =
            |of: &dyn Fn(&Setpoint) -> Point3<f64>| layer.plan.setpoints(RECORDING_STEP).map(|(_, s)| of(&s)).collect();
        FlownWay {
            robot: layer.turn.robot,
            nozzle: along(&|s| s.nozzle.position),
            vehicle: along(&|s| s.sample.position),
        }
    });
    save_path(task, &|hit: &Hit| shading(task, &depth, hit), ways.collect(), &folder.join("path.png"))?;
    stage.share(0.7);
    write(&folder.join("robot.urdf"), &task.urdf())?;
    save_mcap(mission, &vertex_colours(task, &depth), folder)?;
    let figures = figures(mission);
    save_figures(&figures, folder)?;
    stage.done(&folder.display().to_string());
    Ok(figures)
}

/// One row after another of what a robot flies; layers follow each other.
fn table(mission: &PlannedMission, robot: usize) -> String {
    let mut text = String::from(
        "time_s,layer,x_m,y_m,z_m,heading_rad,vx_m_per_s,vy_m_per_s,vz_m_per_s,pan_rad,tilt_rad,flow_m3_per_s,\
         target_x_m,target_y_m,target_z_m,pitch_rad\n",
    );
    let [step, _] = mission.task.settings.record_steps();
    let own = mission.layers().filter(|(_, layer)| layer.turn.robot == robot);
    for (k, (start, layer)) in own.enumerate() {
        for (time, s) in layer.plan.setpoints(step) {
            let (p, v) = (s.sample.position, s.sample.velocity);
            let PitchingJoints { pitch, pan, tilt } = mission.task.planned_robot.joints(s.pan, s.tilt);
            let row = [
                [p.x, p.y, p.z, s.sample.heading, v.x, v.y, v.z, pan, tilt, s.flow].as_slice(),
                &[s.aim.x, s.aim.y, s.aim.z, pitch],
            ]
            .concat();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},{k},{}", cells(&[start + time]), cells(&row));
        }
    }
    text
}

fn save_mcap(mission: &PlannedMission, colours: &[[u8; 3]], folder: &Path) -> Result<(), MissionError> {
    let task = &mission.task;
    let ([_, step], positions) = (task.settings.record_steps(), task.surface.vertices());
    let (mut states, mut log) = (Vec::new(), Vec::new());
    for (k, (start, PlannedLayer { route, plan, turn, .. })) in mission.layers().enumerate() {
        log.push((start, format!("layer {}: {} strokes, as planned", k + 1, route.strokes)));
        states.extend(plan.setpoints(step).map(|(time, s)| state(task, turn.robot, start + time, &s)));
    }
    let faces = task.surface.disk().faces();
    let mesh = ColouredMesh { positions: &positions, faces, colours, bare: task.appearance.srgb(0.0) };
    let (file, origin) = (folder.join("plan.mcap"), task.origin(folder));
    Ok(save_recording(&file, &mesh, &[(0.0, task.paint_style())], &mut states, &mut log, &origin)?)
}

/// The robot as the plan has it: without roll, with the joints of the reference.
fn state(task: &PaintingTask, robot: usize, time: f64, s: &Setpoint) -> RobotState {
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), s.sample.heading);
    let level = Isometry3::from_parts(Translation3::from(s.sample.position), heading);
    let joints = task.planned_robot.joints(s.pan, s.tilt);
    let PitchingJoints { pan, tilt, .. } = joints;
    RobotState {
        robot,
        time,
        world_from_body: PlannedRobot::body(&level, &joints),
        arm: task.robot.chain.link_poses(Joints { pan, tilt }),
        joints: [pan, tilt],
        hit: Some(s.aim),
        flow: s.flow,
    }
}

fn figures(mission: &PlannedMission) -> PlanFigures {
    let (task, planned) = (&mission.task, &mission.planned);
    let outcomes = planned.outcomes;
    let sum = |of: &dyn Fn(&Plan) -> f64| mission.plans().map(|(_, plan)| of(plan)).sum::<f64>();
    let most = |of: &dyn Fn(&Plan) -> f64| mission.plans().map(|(_, plan)| of(plan)).fold(0.0, f64::max);
    let in_the_air = sum(&|plan| plan.trajectory.duration());
    let volume = sum(&|plan| (0..plan.flow.len()).map(|k| plan.volume(k)).sum());
    let deviations: Vec<f64> = mission
        .plans()
        .flat_map(|(route, plan)| {
            let served = route.targets.iter().enumerate().filter(|(k, t)| t.dose > 0.0 && plan.reachable[*k]);
            served.map(|(k, target)| target.normal_deviation(&plan.nozzle[k].position))
        })
        .collect();
    PlanFigures {
        version: env!("CARGO_PKG_VERSION"),
        surface: task.name.clone(),
        seed: task.settings.seed,
        layers: planned.layers.len(),
        strokes: mission.plans().map(|(route, _)| route.strokes).sum(),
        targets: outcomes.targets,
        targets_not_served: outcomes.not_served(),
        targets_out_of_reach: outcomes.out_of_reach,
        targets_hidden: outcomes.hidden,
        targets_without_heading: outcomes.without_heading,
        targets_too_near: outcomes.too_near,
        targets_without_transit: outcomes.without_transit,
        targets_missed: outcomes.missed,
        targets_left_in_wind: outcomes.excluded,
        targets_kept_off: planned.kept_off,
        targets_left_bare: planned.left_bare,
        lost_to_constraints_share: task.share_lost_to_constraints(),
        unreachable_paint_share: share_out_of_reach(task, planned.unreachable_paint, mission.plans()),
        flight_time_s: mission.duration(),
        team: planned_team(mission),
        times: TimeFigures::of(mission.plans().map(|(_, plan)| plan), &task.settings.planner.timing),
        path_length_m: sum(&Plan::path_length),
        valve_open_share: sum(&Plan::open_time) / in_the_air,
        paint_kg: volume * task.paint.liquid.density,
        normal_deviation_mean_m: mean(deviations.iter().copied()),
        normal_deviation_max_m: deviations.iter().fold(0.0, |most, &d| most.max(d)),
        max_speed_m_per_s: most(&|plan| plan.report.extrema.speed),
        max_acceleration_m_per_s2: most(&|plan| plan.report.extrema.acceleration),
        max_joint_rate_rad_per_s: most(&|plan| plan.report.joint_rate),
        max_pitch_rad: max_pitch(mission),
        clearance_missing_m: most(&|plan| plan.report.clearance_missing),
        planning_s: planned.seconds,
        wall_s: task.started.elapsed().as_secs_f64(),
        outcomes,
    }
}

/// Greatest planned pitch, radians; `None` where the vehicle is level.
fn max_pitch(mission: &PlannedMission) -> Option<f64> {
    let task = &mission.task;
    let states = mission.plans().flat_map(|(_, plan)| plan.setpoints(KEPT_STEP).map(|(_, s)| (s.pan, s.tilt)));
    let pitch = |(pan, tilt)| task.planned_robot.joints(pan, tilt).pitch.abs();
    (task.settings.pitch > 0.0).then(|| states.map(pitch).fold(0.0, f64::max))
}
