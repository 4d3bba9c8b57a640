//! The phases of a flight as a state machine that knows neither links nor sensors.

use nalgebra::{Point3, Vector3};

use super::failsafe::Cause;
use super::guidance::{FlightPlan, Guidance, Guided};
use super::phase::{Phase, Request, Situation};

/// Rest before the plan begins or goes on, s: the observer learns wind and hose.
const SETTLE: f64 = 4.0;
/// The plan goes on this much before the place where the paint ended, s.
const RUN_UP: f64 = 1.5;
/// A station is crossed by this much at least, m.
const LEAST_CLEARANCE: f64 = 0.3;
/// Ways to and from a station that is higher than the plan, or hardly lower, begin and end so much above it, m: they are straight.
const CLEARANCE: f64 = 1.0;
/// So near its station, across and in height, the robot has not risen yet, or stands on it again, m.
const STANDS: [f64; 2] = [0.5, 0.1];
/// Rest after take-off and above the place of the start, s.
const REST: f64 = 1.0;
/// So near its end a way is flown, m; later than this it is given up, s.
const NEAR: f64 = 0.2;
const LONGEST_DELAY: f64 = 20.0;
/// So far from the plan it is not followed, m.
const ASTRAY: f64 = 0.5;
/// Times that it may be so before any more is painted.
const ATTEMPTS: usize = 3;
/// A cause must be gone for so long, s.
const RECOVERED: f64 = 1.0;
/// A hold that lasts longer is the end, s.
const LONGEST_HOLD: f64 = 30.0;
/// How long the autopilot's estimate must have been good before it is armed, s.
const ESTIMATE_AGE: f64 = 2.0;

/// The state machine. `P` is the plan that is painted.
#[derive(Debug, Clone)]
pub struct Phases<P> {
    plan: P,
    /// The plan is painted up to here, s.
    until: f64,
    /// The paint of a command leaves so much later, s.
    lead: f64,
    phase: Phase,
    since: f64,
    guidance: Option<Guidance>,
    /// Where it stood, with heading.
    station: Option<(Point3<f64>, f64)>,
    painted: f64,
    /// How often a way or the plan was not followed since this much was painted.
    in_vain: (usize, f64),
    good_since: Option<f64>,
    ended_early: Option<Cause>,
    events: Vec<(f64, Phase)>,
}

impl<P: FlightPlan + Copy> Phases<P> {
    /// On the ground, for the first `seconds` of a plan; the paint of a command leaves `lead` seconds later.
    pub fn new(plan: P, seconds: f64, lead: f64) -> Self {
        Self {
            until: plan.duration().min(seconds),
            plan,
            lead,
            phase: Phase::Wait,
            since: 0.0,
            guidance: None,
            station: None,
            painted: 0.0,
            in_vain: (0, 0.0),
            good_since: None,
            ended_early: None,
            events: Vec::new(),
        }
    }

    /// What the robot is doing.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// When each phase began.
    pub fn events(&self) -> &[(f64, Phase)] {
        &self.events
    }

    /// Time of the plan up to which it is painted, s.
    pub fn painted(&self) -> f64 {
        self.painted
    }

    /// Where the plan is painted next, s of its own time.
    pub fn unpainted(&self) -> std::ops::RangeInclusive<f64> {
        self.painted..=self.until
    }

    /// Why a flight that landed did not paint all of it.
    pub fn ended_early(&self) -> Option<Cause> {
        self.ended_early
    }

    /// Where it stood, with heading.
    pub fn station(&self) -> Option<(Point3<f64>, f64)> {
        self.station
    }

    /// Time of the plan at `now`, while it is followed.
    pub fn plan_time(&self, now: f64) -> Option<f64> {
        match self.guidance {
            Some(Guidance::Plan { offset }) => Some(now - offset),
            _ => None,
        }
    }

    /// Time of the plan that the gun aims by at `now`: before the plan begins or goes on, at where it will.
    pub fn aim_offset(&self, now: f64) -> Option<f64> {
        match (self.phase, self.guidance) {
            (Phase::Paint, Some(Guidance::Plan { offset })) => Some(offset),
            (Phase::Approach, _) => Some(now - self.resume()),
            _ => None,
        }
    }

    /// What is followed; nothing on the ground.
    pub fn guided(&self) -> Option<Guided<P>> {
        if matches!(self.phase, Phase::Wait | Phase::Arm) {
            return None;
        }
        // On the way the gun is kept where the plan will want it.
        let lever = match self.phase {
            Phase::Approach | Phase::Hold(_) => self.plan.at(self.resume()).lever,
            _ => Vector3::zeros(),
        };
        Some(Guided { guidance: self.guidance?, plan: self.plan, lever })
    }

