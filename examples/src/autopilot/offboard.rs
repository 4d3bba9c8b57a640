//! Our side of the off-board link: fed message by message and control step by control step, it says what to send.

use mavlink::dialects::common::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavState, MavType, TIMESYNC_DATA,
};
use mavlink::{MavHeader, MessageData};

use paint_planner::onboard::Request;

use super::odometry::Odometry;
use super::setpoint::Setpoint;
use super::telemetry::{Identity, Mode, Telemetry};

/// Rates of what is sent and asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffboardSettings {
    /// Set-points per second. Default 100, the control rate: an attitude that comes late costs damping.
    pub setpoint_rate: f64,
    /// Odometry per second. Default 50.
    pub odometry_rate: f64,
    /// Attitude and states of the autopilot per second that are asked for. Default 250: a loss is seen within a control step.
    pub telemetry_rate: f64,
    /// A request that is not fulfilled is made again after this time, s. Default 0.5.
    pub retry: f64,
}

impl Default for OffboardSettings {
    fn default() -> Self {
        Self { setpoint_rate: 100.0, odometry_rate: 50.0, telemetry_rate: 250.0, retry: 0.5 }
    }
}

/// All streams are asked for within this time, s, first and then.
const FIRST_RATES: f64 = 0.2;
const ALL_RATES: f64 = 2.0;

/// The state of the link.
#[derive(Debug, Clone)]
pub struct OffboardLink {
    settings: OffboardSettings,
    telemetry: Telemetry,
    request: Option<Request>,
    requested: Pace,
    heartbeats: Pace,
    setpoints: Pace,
    odometry: Pace,
    rates: Pace,
    /// Streams that it has been asked for, again and again.
    asked: usize,
    replies: Vec<MavMessage>,
}

/// Something that is due again and again.
#[derive(Debug, Clone, Copy)]
struct Pace {
    interval: f64,
    next: f64,
}

impl Pace {
    fn every(interval: f64) -> Self {
        Self { interval, next: f64::NEG_INFINITY }
    }

    fn due(&mut self, now: f64) -> bool {
        let due = now >= self.next - 1e-6;
        if due {
            // On the grid, unless it was missed.
            self.next = if now - self.next < self.interval { self.next + self.interval } else { now + self.interval };
        }
        due
    }
}

impl OffboardLink {
    /// A link that has heard nothing.
    pub fn new(settings: OffboardSettings) -> Self {
        Self {
            telemetry: Telemetry::default(),
            request: None,
            requested: Pace::every(settings.retry),
            heartbeats: Pace::every(1.0),
            setpoints: Pace::every(1.0 / settings.setpoint_rate),
            odometry: Pace::every(1.0 / settings.odometry_rate),
            rates: Pace::every(ALL_RATES),
            asked: 0,
            replies: Vec::new(),
            settings,
        }
    }

    /// What the autopilot says of itself.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Asks for something from now on; `None` for nothing.
    pub fn request(&mut self, request: Option<Request>) {
        if request != self.request {
            (self.request, self.requested) = (request, Pace::every(self.settings.retry));
        }
    }

