//! PX4 as a program beside this one, flown in lockstep: its clock is the stamp of the samples that it is given.

use std::fmt::Write as _;
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
use super::sockets::{SimulatorSocket, UdpLink};

/// Name of our airframe among those of PX4.
const AIRFRAME: &str = "22100_paintcopter";
/// Wall clock: a running PX4 answers each sample.
const ANSWER: Duration = Duration::from_secs(10);
/// Instances that are tried: each has ports of its own.
const INSTANCES: u16 = 10;

/// What PX4 must know of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Px4Vehicle {
    /// Share of the full thrust that carries its weight.
    pub hover_thrust: f64,
    /// Largest speed that a plan asks for, m/s.
    pub max_speed: f64,
    /// Largest tilt, rad.
    pub max_tilt: f64,
}

impl Px4Vehicle {
    /// The start-up file of the airframe: four rotors in an X, position, height and heading from our odometry with its covariance.
    fn airframe(&self) -> String {
        let mut file = String::from("#!/bin/sh\n. ${R}etc/init.d/rc.mc_defaults\nset MIXER quad_x\n");
        let tilt = self.max_tilt.to_degrees();
        let values = [
            // One estimator on one inertial sensor.
            ("SENS_IMU_MODE", 1.0),
            ("EKF2_MULTI_IMU", 0.0),
            ("SENS_MAG_MODE", 1.0),
            ("EKF2_MULTI_MAG", 0.0),
            // Position and heading by vision, height as well, noise from the message; no satellites.
            ("EKF2_AID_MASK", 24.0),
            ("EKF2_HGT_MODE", 3.0),
            ("EKF2_EV_NOISE_MD", 0.0),
            ("EKF2_EV_DELAY", 4.0),
            ("COM_ARM_WO_GPS", 1.0),
            // There is one compass: it is compared with none.
            ("COM_ARM_MAG_ANG", -1.0),
            // Set-points that end: it lands after half a second. Nobody has a remote control or a ground station here.
            ("COM_OF_LOSS_T", 0.5),
            ("COM_OBL_ACT", 0.0),
            ("COM_OBL_RC_ACT", 5.0),
            ("NAV_RCL_ACT", 0.0),
            ("NAV_DLL_ACT", 0.0),
            ("COM_RCL_EXCEPT", 4.0),
            ("COM_DISARM_PRFLT", -1.0),
            ("SIM_BAT_DRAIN", 3600.0),
            ("SDLOG_MODE", -1.0),
            // The loops, for rotors that are slow and a body that is heavy.
            ("MPC_THR_HOVER", self.hover_thrust),
            ("MPC_XY_VEL_MAX", 2.0 * self.max_speed),
            ("MPC_TILTMAX_AIR", tilt),
            ("MPC_XY_P", 2.0),
            ("MPC_XY_VEL_P_ACC", 4.0),
            ("MPC_XY_VEL_I_ACC", 1.5),
            ("MPC_XY_VEL_D_ACC", 0.3),
            ("MPC_Z_P", 2.0),
            ("MPC_Z_VEL_P_ACC", 6.0),
            ("MPC_TKO_SPEED", 0.7),
        ];
        for (name, value) in values {
            let whole = value.fract() == 0.0
                && !name.starts_with("MPC")
                && !matches!(name, "COM_OF_LOSS_T" | "EKF2_EV_DELAY" | "COM_DISARM_PRFLT" | "SIM_BAT_DRAIN");
            // Parameters of whole numbers are refused with a point, the others without.
            let _ = if whole {
                writeln!(file, "param set-default {name} {value:.0}")
            } else {
                writeln!(file, "param set-default {name} {value:.6}")
            };
        }
        file
    }
}