    /// What the autopilot is asked for; `arms`: whether it is ours to arm and to take control, which on a vehicle is the pilot's.
    pub fn request(&self, arms: bool) -> Option<Request> {
        match self.phase {
            Phase::Arm => arms.then_some(Request::Arm),
            Phase::Hold(_) => arms.then_some(Request::Offboard),
            Phase::Land => Some(Request::Land),
            _ => None,
        }
    }

    /// One control step.
    pub fn advance(&mut self, situation: &Situation) {
        let Situation { now, cause, position, heading, ready, armed } = *situation;
        let (station, station_heading) = *self.station.get_or_insert((position, heading));
        // A pose that is not good enough to paint by is good enough to fly home by.
        let cause = cause.filter(|cause| !(self.phase == Phase::Return && *cause == Cause::PoseUncertain));
        if let Some(cause) = cause.or(self.astray(situation)).filter(|_| self.phase.is_guarded()) {
            self.good_since = None;
            return self.fail(cause, situation);
        }
        let good_for = now - *self.good_since.get_or_insert(now);
        match self.phase {
            Phase::Wait if !ready => self.good_since = None,
            Phase::Wait if good_for >= ESTIMATE_AGE => self.enter(now, Phase::Arm, None),
            Phase::Arm if cause.is_none() => self.take_off(now, station, station_heading),
            Phase::TakeOff if self.arrived(situation, REST) => self.approach(situation),
            Phase::Approach if self.arrived(situation, SETTLE) => {
                self.enter(now, Phase::Paint, Some(Guidance::Plan { offset: now - self.resume() }));
            }
            Phase::Paint => {
                let at = self.plan_time(now).unwrap_or(self.until);
                self.painted = self.painted.max(at.min(self.until));
                if at >= self.until {
                    self.go_home(situation);
                }
            }
            Phase::Hold(_) if good_for < RECOVERED => {}
            Phase::Hold(_) if stands(&(position - station)) => {
                self.take_off(now, Point3::new(position.x, position.y, station.z), heading);
            }
            Phase::Hold(_) => self.approach(situation),
            Phase::Return if self.arrived(situation, REST) => self.enter(now, Phase::Land, None),
            Phase::Land if !armed => self.enter(now, Phase::Done, None),
            _ => {}
        }
    }

    /// Holds, returns or gives up. The valve is shut by then.
    fn fail(&mut self, cause: Cause, situation: &Situation) {
        let Situation { now, position, heading, .. } = *situation;
        let in_vain = cause == Cause::NotFollowed && self.attempts() >= ATTEMPTS;
        match self.phase {
            Phase::Hold(_) if now - self.since > LONGEST_HOLD => self.enter(now, Phase::Aborted(cause), None),
            _ if in_vain => self.enter(now, Phase::Aborted(cause), None),
            _ if cause.brings_home() => {
                self.ended_early = Some(cause);
                if self.phase == Phase::Return {
                    self.advance(&Situation { cause: None, ..*situation });
                } else {
                    self.go_home(situation);
                }
            }
            _ if !cause.passes() => self.enter(now, Phase::Aborted(cause), None),
            Phase::Hold(held) if held == cause => {}
            Phase::Hold(_) => {
                // Another cause; the hold goes on.
                self.phase = Phase::Hold(cause);
                self.events.push((now, self.phase));
            }
            _ => {
                // What was commanded is painted.
                if let Some(at) = self.plan_time(now).filter(|_| self.phase == Phase::Paint) {
                    self.painted = self.painted.max(at + self.lead);
                }
                self.enter(now, Phase::Hold(cause), Some(Guidance::stay(position, heading, now)));
            }
        }
    }

    /// Times that it has not followed, this one too, since more was painted.
    fn attempts(&mut self) -> usize {
        let (count, painted) = self.in_vain;
        let count = if self.painted > painted { 1 } else { count + 1 };
        self.in_vain = (count, self.painted);
        count
    }

    fn enter(&mut self, now: f64, phase: Phase, guidance: Option<Guidance>) {
        self.phase = phase;
        self.since = now;
        self.good_since = None;
        self.guidance = guidance.or(self.guidance);
        self.events.push((now, phase));
    }

    /// Whether the end of a way is reached, by the time and by the place.
    fn arrived(&self, situation: &Situation, rest: f64) -> bool {
        let Situation { now, .. } = *situation;
        self.guidance.is_some_and(|guidance| guidance.arrived(now, rest)) && self.distance(situation) < NEAR
    }

    /// Whether the plan is left, or the end of a way is not reached in time.
    fn astray(&self, situation: &Situation) -> Option<Cause> {
        let astray = match self.phase {
            Phase::Paint => self.distance(situation) > ASTRAY,
            Phase::TakeOff | Phase::Approach | Phase::Return => {
                self.guidance.is_some_and(|guidance| guidance.arrived(situation.now, LONGEST_DELAY))
            }
            _ => false,
        };
        astray.then_some(Cause::NotFollowed)
    }

