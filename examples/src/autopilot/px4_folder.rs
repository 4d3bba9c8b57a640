//! The folder that a PX4 runs in: the program under its names, its start-up files, and the airframe of our vehicle among them.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::error::AutopilotError;

/// Name of our airframe among those of PX4.
const AIRFRAME: &str = "22100_paintcopter";

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
            ("MPC_XY_P", 3.0),
            ("MPC_XY_VEL_P_ACC", 4.0),
            ("MPC_XY_VEL_I_ACC", 1.5),
            ("MPC_XY_VEL_D_ACC", 0.3),
            ("MPC_Z_P", 3.0),
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

/// Lays out the folder that PX4 runs in: the program under its names, its start-up files, and our airframe among them.
pub(super) fn prepare(source: &Path, run: &Path, vehicle: &Px4Vehicle) -> Result<(), AutopilotError> {
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

pub(super) fn file_error(path: &Path, source: std::io::Error) -> AutopilotError {
    AutopilotError::File { path: path.to_owned(), source }
}
