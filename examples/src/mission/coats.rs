//! Several paints: a mission for each, flown one after another, their films over each other.

use std::borrow::Borrow;
use std::path::PathBuf;
use std::thread;

use paint_net::Image;
use paint_sim::colour::{encode_srgb8, spectrum_lab, spectrum_linear_srgb};
use paint_sim::{Paint, Substrate};

use super::built_in_flyer::BuiltInFlyer;
use super::colour_doses::correct_colours;
use super::error::MissionError;
use super::flyer::Flyer;
use super::grounded::Grounded;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::plan::{Draft, draft, finish, replan};
use super::planned_mission::PlannedMission;
use super::run::Mission;
use crate::appearance::UNIT_THICKNESS;

/// Until another tank is mounted, seconds.
const TOOL_CHANGE_S: f64 = 300.0;

/// What was decided about one paint.
pub struct Coat {
    /// Where its results belong.
    pub folder: PathBuf,
    /// The sprays.
    pub task: PaintingTask,
}

/// What was decided about all paints, in flying order.
pub struct CoatTasks {
    /// The paints.
    pub coats: Vec<Coat>,
    /// The picture that they are painted for, if it is one.
    pub picture: Option<PictureTask>,
}

/// The same, planned.
pub struct PlannedCoats {
    /// The paints with the folders of their results.
    pub missions: Vec<(PathBuf, PlannedMission)>,
    picture: Option<PictureTask>,
}

/// The missions of all paints, flown. Each is complete in itself; its pictures show its paint alone.
pub struct Coats {
    pub(super) missions: Vec<(PathBuf, Mission)>,
    /// What is wanted of every paint, depth per pixel, also of those that were not flown.
    pub(super) wanted: Vec<(Paint, Image)>,
    pub(super) picture: Option<PictureTask>,
    grounded: Option<Grounded>,
}

/// How a place of the painted wall looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) linear: [f64; 3],
    pub(super) lab: [f64; 3],
}

impl Look {
    /// Stored sRGB.
    pub(super) fn srgb8(&self) -> [u8; 3] {
        self.linear.map(|c| encode_srgb8(c).0)
    }

    fn of(wall: &Substrate) -> Self {
        Self { linear: spectrum_linear_srgb(wall.reflectance()), lab: spectrum_lab(wall.reflectance()) }
    }
}

impl PlannedCoats {
    /// Plans all paints; those of a picture with doses for each other.
    ///
    /// # Errors
    /// As [`PlannedMission::new`]; the error of one of several paints names it.
    pub fn new(CoatTasks { coats, picture }: CoatTasks) -> Result<Self, MissionError> {
        let several = coats.len() > 1;
        let named = |task: &PaintingTask, error: MissionError| {
            if several { error.in_paint(&task.paint.name) } else { error }
        };
        let threads = coats.first().map_or(1, |coat| coat.task.settings.threads);
        let tasks: Vec<&PaintingTask> = coats.iter().map(|coat| &coat.task).collect();
        let mut drafts = each(&tasks, threads, &|task| draft(task).map_err(|error| named(task, error)))?;
        if let Some(picture) = &picture {
            let mut open: Vec<(&PaintingTask, &mut Draft)> = tasks.iter().copied().zip(&mut drafts).collect();
            correct_colours(&mut open, picture)?;
        }
        let again = picture.is_some();
        let finished = |(task, mut draft): (&PaintingTask, Draft)| {
            let done = if again { replan(task, &mut draft) } else { Ok(()) };
            done.and_then(|()| finish(task, draft)).map_err(|error| named(task, error))
        };
        let work: Vec<_> = tasks.iter().copied().zip(drafts).collect();
        let planned = each(work, threads, &finished)?;
        let missions = coats.into_iter().zip(planned).map(|(Coat { folder, task }, planned)| {
            let mission = PlannedMission::checked(task, planned);
            mission.map(|mission| (folder, mission))
        });
        Ok(Self { missions: missions.collect::<Result<_, MissionError>>()?, picture })
    }
}

/// Work on every item, as many at once as there are threads; in their order.
fn each<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    threads: usize,
    work: &(dyn Fn(T) -> Result<R, MissionError> + Sync),
) -> Result<Vec<R>, MissionError> {
    let mut results = Vec::new();
    let mut items = items.into_iter().peekable();
    while items.peek().is_some() {
        let batch: Vec<T> = items.by_ref().take(threads.max(1)).collect();
        results.extend(thread::scope(|scope| {
            let handles: Vec<_> = batch.into_iter().map(|item| scope.spawn(move || work(item))).collect();
            let join = |handle: thread::ScopedJoinHandle<'_, Result<R, MissionError>>| {
                handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            handles.into_iter().map(join).collect::<Result<Vec<R>, MissionError>>()
        })?);
    }
    Ok(results)
}