    /// From where it shall be, m.
    fn distance(&self, situation: &Situation) -> f64 {
        self.guided().map_or(0.0, |guided| (guided.at(situation.now).position - situation.position).norm())
    }

    /// Where the plan starts or goes on, s of its own time.
    fn resume(&self) -> f64 {
        (self.painted - RUN_UP).max(0.0)
    }

    /// Straight up from a station.
    fn take_off(&mut self, now: f64, station: Point3<f64>, heading: f64) {
        let above = over(&station, self.plan.at(self.resume()).position.z);
        self.enter(now, Phase::TakeOff, Some(Guidance::way(station, heading, above, heading, now)));
    }

    fn approach(&mut self, situation: &Situation) {
        let Situation { now, position, heading, .. } = *situation;
        let start = self.plan.at(self.resume());
        let way = Guidance::way(position, heading, start.position, start.heading, now);
        self.enter(now, Phase::Approach, Some(way));
    }

    /// Away from the surface, level or up to a station that is higher, until it is over the place of the start.
    fn go_home(&mut self, situation: &Situation) {
        let Situation { now, position, heading, .. } = *situation;
        let (station, station_heading) = self.station.unwrap_or((position, heading));
        let above = over(&station, position.z);
        self.enter(now, Phase::Return, Some(Guidance::way(position, heading, above, station_heading, now)));
    }
}

/// Over a station at a height, or above it where it is higher, or in the way.
fn over(station: &Point3<f64>, height: f64) -> Point3<f64> {
    let height = if height < station.z + LEAST_CLEARANCE { station.z + CLEARANCE } else { height };
    Point3::new(station.x, station.y, height)
}

