//! What a task asks of the planner.

use nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};

use super::scene::TeleopScene;
use super::settings::TeleopSettings;
use super::state::{VrMode, VrState};
use super::targets::targets;
use super::task::Task;
use crate::settings::{Settings, TimingSettings};
use crate::target::Target;

/// The person looks no farther, m.
const SIGHT: f64 = 30.0;
/// Places that are looked at are farther apart than this, m.
const APART: f64 = 0.05;
/// Way between the two targets of a place that is only flown to, m.
const SIDESTEP: f64 = 0.005;

/// What a task is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TaskKind {
    /// To paint a segment.
    Paint,
    /// To look at what the person looks at.
    View,
    /// Rule (c): to go to where painting or viewing begins.
    Approach,
    /// Rule (a): to come to the person.
    Seek,
}

impl TaskKind {
    /// Its name in reports: `paint`, `view`, `approach` or `seek`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paint => "paint",
            Self::View => "view",
            Self::Approach => "approach",
            Self::Seek => "seek",
        }
    }
}

/// A task as the planner takes it: targets, and the settings they are planned with.
pub(super) struct Assignment {
    pub(super) kind: TaskKind,
    /// Fewer than two where there is nothing to fly to.
    pub(super) targets: Vec<Target>,
    pub(super) settings: Settings,
}

impl Assignment {
    pub(super) fn of(task: &Task, scene: &TeleopScene, settings: &TeleopSettings) -> Self {
        let viewing = || settings.viewing.clone();
        let (kind, targets, settings) = match task {
            Task::Segment(segment) if segment.mode == VrMode::Painting => {
                let mut targets = targets(segment, scene.surface, &settings.targets);
                if settings.even_coat {
                    level(&mut targets);
                }
                let stand_offs = segment.states.iter().map(|state| settings.stand_off_of(state));
                let mean = stand_offs.sum::<f64>() / segment.states.len().max(1) as f64;
                (TaskKind::Paint, targets, settings.painting_from(mean))
            }
            Task::Segment(segment) => {
                let mut places: Vec<Target> = segment.states.iter().filter_map(|state| sight(state, scene)).collect();
                places.dedup_by(|b, a| (b.point - a.point).norm() < APART);
                (TaskKind::View, flown_to(places), viewing())
            }
            Task::Approach(state) if state.mode == VrMode::Painting => {
                let place = state.hit.map(|hit| shut(hit.point, hit.normal));
                // The hand's time stamps are none of a flight with the valve shut.
                let timing = TimingSettings::default();
                let here = Settings { timing, ..settings.painting_from(settings.stand_off_of(state)) };
                (TaskKind::Approach, flown_to(place), here)
            }
            Task::Approach(state) => (TaskKind::Approach, flown_to(sight(state, scene)), viewing()),
            Task::Seek(state) => {
                let ahead = UnitQuaternion::from_scaled_axis(Vector3::z() * state.cradle.heading) * Vector3::x_axis();
                (TaskKind::Seek, flown_to(seen(&state.cradle.position, &ahead, scene)), viewing())
            }
        };
        Self { kind, targets, settings }
    }
}

/// What the gun of a state points at.
fn sight(state: &VrState, scene: &TeleopScene) -> Option<Target> {
    seen(&state.nozzle_position(), &(state.nozzle.rotation * Vector3::x_axis()), scene)
}

fn seen(from: &Point3<f64>, along: &UnitVector3<f64>, scene: &TeleopScene) -> Option<Target> {
    scene.canvas.cast(from, along, SIGHT).map(|hit| shut(hit.point, hit.normal))
}

/// A target that is not painted.
fn shut(point: Point3<f64>, normal: UnitVector3<f64>) -> Target {
    Target { point, normal, dose: 0.0, time: None, stand_off: None }
}

/// A planner needs a way: one place becomes two beside each other.
fn flown_to(places: impl IntoIterator<Item = Target>) -> Vec<Target> {
    let mut places: Vec<Target> = places.into_iter().collect();
    if let [only] = places[..] {
        let side = Vector3::z().cross(&only.normal).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        places.push(Target { point: only.point + side * SIDESTEP, ..only });
    }
    places
}

/// One coat for all of the segment.
fn level(targets: &mut [Target]) {
    let steps = || targets.windows(2).map(|pair| (pair[1].point - pair[0].point).norm());
    let length: f64 = steps().sum();
    let volume: f64 = steps().zip(&*targets).map(|(step, target)| step * target.dose).sum();
    let even = if length > 0.0 { volume / length } else { 0.0 };
    if let Some((_, all_but_last)) = targets.split_last_mut() {
        for target in all_but_last {
            target.dose = even;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_levelled_segment_takes_the_paint_that_it_took_before() {
        // 1 m of 3 and 3 m of 7, in any unit of paint: 24 over 4 m.
        let at = |x: f64, dose: f64| Target {
            point: Point3::new(x, 0.0, 0.0),
            normal: Vector3::y_axis(),
            dose,
            time: None,
            stand_off: None,
        };
        let mut targets = [at(0.0, 3.0), at(1.0, 7.0), at(4.0, 0.0)];
        level(&mut targets);
        assert_eq!(targets.map(|target| target.dose), [6.0, 6.0, 0.0]);
        // At one place there is no way to spread it over.
        let mut halted = [at(0.0, 3.0), at(0.0, 0.0)];
        level(&mut halted);
        assert_eq!(halted.map(|target| target.dose), [0.0, 0.0]);
    }
}