impl Coats {
    /// Plans all paints, then flies them in their order in the built-in simulation.
    ///
    /// # Errors
    /// As [`PlannedCoats::new`] and [`Mission::fly`].
    pub fn run(tasks: CoatTasks) -> Result<Self, MissionError> {
        // What cannot be planned is known before anything is flown.
        PlannedCoats::new(tasks).and_then(|planned| Self::fly(planned, &mut BuiltInFlyer))
    }

    /// Flies the paints in their order. What was flown before a flight that could not be is kept, and [`grounded`](Self::grounded) says so.
    ///
    /// # Errors
    /// As [`Mission::fly`], of the first.
    pub fn fly(
        PlannedCoats { missions: planned, picture }: PlannedCoats,
        flyer: &mut dyn Flyer,
    ) -> Result<Self, MissionError> {
        let wanted = planned.iter().map(|(_, mission)| (mission.task.paint.paint, mission.task.wanted_depth()));
        let wanted = wanted.collect();
        let (mut missions, mut grounded) = (Vec::new(), None::<Grounded>);
        for (folder, planned) in planned {
            let duration = planned.duration();
            if let Some(grounded) = &mut grounded {
                grounded.left_s += duration;
                continue;
            }
            let paint = planned.task.paint.name.clone();
            match Mission::fly(planned, flyer) {
                Ok(mission) => {
                    grounded.clone_from(&mission.grounded);
                    missions.push((folder, mission));
                }
                Err(error) if missions.is_empty() => return Err(error),
                Err(error) => grounded = Some(Grounded::by(&error.in_paint(&paint), duration)),
            }
        }
        Ok(Self { missions, wanted, picture, grounded })
    }

    /// Why the rest was not flown, if it was not.
    pub fn grounded(&self) -> Option<&Grounded> {
        self.grounded.as_ref()
    }

    /// The missions in flying order, each with the folder of its results.
    pub fn missions(&self) -> impl Iterator<Item = (&PathBuf, &Mission)> {
        self.missions.iter().map(|(folder, mission)| (folder, mission))
    }

    /// The wall on every pixel as it came out; `None` beside the surface.
    pub(super) fn painted(&self) -> Result<Vec<Option<Look>>, MissionError> {
        self.looks(self.missions().map(|(_, mission)| (&mission.task.paint.paint, mission.painted_depth())))
    }

    /// The same as it is wanted.
    pub(super) fn wanted(&self) -> Result<Vec<Option<Look>>, MissionError> {
        self.looks(self.wanted.iter().map(|(paint, depth)| (paint, depth)))
    }

    fn looks<'a, D: Borrow<Image>>(
        &self,
        layers: impl Iterator<Item = (&'a Paint, D)>,
    ) -> Result<Vec<Option<Look>>, MissionError> {
        let Some((_, first)) = self.missions.first() else { return Ok(Vec::new()) };
        looks(layers, &first.task.coverage, self.picture.as_ref())
    }
}

/// The wall on every pixel under some depths of paints, the first lowest; `None` beside the surface.
pub(super) fn looks<'a, D: Borrow<Image>>(
    layers: impl Iterator<Item = (&'a Paint, D)>,
    coverage: &Image,
    picture: Option<&PictureTask>,
) -> Result<Vec<Option<Look>>, MissionError> {
    let mut wall = Wall::bare(coverage, picture)?;
    for (paint, depth) in layers {
        wall.paint(paint, depth.borrow())?;
    }
    Ok(wall.looks())
}

/// What lies uppermost on every pixel, `None` beside the surface.
pub(super) struct Wall(Vec<Option<Substrate>>);

impl Wall {
    /// Before any paint: as the picture's task knows it, or sandstone.
    pub(super) fn bare(coverage: &Image, picture: Option<&PictureTask>) -> Result<Self, MissionError> {
        let bare = |covered: &f64| (*covered > 0.0).then(Substrate::sandstone);
        let mut wall: Vec<Option<Substrate>> = coverage.data().iter().map(bare).collect();
        if let Some(picture) = picture {
            for (place, &pixel) in picture.pixels.iter().enumerate() {
                if let Some(ground) = &mut wall[pixel] {
                    *ground = Substrate::new(*picture.wall.at(place))?;
                }
            }
        }
        Ok(Self(wall))
    }