    /// Takes in a message that arrives at `now`, s.
    pub fn receive(&mut self, now: f64, header: &MavHeader, message: &MavMessage) {
        self.telemetry.receive(now, header, message);
        if let MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 0, ts1, .. }) = message {
            // It asks for our time: the stamps of odometry are in ours.
            let tc1 = (now * 1e9) as i64;
            self.replies.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1, ts1: *ts1, ..TIMESYNC_DATA::default() }));
        }
    }

    /// What is to be sent at `now`, s, with the newest set-point and odometry.
    pub fn transmit(&mut self, now: f64, setpoint: Option<&Setpoint>, odometry: Option<&Odometry>) -> Vec<MavMessage> {
        let mut messages = std::mem::take(&mut self.replies);
        if self.heartbeats.due(now) {
            messages.push(heartbeat());
        }
        if let Some(odometry) = odometry.filter(|_| self.odometry.due(now)) {
            messages.push(odometry.message(now));
        }
        let Some(autopilot) = self.telemetry.identity else { return messages };
        if let Some(setpoint) = setpoint.filter(|_| self.setpoints.due(now)) {
            messages.push(setpoint.message(now, &autopilot));
        }
        // Asked again and again: an autopilot that was restarted has forgotten it. One at a time: it obeys one command in each of its
        // cycles, and its pilot's must not wait behind ours.
        let wanted = self.wanted_rates(&autopilot);
        let all = if self.asked < wanted.len() { FIRST_RATES } else { ALL_RATES };
        self.rates.interval = all / wanted.len() as f64;
        if self.rates.due(now) {
            messages.push(wanted[self.asked % wanted.len()].clone());
            self.asked += 1;
        }
        if let Some(request) = self.request.filter(|_| self.requested.due(now)) {
            messages.extend(self.commands(request));
        }
        messages
    }

    fn wanted_rates(&self, autopilot: &Identity) -> [MavMessage; 6] {
        let fast = self.settings.telemetry_rate;
        let wanted = [
            (mavlink::dialects::common::ATTITUDE_QUATERNION_DATA::ID, fast),
            (mavlink::dialects::common::ATTITUDE_TARGET_DATA::ID, self.settings.setpoint_rate),
            (mavlink::dialects::common::LOCAL_POSITION_NED_DATA::ID, 50.0),
            (mavlink::dialects::common::ESTIMATOR_STATUS_DATA::ID, fast),
            (mavlink::dialects::common::EXTENDED_SYS_STATE_DATA::ID, 5.0),
            (mavlink::dialects::common::SYS_STATUS_DATA::ID, fast),
        ];
        let ask = |(id, rate): (u32, f64)| {
            command(autopilot, MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [id as f32, (1e6 / rate) as f32, 0.0])
        };
        wanted.map(ask)
    }

    /// The commands that are missing for a request; none while no autopilot is heard.
    pub fn commands(&self, request: Request) -> Vec<MavMessage> {
        let Some(autopilot) = &self.telemetry.identity else { return Vec::new() };
        let mode = |main: f32, sub: f32| command(autopilot, MavCmd::MAV_CMD_DO_SET_MODE, [1.0, main, sub]);
        let offboard = self.telemetry.mode == Some(Mode::Offboard);
        match request {
            Request::Offboard | Request::Arm if !offboard => vec![mode(6.0, 0.0)],
            Request::Arm if !self.telemetry.armed => {
                vec![command(autopilot, MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0])]
            }
            Request::Land if self.telemetry.mode != Some(Mode::Land) => vec![mode(4.0, 6.0)],
            _ => Vec::new(),
        }
    }
}

/// An off-board computer that is active.
fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}

