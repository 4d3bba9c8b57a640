//! What the program does: serve a session, replay one, or let a simulated hand paint.

use std::path::Path;

use super::arguments::{Arguments, Experiment};
use super::counters::Traffic;
use super::design::design;
use super::error::VrError;
use super::event::{Command, Event};
use super::experiment::save_contour;
use super::hand::{Way, hand};
use super::layers::save_layers;
use super::output::save;
use super::recording::{RECORDING, RecordedSession, SessionRecorder, for_each_event};
use super::serve::serve;
use super::session::{Handled, Session};
use super::settings::VrSettings;
use super::watch::watch;
use super::world::VrWorld;
use crate::interruption::Finishing;
use crate::progress::Stage;
use crate::run_folder;
use crate::say;

/// Runs the program.
///
/// # Errors
/// [`VrError`] names the input and the way out.
pub fn run(arguments: &Arguments) -> Result<(), VrError> {
    let folder = &arguments.out;
    if arguments.design_page {
        let _finishing = Finishing::begin();
        return design(arguments);
    }
    run_folder::begin(folder, "vr").map_err(VrError::unwritable(folder))?;
    if let Some(path) = &arguments.replay {
        return replay(path, folder);
    }
    if arguments.pigments.is_some() && arguments.experiment != Some(Experiment::Layers) {
        return Err(VrError::PigmentsUnused);
    }
    if let Some(source) = &arguments.watch {
        let _finishing = Finishing::begin();
        return watch(source, arguments);
    }
    if let (Some(Experiment::Layers), Some(pigments)) = (arguments.experiment, &arguments.pigments) {
        return save_layers(pigments, folder);
    }
    let settings = arguments.settings();
    let world = VrWorld::new(&settings)?;
    if let Some(way) = arguments.experiment.and_then(Experiment::way) {
        let recorder = SessionRecorder::create(folder, &settings, false)?;
        let events = hand(&world, way, arguments.hand_speed, settings.seed);
        return perform(way, &events, Session::new(settings, world, Some(recorder))?, folder);
    }
    let _finishing = Finishing::begin();
    let recorder = SessionRecorder::create(folder, &settings, true)?;
    serve(arguments, Session::new(settings, world, Some(recorder))?)
}

/// Lets a simulated hand paint.
fn perform(way: Way, events: &[Event], mut session: Session, folder: &Path) -> Result<(), VrError> {
    let stage = Stage::start("paint");
    let mut traffic = Traffic::default();
    for (number, event) in events.iter().enumerate() {
        let begun = cpu_time::ThreadTime::now();
        session.handle(event)?;
        session.take_patches();
        traffic.work(begun.elapsed().as_secs_f64(), 1);
        stage.share(number as f64 / events.len() as f64);
    }
    session.finish()?;
    tell(&mut session);
    stage.done(&format!("{:.0} s", session.time()));
    save(&session, &traffic, folder)?;
    if session.canvases()[0].volume() == 0.0 {
        return Err(VrError::NothingPainted { name: session.world().name.clone() });
    }
    if way == Way::Contour { save_contour(&session, folder) } else { Ok(()) }
}

/// Paints a recorded session again and compares the plans.
fn replay(path: &Path, folder: &Path) -> Result<(), VrError> {
    let recorded = RecordedSession::open(path)?;
    let target = folder.join(RECORDING);
    let same = |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    if same(path, &target) {
        return Err(VrError::recording(path, "its own replay would overwrite it: choose another --out"));
    }
    let settings: VrSettings = recorded.settings;
    let world = VrWorld::new(&settings)?;
    let recorder = SessionRecorder::create(folder, &settings, false)?;
    let mut session = Session::new(settings, world, Some(recorder))?;
    let stage = Stage::start("replay");
    let mut traffic = Traffic::default();
    for_each_event(path, |event| {
        // The buttons that only write results change nothing of the session.
        if matches!(event, Event::Command { command: Command::Save | Command::End, .. }) {
            return session.handle(&event).map(|_| ());
        }
        let begun = cpu_time::ThreadTime::now();
        // Nobody looks on: the pictures are drawn once, at the end.
        if session.handle(&event)? == Handled::Gap {
            return Err(VrError::recording(path, "events are missing in it"));
        }
        traffic.work(begun.elapsed().as_secs_f64(), 1);
        Ok(())
    })?;
    session.finish()?;
    tell(&mut session);
    let again = session.plans();
    // Where the end is missing, more is planned now than then.
    let plans = if recorded.whole { recorded.plans.len().max(again.len()) } else { recorded.plans.len() };
    let equal = recorded.plans.iter().zip(again).filter(|(a, b)| a == b).count();
    stage.done(&format!("{equal} of {plans} plans the same, bit for bit"));
    save(&session, &traffic, folder)?;
    if equal == plans { Ok(()) } else { Err(VrError::Different { path: path.into(), different: plans - equal, plans }) }
}

/// What a person would have been told.
fn tell(session: &mut Session) {
    let mut lines: Vec<String> = Vec::new();
    for notice in session.take_notices() {
        if let super::message::Notice::Text { text } = notice {
            lines.push(text);
        }
    }
    lines.dedup();
    for line in lines {
        say!("{line}");
    }
}