    /// Another film, over one that is dry: what was there is its ground (Kubelka-Munk).
    pub(super) fn paint(&mut self, paint: &Paint, depth: &Image) -> Result<(), MissionError> {
        for (ground, depth) in self.0.iter_mut().zip(depth.data()) {
            if let Some(ground) = ground {
                *ground = paint.over(depth * UNIT_THICKNESS, ground)?;
            }
        }
        Ok(())
    }

    pub(super) fn looks(&self) -> Vec<Option<Look>> {
        self.0.iter().map(|ground| ground.as_ref().map(Look::of)).collect()
    }
}

/// How long one paint takes, seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct PaintTime {
    /// In the air.
    pub(super) flown: f64,
    /// Between its coats, while one dries.
    pub(super) waited: f64,
    /// Until its last is dry to touch.
    pub(super) drying: f64,
}

/// How long all paints take, seconds: while one dries, another tank is mounted.
pub(super) fn time_of_paints(paints: &[PaintTime]) -> f64 {
    let ground = |paint: &PaintTime| paint.drying.max(TOOL_CHANGE_S);
    let between = paints.len().saturating_sub(1);
    paints.iter().map(|paint| paint.flown + paint.waited).sum::<f64>()
        + paints[..between].iter().map(ground).sum::<f64>()
}

/// Linear sRGB as three pictures; the mean beside the surface, so that its edge is not darker.
pub(super) fn linear(looks: &[Option<Look>], width: usize, height: usize) -> Result<[Image; 3], MissionError> {
    let known: Vec<[f64; 3]> = looks.iter().flatten().map(|look| look.linear).collect();
    let mean: [f64; 3] =
        std::array::from_fn(|c| known.iter().map(|colour| colour[c]).sum::<f64>() / known.len().max(1) as f64);
    let colours: Vec<[f64; 3]> = looks.iter().map(|look| look.map_or(mean, |look| look.linear)).collect();
    let channel = |c: usize| Image::new(width, height, colours.iter().map(|colour| colour[c]).collect());
    Ok([channel(0)?, channel(1)?, channel(2)?])
}

#[cfg(test)]
mod tests {
    use super::super::settings::{LocalisationChoice, MissionSettings};
    use super::super::test_panel;
    use super::*;
    use crate::design::Design;
    use crate::region::Scene;
    use paint_sim::paint::PaintName;

    #[test]
    fn the_upper_film_hides_the_lower_one() {
        let [charcoal, white] = [PaintName::Charcoal, PaintName::White].map(|name| name.paint(UNIT_THICKNESS).unwrap());
        let coverage = Image::filled(2, 1, 1.0);
        let lightness = |films: [(&Paint, f64); 2]| {
            let layers = films.map(|(paint, depth)| (paint, Image::filled(2, 1, depth)));
            looks(layers.into_iter(), &coverage, None).unwrap()[1].unwrap().lab[0]
        };
        let thick = 40.0;
        let (white_above, white_below) =
            (lightness([(&charcoal, thick), (&white, thick)]), lightness([(&white, thick), (&charcoal, thick)]));
        let alone = |paint: &Paint| lightness([(paint, thick), (paint, 0.0)]);
        assert!((white_above - alone(&white)).abs() < 0.5, "{white_above}");
        assert!((white_below - alone(&charcoal)).abs() < 0.5 && white_below < 40.0, "{white_below}");
    }

    /// The second of three paints cannot be flown, as its localisation has no map: the first is there, and what was wanted of all.
    #[test]
    fn a_paint_that_cannot_be_flown_takes_nothing_from_those_before_it() {
        let coat = |localisation| {
            let settings =
                MissionSettings { localisation: Some(localisation), threads: 1, ..MissionSettings::default() };
            let scene = Scene::whole(test_panel::mesh());
            let task = PaintingTask::new("panel", &scene, &Design::Gradient, settings).unwrap();
            Coat { folder: PathBuf::new(), task }
        };
        let coats = [LocalisationChoice::MotionCapture, LocalisationChoice::Slam, LocalisationChoice::MotionCapture];
        let tasks = CoatTasks { coats: coats.map(coat).into(), picture: None };
        let flown = Coats::run(tasks).unwrap();
        assert_eq!((flown.missions.len(), flown.wanted.len()), (1, 3));
        let duration = flown.missions[0].1.flights()[0].plan.trajectory.duration();
        let Grounded { left_s, why } = flown.grounded().unwrap();
        assert!((left_s - 2.0 * duration).abs() < 1e-9, "{left_s} s of {duration} s each");
        assert!(why.contains("--scan"), "{why}");
        let first = CoatTasks { coats: vec![coat(LocalisationChoice::Slam)], picture: None };
        assert!(matches!(Coats::run(first), Err(MissionError::NoMap)));
    }
}