/// A PX4 that runs.
pub struct Px4 {
    child: Child,
    threads: Threads,
    simulator: SimulatorSocket,
    offboard: UdpLink,
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

fn file_error(path: &Path, source: std::io::Error) -> AutopilotError {
    AutopilotError::File { path: path.to_owned(), source }
}

/// The first instance that does not run, as its lock says, and whose ports are free: the simulator's, and ours of the off-board link.
fn ports() -> Result<(u16, TcpListener, UdpLink), AutopilotError> {
    let local = |port: u16| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let mut last = None;
    let runs = |instance: &u16| {
        let lock = fs::File::open(format!("/tmp/px4_lock-{instance}"));
        lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock)))
    };
    for instance in (0..INSTANCES).filter(|instance| !runs(instance)) {
        let listener = TcpListener::bind(local(4560 + instance));
        let offboard = UdpLink::open(local(14540 + instance), Some(local(14580 + instance)));
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

/// Lays out the folder that PX4 runs in: the program under its names, its start-up files, and our airframe among them.
fn prepare(source: &Path, run: &Path, vehicle: &Px4Vehicle) -> Result<(), AutopilotError> {
    for needed in [
        "px4",
        "px4-alias.sh",
        "etc/init.d-posix/rcS",
        "etc/init.d-posix/airframes",
        "etc/init.d/rc.mc_defaults",
        "etc/mixers/quad_x.main.mix",
    ] {
        if !source.join(needed).exists() {
            return Err(AutopilotError::Folder { folder: source.to_owned(), missing: needed.to_owned() });
        }
    }
    if run.exists() {
        fs::remove_dir_all(run).map_err(|source| file_error(run, source))?;
    }
    let bin = run.join("bin");
    copy(&source.join("etc"), &bin.join("etc"))?;
    let aliases = source.join("px4-alias.sh");
    for name in ["px4", "px4-alias.sh"] {
        fs::copy(source.join(name), bin.join(name)).map_err(|source| file_error(&bin.join(name), source))?;
    }
    let text = fs::read_to_string(&aliases).map_err(|source| file_error(&aliases, source))?;
    let names = text.lines().filter_map(|line| line.strip_prefix("alias ")?.split_once("='px4-").map(|(name, _)| name));
    for name in names {
        let link = bin.join(format!("px4-{name}"));
        std::os::unix::fs::symlink("px4", &link).map_err(|source| file_error(&link, source))?;
    }
    // Commands that the start-up script calls and a lean build leaves out.
    script(&bin.join("replay"), "#!/bin/sh\nexit 1\n")?;
    script(&bin.join("tone_alarm"), "#!/bin/sh\nexit 0\n")?;
    let posix = bin.join("etc/init.d-posix");
    script(&posix.join("airframes").join(AIRFRAME), &vehicle.airframe())?;
    // The off-board link only, silent but for what it is asked for and for the heartbeat, whose rate it does not let itself be asked.
    script(
        &posix.join("px4-rc.mavlink"),
        "#!/bin/sh\nport=$((14580+px4_instance))\n\
         mavlink start -x -u $port -r 4000000 -f -m minimal -o $((14540+px4_instance))\n\
         mavlink stream -u $port -s HEARTBEAT -r 250\n",
    )
}

fn script(path: &Path, text: &str) -> Result<(), AutopilotError> {
    use std::os::unix::fs::PermissionsExt;
    let executable = fs::Permissions::from_mode(0o755);
    // A copy of a file without write permission cannot be written over.
    let _ = fs::remove_file(path);
    fs::write(path, text)
        .and_then(|()| fs::set_permissions(path, executable))
        .map_err(|source| file_error(path, source))
}

/// Copies a folder; the copy can be written to whatever the source permits.
fn copy(from: &Path, to: &Path) -> Result<(), AutopilotError> {
    fs::create_dir_all(to).map_err(|source| file_error(to, source))?;
    let entries = fs::read_dir(from).map_err(|source| file_error(from, source))?;
    for entry in entries {
        let entry = entry.map_err(|source| file_error(from, source))?;
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), &target).map_err(|source| file_error(&target, source))?;
        }
    }
    Ok(())
}
