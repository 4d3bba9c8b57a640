//! What a mission comes to: at once on coarse texels, then on its own.

use std::path::Path;
use std::time::{Duration, Instant};

use super::estimate_message::{EstimateHead, texels};
use super::session::ShownSurface;
use super::surface_message::{Geometry, surface_message};
use crate::cancellation::{Cancellation, until_cancelled};
use crate::console::heard;
use crate::mission::{KnownSurface, MissionError, MissionSettings, estimate_coats};
use crate::mission_file::{MissionFile, MissionFileError};
use crate::picture_placement::PicturePlacement;
use crate::region::Scene;

/// Most texels of the coarse estimate: as many as are planned in about a second.
const COARSE_TEXELS: f64 = 3600.0;
/// Who has changed something often goes on: the mission's own texels wait so long, and look for a newer design as often.
const REST: Duration = Duration::from_millis(500);
const STEP: Duration = Duration::from_millis(20);
/// A spot that is narrower than this in texels leaves its neighbours' shares out of the sum.
const NARROWEST_SPOT: f64 = 0.5;

/// A design to estimate.
#[derive(Debug, Clone)]
pub(super) struct Job {
    pub(super) number: u64,
    pub(super) mission: MissionFile,
}

/// What is found.
pub(super) enum Found {
    /// Another surface is shown: as the page takes it, and as the session needs it.
    Surface { bytes: Vec<u8>, shown: ShownSurface },
    /// There is the surface that a mission asks for.
    Known { mission: Box<MissionFile> },
    /// What the design comes to, as the page takes it.
    Estimate { number: u64, own: bool, bytes: Vec<u8> },
    /// There is no such surface.
    NoSurface { text: String },
    /// The design cannot be painted.
    Failed { text: String },
}

/// Surfaces that are known already.
#[derive(Default)]
pub(super) struct Estimator {
    scene: Option<(MissionFile, String, Scene)>,
    known: Vec<(MissionFile, KnownSurface)>,
    /// The surface that is shown, and its number.
    shown: Option<Geometry>,
    surfaces: u64,
}

impl Estimator {
    /// Estimates a design, the coarse way first; `tell` hears what is found. `None` where it was cancelled.
    pub(super) fn estimate(
        &mut self,
        job: &Job,
        cancellation: &Cancellation,
        tell: &mut dyn FnMut(Found),
    ) -> Option<()> {
        let area = match until_cancelled(cancellation, || heard(|| self.read(&job.mission)).0)? {
            Ok(area) => area,
            Err(error) => {
                tell(Found::NoSurface { text: line(&error) });
                return Some(());
            }
        };
        let coarse = coarse(&job.mission.settings, area);
        let own = job.mission.settings.clone();
        let bare = job.mission.design.is_none();
        // Without a picture there is nothing that finer texels would show.
        let steps = match coarse {
            Some(coarse) if bare => vec![(coarse, true)],
            Some(coarse) => vec![(coarse, false), (own, true)],
            None => vec![(own, true)],
        };
        for (step, (settings, is_own)) in steps.into_iter().enumerate() {
            if step > 0 {
                rest(cancellation)?;
            }
            let mission = MissionFile { settings, ..job.mission.clone() };
            if let Err(error) = until_cancelled(cancellation, || heard(|| self.know(&mission)).0)? {
                tell(Found::NoSurface { text: line(&error) });
                return Some(());
            }
            self.show(&mission, tell);
            tell(Found::Known { mission: Box::new(mission.clone()) });
            let (found, notes) = until_cancelled(cancellation, || heard(|| self.decide(job.number, &mission)))?;
            match found {
                Ok((head, texels)) => {
                    let head = EstimateHead { own: is_own, notes, ..head };
                    tell(Found::Estimate { number: job.number, own: is_own, bytes: head.with_texels(&texels) });
                }
                Err(error) => {
                    tell(Found::Failed { text: line(&error) });
                    return Some(());
                }
            }
        }
        Some(())
    }

