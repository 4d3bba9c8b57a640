//! A session as MCAP: events and plans as JSON of our own, the flight with Foxglove's schema.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, UNIX_EPOCH};

use foxglove::messages::{Pose, PoseInFrame, Timestamp};
use mcap::Message;
use paint_planner::Plan;
use paint_planner::teleop::PlannedTask;
use serde::{Deserialize, Serialize};

use super::error::VrError;
use super::event::Event;
use super::settings::VrSettings;
use super::simulated_vehicle::VehicleView;
use crate::mcap_messages::{MessagesFault, messages_of};
use crate::recording::{Recorder, quaternion, vector};
use crate::say;
use crate::whole_file::{self, part_of};

/// Name of the recording in the folder of the results.
pub(super) const RECORDING: &str = "session.mcap";
/// A session that ends without warning loses no more than this.
const LONGEST_LOSS: Duration = Duration::from_secs(5);
const SETTINGS_TOPIC: &str = "/vr/settings";
const EVENT_TOPIC: &str = "/vr/event";
const PLAN_TOPIC: &str = "/vr/plan";
const VEHICLE_TOPIC: &str = "/vehicle/pose";
/// The schemas say no more than that these are objects: the types are documented in the book.
const SCHEMA: &str = r#"{"type":"object"}"#;

/// What identifies a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanMark {
    /// Number of the task.
    pub(super) number: u64,
    /// When it was planned on the session's clock, s.
    pub(super) time: f64,
    /// What kind of task it is.
    pub(super) kind: String,
    /// Hash of every bit of its waypoints, flows and trajectory, hexadecimal; empty where the planner refused.
    pub(super) hash: String,
}

impl PlanMark {
    pub(super) fn of(planned: &PlannedTask) -> Self {
        let hash = planned
            .flight
            .as_ref()
            .map_or_else(|_| String::new(), |flight| format!("{:016x}", plan_hash(&flight.plan)));
        Self { number: planned.number, time: planned.time, kind: planned.kind.name().into(), hash }
    }
}

/// FNV-1a over the bits of everything that is flown.
fn plan_hash(plan: &Plan) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |value: f64| {
        for byte in value.to_bits().to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for waypoint in &plan.waypoints {
        let state = waypoint.state;
        let at = plan.trajectory.sample(waypoint.time);
        let numbers = [waypoint.time, state.heading, state.pan, state.tilt, at.heading];
        numbers.into_iter().chain(at.position.iter().copied()).chain(at.velocity.iter().copied()).for_each(&mut add);
        state.position.iter().copied().for_each(&mut add);
    }
    plan.flow.iter().copied().for_each(&mut add);
    hash
}

/// A recording and its channels.
struct RecordingWriter {
    recorder: Recorder,
    settings: u16,
    events: u16,
    plans: u16,
    vehicle: u16,
}

impl RecordingWriter {
    /// `kept`: as [`WholeFile::create_kept`](whole_file::WholeFile::create_kept).
    fn create(path: &Path, kept: bool) -> Result<Self, VrError> {
        let mut recorder = if kept { Recorder::create_kept(path) } else { Recorder::create(path) }?;
        let settings = recorder.json_channel(SETTINGS_TOPIC, "paintcopter.VrSettings", SCHEMA)?;
        let events = recorder.json_channel(EVENT_TOPIC, "paintcopter.VrEvent", SCHEMA)?;
        let plans = recorder.json_channel(PLAN_TOPIC, "paintcopter.VrPlan", SCHEMA)?;
        let vehicle = recorder.channel::<PoseInFrame>(VEHICLE_TOPIC)?;
        Ok(Self { recorder, settings, events, plans, vehicle })
    }

    /// Everything of another recording, as it is.
    fn copy(&mut self, path: &Path) -> Result<(), VrError> {
        for_each_message(path, |message| {
            let channel = match message.channel.topic.as_str() {
                SETTINGS_TOPIC => self.settings,
                EVENT_TOPIC => self.events,
                PLAN_TOPIC => self.plans,
                _ => self.vehicle,
            };
            Ok(self.recorder.write_bytes(channel, message.log_time, &message.data)?)
        })
        .map(|_| ())
    }
}

