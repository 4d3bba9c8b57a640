//! A session as MCAP: events and plans as JSON of our own, the flight with Foxglove's schema.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

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

/// Name of the recording in the folder of the results.
pub(super) const RECORDING: &str = "session.mcap";
/// Its name as long as it is not whole.
const PART: &str = "session.mcap.part";
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
    fn create(path: &Path) -> Result<Self, VrError> {
        let mut recorder = Recorder::create(path)?;
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
    }
}

/// Writes a session as it goes, beside its final name: what has that name is whole.
pub struct SessionRecorder {
    writer: RecordingWriter,
    /// The recording when it is whole, and while it is not.
    path: PathBuf,
    part: PathBuf,
    /// The plans as a table.
    table: BufWriter<File>,
    table_path: PathBuf,
}

impl SessionRecorder {
    /// Begins `session.mcap` and `plan.csv` in a folder.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn create(folder: &Path, settings: &VrSettings) -> Result<Self, VrError> {
        let (path, part) = (folder.join(RECORDING), folder.join(PART));
        let mut writer = RecordingWriter::create(&part)?;
        let table_path = folder.join("plan.csv");
        let mut table = File::create(&table_path).map(BufWriter::new).map_err(VrError::unwritable(&table_path))?;
        writeln!(table, "task,kind,time_s,x_m,y_m,z_m,heading_rad,pan_rad,tilt_rad,target")
            .map_err(VrError::unwritable(&table_path))?;
        writer.recorder.write_json(writer.settings, 0.0, settings)?;
        Ok(Self { writer, path, part, table, table_path })
    }

    /// Makes what is recorded so far a whole file, and goes on in another that begins with the same: a finished MCAP file has its index
    /// at its end. Its path.
    pub(super) fn save(&mut self) -> Result<PathBuf, VrError> {
        self.close()?;
        self.writer = RecordingWriter::create(&self.part)?;
        self.writer.copy(&self.path)?;
        Ok(self.path.clone())
    }

    fn close(&mut self) -> Result<(), VrError> {
        self.table.flush().map_err(VrError::unwritable(&self.table_path))?;
        self.writer.recorder.finish()?;
        std::fs::rename(&self.part, &self.path).map_err(VrError::unwritable(&self.path))
    }

    pub(super) fn event(&mut self, time: f64, event: &Event) -> Result<(), VrError> {
        Ok(self.writer.recorder.write_json(self.writer.events, time, event)?)
    }

    pub(super) fn plan(&mut self, planned: &PlannedTask, mark: &PlanMark) -> Result<(), VrError> {
        self.write_table(planned).map_err(VrError::unwritable(&self.table_path))?;
        Ok(self.writer.recorder.write_json(self.writer.plans, planned.time, mark)?)
    }

    /// The waypoints of a plan as rows; numbers have the digits that tell them apart.
    fn write_table(&mut self, planned: &PlannedTask) -> std::io::Result<()> {
        let (number, kind) = (planned.number, planned.kind.name());
        for waypoint in planned.flight.iter().flat_map(|flight| &flight.plan.waypoints) {
            let s = &waypoint.state;
            let target = waypoint.target.map_or(String::new(), |target| target.to_string());
            let [x, y, z] = s.position.into();
            let numbers = format!("{},{x},{y},{z},{},{},{}", planned.time + waypoint.time, s.heading, s.pan, s.tilt);
            writeln!(self.table, "{number},{kind},{numbers},{target}")?;
        }
        Ok(())
    }

    pub(super) fn vehicle(&mut self, time: f64, view: &VehicleView) -> Result<(), VrError> {
        let body = &view.world_from_body;
        let pose = Some(Pose { position: Some(vector(body)), orientation: Some(quaternion(body)) });
        let timestamp = Some(Timestamp::saturating_from_epoch_secs_f64(time));
        let message = PoseInFrame { timestamp, frame_id: "world".into(), pose };
        Ok(self.writer.recorder.write(self.writer.vehicle, time, &message)?)
    }

    pub(super) fn finish(mut self) -> Result<(), VrError> {
        self.close()
    }
}

/// A recording as it is read.
pub(super) struct RecordedSession {
    pub(super) settings: VrSettings,
    pub(super) plans: Vec<PlanMark>,
}

impl RecordedSession {
    /// Reads settings and plans; the events are streamed by [`for_each_event`].
    pub(super) fn open(path: &Path) -> Result<Self, VrError> {
        let (mut settings, mut plans) = (None, Vec::new());
        for_each_message(path, |message| {
            let (topic, data) = (message.channel.topic.as_str(), &message.data[..]);
            match topic {
                SETTINGS_TOPIC => settings = Some(parsed(path, topic, data)?),
                PLAN_TOPIC => plans.push(parsed(path, topic, data)?),
                _ => {}
            }
            Ok(())
        })?;
        let settings = settings.ok_or_else(|| {
            VrError::recording(path, "no session of `vr`: it has no topic /vr/settings; give a session.mcap")
        })?;
        Ok(Self { settings, plans })
    }
}

/// Hands out the events of a recording in their order; memory does not grow with the file.
pub(super) fn for_each_event(path: &Path, mut take: impl FnMut(Event) -> Result<(), VrError>) -> Result<(), VrError> {
    for_each_message(path, |message| match message.channel.topic.as_str() {
        topic @ EVENT_TOPIC => take(parsed(path, topic, &message.data)?),
        _ => Ok(()),
    })
}

fn for_each_message(path: &Path, mut take: impl FnMut(&Message) -> Result<(), VrError>) -> Result<(), VrError> {
    let fault = |fault: MessagesFault| match fault {
        MessagesFault::Unreadable(why) => VrError::recording(path, format!("cannot be read ({why})")),
        MessagesFault::Malformed(why) => VrError::recording(path, why),
    };
    for message in messages_of(path).map_err(fault)? {
        take(&message.map_err(fault)?)?;
    }
    Ok(())
}

fn parsed<T: for<'a> Deserialize<'a>>(path: &Path, topic: &str, data: &[u8]) -> Result<T, VrError> {
    serde_json::from_slice(data)
        .map_err(|why| VrError::recording(path, format!("a message of {topic} cannot be read: {why}")))
}
