//! Several robots on one surface: how near they come, and whose file is whose.

use nalgebra::Point3;
use paint_planner::mission::{Track, Turn, nearest_approach};

use super::fly::LayerFlight;
use super::planned_mission::PlannedMission;
use super::run::Mission;
use crate::report::TeamFigures;

/// Time between two looks at where the robots are, s.
const LOOK: f64 = 0.1;

/// As it was flown.
pub(super) fn flown_team(mission: &Mission) -> TeamFigures {
    let flights = mission.flights.iter().map(|flight| {
        let log = &flight.flight;
        let at = log.every(LOOK).map(|s| s.world_from_body.translation.vector.into());
        (flight.turn.robot, flight.start, LOOK, at.collect())
    });
    let seconds = mission.flights.iter().map(LayerFlight::duration).sum();
    team_figures(mission.task.settings.team.robots, seconds, flights)
}

/// As it is planned.
pub(super) fn planned_team(mission: &PlannedMission) -> TeamFigures {
    let flights = mission.layers().map(|(start, layer)| {
        let at = layer.plan.setpoints(LOOK).map(|(_, setpoint)| setpoint.sample.position);
        (layer.turn.robot, start, LOOK, at.collect())
    });
    let seconds = mission.plans().map(|(_, plan)| plan.trajectory.duration()).sum();
    team_figures(mission.task.settings.team.robots, seconds, flights)
}

/// Of flights as robot, start (s), time between positions (s), and positions, in the order of each robot.
fn team_figures(
    robots: usize,
    seconds: f64,
    flights: impl Iterator<Item = (usize, f64, f64, Vec<Point3<f64>>)>,
) -> TeamFigures {
    if robots < 2 {
        return TeamFigures { robots, ..TeamFigures::default() };
    }
    let (mut tracks, mut flown) = (vec![Track::default(); robots], 0);
    for (robot, start, step, positions) in flights {
        tracks[robot].push(start, step, positions);
        flown = flown.max(robot + 1);
    }
    TeamFigures { robots: flown, robots_nearest_m: nearest_approach(&tracks), robots_flight_time_s: Some(seconds) }
}

/// Of flights with their turns, the first of each cell of the first layer.
pub(super) fn first_of_each_cell<T>(flights: impl Iterator<Item = (Turn, T)>) -> impl Iterator<Item = T> {
    let mut seen: Vec<Turn> = Vec::new();
    flights.filter_map(move |(turn, flight)| {
        let new = !seen.contains(&turn) && seen.first().is_none_or(|first| first.layer == turn.layer);
        new.then(|| {
            seen.push(turn);
            flight
        })
    })
}

/// The file of a robot, from 0: the first has the name, the others their number behind it.
pub(super) fn robot_file(name: &str, robot: usize) -> String {
    match (robot, name.rsplit_once('.')) {
        (0, _) | (_, None) => name.to_owned(),
        (_, Some((stem, extension))) => format!("{stem}_{}.{extension}", robot + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::super::built_in_flyer::BuiltInFlyer;
    use super::super::painting_task::PaintingTask;
    use super::super::run::one_after_another;
    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::design::Design;
    use crate::region::Scene;

    /// A wall of six by half a metre, painted by so many robots that keep a metre apart.
    fn planned(robots: usize) -> PlannedMission {
        let mut mesh = test_panel::mesh();
        for [_, y, z] in &mut mesh.positions {
            (*y, *z) = (3.0 * *y, 1.0 + 0.25 * *z);
        }
        let mut settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        (settings.team.robots, settings.team.apart) = (robots, 1.0);
        PlannedMission::new(PaintingTask::new("wall", &Scene::whole(mesh), &Design::Gradient, settings).unwrap())
            .unwrap()
    }

    #[test]
    fn two_robots_leave_the_picture_of_one_in_less_time_and_stay_apart() {
        let (one, two) = (planned(1), planned(2));
        let [alone, team] = [one, two].map(|planned| Mission::fly(planned, &mut BuiltInFlyer).unwrap());
        assert!(team.flight_time() < 0.65 * alone.flight_time(), "{} {}", team.flight_time(), alone.flight_time());
        let figures = flown_team(&team);
        assert!(figures.robots == 2 && figures.robots_nearest_m.unwrap() >= 1.0, "{figures:?}");
        assert!(figures.robots_flight_time_s.unwrap() > 1.5 * team.flight_time());
        assert_eq!(flown_team(&alone), TeamFigures { robots: 1, ..TeamFigures::default() });
        // As much paint, and on every texel as thick as the picture of one but for what the winds of two flights differ by.
        let [paint, same] = [&alone, &team].map(|mission| mission.film.mass_balance().deposited as f64);
        assert!((paint / same - 1.0).abs() < 0.01, "{paint} {same}");
        let off = |k: usize| (alone.film.thickness(k) - team.film.thickness(k)).abs();
        let count = alone.film.texels().len();
        let [off, all] = [(0..count).map(off).sum::<f64>(), (0..count).map(|k| alone.film.thickness(k)).sum()];
        assert!(off < 0.05 * all, "{off} {all}");
        // Both fly at the same time; each one's flights follow each other.
        let begun: Vec<(usize, f64, f64)> =
            one_after_another(&[&team]).map(|(start, f)| (f.turn.robot, start, start + f.duration())).collect();
        assert!(begun.iter().filter(|(_, start, _)| *start == 0.0).count() == 2, "{begun:?}");
        for robot in 0..2 {
            let own: Vec<_> = begun.iter().filter(|(flown_by, ..)| *flown_by == robot).collect();
            assert!(own.len() >= 2 && own.windows(2).all(|pair| pair[1].1 >= pair[0].2 - 1e-9), "{begun:?}");
        }
    }

    #[test]
    fn files_of_later_robots_have_their_numbers() {
        assert_eq!(["plan.csv", "plan"].map(|name| robot_file(name, 0)), ["plan.csv", "plan"]);
        assert_eq!(robot_file("trajectory.csv", 2), "trajectory_3.csv");
    }

    /// One flight of each cell of the first layer: neither what is flown once more, nor the next layer.
    #[test]
    fn the_ways_are_those_of_the_first_layer() {
        let turn = |layer, robot, shift| Turn { layer, robot, shift };
        let turns = [turn(3, 0, 0), turn(3, 0, 0), turn(3, 0, 1), turn(3, 1, 0), turn(4, 1, 1)];
        let shown: Vec<usize> = first_of_each_cell(turns.into_iter().zip(0..)).collect();
        assert_eq!(shown, [0, 2, 3]);
    }
}