fn command(to: &Identity, command: MavCmd, [param1, param2, param3]: [f32; 3]) -> MavMessage {
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        command,
        target_system: to.system,
        target_component: to.component,
        ..COMMAND_LONG_DATA::default()
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn heard(custom_mode: u32, base_mode: MavModeFlag) -> (MavHeader, MavMessage) {
        let autopilot = MavAutopilot::MAV_AUTOPILOT_PX4;
        let header = MavHeader { system_id: 3, component_id: 1, sequence: 0 };
        (
            header,
            MavMessage::HEARTBEAT(HEARTBEAT_DATA { custom_mode, base_mode, autopilot, ..HEARTBEAT_DATA::default() }),
        )
    }

    fn names(messages: &[MavMessage]) -> Vec<&'static str> {
        use mavlink::Message;
        messages.iter().map(Message::message_name).collect()
    }

    #[test]
    fn nothing_is_commanded_before_an_autopilot_is_heard_and_all_in_order_after() {
        let mut link = OffboardLink::new(OffboardSettings::default());
        link.request(Some(Request::Arm));
        let setpoint = Setpoint::leaning(0.0, 0.0, 0.0, 0.0, 0.5);
        assert_eq!(names(&link.transmit(0.0, Some(&setpoint), None)), ["HEARTBEAT"]);
        // Another ground station's heartbeat is none of an autopilot.
        let (header, _) = heard(0, MavModeFlag::empty());
        link.receive(0.0, &header, &heartbeat());
        assert_eq!(link.telemetry().identity, None);
        let (header, message) = heard(0, MavModeFlag::empty());
        link.receive(0.01, &header, &message);
        let commands = |messages: &[MavMessage]| -> Vec<(u32, f32, u8)> {
            let of = |m: &MavMessage| match m {
                MavMessage::COMMAND_LONG(c) => Some((c.command as u32, c.param2, c.target_system)),
                _ => None,
            };
            messages.iter().filter_map(of).filter(|(command, ..)| *command != 511).collect()
        };
        let sent = link.transmit(0.01, Some(&setpoint), None);
        assert!(names(&sent).contains(&"SET_ATTITUDE_TARGET"));
        assert_eq!(commands(&sent), [(176, 6.0, 3)]);
        // Not again before its time, and set-points at 100 Hz.
        let sent = link.transmit(0.015, Some(&setpoint), None);
        assert!(sent.is_empty(), "{sent:?}");
        assert_eq!(names(&link.transmit(0.02, Some(&setpoint), None)), ["SET_ATTITUDE_TARGET"]);
        let (header, message) = heard(6 << 16, MavModeFlag::empty());
        link.receive(0.4, &header, &message);
        assert_eq!(commands(&link.transmit(0.51, Some(&setpoint), None)), [(400, 0.0, 3)]);
        let (header, message) = heard(6 << 16, MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        link.receive(0.6, &header, &message);
        assert_eq!(commands(&link.transmit(1.01, Some(&setpoint), None)), []);
        link.request(Some(Request::Land));
        assert_eq!(commands(&link.transmit(1.02, Some(&setpoint), None)), [(176, 4.0, 3)]);
    }

    /// Its pilot's command waits behind one of ours at most, and a stream that it forgot comes back within two seconds.
    #[test]
    fn streams_are_asked_for_one_at_a_time_soon_at_first_and_again() {
        let mut link = OffboardLink::new(OffboardSettings::default());
        let (header, message) = heard(0, MavModeFlag::empty());
        link.receive(0.0, &header, &message);
        let asked = (0..450).map(|step| {
            let of = |m: &MavMessage| match m {
                MavMessage::COMMAND_LONG(c) => Some(c.param1 as u32),
                _ => None,
            };
            link.transmit(0.01 * f64::from(step), None, None).iter().filter_map(of).collect::<Vec<u32>>()
        });
        let asked: Vec<Vec<u32>> = asked.collect();
        assert!(asked.iter().all(|ids| ids.len() <= 1));
        let within = |steps: std::ops::Range<usize>| asked[steps].concat().into_iter().collect::<BTreeSet<u32>>().len();
        assert_eq!((within(0..20), within(30..240), within(240..450)), (6, 6, 6));
        let all = asked.concat().len();
        assert!(all < 6 + 16, "{all}");
    }

    #[test]
    fn a_request_for_our_time_is_answered_and_an_answer_is_not() {
        let mut link = OffboardLink::new(OffboardSettings::default());
        let (header, _) = heard(0, MavModeFlag::empty());
        let ask = |tc1| MavMessage::TIMESYNC(TIMESYNC_DATA { tc1, ts1: 77, ..TIMESYNC_DATA::default() });
        link.receive(1.5, &header, &ask(0));
        link.receive(1.5, &header, &ask(5));
        let sent = link.transmit(1.5, None, None);
        let answers: Vec<_> = sent.iter().filter(|m| matches!(m, MavMessage::TIMESYNC(_))).collect();
        let expected = TIMESYNC_DATA { tc1: 1_500_000_000, ts1: 77, ..TIMESYNC_DATA::default() };
        assert_eq!(answers, [&MavMessage::TIMESYNC(expected)]);
    }
}