    /// Reads the mesh if it is not the one that is known; its painted area, m².
    fn read(&mut self, mission: &MissionFile) -> Result<f64, MissionFileError> {
        let key = surface_key(mission);
        if self.scene.as_ref().is_none_or(|(of, ..)| *of != key) {
            let (name, scene) = mission.read_surface()?;
            self.scene = Some((key, name, scene));
            self.known.clear();
        }
        Ok(self.scene.as_ref().map_or(0.0, |(.., scene)| scene.canvas.area()))
    }

    /// Unwraps it and searches it for reach with texels of this size.
    fn know(&mut self, mission: &MissionFile) -> Result<(), MissionFileError> {
        let key = surface_key(mission);
        if self.known.iter().any(|(of, _)| *of == key) {
            return Ok(());
        }
        if let Some((_, name, scene)) = &self.scene {
            let known = KnownSurface::new(name, scene.clone(), mission.settings.clone());
            self.known.push((key, known.map_err(|error| mission.in_mesh(error))?));
        }
        Ok(())
    }

    /// Tells of a surface that is not shown yet.
    fn show(&mut self, mission: &MissionFile, tell: &mut dyn FnMut(Found)) {
        let Ok(known) = self.find(mission) else { return };
        let geometry = Geometry::new(known);
        if self.shown.as_ref().is_some_and(|shown| shown.is_same(&geometry)) {
            return;
        }
        let (bytes, shown) = surface_message(self.surfaces + 1, known, &geometry);
        self.surfaces += 1;
        self.shown = Some(geometry);
        tell(Found::Surface { bytes, shown });
    }

    fn find(&self, mission: &MissionFile) -> Result<&KnownSurface, MissionError> {
        let key = surface_key(mission);
        let found = self.known.iter().find(|(of, _)| *of == key);
        found.map(|(_, known)| known).ok_or(MissionError::NothingToPaint("its surface is not known"))
    }

    /// Decides and plans the design.
    fn decide(&self, number: u64, mission: &MissionFile) -> Result<(EstimateHead, Vec<u8>), MissionFileError> {
        let known = self.find(mission).map_err(|error| mission.in_mesh(error))?;
        let estimate = if mission.design.is_some() {
            let tasks = mission.decide_on_known(known, Path::new(""))?;
            let stage = crate::progress::Stage::start("estimate");
            Some(estimate_coats(&tasks, &|share| stage.share(share)).map_err(|error| mission.in_mesh(error))?)
        } else {
            None
        };
        let texels = texels(known, estimate.as_ref()).map_err(|error| mission.in_mesh(error))?;
        Ok((EstimateHead::new([number, self.surfaces], known, estimate.as_ref()), texels))
    }
}

/// Lets a moment pass in which a newer design may come; `None` where one did.
fn rest(cancellation: &Cancellation) -> Option<()> {
    let begun = Instant::now();
    while begun.elapsed() < REST {
        std::thread::sleep(STEP);
        until_cancelled(cancellation, || ())?;
    }
    Some(())
}

/// The settings of a coarse estimate; `None` where the mission's own are as coarse. Its texels are some of the mission's together, so that both end where the
/// surface does.
pub(super) fn coarse(settings: &MissionSettings, area: f64) -> Option<MissionSettings> {
    let together = ((area / COARSE_TEXELS).sqrt() / settings.texel).ceil();
    if together.is_nan() || together <= 1.0 {
        return None;
    }
    let texel = together * settings.texel;
    let mut coarse = MissionSettings { texel, ..settings.clone() };
    coarse.spot = settings.spot.max(NARROWEST_SPOT * texel);
    let fewer = |cells: usize| ((cells as f64 / together).round() as usize).max(1);
    coarse.limits.spray_spacing = fewer(settings.limits.spray_spacing);
    coarse.limits.row_spacing = fewer(settings.limits.row_spacing);
    Some(coarse)
}

/// The mission without what the surface does not depend on.
fn surface_key(mission: &MissionFile) -> MissionFile {
    let MissionFile { mesh, scale, up, region, keep_clean, settings, .. } = mission.clone();
    let bare = MissionSettings::default();
    let settings = MissionSettings { placement: PicturePlacement::default(), paint: bare.paint, ..settings };
    MissionFile { mesh, scale, up, region, keep_clean, settings, ..MissionFile::default() }
}

/// An error in one line.
fn line(error: &MissionFileError) -> String {
    error.to_string().replace('\n', " ")
}