/// Writes a session as it goes, beside its final name: what has that name is whole, and the rest can be replayed all the same.
pub struct SessionRecorder {
    /// `None` only while one file is finished and the next is begun, or after that has failed.
    writer: Option<RecordingWriter>,
    path: PathBuf,
    /// The plans as a table, and where it is written.
    table: String,
    table_path: PathBuf,
    /// Whether it cannot be made again, and when what is recorded was last made safe.
    kept: bool,
    flushed: Instant,
}

impl SessionRecorder {
    /// Begins `session.mcap` and `plan.csv` in a folder. A session that is there is kept: it is renamed, and so is what was left of one that
    /// ended without its last words. `by_hand`: a person paints, and what is recorded stays whatever happens.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn create(folder: &Path, settings: &VrSettings, by_hand: bool) -> Result<Self, VrError> {
        let path = folder.join(RECORDING);
        for earlier in [path.clone(), part_of(&path)] {
            keep(&earlier)?;
        }
        let mut writer = RecordingWriter::create(&path, by_hand)?;
        writer.recorder.write_json(writer.settings, 0.0, settings)?;
        let table = "task,kind,time_s,x_m,y_m,z_m,heading_rad,pan_rad,tilt_rad,target\n".into();
        let table_path = folder.join("plan.csv");
        Ok(Self { writer: Some(writer), path, table, table_path, kept: by_hand, flushed: Instant::now() })
    }

    /// Makes what is recorded so far a whole file, and goes on in another that begins with the same: a finished MCAP file has its index
    /// at its end. Its path.
    pub(super) fn save(&mut self) -> Result<PathBuf, VrError> {
        self.close()?;
        let mut next = RecordingWriter::create(&self.path, self.kept)?;
        next.copy(&self.path)?;
        self.writer = Some(next);
        Ok(self.path.clone())
    }

    fn close(&mut self) -> Result<(), VrError> {
        if let Some(writer) = self.writer.take() {
            writer.recorder.finish()?;
        }
        whole_file::write(&self.table_path, &self.table).map_err(VrError::unwritable(&self.table_path))
    }

    /// Makes the events so far safe, from time to time: a chunk of a recording can be read when it has ended.
    fn flush(&mut self) -> Result<(), VrError> {
        if self.flushed.elapsed() < LONGEST_LOSS {
            return Ok(());
        }
        self.flushed = Instant::now();
        Ok(self.writer()?.recorder.flush()?)
    }

    fn writer(&mut self) -> Result<&mut RecordingWriter, VrError> {
        let gone = || VrError::recording(&self.path, "could not be saved before: nothing more is recorded");
        self.writer.as_mut().ok_or_else(gone)
    }

    pub(super) fn event(&mut self, time: f64, event: &Event) -> Result<(), VrError> {
        let writer = self.writer()?;
        writer.recorder.write_json(writer.events, time, event)?;
        self.flush()
    }

    pub(super) fn plan(&mut self, planned: &PlannedTask, mark: &PlanMark) -> Result<(), VrError> {
        self.write_table(planned);
        let writer = self.writer()?;
        Ok(writer.recorder.write_json(writer.plans, planned.time, mark)?)
    }

    /// The waypoints of a plan as rows; numbers have the digits that tell them apart.
    fn write_table(&mut self, planned: &PlannedTask) {
        let (number, kind) = (planned.number, planned.kind.name());
        for waypoint in planned.flight.iter().flat_map(|flight| &flight.plan.waypoints) {
            let s = &waypoint.state;
            let target = waypoint.target.map_or(String::new(), |target| target.to_string());
            let [x, y, z] = s.position.into();
            let numbers = format!("{},{x},{y},{z},{},{},{}", planned.time + waypoint.time, s.heading, s.pan, s.tilt);
            let _ = writeln!(self.table, "{number},{kind},{numbers},{target}");
        }
    }

    pub(super) fn vehicle(&mut self, time: f64, view: &VehicleView) -> Result<(), VrError> {
        let body = &view.world_from_body;
        let pose = Some(Pose { position: Some(vector(body)), orientation: Some(quaternion(body)) });
        let timestamp = Some(Timestamp::saturating_from_epoch_secs_f64(time));
        let message = PoseInFrame { timestamp, frame_id: "world".into(), pose };
        let writer = self.writer()?;
        Ok(writer.recorder.write(writer.vehicle, time, &message)?)
    }

    pub(super) fn finish(mut self) -> Result<(), VrError> {
        self.close()
    }
}