/// Whether a robot so far from its station is still, or again, on it.
fn stands(off: &Vector3<f64>) -> bool {
    let [across, in_height] = STANDS;
    off.xy().norm() < across && off.z.abs() < in_height
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::onboard::guidance::tests::Line;

    /// Ten steps a second until a phase, at the place where it is guided to.
    fn until(phases: &mut Phases<Line>, clock: &mut f64, cause: Option<Cause>, phase: impl Fn(Phase) -> bool) {
        for _ in 0..1000 {
            *clock += 0.1;
            let (position, heading) =
                phases.guided().map_or((Point3::origin(), 0.0), |g| (g.at(*clock).position, g.at(*clock).heading));
            let situation = Situation { now: *clock, cause, position, heading, ready: true, armed: true };
            phases.advance(&situation);
            if phase(phases.phase()) {
                return;
            }
        }
        panic!("stays in {}", phases.phase());
    }

    #[test]
    fn the_phases_follow_the_table() {
        let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.0), 0.0);
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Return);
        let names: Vec<_> = phases.events().iter().map(|(_, phase)| phase.to_string()).collect();
        assert_eq!(names, ["arm", "take off", "approach", "paint", "return"]);
        assert_eq!((phases.painted(), phases.ended_early()), (Line.duration(), None));
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Land);
        assert_eq!(phases.request(false), Some(Request::Land));
        let rest =
            Situation { now: clock, cause: None, position: Point3::origin(), heading: 0.0, ready: true, armed: false };
        phases.advance(&rest);
        assert_eq!(phases.phase(), Phase::Done);
    }

    #[test]
    fn a_hold_goes_on_before_the_place_where_the_paint_ended() {
        let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.3), 0.0);
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
        for _ in 0..30 {
            until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
        }
        let painted = phases.painted();
        assert!((painted - 3.0).abs() < 0.11, "{painted}");
        until(&mut phases, &mut clock, Some(Cause::PoseLost), |phase| phase == Phase::Hold(Cause::PoseLost));
        assert_eq!((phases.request(true), phases.request(false)), (Some(Request::Offboard), None));
        // It stays where it was.
        assert_eq!(phases.guided().unwrap().at(clock + 5.0).velocity, Vector3::zeros());
        // A step later, and what was commanded by then leaves 0.3 s after it.
        let ended = phases.painted();
        assert!((ended - (painted + 0.1 + 0.3)).abs() < 1e-9, "{painted} {ended}");
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
        assert_eq!(phases.painted(), ended);
        assert!((phases.plan_time(clock).unwrap() - (ended - RUN_UP)).abs() < 1e-9);
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Return);
    }

    #[test]
    fn a_robot_that_stays_on_the_ground_does_not_paint() {
        let mut phases = Phases::new(Line, 20.0, 0.0);
        for k in 0..1000 {
            let now = 0.1 * f64::from(k);
            let position = Point3::origin();
            phases.advance(&Situation { now, cause: None, position, heading: 0.0, ready: true, armed: true });
        }
        let names: Vec<_> = phases.events().iter().map(|(_, phase)| *phase).collect();
        let [hold, again] = [Phase::Hold(Cause::NotFollowed), Phase::TakeOff];
        let given_up = Phase::Aborted(Cause::NotFollowed);
        assert_eq!(names, [Phase::Arm, Phase::TakeOff, hold, again, hold, again, given_up]);
    }

    /// Stands around a plan at 2 m: whatever lies within 30 cm of their middle is crossed well above them.
    #[test]
    fn a_station_as_high_as_the_plan_is_left_and_reached_from_above() {
        for height in [3.5, 2.01, 2.0, 1.99, 1.8, 1.6] {
            let stand = Point3::new(0.0, 0.0, height);
            let (mut phases, mut clock, mut lowest) = (Phases::new(Line, 20.0, 0.0), 0.0, f64::INFINITY);
            while phases.phase() != Phase::Land {
                clock += 0.1;
                assert!(clock < 100.0, "stays in {}", phases.phase());
                let position = phases.guided().map_or(stand, |guided| guided.at(clock).position);
                let leaves = matches!(phases.phase(), Phase::Approach | Phase::Return);
                if leaves && (position - stand).xy().norm() < 0.3 {
                    lowest = lowest.min(position.z - stand.z);
                }
                let situation = Situation { now: clock, cause: None, position, heading: 0.0, ready: true, armed: true };
                phases.advance(&situation);
            }
            // One metre at the middle of a high one, one tenth of the way of 3 m and 2.5 m down less.
            let least = if height > 1.7 { 0.7 } else { 0.39 };
            assert!((least..=1.0).contains(&lowest), "{lowest} over {height}");
            assert!((phases.painted() - Line.duration()).abs() < 1e-9);
        }
    }

    /// Set down on the stand by what made it hold, it rises before it goes anywhere.
    #[test]
    fn a_robot_that_stands_again_takes_off_again() {
        let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.0), 0.0);
        until(&mut phases, &mut clock, None, |phase| phase == Phase::TakeOff);
        until(&mut phases, &mut clock, Some(Cause::PoseLost), |phase| phase == Phase::Hold(Cause::PoseLost));
        until(&mut phases, &mut clock, None, |phase| !matches!(phase, Phase::Hold(_)));
        assert_eq!(phases.phase(), Phase::TakeOff);
        until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
        until(&mut phases, &mut clock, Some(Cause::PoseLost), |phase| phase == Phase::Hold(Cause::PoseLost));
        until(&mut phases, &mut clock, None, |phase| !matches!(phase, Phase::Hold(_)));
        assert_eq!(phases.phase(), Phase::Approach);
    }

    /// Above a small wall, where nothing of the map is in view, say.
    #[test]
    fn it_flies_home_by_an_uncertain_pose_but_not_without_one() {
        for (cause, next) in [(Cause::PoseUncertain, Phase::Land), (Cause::PoseLost, Phase::Hold(Cause::PoseLost))] {
            let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.0), 0.0);
            until(&mut phases, &mut clock, None, |phase| phase == Phase::Return);
            until(&mut phases, &mut clock, Some(cause), |phase| phase != Phase::Return);
            assert_eq!((phases.phase(), phases.ended_early()), (next, None));
        }
    }

    #[test]
    fn what_does_not_pass_ends_the_flight() {
        for (cause, phase) in [
            (Cause::AutopilotRestarted, Phase::Aborted(Cause::AutopilotRestarted)),
            (Cause::Disarmed, Phase::Aborted(Cause::Disarmed)),
            (Cause::BatteryLow, Phase::Return),
            (Cause::Interrupted, Phase::Return),
            (Cause::LinkLost, Phase::Aborted(Cause::LinkLost)),
        ] {
            let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.0), 0.0);
            until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
            let before = clock;
            until(&mut phases, &mut clock, Some(cause), |found| found == phase);
            let waited = clock - before;
            assert_eq!(waited > 1.0, cause == Cause::LinkLost, "{cause:?} {waited}");
            assert!(waited < LONGEST_HOLD + 0.3);
        }
        // A battery that is low still brings it home, and so does an interruption.
        for cause in [Cause::BatteryLow, Cause::Interrupted] {
            let (mut phases, mut clock) = (Phases::new(Line, 20.0, 0.0), 0.0);
            until(&mut phases, &mut clock, None, |phase| phase == Phase::Paint);
            until(&mut phases, &mut clock, Some(cause), |phase| phase == Phase::Land);
            assert_eq!(phases.ended_early(), Some(cause));
        }
    }
}
