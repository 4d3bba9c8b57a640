//! PX4 as a program beside this one, flown in lockstep: its clock is the stamp of the samples that it is given.

use std::fs;
use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use mavlink::MavHeader;
use mavlink::dialects::common::{HIL_ACTUATOR_CONTROLS_DATA, MavMessage};

use super::error::AutopilotError;
use super::lockstep::{Threads, tied};
use super::px4_folder::{Px4Vehicle, file_error, prepare};
use super::simulator_socket::SimulatorSocket;
use super::vehicle_link::VehicleLink;

/// Wall clock: a running PX4 answers each sample.
const ANSWER: Duration = Duration::from_secs(10);
/// Instances that are tried: each has ports of its own.
const INSTANCES: u16 = 10;

/// A PX4 that runs.
pub struct Px4 {
    child: Child,
    threads: Threads,
    simulator: SimulatorSocket,
    offboard: VehicleLink,
    log: PathBuf,
    controls: Option<HIL_ACTUATOR_CONTROLS_DATA>,
}

impl Px4 {
    /// Starts the PX4 of `source` (`px4`, `px4-alias.sh`, `etc/`) in the folder `run`, which is made anew, with the first free instance.
    pub fn start(source: &Path, run: &Path, vehicle: &Px4Vehicle) -> Result<Self, AutopilotError> {
        prepare(source, run, vehicle)?;
        let run = &run.canonicalize().map_err(|source| file_error(run, source))?;
        let (instance, listener, offboard) = ports()?;
        let log = run.join("px4.log");
        let output = fs::File::create(&log).map_err(|source| file_error(&log, source))?;
        let errors = output.try_clone().map_err(|source| file_error(&log, source))?;
        let program = run.join("bin/px4");
        let path = std::env::var("PATH").unwrap_or_default();
        let child = tied(&program, instance)
            .args(["-d", "-i", &instance.to_string()])
            .arg(run.join("bin/etc"))
            .args(["-s", "etc/init.d-posix/rcS"])
            .current_dir(run)
            .env("PX4_SIM_MODEL", "paintcopter")
            .env("PATH", format!("{}:{path}", run.join("bin").display()))
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(errors)
            .spawn()
            .map_err(|source| file_error(&program, source))?;
        let mut child = Guard(Some(child));
        let simulator = SimulatorSocket::accept(&listener, || child.alive(&log))?;
        let child = child.release();
        let threads = Threads::of(child.id());
        Ok(Self { child, threads, simulator, offboard, log, controls: None })
    }

    /// Gives PX4 the next samples, returns its motor commands once it gives any, and lets it do all that it can do with them.
    pub fn step(&mut self, sensors: &[MavMessage]) -> Result<Option<&HIL_ACTUATOR_CONTROLS_DATA>, AutopilotError> {
        for message in sensors {
            self.simulator.send(message).map_err(|error| self.ended().unwrap_or(error))?;
        }
        // Before it is ready it gives no commands; after, each sample is answered.
        let ready = self.controls.is_some();
        if !ready {
            self.threads.wait_until_idle();
        }
        let until = Instant::now() + if ready { ANSWER } else { Duration::from_micros(200) };
        loop {
            let left = until.saturating_duration_since(Instant::now()).max(Duration::from_micros(1));
            match self.simulator.receive(left) {
                Ok(Some(MavMessage::HIL_ACTUATOR_CONTROLS(controls))) => {
                    self.controls = Some(controls);
                    break;
                }
                Ok(Some(_)) => {}
                Ok(None) if !ready => break,
                Ok(None) => {
                    let silent = AutopilotError::silent("PX4", ANSWER, "it runs, but gives no motor commands");
                    return Err(self.ended().unwrap_or(silent));
                }
                Err(error) => return Err(self.ended().unwrap_or(error)),
            }
        }
        self.threads.wait_until_idle();
        Ok(self.controls.as_ref())
    }

    /// Sends messages over the off-board link and lets PX4 take them in. Odometry goes over the simulator's link, where its place
    /// among the samples is certain: datagrams have none.
    pub fn send(&mut self, messages: &[MavMessage]) -> Result<(), AutopilotError> {
        for message in messages {
            match message {
                MavMessage::ODOMETRY(_) => {
                    self.simulator.send(message).map_err(|error| self.ended().unwrap_or(error))?;
                }
                message => self.offboard.send(message),
            }
        }
        self.threads.wait_until_idle();
        Ok(())
    }

    /// What PX4 has sent over the off-board link.
    pub fn receive(&mut self) -> Vec<(MavHeader, MavMessage)> {
        self.offboard.receive()
    }

    /// Processor time that it has used, s; 0 where the system does not tell.
    pub fn cpu_seconds(&self) -> f64 {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap_or_default();
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
        let ticks = |k: usize| fields.get(k).and_then(|v| v.parse::<f64>().ok()).unwrap_or(0.0);
        // utime and stime, in hundredths of a second.
        (ticks(11) + ticks(12)) / 100.0
    }

    /// Ends it at once, as a loss of power would.
    pub fn kill(&mut self) {
        end(&mut self.child);
    }

    fn ended(&mut self) -> Option<AutopilotError> {
        let status = self.child.try_wait().ok().flatten()?;
        Some(AutopilotError::Ended { status: status.to_string(), log: self.log.clone() })
    }
}

impl Drop for Px4 {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Ends a child that is not handed on.
struct Guard(Option<Child>);

impl Guard {
    fn alive(&mut self, log: &Path) -> Result<(), AutopilotError> {
        match self.0.as_mut().and_then(|child| child.try_wait().ok().flatten()) {
            Some(status) => Err(AutopilotError::Ended { status: status.to_string(), log: log.to_owned() }),
            None => Ok(()),
        }
    }

    fn release(mut self) -> Child {
        self.0.take().unwrap_or_else(|| unreachable!("a guard is released once"))
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            end(child);
        }
    }
}

/// Ends a program with the commands that its start-up script has started, which would keep its lock.
fn end(child: &mut Child) {
    let group = format!("kill -KILL -- -{}", child.id());
    let _ = Command::new("sh").args(["-c", &group]).stderr(Stdio::null()).status();
    let _ = child.kill();
    let _ = child.wait();
}

/// The first instance that does not run, as its lock says, and whose ports are free: the simulator's, and ours of the off-board link.
fn ports() -> Result<(u16, TcpListener, VehicleLink), AutopilotError> {
    let local = |port: u16| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let mut last = None;
    let runs = |instance: &u16| {
        let lock = fs::File::open(format!("/tmp/px4_lock-{instance}"));
        lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock)))
    };
    for instance in (0..INSTANCES).filter(|instance| !runs(instance)) {
        let listener = TcpListener::bind(local(4560 + instance));
        let offboard = VehicleLink::udp(local(14540 + instance), Some(local(14580 + instance)));
        match (listener, offboard) {
            (Ok(listener), Ok(offboard)) => return Ok((instance, listener, offboard)),
            (Err(source), _) => last = Some(AutopilotError::Socket { what: "TCP ports 4560 to 4569".into(), source }),
            (_, Err(error)) => last = Some(error),
        }
    }
    let taken =
        || AutopilotError::Socket { what: "instances 0 to 9 of PX4".into(), source: ErrorKind::AddrInUse.into() };
    Err(last.unwrap_or_else(taken))
}