/// A recording as it is read.
pub(super) struct RecordedSession {
    pub(super) settings: VrSettings,
    pub(super) plans: Vec<PlanMark>,
    /// Whether it has its end.
    pub(super) whole: bool,
}

impl RecordedSession {
    /// Reads settings and plans; the events are streamed by [`for_each_event`].
    pub(super) fn open(path: &Path) -> Result<Self, VrError> {
        let (mut settings, mut plans) = (None, Vec::new());
        let whole = for_each_message(path, |message| {
            let (topic, data) = (message.channel.topic.as_str(), &message.data[..]);
            match topic {
                SETTINGS_TOPIC => settings = Some(parsed(path, topic, data)?),
                PLAN_TOPIC => plans.push(parsed(path, topic, data)?),
                _ => {}
            }
            Ok(())
        })?;
        if !whole {
            say!("{}: its end is missing: what is there is painted", path.display());
        }
        let settings = settings.ok_or_else(|| {
            VrError::recording(path, "no session of `vr`: it has no topic /vr/settings; give a session.mcap")
        })?;
        Ok(Self { settings, plans, whole })
    }
}

/// Hands out the events of a recording in their order; memory does not grow with the file.
pub(super) fn for_each_event(path: &Path, mut take: impl FnMut(Event) -> Result<(), VrError>) -> Result<(), VrError> {
    for_each_message(path, |message| match message.channel.topic.as_str() {
        topic @ EVENT_TOPIC => take(parsed(path, topic, &message.data)?),
        _ => Ok(()),
    })
    .map(|_| ())
}

/// Renames a recording after the time of its last change, so that no session overwrites it.
fn keep(path: &Path) -> Result<(), VrError> {
    let Ok(changed) = std::fs::metadata(path).and_then(|found| found.modified()) else { return Ok(()) };
    let seconds = changed.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (mut kept, mut number) = (path.with_file_name(format!("session-{seconds}.mcap")), 1);
    while kept.exists() {
        number += 1;
        kept.set_file_name(format!("session-{seconds}-{number}.mcap"));
    }
    std::fs::rename(path, &kept).map_err(VrError::unwritable(&kept))?;
    say!("an earlier session is kept as {}", kept.display());
    Ok(())
}

/// Hands out the messages of a recording; whether it has its end. A session that ended without its last words is what there is of it.
fn for_each_message(path: &Path, mut take: impl FnMut(&Message) -> Result<(), VrError>) -> Result<bool, VrError> {
    let fault = |fault: MessagesFault| match fault {
        MessagesFault::Unreadable(why) => VrError::recording(path, format!("cannot be read ({why})")),
        MessagesFault::Malformed(why) | MessagesFault::CutOff(why) => VrError::recording(path, why),
    };
    let mut empty = true;
    for message in messages_of(path).map_err(fault)? {
        match message {
            Err(MessagesFault::CutOff(_)) if !empty => return Ok(false),
            message => take(&message.map_err(fault)?)?,
        }
        empty = false;
    }
    Ok(true)
}

fn parsed<T: for<'a> Deserialize<'a>>(path: &Path, topic: &str, data: &[u8]) -> Result<T, VrError> {
    serde_json::from_slice(data)
        .map_err(|why| VrError::recording(path, format!("a message of {topic} cannot be read: {why}")))
}
